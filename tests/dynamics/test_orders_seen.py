"""How errors grow with the tolerance is seen in the runs beside: where a rope rattles, not as steps to a power."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.checking import _order
from flexctrl.dynamics.methods.checked import Beside
from flexctrl.dynamics.notes.gap import Gap
from flexctrl.dynamics.others import Other


def section(EI: float, EA: float) -> fc.Section:
    return fc.Section(EA=EA, EI_y=EI, EI_z=1.3 * EI, GJ=0.8 * EI, rhoA=2.5, rhoJ=2e-3, rhoI_y=1e-3, rhoI_z=1e-3)


def rattling(EI: float, EA: float, mass: float) -> fc.Model:
    """A load on a rope at the end of a jib that is let go: it goes slack and taut some tens of times."""
    mast = fc.Beam("mast", (0, 0, 0), (0, 0, 2), section(300.0, 5e4), elements=2)
    jib = fc.Beam("jib", mast.end, (1.2, 0.2, 2), section(EI, 5e4), elements=2)
    rope = fc.Rope("rope", jib.end, (1.2, 0.2, 0.8), EA=EA)
    load = fc.PointMass("load", rope.end, mass)
    joints = [fc.Support(mast.start, "u v w rx ry"), fc.Weld(mast.end, jib.start)]
    joints += [fc.Pin(jib.end, rope.start), fc.Pin(rope.end, load.node)]
    push = [fc.Force("push", load.node, "y")]
    outputs = [fc.Position(f"load_{k}", load.node, k) for k in "xyz"]
    structure = fc.Structure([mast, jib, rope, load], joints, inputs=push, outputs=outputs)
    return fc.assemble(structure, [fc.Flexible(), fc.LargeRotation(), fc.Gravity()])


@pytest.mark.parametrize(
    ("EI", "EA", "mass"), [(20.0, 2.5e5, 0.3), (30.0, 5e4, 0.8), (30.0, 2.5e5, 0.3), (30.0, 2.5e5, 0.8)]
)
def test_what_does_not_follow_a_power_of_steps_is_told_whole(EI, EA, mass):
    """An eighth of what two runs are apart, which steps of second order leave, was a sixth of the truth and less."""
    model, every = rattling(EI, EA, mass), 0.05
    run = fc.simulate(model, until=2.0, every=every, inputs={"push": 1.0})
    close = fc.Unchecked(fc.AdaptiveAlpha())
    right = fc.simulate(
        model, until=2.0, every=every, inputs={"push": 1.0}, method=close, tolerance=fc.Tolerance(1e-7, 1e-10)
    )
    assert len(run.events) > 10
    off = np.linalg.norm(run.y - right.y, axis=1).max() / np.linalg.norm(right.y - right.y[0], axis=1).max()
    assert run.report.error > off / 3.0


def _finished() -> fc.Run:
    mass = fc.PointMass("mass", (0, 0, 0), 1.0)
    model = fc.assemble(fc.Structure([mass], [fc.Support(mass.node)]), [])
    return fc.simulate(model, until=0.1)


@pytest.mark.parametrize("order", [1.4, 1.7, 2.0, 2.6])
def test_the_order_is_that_of_the_gaps(order):
    """Gaps of rᵖ − 1; no more than the method's, and no less than leaves the whole gap."""
    others = []
    for longer in (3.0**0.5, 3.0):
        beside = Beside(fc.AdaptiveAlpha(), fc.Tolerance(), longer, "")
        gap = Gap(np.zeros(1), np.array([1e-3 * (longer**order - 1.0)]), "", np.zeros(0))
        run = _finished()
        others.append(Other(run, gap, beside, run))
    assert _order(*others, 2.0) == pytest.approx(min(order, 2.0))
