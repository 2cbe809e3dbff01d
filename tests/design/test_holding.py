"""Laws of several sample times: a slower one held in a faster loop does what it does alone."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la

import flexctrl as fc
from flexctrl.design import FilteredRate, Held, OpenLoop, Sampled, Table, Together, pd
from flexctrl.design.lowering import lowered
from flexctrl.dynamics.feed import feed_of
from flexctrl.dynamics.notes.sampled_growth import _loop_at
from flexctrl.errors import ControllerError
from flexctrl.study.broken_loop import broken_loop

FAST, RATIO = 0.005, 10
SLOW = RATIO * FAST
STIFFNESS, MASS = 40.0, 2.0


def cart():
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=STIFFNESS)
    mass = fc.PointMass("mass", spring.end, MASS)
    joints = [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")]
    inputs = [fc.Force("push", mass.node, "x"), fc.Force("gust", mass.node, "x")]
    outputs = [fc.Position("x", mass.node, "x"), fc.Velocity("v", mass.node, "x")]
    return fc.assemble(fc.Structure([spring, mass], joints, inputs=inputs, outputs=outputs), [fc.LargeRotation()])


def slow(kp=30.0):
    return Sampled(pd(kp, 6.0, measured="x", rate=FilteredRate(0.08), command="push"), SLOW)


def test_a_held_law_says_what_it_says_alone():
    law, x = slow(), slow().initial()
    held, kept = Held(law, FAST), Held(law, FAST).initial()
    rng = np.random.default_rng(1)
    for sample in range(5 * RATIO):
        t, y = sample * FAST, rng.normal(size=1)
        if sample % RATIO == 0:
            wanted, x = law.command(t, x, y), law.update(t, x, y)
        assert np.array_equal(held.command(t, kept, y), wanted)
        kept = held.update(t, kept, y)
        assert np.array_equal(kept[: len(x)], x)


def test_a_run_under_a_held_law_is_that_under_the_law():
    model, how = cart(), {"until": 2.0, "method": fc.GeneralizedAlpha(FAST), "every": FAST}
    start = model.displace([0.1])
    alone = fc.simulate(model, slow(), start=start, **how)
    fast = Sampled(OpenLoop({"gust": lambda t: 0.0}), FAST)
    assert lowered(Together(Held(slow(), FAST), fast)) is not None
    beside = fc.simulate(model, Together(Held(slow(), FAST), fast), start=start, **how)
    assert beside["x"] == pytest.approx(alone["x"], abs=1e-12)
    assert beside["push"] == pytest.approx(alone["push"], abs=1e-10)


def test_a_run_under_a_held_law_goes_on_with_the_same_bits():
    model, law = cart(), Together(Held(slow(), FAST), Sampled(OpenLoop({"gust": np.sin}), FAST))
    half = fc.simulate(model, law, until=0.5 + 3 * FAST)
    assert np.array_equal(
        fc.simulate(model, law, until=1.0, start=half.checkpoint).final.x, fc.simulate(model, law, until=1.0).final.x
    )


@pytest.mark.parametrize("kp", [30.0, 400.0])
def test_poles_of_a_loop_of_two_rates_are_those_by_hand(kp):
    """Over a sample of the slow law the cart moves exactly under a push that is held."""
    model, gain = cart(), np.array([[-kp, -6.0]])
    law = Held(Sampled(pd(kp, 6.0, measured="x", rate="v", command="push"), SLOW), FAST)
    A = np.array([[0.0, 1.0, 0.0], [-STIFFNESS / MASS, 0.0, 1.0 / MASS], [0.0, 0.0, 0.0]])
    moved = la.expm(SLOW * A)
    wanted = np.linalg.eigvals(moved[:2, :2] + moved[:2, 2:] @ gain)
    wanted = wanted[abs(wanted) > 1.0 + 1e-9]
    feed = feed_of(model, law, np.zeros(2))
    [loop] = _loop_at(feed, model.rest, law.initial(), np.zeros(2))
    found = loop.poles(1.0 + 1e-9)
    assert np.sort(abs(found) ** RATIO) == pytest.approx(np.sort(abs(wanted)), rel=1e-5)
    run = fc.simulate(model, law, until=6.0, start=model.displace([1e-3]))
    assert any("unstable" in said for said in (run.report.message, *run.report.notes)) == bool(len(wanted))


@pytest.mark.parametrize(
    ("broken", "message"),
    [
        (
            lambda: Together(slow(), OpenLoop({"gust": np.sin})),
            r"\[0.0, 0.05\] s; sample .*: Sampled\(law, 0.05\)$",
        ),
        (lambda: Together(slow(), Sampled(OpenLoop({"gust": np.sin}), FAST)), r"slower one: Held\(law, 0.005\)$"),
        (lambda: Sampled(slow(), FAST), r"cannot be resampled to 0.005 s; .* Held\(controller, seconds\)"),
        (lambda: Held(slow(), 0.02), "sampled every 0.05 s, no whole multiple of 0.02 s"),
        (lambda: Held(slow(), 0.1), "no whole multiple of 0.1 s"),
        (lambda: Held(slow(), "1"), "no whole multiple of '1' s"),
        (lambda: Held(OpenLoop({"gust": np.sin}), FAST), r"is continuous; give Sampled\(law, seconds\)"),
        (lambda: broken_loop(fc.linearize(cart()), Held(slow(), FAST), "push"), "held over 10 samples"),
    ],
)
def test_what_does_not_fit_is_refused_with_what_does(broken, message):
    with pytest.raises(ControllerError, match=message):
        broken()


def test_a_disturbance_from_a_table_beside_a_sampled_law_can_be_had_as_the_message_says():
    gust = OpenLoop({"gust": Table([0.0, 1.0, 2.0], [0.0, 50.0, 0.0])})
    law = Together(slow(), Sampled(gust, SLOW))
    run = fc.simulate(cart(), law, until=1.0, every=SLOW)
    assert run["gust"][:-1] == pytest.approx(50.0 * run.t[:-1])
