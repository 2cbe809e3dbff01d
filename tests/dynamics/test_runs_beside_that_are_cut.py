"""Runs beside end where they take far longer than the run: by its own time, whatever else a computer does."""

from __future__ import annotations

import itertools
import time

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics import others


def links() -> fc.Model:
    """Three of them, hinged one below the other."""
    points = {"a": (0.0, 0.0, 0.5), "b": (0.0, 0.0, -0.5)}
    bodies = [
        fc.RigidBody(
            f"b{i}",
            (0, 0, -i - 0.5),
            1.0,
            (0.1, 0.1, 0.1),
            {name: (x, y, z - i - 0.5) for name, (x, y, z) in points.items()},
        )
        for i in range(3)
    ]
    joints = [fc.Support(bodies[0].point("a"), "u v w rx rz")]
    joints += [fc.Hinge(a.point("b"), b.point("a"), "y") for a, b in itertools.pairwise(bodies)]
    last = bodies[-1]
    outputs = [fc.Position("x", last.point("b"), "x"), fc.Velocity("vx", last.point("b"), "x")]
    plan = fc.Structure(bodies, joints, inputs=[fc.Force("push", last.node, "x")], outputs=outputs)
    return fc.assemble(plan, [fc.Gravity(), fc.LargeRotation()])


class Law:
    """Shakes the last link and brakes it; waits once, at some question, or works as long at that one."""

    inputs, outputs, sample_time = ("vx",), ("push",), 5e-3
    asked = 0

    def __init__(self, waits_at: int = -1, works_at: int = -1) -> None:
        self.waits_at, self.works_at = waits_at, works_at

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        Law.asked += 1
        if Law.asked == self.waits_at:
            time.sleep(1.0)
        began = time.thread_time()
        while Law.asked == self.works_at and time.thread_time() < began + 1.0:
            pass
        return np.array([25.0 * np.sin(2.0 * t) - y[0]])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x


def simulated(law: Law) -> fc.dynamics.run.Run:
    Law.asked = 0
    return fc.simulate(links(), law, until=4.0, every=0.02)


@pytest.mark.parametrize("waits_at", [900, 1700, 2200])
def test_what_is_told_does_not_hang_on_the_clock(waits_at, monkeypatch):
    """A second in which nothing is done, in the run or in one beside it, of which these have half to themselves."""
    monkeypatch.setattr(others, "_SECONDS", 0.5)
    quick = simulated(Law())
    slow = simulated(Law(waits_at))
    assert np.array_equal(slow.y, quick.y)
    assert slow.report.output_errors == quick.report.output_errors
    assert slow.report.notes == quick.report.notes


@pytest.mark.parametrize("works_at", [1700, 2000, 2300])
def test_one_that_is_cut_is_told_of(works_at, monkeypatch):
    """Until when it went, and that nobody knows since; here it says nothing of what comes after."""
    monkeypatch.setattr(others, "_SECONDS", 0.0)
    monkeypatch.setattr(others, "_LONGER", 0.5)
    run = simulated(Law(works_at=works_at))
    (note,) = (note for note in run.report.notes if "run beside it ended at t =" in note)
    assert float(note.split("ended at t = ")[1].split()[0]) < 4.0
    assert "see whether Tolerance(1e-06, 1e-09) agrees" in note
