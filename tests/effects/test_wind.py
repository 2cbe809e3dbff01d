"""Wind: drag on nodes against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import StructureError

LARGE, G, MASS, LENGTH = fc.LargeRotation(), 9.81, 1000.0, 10.0
K = 0.5 * 1.25 * 8.0


def load(drop: bool = False) -> fc.Structure:
    """A load of 1 t on a rigid rope in the x-z plane, or falling."""
    mass = fc.PointMass("load", (0, 0, -LENGTH), MASS)
    outputs = [fc.Position("x", mass.node, "x"), fc.Velocity("vz", mass.node, "z")]
    if drop:
        return fc.Structure([mass], [fc.Support(mass.node, "u v")], outputs=outputs)
    rope = fc.Rope("rope", (0, 0, 0), mass.node, EA=1e8)
    joints = [fc.Support(rope.start), fc.Pin(rope.end, mass.node), fc.Support(mass.node, "v")]
    return fc.Structure([rope, mass], joints, inputs=[fc.Force("push", mass.node, "x")], outputs=outputs)


def blown(*speed: float, drop: bool = False, area: float = 8.0, backend: fc.Backend | None = None) -> fc.Model:
    return fc.assemble(load(drop), [LARGE, fc.Gravity(), fc.Wind({"load": area}, speed or (0, 0, 0))], backend)


@pytest.mark.parametrize("backend", [fc.Compiled(), fc.CasadiVM()])
def test_a_fall_tends_to_terminal_speed(backend):
    """v = v∞ tanh(g t/v∞), v∞ = √(m g/k), in still air; in a rising one it is slower by that wind."""
    rising = (0.0, 0.0, 5.0)
    last = np.sqrt(MASS * G / K)
    run = fc.simulate(blown(drop=True, backend=backend), until=10.0, method=fc.GeneralizedAlpha(1e-2, rho=1.0))
    assert run["vz"] == pytest.approx(-last * np.tanh(G * run.t / last), abs=1e-4)
    assert run.report.energy_residual < 1e-5
    up = blown(*rising, drop=True, backend=backend)
    slower = fc.simulate(up, until=40.0, method=fc.GeneralizedAlpha(5e-2, rho=1.0))
    assert slower["vz"][-1] == pytest.approx(-last + 5.0, rel=1e-3)


def test_a_hanging_load_leans_into_equilibrium():
    """tan φ = k w²/(m g)."""
    rest = fc.equilibrium(blown(20.0, 0.0, 0.0))
    x, _, z = rest.state.x[1]
    assert -x / z == pytest.approx(K * 400.0 / (MASS * G), rel=1e-9)


def test_the_mean_wind_damps():
    """Along the wind 2 k w, across it k w, in still air nothing; a swing in the leaning equilibrium as certified."""
    structure = fc.Structure([fc.PointMass("load", (0, 0, 0), MASS)], [])
    a = np.zeros(3)
    for speed in (20.0, 0.0):
        model = fc.assemble(structure, [LARGE, fc.Wind({"load": 8.0}, (speed, 0, 0))])
        C = -model.slope(model.rest, a, a, (0.0, 1.0, 0.0), np.zeros(0)).toarray()
        assert pytest.approx(np.diag([2.0, 1.0, 1.0]) * K * speed) == C
    model = blown(20.0, 0.0, 0.0)
    linear = fc.linearize(model, at=fc.equilibrium(model))
    assert linear.certificate.taylor_slope > 1.9
    lean = np.arctan(K * 400.0 / (MASS * G))
    pole = linear.to_ss().poles()[0]
    decay = K * 20.0 * (1.0 + np.cos(lean) ** 2) / (2.0 * MASS)
    assert -pole.real == pytest.approx(decay, rel=1e-6)
    assert abs(pole) ** 2 == pytest.approx(G / (LENGTH * np.cos(lean)), rel=1e-6)


def test_small_motion_feels_the_mean_wind():
    """Without large rotation: constant force, linear damping; a light breath of wind speeds up the same way."""
    mass = fc.PointMass("load", (0, 0, 0), MASS)
    structure = fc.Structure([mass], [fc.Support(mass.node, "v w")], outputs=[fc.Velocity("v", mass.node, "x")])
    run = fc.simulate(fc.assemble(structure, [fc.Wind({"load": 8.0}, (2, 0, 0))]), until=50.0, every=1.0)
    rate = 2.0 * K * 2.0 / MASS
    assert run["v"] == pytest.approx(K * 4.0 / MASS / rate * -np.expm1(-rate * run.t), abs=5e-4)


def test_wind_on_a_beam_is_spread_over_it():
    """Tip deflection w L⁴/8EI under an even load, from forces at the nodes as the mesh gets finer."""
    section = fc.Section(EA=1e9, EI_y=1e7, EI_z=1e7, GJ=1e7, rhoA=10.0, rhoJ=1.0)
    errors = []
    for count in (4, 8):
        mast = fc.Beam("mast", (0, 0, 0), (0, 0, 20), section, elements=count)
        structure = fc.Structure([mast], [fc.Support(mast.start)])
        model = fc.assemble(structure, [LARGE, fc.BeamFlexibility(), fc.Wind({"mast": 40.0}, (5, 0, 0))])
        tip = fc.equilibrium(model).state.x[count, 0]
        errors.append(abs(tip / (0.5 * 1.25 * 40.0 * 25.0 / 20.0 * 20.0**4 / 8e7) - 1.0))
    assert errors[1] < 0.3 * errors[0] < 0.02


def test_no_area_is_no_wind():
    plain, calm = (fc.assemble(load(), [LARGE, fc.Gravity(), *e]) for e in ([], [fc.Wind({"load": 0.0}, (9, 0, 0))]))
    assert [f.kernels for f in plain.forces.families] == [f.kernels for f in calm.forces.families]
    assert plain.n == calm.n


@pytest.mark.parametrize("wind", [{}, {"sm": 0.0}, {"big": 0.0}])
@pytest.mark.parametrize("density", [0.0, 1.25])
def test_wind_of_no_strength_changes_no_bit(wind, density):
    """Nor how a light part on a stiff spring sets out, which is another matter where drag acts."""
    big, small = fc.PointMass("big", (0, 0, 0), 1.0), fc.PointMass("sm", (1, 0, 0), 1e-3)
    spring = fc.Spring("sp", (0, 0, 0), (1, 0, 0), stiffness=1e8)
    joints = [fc.Pin(big.node, spring.start), fc.Pin(spring.end, small.node)]
    joints += [fc.Support(big.node, "u v w"), fc.Support(small.node, "v w")]
    push, seen = fc.Force("f", small.node, "x"), fc.Position("x", small.node, "x")
    structure = fc.Structure([big, small, spring], joints, inputs=[push], outputs=[seen])
    how = {"until": 0.5, "inputs": {"f": 100.0}, "method": fc.GeneralizedAlpha(0.01)}
    without = fc.simulate(fc.assemble(structure, [LARGE]), **how)
    blown = fc.simulate(fc.assemble(structure, [LARGE, fc.Wind(wind, density=density)]), **how)
    assert blown.status is fc.Status.FINISHED
    assert np.array_equal(blown.y, without.y)
    if wind and not density:
        felt = fc.assemble(structure, [LARGE, fc.Wind({"sm": 1.0}, density=0.0)])
        assert np.array_equal(fc.simulate(felt, **how).y, without.y)


def test_the_wind_frame_is_the_machines():
    """Blown at speed w at rest, or moving at −w in still air: the same force."""
    still, a = blown(drop=True), np.zeros(1)
    moving = still.balance(still.rest, np.array([-3.0]), a)
    windy = blown(0.0, 0.0, 3.0, drop=True)
    assert moving == pytest.approx(windy.balance(windy.rest, np.zeros(1), a), rel=1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fc.Wind({"load": -1.0}), "Wind: area of 'load' = -1"),
        (lambda: fc.Wind({"load": 1.0}, speed=(1.0, 2.0)), "Wind: speed: expected three finite numbers"),
        (lambda: fc.assemble(load(), [fc.Wind({"laod": 1.0})]), "Wind: .*no element 'laod'.*load"),
    ],
)
def test_impossible_wind_is_refused(make, message):
    with pytest.raises(StructureError, match=message):
        make()
