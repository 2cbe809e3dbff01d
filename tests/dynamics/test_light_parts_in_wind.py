"""Parts of next to no mass in the wind: at once as fast as it lets them be, with the massless limit for their own."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc
from flexctrl.design import OpenLoop, Table, Together, pd

ARM, RATIO, MOTOR, DAMPING, AREA, ANGLE, UNTIL = 1.287, -0.967, 2.04e-3, 0.0387, 0.408, -1.187, 0.1
METHODS = {
    "adaptive": fc.AdaptiveAlpha(),
    "alpha": fc.GeneralizedAlpha(1e-3),
    "midpoint": fc.ConservingMidpoint(1e-3),
    "extrapolated": fc.Richardson(fc.GeneralizedAlpha(2e-3)),
}


def rod(mass: float, wind: float, stiffness: float) -> fc.Model:
    """A rod on a drive's shaft, with drag at its tip."""
    along, inertia = np.array([np.sin(ANGLE), 0.0, -np.cos(ANGLE)]), 0.238 * mass
    tip = tuple(ARM * along)
    body = fc.RigidBody("rod", tuple(0.5 * ARM * along), mass, (inertia,) * 3, {"a": (0, 0, 0), "tip": tip})
    motor = fc.RotaryDrive(
        "motor", body.point("a"), axis="y", stiffness=stiffness, ratio=RATIO, inertia=MOTOR, damping=DAMPING
    )
    held = [fc.Support(body.point("a"), "u v w rx rz")]
    structure = fc.Structure([body], held, [motor], [], [fc.Position(axis, body.point("tip"), axis) for axis in "xz"])
    air = fc.Wind({"rod.tip": AREA}, speed=(wind, 0, 0))
    return fc.assemble(structure, [fc.LargeRotation(), fc.Gravity(), fc.ShaftElasticity(), air])


def tip(mass: float, winds: tuple[float, ...], stiffness: float) -> np.ndarray:
    """Where it is by another code, from the two equations of motion, after winds that take turns."""

    def slope(_: float, y: np.ndarray, wind: float) -> list[float]:
        angle, turn, motor, spin = y
        across, down = wind - ARM * np.cos(angle) * turn, -ARM * np.sin(angle) * turn
        drag = 0.5 * 1.25 * AREA * np.hypot(across, down)
        torque = stiffness * (RATIO * (ANGLE - angle) - motor) + DAMPING * (-RATIO * turn - spin)
        pushed = ARM * drag * (np.cos(angle) * across + np.sin(angle) * down)
        weight = -mass * 9.81 * ARM / 2 * np.sin(angle)
        return [turn, (RATIO * torque + weight + pushed) / (0.238 * mass + mass * ARM**2 / 4), spin, torque / MOTOR]

    y, span = np.array([ANGLE, 0.0, 0.0, 0.0]), UNTIL / len(winds)
    for wind in winds:
        y = solve_ivp(slope, (0, span), y, rtol=1e-9, atol=1e-11, method="Radau", args=(wind,)).y[:, -1]
    return np.array([ARM * np.sin(y[0]), -ARM * np.cos(y[0])])


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("mass", [6.7e-3, 6.7e-4, 6.7e-5, 6.7e-7, 6.7e-10])
@pytest.mark.parametrize("wind", [-1.0, -5.03, -25.0])
def test_a_rod_on_a_soft_shaft(mass, wind, name):
    run = fc.simulate(rod(mass, wind, 9.02), until=UNTIL, method=METHODS[name])
    assert run.status is fc.Status.FINISHED
    assert np.abs(run.y[-1] - tip(mass, (wind,), 9.02)).max() <= 5e-5
    assert run.report.energy_residual < 0.1


@pytest.mark.parametrize("mass", [6.7e-3, 6.7e-5, 6.7e-7, 6.7e-10])
@pytest.mark.parametrize("name", ["adaptive", "alpha"])
def test_a_rod_on_a_stiff_shaft(mass, name):
    """With steps that see its motor swing."""
    method = {"adaptive": fc.AdaptiveAlpha(), "alpha": fc.GeneralizedAlpha(1e-4)}[name]
    run = fc.simulate(rod(mass, -5.03, 1e4), until=UNTIL, method=method)
    assert run.status is fc.Status.FINISHED
    assert np.abs(run.y[-1] - tip(mass, (-5.03,), 1e4)).max() <= 5e-5
    assert run.report.energy_residual < 0.02


@pytest.mark.parametrize("mass", [6.7e-5, 6.7e-7])
def test_errors_fall_with_the_square_of_the_step(mass):
    """Steps of 20 time constants of the layer, and of more."""
    model, there = rod(mass, -5.03, 9.02), tip(mass, (-5.03,), 9.02)
    off = [
        np.abs(fc.simulate(model, until=UNTIL, method=fc.GeneralizedAlpha(step)).y[-1] - there).max()
        for step in (4e-3, 1e-3)
    ]
    assert off[1] < off[0] / 8.0


def hung(mass: float, wind: float) -> fc.Model:
    """A load on a rigid rope of 2 m, 0.3 rad from the vertical."""
    place = (2.0 * np.sin(0.3), 0, -2.0 * np.cos(0.3))
    load, rope = fc.PointMass("load", place, mass), fc.Rope("rope", (0, 0, 0), place, EA=1e5)
    joints = [fc.Support(rope.start), fc.Pin(rope.end, load.node), fc.Support(load.node, "v")]
    structure = fc.Structure([rope, load], joints, outputs=[fc.SwayAngle("sway", rope.start, load.node, "x")])
    return fc.assemble(structure, [fc.LargeRotation(), fc.Gravity(), fc.Wind({"load": 0.1}, (wind, 0, 0))])


@pytest.mark.parametrize("name", ["adaptive", "alpha"])
@pytest.mark.parametrize("wind", [1.0, 5.0, 30.0])
def test_a_load_without_mass_goes_with_the_wind(wind, name):
    """Without mass there is no drag across the rope: φ̇ = (w/ℓ) cos φ, tan(φ/2 + π/4) ~ exp(w t/ℓ)."""
    grown = np.tan(0.15 + np.pi / 4) * np.exp(0.5 * wind * 0.2)
    limit, off = 2.0 * np.arctan(grown) - np.pi / 2, []
    for mass in (1e-6, 1e-8, 1e-10):
        run = fc.simulate(hung(mass, wind), until=0.2, method=METHODS[name])
        assert run.status is fc.Status.FINISHED
        assert run.report.energy_residual < 0.2
        off.append(abs(run["sway"][-1] - limit))
    assert off[0] <= 1e-3
    assert max(off[1:]) <= 3e-4


def test_a_run_says_where_it_sets_out():
    light, heavy = (fc.simulate(rod(mass, -5.03, 9.02), until=0.01).report.notes for mass in (6.7e-10, 6.7e-2))
    assert any("rod_0_ry" in note and "start at the velocity at which drag balances" in note for note in light)
    assert not heavy


def test_what_fails_is_not_sent_to_a_method_that_does_no_better():
    run = fc.simulate(rod(6.7e-4, -5.03, 1e4), until=UNTIL, method=fc.GeneralizedAlpha(1e-3))
    assert run.status is fc.Status.FAILED
    assert "AdaptiveAlpha" in run.report.message
    assert "ConservingMidpoint" not in run.report.message


@pytest.mark.parametrize("mass", [3e-3, 1e-4, 1e-7, 1e-10])
def test_what_floats_goes_with_the_wind(mass):
    """Without weight m u̇ = −k u², so that it stays behind by m/k ln(1 + k w t/m)."""
    load = fc.PointMass("load", (0, 0, 0), mass)
    structure = fc.Structure([load], [], outputs=[fc.Position("x", load.node, "x")])
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Wind({"load": 1.0}, (10, 0, 0))])
    lag = mass / 0.625 * np.log1p(0.625 * 10.0 * 0.2 / mass)
    for method, off in ((fc.GeneralizedAlpha(1e-3), 3e-3), (fc.AdaptiveAlpha(), 3e-4)):
        run = fc.simulate(model, until=0.2, method=method)
        assert run.status is fc.Status.FINISHED
        assert run["x"][-1] == pytest.approx(2.0 - lag, abs=off)
        assert run.report.energy_residual < 0.1


class Gusts:
    """5 m/s, every other time."""

    inputs, outputs, sample_time = (), ("gust",), UNTIL / 5

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([5.0 * (round(t / self.sample_time) % 2)])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x


@pytest.mark.parametrize("mass", [1e-5, 1e-7, 1e-9])
def test_chosen_steps_see_a_gust_come(mass):
    """Each gust begins another layer, shorter than rounding of places lets differences of forces be taken."""
    model = rod(mass, -5.03, 9.02)
    gusty = fc.Structure(
        model.structure.elements,
        model.structure.joints,
        model.structure.drives,
        [fc.WindSpeed("gust", "x")],
        model.structure.outputs,
    )
    run = fc.simulate(fc.assemble(gusty, model.effects), Gusts(), until=UNTIL)
    assert run.status is fc.Status.FINISHED
    assert np.abs(run.y[-1] - tip(mass, (-5.03, -0.03, -5.03, -0.03, -5.03), 9.02)).max() <= 1e-4
    assert run.report.steps < 500


def test_what_is_at_rest_in_the_wind_stays_so():
    model = hung(1e-6, 5.0)
    run = fc.simulate(model, until=0.1, start=fc.equilibrium(model), method=fc.GeneralizedAlpha(1e-3))
    assert np.ptp(run["sway"]) < 1e-9
    assert not any("set out" in note for note in run.report.notes)


@pytest.mark.parametrize("mass", [1e-3, 1e-5, 1e-7])
def test_a_law_that_reads_how_they_set_out_is_laid_beside_others(mass):
    """Its first command hangs on the steps: it was taken for a law with a memory, and nothing told of forces."""
    cart, line = fc.PointMass("cart", (0, 0, 0), 5.0), fc.Spring("line", (0, 0, 0), (0, 0, -1.0), 50.0)
    vane = fc.PointMass("vane", line.end, mass)
    machine = fc.Structure(
        [cart, line, vane],
        [
            fc.Support(cart.node, "v w"),
            fc.Pin(cart.node, line.start),
            fc.Pin(line.end, vane.node),
            fc.Support(vane.node, "v"),
        ],
        [],
        [fc.Force("push", cart.node, "x"), fc.WindSpeed("gust", "x")],
        [fc.Position("x", cart.node, "x"), fc.Velocity("v", vane.node, "x"), fc.Tension("tension", line)],
    )
    model = fc.assemble(machine, [fc.Gravity(), fc.LargeRotation(), fc.Wind({"vane": 1.0})])
    gust = OpenLoop({"gust": Table((0.0, 1.0, 2.0, 5.0), (3.0, 8.0, 2.0, 2.0))})
    law = Together(pd(20.0, 8.0, measured="x", rate="v", command="push"), gust)
    run = fc.simulate(model, law, until=2.0, every=0.02)
    assert not any("keep memory" in note for note in run.report.notes)
    assert set(run.report.output_errors) == {"x", "v", "tension"}
