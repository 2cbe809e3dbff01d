"""Loads on ropes and springs from soft to stiffer than the digits of places: as on rigid ones, however stiff."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.special import ellipj, ellipk

import flexctrl as fc
from flexctrl.dynamics.march import marching

MASS, LENGTH, G = 2.0, 1.0, 9.81
SCALE = [1e4, 1e6, 1e8, 1e10, 1e12, 1e14, 1e16, 1e18]
"""EA/L/m [1/s²]."""
WEIGHT = fc.Gravity((0, 0, -G))


def rope(pull: float, start: tuple[float, ...], end: tuple[float, ...], name: str = "rope") -> fc.Rope:
    return fc.Rope(name, start, end, EA=pull * MASS * LENGTH, length=LENGTH)


def spring(pull: float, start: tuple[float, ...], end: tuple[float, ...], name: str = "spring") -> fc.Spring:
    return fc.Spring(name, start, end, stiffness=pull * MASS, length=LENGTH)


def chain(pull: float, angle: float, line: Callable[..., fc.Rope | fc.Spring] = rope, count: int = 1) -> fc.Model:
    """Loads one below the other, straight, at an angle to the vertical."""
    places = [(i * np.sin(angle), 0.0, -i * np.cos(angle)) for i in range(count + 1)]
    lines = [line(pull, places[i], places[i + 1], f"line{i}") for i in range(count)]
    loads = [fc.PointMass(f"load{i}", one.end, MASS) for i, one in enumerate(lines)]
    joints = [fc.Support(lines[0].start), *(fc.Pin(a.end, b.start) for a, b in pairwise(lines))]
    joints += [fc.Pin(one.end, load.node) for one, load in zip(lines, loads, strict=True)]
    outputs = [fc.Position(axis, loads[-1].node, axis) for axis in "xz"]
    structure = fc.Structure([*lines, *loads], joints, outputs=outputs)
    return fc.assemble(structure, [fc.LargeRotation(), WEIGHT, fc.RopeStretch()])


def swing(t: np.ndarray, angle: float, length: float = LENGTH) -> np.ndarray:
    """The angle of an inextensible pendulum let go at rest, by elliptic functions."""
    k = np.sin(0.5 * angle)
    return 2.0 * np.arcsin(k * ellipj(ellipk(k * k) - np.sqrt(G / length) * t, k * k)[0])


def whip(t: np.ndarray, angle: float, count: int) -> np.ndarray:
    """How far aside the last of some masses on rigid links is, from Lagrange's equations."""
    below = np.array([[count - max(i, j) for j in range(count)] for i in range(count)], dtype=float)

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        turned, speed = y[:count], y[count:]
        apart = turned[:, None] - turned[None, :]
        force = -(below * np.sin(apart)) @ speed**2 - G * np.diag(below) * np.sin(turned)
        return np.concatenate([speed, np.linalg.solve(below * np.cos(apart), force)])

    start = np.concatenate([np.full(count, angle), np.zeros(count)])
    found = solve_ivp(rates, (0.0, t[-1]), start, t_eval=t, rtol=1e-10, atol=1e-12)
    return np.sin(found.y[:count]).sum(axis=0)


def told(run: fc.Run) -> bool:
    return any("last digits of places" in note for note in run.report.notes)


@pytest.mark.parametrize("pull", SCALE, ids="{:.0e}".format)
@pytest.mark.parametrize("angle", [0.5, 1.0])
@pytest.mark.parametrize("line", [rope, spring])
def test_a_stiff_line_is_a_rigid_one(line, angle, pull):
    """Errors are a few times the tolerance; the softest line's own stretch is 3e-3. No more steps for a stiffer one."""
    run = fc.simulate(chain(pull, angle, line), until=1.0)
    assert run.status is fc.Status.FINISHED
    assert np.abs(run["x"] - np.sin(swing(run.t, angle))).max() < 4e-3
    assert run.report.energy_residual < 2e-3
    assert run.report.steps + run.report.rejected_steps < 400
    assert run.report.newton_iterations < 4000


@pytest.mark.parametrize("pull", [1e6, 1e10, 1e14, 1e18], ids="{:.0e}".format)
@pytest.mark.parametrize("line", [rope, spring])
def test_steps_of_one_length_over_a_stiff_line(line, pull):
    run = fc.simulate(chain(pull, 1.0, line), until=1.0, method=fc.GeneralizedAlpha(5e-3))
    assert np.abs(run["x"] - np.sin(swing(run.t, 1.0))).max() < 3e-4
    assert run.report.energy_residual < 1e-3


@pytest.mark.parametrize("pull", [1e6, 1e10, 1e14, 1e18], ids="{:.0e}".format)
@pytest.mark.parametrize("line", [rope, spring])
def test_steps_that_keep_energy_keep_it_on_a_stiff_line(line, pull):
    run = fc.simulate(chain(pull, 1.0, line), until=1.0, method=fc.ConservingMidpoint(5e-3))
    assert np.abs(run["x"] - np.sin(swing(run.t, 1.0))).max() < 2e-4
    assert run.report.energy_residual < 1e-8


@pytest.mark.parametrize("pull", [1e6, 1e10, 1e14, 1e15], ids="{:.0e}".format)
@pytest.mark.parametrize("line", [rope, spring])
def test_a_chain_of_stiff_lines_is_one_of_rigid_links(line, pull):
    run = fc.simulate(chain(pull, 0.5, line, count=3), until=1.0)
    assert run.status is fc.Status.FINISHED
    assert np.abs(run["x"] - whip(run.t, 0.5, 3)).max() < 4e-3


@pytest.mark.parametrize("pull", [1e6, 1e10, 1e14, 1e18], ids="{:.0e}".format)
def test_a_load_on_two_stiff_ropes_swings_about_the_line_between_their_tops(pull):
    place, reach = (0.3, 0.4, -1.0), np.hypot(0.4, 1.0)
    ropes = [fc.Rope(f"rope{i}", (side, 0, 0), place, EA=pull * MASS) for i, side in enumerate((-1.0, 1.0))]
    load = fc.PointMass("load", place, MASS)
    joints = [joint for one in ropes for joint in (fc.Support(one.start), fc.Pin(one.end, load.node))]
    outputs = [fc.Position(axis, load.node, axis) for axis in "xy"]
    model = fc.assemble(
        fc.Structure([*ropes, load], joints, outputs=outputs), [fc.LargeRotation(), WEIGHT, fc.RopeStretch()]
    )
    run = fc.simulate(model, until=2.0)
    assert run.status is fc.Status.FINISHED
    assert np.abs(run["y"] - reach * np.sin(swing(run.t, np.arctan2(0.4, 1.0), reach))).max() < 4e-3
    assert np.abs(run["x"] - 0.3).max() < 1e-3


@pytest.mark.parametrize("pull", [1e6, 1e10, 1e14, 1e16], ids="{:.0e}".format)
def test_a_load_that_pulls_a_stiff_rope_off_its_drum(pull):
    """From the drum on, l'' (m + J/r²) = m (l φ'² + g cos φ) and l φ'' = −g sin φ − 2 l' φ'."""
    load, top = fc.PointMass("load", (0, 0, -LENGTH), MASS), fc.PointMass("top", (0, 0, 0), 1.0)
    winch = fc.Winch("hoist", load.node, top.node, EA=pull * MASS, radius=0.1, ratio=10.0, inertia=0.01)
    outputs = [fc.Position(axis, load.node, axis) for axis in "xz"]
    structure = fc.Structure([load, top], [fc.Support(top.node)], drives=[winch], outputs=outputs)
    model = fc.assemble(structure, [fc.LargeRotation(), WEIGHT, fc.RopeStretch()])
    v = np.zeros(model.n)
    v[model.coordinates.index("load_0_u")] = 0.3
    run = fc.simulate(model, until=2.0, start=model.rest.with_(v=v))

    def rates(_: float, y: np.ndarray) -> list[float]:
        out, turned, pays, turns = y
        pull = MASS * (out * turns**2 + G * np.cos(turned)) / (MASS + 0.01 / 0.01**2)
        return [pays, turns, pull, -(G * np.sin(turned) + 2.0 * pays * turns) / out]

    exact = solve_ivp(rates, (0.0, 2.0), [LENGTH, 0.0, 0.0, 0.3], t_eval=run.t, rtol=1e-10, atol=1e-12).y
    assert run.status is fc.Status.FINISHED
    assert np.abs(run["x"] - exact[0] * np.sin(exact[1])).max() < 1e-3
    assert np.abs(run["z"] + exact[0] * np.cos(exact[1])).max() < 1e-3


@pytest.mark.parametrize("pull", [1e6, 1e10, 1e14, 1e18], ids="{:.0e}".format)
def test_a_load_let_go_above_its_stiff_rope_falls_freely(pull):
    run = fc.simulate(chain(pull, 2.0 * np.pi / 3.0), until=0.44)
    assert np.abs(run["z"] - (0.5 - 0.5 * G * run.t**2)).max() < 1e-3


@pytest.mark.parametrize("pull", [1e8, 1e10, 1e12, 1e14, 1e16], ids="{:.0e}".format)
def test_a_load_thrown_over_leaves_its_stiff_rope_and_falls(pull):
    """From v² = 4 g ℓ below on; it is slack from where v² = −g ℓ cos φ."""
    model = chain(pull, 0.0)
    v = np.zeros(model.n)
    v[model.coordinates.index("line0_1_u")] = np.sqrt(4.0 * G * LENGTH)
    run = fc.simulate(model, until=0.95, start=model.rest.with_(v=v), tolerance=fc.Tolerance(1e-6, 1e-9))
    angle = np.arccos(-2.0 / 3.0)  # 4 − 2 (1 − cos φ) = −cos φ
    speed = np.sqrt(2.0 / 3.0 * G * LENGTH)
    leaves = quad(lambda phi: 1.0 / np.sqrt(2.0 * G * (1.0 + np.cos(phi))), 0.0, angle, epsabs=1e-12)[0]
    flying = run.t > leaves
    exact = np.sin(angle) + speed * np.cos(angle) * (run.t[flying] - leaves)
    assert flying.sum() > 3
    assert np.abs(run["x"][flying] - exact).max() < 1e-3
    assert run.report.energy_residual < 1.2e-4


@pytest.mark.parametrize("pull", [1e6, 1e10, 1e14], ids="{:.0e}".format)
def test_plain_steps_over_stiff_ropes_are_those_of_the_loops(pull, monkeypatch):
    ours = fc.simulate(chain(pull, 1.0), until=0.5)
    monkeypatch.setattr(marching, "can_march", lambda model: False)
    plain = fc.simulate(chain(pull, 1.0), until=0.5)
    at = np.linspace(0.0, 0.5, 26)
    assert np.abs(np.interp(at, ours.t, ours["x"]) - np.interp(at, plain.t, plain["x"])).max() < 1e-3
    assert plain.report.newton_iterations < 2000


@pytest.mark.parametrize("pull", [1e15, 1e16, 1e18], ids="{:.0e}".format)
@pytest.mark.parametrize("line", [rope, spring])
def test_a_tension_that_hangs_on_the_last_digits_of_places_is_told(line, pull):
    assert told(fc.simulate(chain(pull, 1.0, line), until=1.0))


@pytest.mark.parametrize("pull", [1e4, 1e9, 1e12], ids="{:.0e}".format)
@pytest.mark.parametrize("line", [rope, spring])
def test_what_can_be_told_is_not_doubted(line, pull):
    assert fc.simulate(chain(pull, 0.5, line), until=0.5).report.notes == ()


def test_rest_that_the_explicit_method_makes_a_bounce_is_told():
    model = chain(1e12, 0.0)
    run = fc.simulate(model, until=2e-3, start=fc.equilibrium(model), method=fc.ExplicitRungeKutta())
    assert np.ptp(run["z"]) < 1e-3  # nothing that is seen
    assert np.ptp(run["z"]) < 1e-6 or any("the method has made" in note for note in run.report.notes)


@pytest.mark.parametrize("pull", [1e4, 1e6, 1e12], ids="{:.0e}".format)
@pytest.mark.parametrize("method", [fc.AdaptiveAlpha(), fc.ExplicitRungeKutta()], ids=["implicit", "explicit"])
def test_rest_that_only_rounds_is_not_flagged(pull, method):
    model = chain(pull, 0.0)
    run = fc.simulate(model, until=1e-5, start=fc.equilibrium(model), method=method)
    assert run.status is fc.Status.FINISHED
    assert np.ptp(run["z"]) < 1e-6
    assert run.report.notes == ()
