"""Ctrl-C while a controller is asked for the first time: there is a run, which stands where it was to begin."""

from __future__ import annotations

import os
import signal

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import StructureError


class Law:
    """A push that is interrupted when it is first asked for, once."""

    inputs, outputs = ("x",), ("push",)

    def __init__(self, sample_time, patient=False, signalled=False):
        self.sample_time, self.patient, self.signalled = sample_time, patient, signalled

    def initial(self):
        return np.array([1.0])

    def command(self, t, x, y):
        if not self.patient:
            self.patient = True
            if self.signalled:
                os.kill(os.getpid(), signal.SIGINT)
            else:
                raise KeyboardInterrupt
        return np.array([10.0 * x[0] - y[0]])

    def update(self, t, x, y):
        return 0.9 * x

    def rate(self, t, x, y):
        return -x


def pushed() -> fc.Model:
    mass = fc.PointMass("mass", (0, 0, 0), 2.0)
    structure = fc.Structure(
        [mass],
        [fc.Support(mass.node, "v w")],
        inputs=[fc.Force("push", mass.node, "x")],
        outputs=[fc.Position("x", mass.node, "x")],
    )
    return fc.assemble(structure, [fc.LargeRotation()])


HOW = {"until": 1.0, "every": 0.1}


@pytest.mark.parametrize("sample_time", [0.0, 0.01])
@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(1e-2), fc.ConservingMidpoint(1e-2)])
def test_the_run_stands_at_its_start_and_goes_on_from_there(tmp_path, sample_time, method):
    model, path = pushed(), tmp_path / "begun.npz"
    start = model.rest.with_(v=np.array([0.5]))
    run = fc.simulate(model, Law(sample_time), start=start, method=method, **HOW)
    assert run.status is fc.Status.INTERRUPTED
    assert "before the first step" in run.report.message
    assert run.t.tolist() == [0.0]
    assert run.report.steps == 0
    run.checkpoint.save(path)
    law = Law(sample_time, patient=True)
    later = fc.simulate(model, law, start=fc.load_checkpoint(path), method=method, **HOW)
    whole = fc.simulate(model, law, start=start, method=method, **HOW)
    assert later.status is fc.Status.FINISHED
    assert np.array_equal(later.y, whole.y)
    assert np.array_equal(later.t, whole.t)


def test_a_signal_does_the_same():
    run = fc.simulate(pushed(), Law(0.01, signalled=True), **HOW)
    assert run.status is fc.Status.INTERRUPTED
    assert run.final.t == 0.0


def test_a_run_that_was_to_go_on_stays_where_it_was():
    model, law = pushed(), Law(0.01, patient=True)
    half = fc.simulate(model, law, until=0.5, every=0.1)
    again = fc.simulate(model, Law(0.01), start=half.checkpoint, **HOW)
    assert again.status is fc.Status.INTERRUPTED
    assert again.final.t == half.checkpoint.t
    whole = fc.simulate(model, law, start=again.checkpoint, **HOW)
    assert np.array_equal(whole.y[-1], fc.simulate(model, law, **HOW).y[-1])


def test_only_what_belongs_to_it_goes_on():
    checkpoint = fc.simulate(pushed(), Law(0.01), **HOW).checkpoint
    with pytest.raises(StructureError, match="checkpoint is of another method"):
        fc.simulate(pushed(), Law(0.01), start=checkpoint, method=fc.GeneralizedAlpha(1e-3), **HOW)


class Servo:
    """Holds the mass back, and says when it was asked; Ctrl-C is pressed while it is, once."""

    inputs, outputs, sample_time = ("x",), ("push",), 0.01

    def __init__(self, when):
        self.when, self.asked = when, []

    def initial(self):
        return np.zeros(0)

    def command(self, t, x, y):
        self.asked.append(t)
        if t > self.when - 1e-9:
            self.when = np.inf
            os.kill(os.getpid(), signal.SIGINT)
        return -10.0 * y


@pytest.mark.parametrize("method", [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(1e-3), fc.ConservingMidpoint(1e-3)])
def test_a_law_is_not_asked_again(method):
    model, law = pushed(), Servo(1.0)
    how = {"until": 5.0, "every": 0.01, "start": model.displace([0.1]), "method": fc.Unchecked(method)}
    run = fc.simulate(model, law, **how)
    assert run.status is fc.Status.INTERRUPTED
    assert law.asked[-1] == pytest.approx(1.0)
    assert 1.0 - 1e-9 <= run.t[-1] < 1.0 + 1.5e-3  # after the step under way
    resumed = fc.simulate(model, law, **how | {"start": run.checkpoint})
    once = fc.simulate(model, Servo(np.inf), **how)
    assert np.array_equal(resumed.final.x, once.final.x)
    assert np.array_equal(resumed.final.v, once.final.v)
