"""An equilibrium brings its inputs along and the controller's add to them: a note tells of a load borne twice."""

from __future__ import annotations

import control
import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import Constant

MASS, RADIUS, RATIO, INERTIA = 30e3, 0.75, 30.0, 30.0
WEIGHT = -MASS * 9.81 * RADIUS / RATIO


def crane() -> fc.Model:
    trolley, load = fc.PointMass("trolley", (0, 0, 40), 50e3), fc.PointMass("load", (0, 0, 10), MASS)
    hoist = fc.Winch("hoist", load.node, trolley.node, EA=5e7, radius=RADIUS, ratio=RATIO, inertia=INERTIA)
    plan = fc.Structure(
        [trolley, load],
        [fc.Support(trolley.node, "u v w"), fc.Support(load.node, "u v")],
        drives=[hoist],
        inputs=[fc.MotorTorque("torque", hoist)],
        outputs=[fc.Position("height", load.node, "z"), fc.DriveAngle("angle", hoist), fc.DriveSpeed("speed", hoist)],
    )
    return fc.assemble(plan, [fc.LargeRotation(), fc.Gravity()])


def borne(bearing: dict[str, float]) -> tuple[fc.Model, fc.Rest]:
    """The load hangs on the torque alone: with the rope rigid it rests wherever it is."""
    model = crane()
    return model, fc.equilibrium(model, hold={"load_0_w": 0.0}, inputs=bearing)


def told(run: fc.Run) -> list[str]:
    return [note for note in run.report.notes if "brings" in note]


@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(1e-2)], ids=str)
@pytest.mark.parametrize("law", [fc.OpenLoop({"torque": Constant(WEIGHT)}), fc.OpenLoop({"torque": lambda t: WEIGHT})])
def test_a_torque_that_comes_twice_is_told(law, method):
    """The load is hauled in by m g beyond its weight, m g / (m + J R²/r²)."""
    model, rest = borne({"torque": WEIGHT})
    run = fc.simulate(model, law, until=1.0, start=rest, method=method, every=0.1)
    gone = 0.5 * MASS * 9.81 / (MASS + INERTIA * (RATIO / RADIUS) ** 2)
    assert run["height"][-1] - 10.0 == pytest.approx(gone, rel=1e-3)
    assert len(told(run)) == 1
    assert "torque: the equilibrium that it starts from brings -7357.5 along and the controller" in told(run)[0]
    assert "commands -7357.5 at the start, so -14715 act" in told(run)[0]
    assert "start=rest.state" in told(run)[0]


def test_what_is_told_to_do_holds_the_load():
    model, rest = borne({"torque": WEIGHT})
    run = fc.simulate(model, fc.OpenLoop({"torque": Constant(WEIGHT)}), until=1.0, start=rest.state, every=0.1)
    assert run["height"] == pytest.approx(10.0, abs=1e-9)
    assert not told(run)


def test_nothing_is_told_of_laws_of_deviations_nor_of_what_is_given_by_hand():
    model, rest = borne({"torque": WEIGHT})
    pd = control.ss([], [], [], [[-900.0, -300.0]], inputs=["angle", "speed"], outputs=["torque"])
    run = fc.simulate(model, pd, until=1.0, start=rest, every=0.1)
    assert run["height"] == pytest.approx(10.0, abs=1e-6)
    assert not told(run)
    push = fc.OpenLoop({"torque": Constant(-300.0)})  # deviates by 4 %
    assert not told(fc.simulate(model, push, until=0.1, start=rest))
    assert not told(fc.simulate(model, until=0.1, start=rest))
    given = fc.simulate(model, fc.OpenLoop({"torque": Constant(WEIGHT)}), until=0.1, start=rest, inputs={"torque": 0.0})
    assert given["height"] == pytest.approx(10.0, abs=1e-9)
    assert not told(given)


def test_a_law_that_bears_the_load_within_a_fifth_is_one_that_bears_it():
    model, rest = borne({"torque": WEIGHT})
    for share, count in ((0.79, 0), (0.81, 1), (1.19, 1), (1.21, 0)):
        law = fc.OpenLoop({"torque": Constant(share * WEIGHT)})
        assert len(told(fc.simulate(model, fc.Sampled(law, 0.01), until=0.05, start=rest))) == count


SLOW = {
    "delayed": lambda law: fc.Delayed(law, 2),
    "delayed before limits": lambda law: fc.Saturated(fc.Delayed(law, 1), {"torque": 1e5}),
    "rate": lambda law: fc.RateLimited(law, {"torque": 1e6}),
    "rate and delay": lambda law: fc.RateLimited(fc.Delayed(law, 3), {"torque": 1e6}),
}


@pytest.mark.parametrize("name", SLOW)
def test_commands_that_come_through_later_are_told_as_well(name):
    """Nothing comes of the law at the start; then the load is hauled in by its weight again, and is told to be."""
    model, rest = borne({"torque": WEIGHT})
    law = SLOW[name](fc.Sampled(fc.OpenLoop({"torque": lambda t: WEIGHT}), 0.01))
    run = fc.simulate(model, law, until=0.3, start=rest, every=0.1)
    assert run["torque"][-1] == pytest.approx(2.0 * WEIGHT)
    assert "commands -7357.5 at the start, so -14715 act once that has come through" in told(run)[0]
    assert not told(fc.simulate(model, law, until=0.05, start=rest.state))
    pd = control.ss([], [], [], [[-900.0, -300.0]], inputs=["angle", "speed"], outputs=["torque"])
    assert not told(fc.simulate(model, SLOW[name](fc.Sampled(pd, 0.001)), until=0.05, start=rest))


class Counting:
    """A law of one's own that remembers in itself: it bears the load from its third answer on."""

    inputs, outputs, sample_time = ("angle",), ("torque",), 0.01

    def __init__(self):
        self.asked = 0

    def initial(self):
        return np.zeros(0)

    def command(self, t, x, y):
        self.asked += 1
        return np.array([WEIGHT if self.asked > 2 else 0.0])

    def rate(self, t, x, y):
        return np.zeros(0)


def test_a_law_that_remembers_is_asked_as_it_was_and_is_left_alone():
    """Asked once more after the run, it said what it came to command, as if it had at the start."""
    model, rest = borne({"torque": WEIGHT})
    bare, delayed = Counting(), Counting()
    for law in (bare, fc.Delayed(delayed, 2)):
        assert not told(fc.simulate(model, law, until=0.1, start=rest))
    assert delayed.asked == bare.asked > 2
