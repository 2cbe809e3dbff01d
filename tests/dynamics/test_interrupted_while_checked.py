"""Ctrl-C after the last step, as it is seen how far a run is off: the run is kept, and says that it was cut."""

from __future__ import annotations

import os
import signal

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics import simulate as simulating
from flexctrl.dynamics.notes import gap
from flexctrl.dynamics.records.digest import Digest


def beam() -> fc.Model:
    """A soft pipe, held level at one end and let go."""
    tube = fc.Section.tube(fc.STEEL, radius=0.01, thickness=0.001)
    pipe = fc.Beam("pipe", (0, 0, 0), (4, 0, 0), tube, elements=3)
    plan = fc.Structure(
        [pipe],
        [fc.Support(pipe.start, "u v w rx rz")],
        outputs=[fc.Position("z", pipe.end, "z"), fc.Velocity("vz", pipe.end, "z")],
    )
    return fc.assemble(plan, [fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(beta=1e-3)])


HOW = {"until": 1.0, "every": 0.05}


def pressed(times: int) -> None:
    for _ in range(times):
        os.kill(os.getpid(), signal.SIGINT)


def pressing(monkeypatch, where, name, times):
    """Have Ctrl-C pressed as a function is called, once."""
    kept, left = getattr(where, name), [times]

    def called(*given):
        pressed(left.pop() if left else 0)
        return kept(*given)

    monkeypatch.setattr(where, name, called)


@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize(
    ("where", "name"),
    [
        (gap, "_of_tracks"),
        (simulating, "answers"),
        (simulating, "can_be_told"),
        (simulating, "ringing"),
        (simulating, "said_of_rates"),
    ],
)
def test_all_rows_are_kept(monkeypatch, where, name, times):
    model = beam()
    whole = fc.simulate(model, **HOW)
    assert whole.status is fc.Status.FINISHED
    pressing(monkeypatch, where, name, times)
    run = fc.simulate(model, **HOW)
    assert run.status is fc.Status.INTERRUPTED
    assert "others were laid beside" in run.report.message
    assert np.array_equal(run.y, whole.y)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("name", ["drifted", "by_sums", "strayed", "unsure", "left_out"])
def test_twice_as_the_report_is_made(monkeypatch, name):
    """Not even a second one loses the run."""
    from flexctrl.dynamics import result

    model = beam()
    whole = fc.simulate(model, **HOW)
    pressing(monkeypatch, result, name, 2)
    run = fc.simulate(model, **HOW)
    assert run.status is fc.Status.INTERRUPTED
    assert any("pressed twice" in note for note in run.report.notes)
    assert np.array_equal(run.y, whole.y)


def test_it_goes_on_with_the_same_bits(monkeypatch):
    model = beam()
    pressing(monkeypatch, simulating, "answers", 1)
    first = fc.simulate(model, **HOW)
    assert first.status is fc.Status.INTERRUPTED
    assert first.final.t == HOW["until"]
    monkeypatch.undo()
    on = fc.simulate(model, until=1.5, every=0.05, start=first.checkpoint)
    half = fc.simulate(model, **HOW)
    on_from_whole = fc.simulate(model, until=1.5, every=0.05, start=half.checkpoint)
    assert np.array_equal(on.y, on_from_whole.y)


def test_nobody_is_asked_again_after_it(monkeypatch):
    """Once Ctrl-C is pressed no other run is begun."""
    model, begun = beam(), []
    kept = Digest.start
    monkeypatch.setattr(Digest, "start", lambda self, *given: begun.append(1) or kept(self, *given))
    fc.simulate(model, **HOW)
    others = len(begun)
    assert others > 0
    begun.clear()
    pressing(monkeypatch, simulating, "can_be_told", 1)
    fc.simulate(model, **HOW)
    assert not begun
