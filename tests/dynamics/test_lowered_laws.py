"""Runs whose controller is asked by compiled loops are those that ask it in Python."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import FilteredRate, MinimumJerk, OpenLoop, Ramp, pid
from flexctrl.dynamics.march.legs import Told
from flexctrl.dynamics.march.marching import Pacing

pytest.importorskip("llvmlite")

PACES = {"fixed": fc.GeneralizedAlpha(1e-3), "controlled": fc.AdaptiveAlpha(first_step=1e-3)}
H = 4e-3


def law() -> fc.Delayed:
    """Follows a path; encoders, noise, limits and a delay; a command that starts under way."""
    inner = pid(900.0, 200.0, 30.0, measured="travel", rate=FilteredRate(0.01), command="push")
    follow = fc.Tracking(inner, {"travel": MinimumJerk(0.3, 0.2, at=0.02)})
    heard = fc.Quantised(fc.Noisy(fc.Sampled(follow, H), {"travel": 1e-4}, seed=3), {"travel": 1e-3})
    return fc.Delayed(fc.Saturated(heard, {"push": 120.0}), 2)


def crane() -> fc.Model:
    return fc.assemble(fc.cranes.ceiling_crane(), [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])


def both(model: fc.Model, monkeypatch: pytest.MonkeyPatch, **how) -> tuple[fc.dynamics.run.Run, fc.dynamics.run.Run]:
    told = fc.simulate(model, **how)
    with monkeypatch.context() as patch:
        patch.setattr("flexctrl.design.lowering.lowered", lambda law: None)
        return told, fc.simulate(model, **how)


def alike(a, b, tolerance: float = 1e-8) -> None:
    assert (a.status, a.report.steps, a.report.rejected_steps) == (b.status, b.report.steps, b.report.rejected_steps)
    assert np.allclose(a.t, b.t, rtol=1e-9, atol=0.0)
    assert np.allclose(a.y, b.y, rtol=tolerance, atol=tolerance)
    assert np.allclose(a.u, b.u, rtol=1e-7, atol=1e-7)
    assert np.allclose(a.final.q, b.final.q, rtol=0.0, atol=tolerance)
    assert a.report.energy.work == pytest.approx(b.report.energy.work, rel=1e-7)
    assert len(a.frames) == len(b.frames)


@pytest.mark.parametrize("every", [None, H, 2 * H, 3.1e-3])
@pytest.mark.parametrize("pace", PACES)
def test_who_asks_makes_no_difference(pace, every, monkeypatch):
    a, b = both(crane(), monkeypatch, controller=law(), until=0.3, method=PACES[pace], every=every)
    alike(a, b)
    for t in (0.0, 0.0123, 0.1, 0.2987, 0.3):
        assert np.allclose(a.at(t).state.x, b.at(t).state.x, rtol=0.0, atol=1e-8)
        assert a.at(t)["push"] == pytest.approx(b.at(t)["push"], rel=1e-6, abs=1e-6)


def test_nor_in_plain_steps(monkeypatch):
    """First-order freedoms do not march."""
    a, b = both(crane(), monkeypatch, controller=law(), until=0.02, method=fc.ConservingMidpoint(1e-3))
    alike(a, b)


@pytest.mark.parametrize("pace", PACES)
def test_runs_go_on_bit_for_bit(pace):
    """Also from the middle of a sample."""
    how = {"method": PACES[pace], "controller": law()}
    whole = fc.simulate(crane(), until=0.2, **how)
    for middle in (0.1, 0.1015):
        half = fc.simulate(crane(), until=middle, **how)
        rest = fc.simulate(crane(), until=0.2, start=half.checkpoint, **how)
        assert np.array_equal(rest.final.q, whole.final.q)
        assert rest.report.steps == whole.report.steps


def test_samples_longer_than_what_a_call_has_room_for(monkeypatch):
    how = {"controller": OpenLoop({"push": Ramp(300.0)}, 0.03), "until": 0.075, "method": fc.GeneralizedAlpha(2e-5)}
    alike(*both(crane(), monkeypatch, **how))


@pytest.mark.parametrize("pace", PACES)
def test_a_command_that_is_no_number_ends_the_run(pace, monkeypatch):
    """At the same sample, with the same words."""
    broken = OpenLoop({"push": lambda t: 10.0 if t < 0.05 else float("nan")}, H)
    a, b = both(crane(), monkeypatch, controller=broken, until=0.1, method=PACES[pace])
    assert a.status is fc.Status.FAILED
    assert "commands nan for 'push'" in a.report.message
    assert a.report.message == b.report.message
    assert a.t[-1] == pytest.approx(b.t[-1])
    assert np.isfinite(a.y).all()


def test_a_signal_that_fails_does_so_when_its_time_has_come():
    def signal(t: float) -> float:
        if t > 0.06:
            raise KeyboardInterrupt
        return 5.0

    run = fc.simulate(crane(), OpenLoop({"push": signal}, H), until=0.1, method=PACES["fixed"])
    assert run.status is fc.Status.INTERRUPTED
    assert 0.055 < run.t[-1] < 0.07


def test_rigid_and_small_motion_too(monkeypatch):
    effects = [fc.Gravity(), fc.Flexible(), fc.GeometricStiffness()]
    small = fc.assemble(fc.cranes.ceiling_crane(), effects)
    for model in (fc.rigid(crane()), small):
        alike(*both(model, monkeypatch, controller=law(), until=0.15, method=PACES["fixed"]))


@pytest.mark.parametrize("period", [0.02, 1e-3, 0.1, 1.0 / 3.0])
@pytest.mark.parametrize("early", [0.0, 1e-11, 1e-9, 1e-7, 0.4])
def test_legs_end_at_the_next_sample_however_near_it_is(period, early):
    """A corner 8 ns before a sample began one that went on to the sample after it when it was done again."""
    starts = period * (np.arange(1, 2000) - early)
    table = np.column_stack([starts, np.full_like(starts, 0.1 * period), np.ones_like(starts)])
    pacing = Pacing(0.1 * period, np.inf, 0.0, 1e4, 1e-4, 1e-7)
    legs = Told(np.zeros(0), table, 0, period, pacing).legs()
    nearest = period * np.arange(1, 2000)
    assert [leg.pacing.stop for leg in legs] == [*(nearest if early else period * np.arange(2, 2001))]
