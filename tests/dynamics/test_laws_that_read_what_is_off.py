"""A law that reads a load cell whose ring steps do not see: what it moves goes by that, and a note says so."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

OMEGA, SAMPLE, MASS = 250.0, 0.031, 4.0


class Cell:
    """Holds a mass at a place; adds a share of the tension behind it."""

    inputs, outputs, sample_time = ("x", "v", "T"), ("push",), SAMPLE

    def __init__(self, share: float) -> None:
        self.share = share

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        wanted = 0.4 if t < 1.0 else -0.1
        return np.array([2.0 * MASS * (4.0 * (wanted - y[0]) - 2.8 * y[1]) - self.share * y[2]])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x


def run(share: float) -> fc.dynamics.run.Run:
    a, b = fc.PointMass("a", (0, 0, 0), MASS), fc.PointMass("b", (1, 0, 0), MASS)
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=0.5 * MASS * OMEGA**2)
    joints = [fc.Support(a.node, "v w"), fc.Support(b.node, "v w"), fc.Pin(a.node, spring.start)]
    outputs = [fc.Position("x", a.node, "x"), fc.Velocity("v", a.node, "x"), fc.Tension("T", spring)]
    plan = fc.Structure(
        [a, b, spring],
        [*joints, fc.Pin(spring.end, b.node)],
        inputs=[fc.Force("push", a.node, "x")],
        outputs=outputs,
    )
    return fc.simulate(fc.assemble(plan, [fc.LargeRotation()]), Cell(share), until=3.0, every=SAMPLE)


def notes(found: fc.dynamics.run.Run) -> list[str]:
    return [note for note in found.report.notes if note.startswith("the law reads T")]


def test_a_law_that_goes_by_it_is_told_of():
    """By how much commands are off is the law's share of what the reading is off by."""
    found = run(0.3)
    (note,) = notes(found)
    off = min(found.report.output_errors["T"], 1.0)
    wanted = 0.3 * off * np.ptp(found["T"]) / np.ptp(found.u[:, 0])
    told = float(note.split("its commands by ")[1].split()[0]) / 100.0
    assert off > 0.2
    assert told == pytest.approx(wanted, rel=0.1)


def test_one_that_does_not_go_by_it_is_not():
    found = run(0.0)
    assert found.report.output_errors["T"] > 0.2
    assert not notes(found)
