"""Explicit steps where several contacts stick and slide: what holds a contact is no stiff spring to them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import flexctrl as fc

BLOCKS = 3


def pile() -> fc.Model:
    """Blocks on top of each other that slide along x, each on the one below, the lowest on the ground."""
    ends = {"lo": (0, 0, -0.5), "hi": (0, 0, 0.5)}
    blocks = [
        fc.RigidBody(f"b{i}", (0, 0, i), mass, (1, 1, 1), {k: (0, 0, i + z) for k, (_, _, z) in ends.items()})
        for i, mass in enumerate((2.1, 1.2, 0.6))
    ]
    springs = [fc.Spring(f"s{i}", (-3, 0, i), (0, 0, i), stiffness=k) for i, k in enumerate((5.0, 26.0, 16.0))]
    joints = [fc.Support(blocks[0].node, "v w rx ry rz")]
    joints += [fc.Slide(a.point("hi"), b.point("lo"), "x") for a, b in pairwise(blocks)]
    joints += [j for s, b in zip(springs, blocks, strict=True) for j in (fc.Support(s.start), fc.Pin(s.end, b.node))]
    outputs = [fc.Position(f"x{i}", b.node, "x") for i, b in enumerate(blocks)]
    inputs = [fc.Force(f"f{i}", b.node, "x") for i, b in enumerate(blocks)]
    friction = {"b0.u": fc.Coulomb(0.54), "b1.lo": fc.Coulomb(2.5), "b2.lo": fc.Coulomb(2.8)}
    structure = fc.Structure([*blocks, *springs], joints, inputs=inputs, outputs=outputs)
    return fc.assemble(structure, [fc.LargeRotation(), fc.CoulombFriction(friction)])


def pushes(t: float) -> np.ndarray:
    return np.array([5.2, 6.1, 4.8]) * np.sin(np.array([4.7, 9.0, 1.2]) * t + np.array([-1.1, 0.2, -1.9]))


class Pushing:
    inputs: tuple[str, ...] = ()
    outputs = ("f0", "f1", "f2")
    sample_time = 0.01

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return pushes(t)


def test_several_contacts_as_by_fine_implicit_steps():
    model = pile()
    explicit = fc.simulate(model, Pushing(), until=2.0, every=0.05, method=fc.ExplicitRungeKutta())
    fine = fc.simulate(model, Pushing(), until=2.0, every=0.05, method=fc.GeneralizedAlpha(1e-4))
    assert explicit.status is fc.Status.FINISHED
    assert [e.name for e in explicit.events] == [e.name for e in fine.events]
    assert len(explicit.events) >= 6
    assert np.array([e.t for e in explicit.events]) == pytest.approx([e.t for e in fine.events], abs=1e-5)
    assert np.abs(explicit.y - fine.y).max() < 1e-6
    assert explicit.report.energy_residual < 1e-9
    assert explicit.report.steps < 400


def test_what_sticks_does_not_drift():
    """A block held on one that is pushed away: it does not move on it, to round-off, however long the steps."""
    how = {"method": fc.ExplicitRungeKutta(), "tolerance": fc.Tolerance(1e-3)}
    run = fc.simulate(pile(), inputs={"f0": 4.0}, until=0.33, every=0.03, **how)
    assert not run.events
    assert np.ptp(run["x0"]) > 0.04
    assert np.ptp(run["x1"] - run["x0"]) < 1e-14
