"""What a winch hauls up stops at the sheave, however long the steps and short the last piece of rope."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.model.laws.sheaves import closest

METHODS = (
    fc.AdaptiveAlpha(),
    fc.GeneralizedAlpha(1e-3),
    fc.ExplicitRungeKutta(),
    fc.ConservingMidpoint(1e-3),
    fc.Richardson(fc.GeneralizedAlpha(1e-3)),
)


def hoist(stretches: bool) -> fc.Model:
    trolley, load = fc.PointMass("trolley", (0, 0, 5), 5.0), fc.PointMass("load", (0, 0, 0), 10.0)
    winch = fc.Winch("winch", load.node, trolley.node, EA=1e5, radius=0.1, inertia=0.02)
    outputs = [fc.Position("z", load.node, "z")]
    structure = fc.Structure(
        [trolley, load], [fc.Support(trolley.node)], [winch], [fc.MotorTorque("torque", winch)], outputs
    )
    effects = [fc.LargeRotation(), fc.Gravity(), *([fc.RopeStretch()] if stretches else [])]
    return fc.assemble(structure, effects)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
@pytest.mark.parametrize("stretches", [False, True])
def test_a_load_hauled_up_stops_at_the_sheave(stretches, method):
    run = fc.simulate(hoist(stretches), until=1.5, inputs={"torque": -40.0}, method=method)
    lifted = 40.0 / 0.1 - 10.0 * 9.81
    rigid = (2.0 * 4.9995 * (10.0 + 0.02 / 0.1**2) / lifted) ** 0.5
    assert run.status is fc.Status.STOPPED
    assert "the rope of winch is down to its shortest" in run.report.message
    assert run.final.x[1, 2] == pytest.approx(4.9995, abs=1e-8)
    assert run.final.t == pytest.approx(rigid, abs=2e-3 if stretches else 1e-8)


def test_a_load_that_swings_by_far_from_the_sheave_goes_on():
    model = hoist(stretches=False)
    start = model.rest.with_(v=np.array([25.0, 0.0, 0.0]))
    run = fc.simulate(model, until=2.0, start=start, inputs={"torque": -100.0}, method=fc.AdaptiveAlpha())
    assert run.status is fc.Status.FINISHED
    assert run["z"].max() > 5.0


def light_load(EA: float) -> fc.Model:
    """A kilogram on 2 m of rope, hauled in by a light motor: the last piece of rope is stiff beside it."""
    trolley, load = fc.PointMass("trolley", (0, 0, 10), 1e3), fc.PointMass("load", (0, 0, 8), 1.0)
    winch = fc.Winch("winch", load.node, trolley.node, EA=EA, radius=0.1, ratio=10.0, inertia=1e-4)
    outputs = [fc.Velocity("speed", load.node, "z"), fc.Tension("pull", winch), fc.DriveAngle("angle", winch)]
    structure = fc.Structure(
        [trolley, load], [fc.Support(trolley.node)], [winch], [fc.MotorTorque("torque", winch)], outputs
    )
    return fc.assemble(structure, [fc.LargeRotation(), fc.Gravity(), fc.RopeStretch()])


@pytest.mark.parametrize(
    ("EA", "torque", "method"),
    [
        (1e5, 0.12, fc.AdaptiveAlpha()),
        (1e6, 0.15, fc.AdaptiveAlpha()),
        (1e6, 0.2, fc.AdaptiveAlpha()),
        (1e5, 0.12, fc.GeneralizedAlpha(1e-2)),
    ],
    ids=["1e5, 0.12", "1e6, 0.15", "1e6, 0.2", "alpha"],
)
def test_nothing_is_hauled_through_the_sheave(EA, torque, method):
    """On a rigid rope v² = 2 a s with a = ½ (M R/r − g), for R²J/r² = 1 kg beside the load."""
    run = fc.simulate(light_load(EA), until=3.0, inputs={"torque": -torque}, method=method)
    shortest = 1e-4 * 2.0
    out, way = 2.0 + 0.01 * run["angle"], 10.0 - run.final.x[1, 2]
    assert run.status is fc.Status.STOPPED
    assert "the rope of winch is down to its shortest" in run.report.message
    assert out.min() >= shortest * (1.0 - 1e-6)
    assert min(out[-1], way) == pytest.approx(shortest, rel=1e-6)
    assert run["speed"][-1] == pytest.approx((100.0 * torque - 9.81) ** 0.5 * (2.0 - shortest) ** 0.5, rel=0.02)
    assert run["pull"].max() < 1e3
    assert run.report.energy_residual < 1e-3


@pytest.mark.parametrize("beside", [0.0, 1e-3, 0.02])
@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_what_flies_by_on_a_slack_rope_goes_on(method, beside):
    """z = z₀ + v t − ½ g t² until the rope is taut again: it stops only where it meets the sheave."""
    model = hoist(stretches=True)
    rest = model.rest
    start = model.advance(rest, np.array([beside, 0.0, 4.0, 0.0]), np.array([0.0, 0.0, 20.0, 0.0]), rest.t)
    run = fc.simulate(model, until=0.1, start=start, method=method)
    assert (run.status is fc.Status.STOPPED) == (beside == 0.0), run.report.message
    np.testing.assert_allclose(run["z"], 4.0 + 20.0 * run.t - 0.5 * 9.81 * run.t**2, atol=1e-4)


def test_the_nearest_point_of_a_way_is_that_of_its_samples():
    rng, s = np.random.default_rng(1), np.linspace(0.0, 1.0, 20001)[:, None]
    for _ in range(50):
        was, leaving, now, arriving = rng.normal(size=(4, 3))
        way = (1 + 2 * s) * (1 - s) ** 2 * was + s * (1 - s) ** 2 * leaving
        way = way + s**2 * (3 - 2 * s) * now + s**2 * (s - 1) * arriving
        least = np.linalg.norm(way, axis=1).min()
        assert closest(was, leaving, now, arriving) == pytest.approx(least, rel=1e-6, abs=1e-7)
    assert closest(-was, 2 * was, was, 2 * was) <= 1e-12
