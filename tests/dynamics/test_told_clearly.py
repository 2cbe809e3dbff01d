"""What a controller may not be, when a run may not begin, and which way a dry contact switches."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import ControllerError


def rubbing() -> fc.Model:
    """A mass on a spring, on a rough floor."""
    spring, mass = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=100.0), fc.PointMass("mass", (1, 0, 0), 1.0)
    structure = fc.Structure(
        [spring, mass],
        [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")],
        inputs=[fc.Force("push", mass.node, "x")],
        outputs=[fc.Velocity("speed", mass.node, "x")],
    )
    return fc.assemble(structure, [fc.LargeRotation(), fc.CoulombFriction({"mass.u": fc.Coulomb(2.0, static=3.0)})])


class Law:
    inputs, outputs = ("speed",), ("push",)

    def __init__(self, sample_time, command) -> None:
        self.sample_time, self.said = sample_time, command

    def initial(self):
        return np.zeros(0)

    def command(self, t, x, y):
        return self.said(t)


@pytest.mark.parametrize("sample_time", [None, "fast", float("nan"), -0.1])
def test_a_sample_time_is_a_time(sample_time):
    with pytest.raises(ControllerError, match="controller Law: sample_time"):
        fc.simulate(rubbing(), Law(sample_time, lambda t: [0.0]), until=0.1)


def test_what_fails_at_once_is_an_error_and_later_a_failed_run():
    def late(t):
        return None if t > 0.05 else [0.0]

    with pytest.raises(ControllerError, match="command is None"):
        fc.simulate(rubbing(), Law(0.01, lambda t: None), until=0.1)
    with pytest.raises(ControllerError, match="ZeroDivisionError") as caught:
        fc.simulate(rubbing(), Law(0.01, lambda t: [1 / 0]), until=0.1)
    assert isinstance(caught.value.__cause__, ZeroDivisionError)
    run = fc.simulate(rubbing(), Law(0.01, late), until=0.1)
    assert run.status is fc.Status.FAILED
    assert "command is None" in run.report.message


def test_breaking_loose_and_sticking_are_told_apart():
    run = fc.simulate(rubbing(), Law(0.0, lambda t: [6.0 * np.sin(5.0 * t)]), until=2.0)
    switches = [event.rising for event in run.events if event.name == "mass.u"]
    assert len(switches) >= 4
    assert switches == [i % 2 == 0 for i in range(len(switches))]
    for event, following in zip(run.events, run.events[1:], strict=False):
        if not event.rising:
            between = (run.t > event.t) & (run.t < following.t)
            assert np.abs(run["speed"][between]).max(initial=0.0) < 1e-6


@pytest.mark.parametrize("method", [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(1e-2)], ids=["adaptive", "fixed"])
@pytest.mark.parametrize(("pull", "stands", "slides"), [(-5.0, 1 / 3, True), (-0.5, 4 / 3, False)])
def test_a_slip_that_turns_back_is_not_told_to_stick(pull, stands, slides, method):
    """A block at 2 m/s under dry friction of 1 N stands still after 2/(1 − pull) s; 5 N pull it back, 0.5 N do not."""
    block = fc.PointMass("block", (0, 0, 0), 1.0)
    structure = fc.Structure(
        [block], [fc.Support(block.node, "v w")], inputs=[fc.Force("pull", block.node, "x")], outputs=[]
    )
    model = fc.assemble(structure, [fc.LargeRotation(), fc.CoulombFriction({"block.u": 1.0})])
    start = model.rest.with_(v=np.array([2.0]))
    run = fc.simulate(model, until=2.0, start=start, inputs={"pull": pull}, method=method)
    assert [(event.name, event.rising) for event in run.events] == [("block.u", slides)]
    assert run.events[0].t == pytest.approx(stands, rel=1e-9)
    assert run.final.v[0] == pytest.approx((pull + 1.0) * (2.0 - stands) if slides else 0.0, rel=1e-6)
