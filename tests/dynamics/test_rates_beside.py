"""Forces and rates are told of instant by instant: against a far finer run, and orders of errors put in by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.notes.apart import Apart, off_by
from flexctrl.dynamics.notes.rates import is_named

FINE = fc.Unchecked(fc.GeneralizedAlpha(2e-5))


def girder() -> fc.Model:
    """A hoist on a trolley that a soft girder carries."""
    trolley, load = fc.PointMass("trolley", (0, 0, 0), 4000.0), fc.PointMass("load", (0, 0, -7), 2000.0)
    beam = fc.Spring("girder", (0, 0, -2), trolley.node, stiffness=5e6)
    hoist = fc.Winch("hoist", load.node, trolley.node, EA=5e5, damping=900.0, radius=0.3, ratio=30.0, inertia=9.0)
    joints = [fc.Support(trolley.node, "u v"), fc.Support(load.node, "u v")]
    joints += [fc.Support(beam.start), fc.Pin(beam.end, trolley.node)]
    outputs = [fc.Position("z", load.node, "z"), fc.Velocity("shake", trolley.node, "z")]
    outputs += [fc.Tension("tension", hoist), fc.Tension("carried", beam), fc.DriveSpeed("speed", hoist)]
    plan = fc.Structure([trolley, load, beam], joints, [hoist], [fc.MotorTorque("torque", hoist)], outputs)
    return fc.assemble(plan, [fc.Gravity(), fc.LargeRotation(), fc.Flexible()])


class Lift:
    """Holds the load, and lifts it at half a metre per second squared for a second."""

    inputs = ("speed",)
    outputs = ("torque",)
    sample_time = 0.005

    def initial(self):
        return np.zeros(0)

    def command(self, t, x, y):
        weight, mass = 2000.0 * 9.81 * 0.01, 9.0 + 2000.0 * 1e-4
        return np.array([-weight - mass * 50.0 if t < 1.0 else -weight - 20.0 * y[0]])


METHODS = (fc.AdaptiveAlpha(), fc.GeneralizedAlpha(5e-3), fc.ConservingMidpoint(5e-3))


@pytest.mark.parametrize("sampled", [False, True], ids=["runs beside", "no run beside"])
@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_what_is_told_is_what_a_far_finer_run_says(method, sampled):
    """Two to nine percent, where places are right to 0.1 %: nothing was told of that."""
    law, inputs = (Lift(), None) if sampled else (None, {"torque": -250.0})
    run, fine = (fc.simulate(girder(), law, until=2.5, every=0.005, inputs=inputs, method=m) for m in (method, FINE))
    told = run.report.output_errors
    for name in ("shake", "tension", "carried", "speed"):
        off = np.abs(run[name] - fine[name]).max() / np.ptp(fine[name])
        assert 0.6 * off - 4e-3 < told.get(name, 0.0) < max(2.5 * off, 5e-3), name
    assert max(told["shake"], told["carried"]) > 0.01
    assert max(told["z"], run.report.error) < 0.01


def test_what_is_far_off_is_noted_and_what_finer_steps_mend_is_not():
    rough, fine = (
        fc.simulate(girder(), until=2.5, inputs={"torque": -250.0}, method=fc.GeneralizedAlpha(step))
        for step in (1e-2, 5e-4)
    )
    assert rough.report.output_errors["shake"] > 0.1
    assert any("shake" in note for note in rough.report.notes)
    assert not fine.report.notes
    assert fine.report.output_errors["shake"] < 0.01


@pytest.mark.parametrize("order", [0.0, 1.0, 2.0])
def test_two_coarser_runs_tell_the_order(order):
    near, far = (Apart(r, 1.0, np.array([1e-3 * max(r**order - 1.0, 1.0 - 1.0 / r)])) for r in (3.0, 6.0))
    # of an order that is not the method's the mean of what it leaves and all of the gap
    expected = np.sqrt(1e-3 * near.most[0]) if order == 1.0 else 1e-3 if order else near.most[0]
    assert off_by([far, near], np.ones(1), 2.0, steady=False)[0] == pytest.approx(expected, rel=1e-6)


def test_a_single_coarser_run_may_be_right_where_this_one_is_wrong():
    assert off_by([Apart(3.0, 1.0, np.array([0.3]))], np.array([3.0]), 2.0, steady=False)[0] == pytest.approx(0.3)
    assert off_by([Apart(2.0, 1.0, np.array([0.3]))], np.array([3.0]), 2.0, steady=True)[0] == pytest.approx(0.1)
    finer = Apart(0.5, 1.0, np.array([0.3]))
    assert off_by([finer], np.ones(1), 2.0, steady=False)[0] == pytest.approx(0.4)
    mean = np.sqrt(0.4 * 0.9)  # as the finer one may be near by chance
    assert off_by([Apart(3.0, 1.0, np.array([0.9])), finer], np.ones(1), 2.0, steady=False)[0] == pytest.approx(mean)


def test_rows_at_other_times_are_laid_beside_what_is_between():
    """Rows between rows err by next to nothing."""
    run = fc.simulate(girder(), until=0.1, inputs={"torque": -196.2}, method=fc.GeneralizedAlpha(1e-3))
    other = fc.simulate(girder(), until=0.1, inputs={"torque": -196.2}, method=fc.GeneralizedAlpha(7e-4))
    apart = Apart.of(run, other, 0.7).most
    assert (apart < 1e-3 * np.maximum(np.ptp(run.y, axis=0), 1e-9) + 1e-9).all()


def test_a_name_within_other_words_is_not_named():
    notes = ("rope_0_rx given by the others through v of node 1", "lv rings by up to 2 from the start on")
    assert not is_named("v", notes)
    assert is_named("lv", notes)


def test_rows_that_are_no_numbers_tell_nothing():
    run = fc.simulate(girder(), until=0.1, inputs={"torque": -196.2}, method=fc.GeneralizedAlpha(1e-3))
    y = run.y.copy()
    y[7] = np.nan
    assert np.isfinite(Apart.of(run, replace(run, y=y), 2.0).most).all()


def test_what_has_lost_its_phase_goes_by_no_power():
    """Of a gap all may be the run's own where it is a third of the output's range, or a farther run's is a fifth."""
    gap = np.array([0.3])
    assert off_by([Apart(2.0, 1.0, gap)], np.ones(1), 2.0, steady=True)[0] == pytest.approx(0.3)
    for size, grown, left in ((0.03, 35.0 / 8.0, 0.03 / 8.0), (0.06, 35.0 / 8.0, 0.06), (0.3, 1.5, 0.3)):
        pair = [Apart(3.0, 1.0, np.array([size])), Apart(6.0, 1.0, np.array([size * grown]))]
        assert off_by(pair, np.ones(1), 2.0, steady=False)[0] == pytest.approx(left)
