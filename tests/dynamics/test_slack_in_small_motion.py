"""Ropes in small motion go slack where their tension does, which is linear, however far they swing."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

EA, LIFT, SIDE = 1e4, 60.0, 15.0
HELD = -0.01 * 98.1 * (1.0 + 98.1 / (2.0 * EA))
"""The torque that holds ten kilograms on a winch, with the energy of the stretch that goes onto its drum [N m]."""
METHODS = [fc.GeneralizedAlpha(1e-3), fc.AdaptiveAlpha(), fc.ExplicitRungeKutta(2e-3), fc.Exact(1e-3)]
BACKENDS = {"plain": fc.CasadiVM(), "marched": None}


@pytest.fixture(scope="module", params=BACKENDS)
def swung(request):
    """A load that is lifted by six tenths of its weight and pushed aside so far that its rope bends the picture."""
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -1), EA=EA)
    load = fc.PointMass("load", rope.end, 10.0)
    machine = fc.Structure(
        [rope, load],
        [fc.Support(rope.start), fc.Pin(rope.end, load.node)],
        inputs=[fc.Force("up", load.node, "z"), fc.Force("side", load.node, "x")],
        outputs=[fc.Tension("pull", rope), fc.Position("x", load.node, "x")],
    )
    return fc.assemble(machine, [fc.Gravity(), fc.Flexible(), fc.GeometricStiffness()], BACKENDS[request.param])


@pytest.fixture(scope="module", params=[("plain", 20.0), ("marched", 0.0), ("marched", 20.0)], ids=str)
def hoisted(request):
    """The same load on a winch that has paid out some rope, or none, and pays out more as it is pulled."""
    backend, angle = request.param
    top, load = fc.PointMass("top", (0, 0, 0), 1.0), fc.PointMass("load", (0, 0, -1), 10.0)
    winch = fc.Winch("rope", load.node, top.node, EA=EA, radius=0.1, ratio=10.0, inertia=0.1)
    machine = fc.Structure(
        [top, load],
        [fc.Support(top.node)],
        [winch],
        [fc.MotorTorque("torque", winch), fc.Force("up", load.node, "z"), fc.Force("side", load.node, "x")],
        [fc.Tension("pull", winch), fc.Position("x", load.node, "x"), fc.DriveAngle("angle", winch)],
    )
    about = fc.GeometricStiffness(hold={"rope_source": angle}, inputs={"torque": HELD})
    return fc.assemble(machine, [fc.Gravity(), fc.Flexible(), about], BACKENDS[backend])


@pytest.mark.parametrize("method", METHODS, ids=lambda m: type(m).__name__)
def test_a_rope_is_slack_while_its_tension_is_below_zero(swung, method):
    goes_slack_with_its_tension(swung, method, {"up": LIFT, "side": SIDE})


@pytest.mark.parametrize("method", METHODS, ids=lambda m: type(m).__name__)
def test_so_is_that_of_a_winch(hoisted, method):
    """It was told slack by its geometric length: four times of ten, 22 ms off."""
    run = goes_slack_with_its_tension(hoisted, method, {"torque": HELD, "up": LIFT, "side": SIDE})
    assert np.ptp(run["angle"]) > 1.0


def goes_slack_with_its_tension(model: fc.Model, method: fc.Integrator, inputs: dict[str, float]) -> fc.Run:
    """Return a run in which the rope goes slack or taut eight times or more, each where its tension passes zero."""
    run = fc.simulate(
        model, until=1.0, start=model.rest, inputs=inputs, method=method, events=[fc.Event("no pull", "pull")]
    )
    assert abs(run["x"]).max() > 0.2
    slack = [e for e in run.events if e.name == "rope"]
    zero = [e for e in run.events if e.name == "no pull"]
    assert len(slack) == len(zero) >= 8
    for corner, crossing in zip(slack, zero, strict=True):
        assert corner.rising == crossing.rising
        assert corner.t == pytest.approx(crossing.t, abs=1e-9)
        assert corner.signals["pull"] == pytest.approx(0.0, abs=1e-5)
    return run
