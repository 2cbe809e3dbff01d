"""Ropes in small motion go slack where their tension does, which is linear, however far they swing."""

from __future__ import annotations

import pytest

import flexctrl as fc


@pytest.fixture(scope="module", params=[fc.CasadiVM(), None], ids=["plain", "marched"])
def swung(request):
    """A load that is lifted by six tenths of its weight and pushed aside so far that its rope bends the picture."""
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -1), EA=1e4)
    load = fc.PointMass("load", rope.end, 10.0)
    machine = fc.Structure(
        [rope, load],
        [fc.Support(rope.start), fc.Pin(rope.end, load.node)],
        inputs=[fc.Force("up", load.node, "z"), fc.Force("side", load.node, "x")],
        outputs=[fc.Tension("pull", rope), fc.Position("x", load.node, "x")],
    )
    return fc.assemble(machine, [fc.Gravity(), fc.Flexible(), fc.GeometricStiffness()], request.param)


@pytest.mark.parametrize(
    "method",
    [fc.GeneralizedAlpha(1e-3), fc.AdaptiveAlpha(), fc.ExplicitRungeKutta(1e-3), fc.Exact(1e-3)],
    ids=lambda m: type(m).__name__,
)
def test_a_rope_is_slack_while_its_tension_is_below_zero(swung, method):
    run = fc.simulate(
        swung,
        until=1.0,
        start=fc.equilibrium(swung).state,
        inputs={"up": 60.0, "side": 15.0},
        method=method,
        events=[fc.Event("no pull", "pull")],
    )
    assert abs(run["x"]).max() > 0.2
    slack = [e for e in run.events if e.name == "rope"]
    zero = [e for e in run.events if e.name == "no pull"]
    assert len(slack) == len(zero) >= 8
    for corner, crossing in zip(slack, zero, strict=True):
        assert corner.rising == crossing.rising
        assert corner.t == pytest.approx(crossing.t, abs=1e-9)
        assert corner.signals["pull"] == pytest.approx(0.0, abs=1e-5)
