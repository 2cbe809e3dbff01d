"""Rows of a run lie where they were asked for, however many steps were added up to get there."""

from __future__ import annotations

import os
import signal

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.march.clock import later


def pendulum() -> fc.Model:
    bob = fc.RigidBody("bob", (0, 0, -1), 1.0, (1e-3,) * 3, points={"top": (0, 0, 0)})
    held = [fc.Support(bob.point("top"), "u v w rx rz")]
    structure = fc.Structure([bob], held, outputs=[fc.Rotation("turn", bob.node, "y")])
    return fc.assemble(structure, [fc.Gravity(), fc.LargeRotation()])


def off_grid(run: fc.Run, every: float) -> float:
    return float(np.abs(run.t - every * np.arange(len(run.t))).max())


@pytest.mark.parametrize(("step", "every"), [(1e-4, 0.01), (1e-3, 0.1), (3e-4, 0.01)])
def test_rows_do_not_slip_off_their_grid(step, every):
    model = pendulum()
    run = fc.simulate(
        model,
        until=1.5e4 * step,
        start=model.rest.with_(v=np.array([2.0])),
        method=fc.GeneralizedAlpha(step),
        every=every,
    )
    assert off_grid(run, every) <= 1e-13
    assert run.report.steps == 15_000
    assert len(run.t) == round(1.5e4 * step / every) + 1


def test_steps_that_began_elsewhere_are_summed_up():
    t = 0.25e-3
    for _ in range(1000):
        t = later(t, 1e-3)
    assert t == pytest.approx(1.00025, abs=1e-12)
    assert later(0.3, 0.1) == 4 * 0.1


def test_rows_after_a_rope_went_slack_lie_between_the_steps():
    rope, bob = fc.Rope("rope", (0, 0, 0), (0, 0, -1), EA=1e4, length=1.0), fc.PointMass("bob", (0, 0, -1), 1.0)
    constraints = [fc.Support(rope.start), fc.Pin(rope.end, bob.node)]
    structure = fc.Structure([rope, bob], constraints, outputs=[fc.Position("z", bob.node, "z")])
    model = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), fc.RopeStretch()])
    start = model.rest.with_(v=np.array([1.0, 0.0, 3.0]))
    run = fc.simulate(model, until=0.98, start=start, method=fc.GeneralizedAlpha(0.7e-3), every=0.007)
    assert len(run.events) >= 1
    assert off_grid(run, 0.007) <= 1e-13
    fine = fc.simulate(model, until=0.98, start=start, method=fc.GeneralizedAlpha(0.7e-4), every=0.007)
    assert np.abs(run["z"] - fine["z"]).max() <= 1e-4


def test_an_interrupted_stream_is_the_file_of_a_run_never_stopped(tmp_path):
    model, method = pendulum(), fc.GeneralizedAlpha(1e-4)
    start = model.rest.with_(v=np.array([2.0]))

    def ran(name: str, start, progress=None) -> fc.Run:
        record = fc.CsvStream(tmp_path / name, every=1.0)
        return fc.simulate(model, until=300.0, start=start, method=method, record=record, progress=progress)

    ran("once", start)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where tests run in the background
    half = ran("parts", start, lambda share: os.kill(os.getpid(), signal.SIGINT))
    signal.signal(signal.SIGINT, before)
    assert half.status is fc.Status.INTERRUPTED
    whole = ran("parts", half.checkpoint)
    assert whole.status is fc.Status.FINISHED
    assert (tmp_path / "parts").read_bytes() == (tmp_path / "once").read_bytes()
    assert len((tmp_path / "once").read_text().splitlines()) == 302
