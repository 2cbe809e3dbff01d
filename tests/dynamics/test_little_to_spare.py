"""A dry contact with little to spare breaks loose, or does not, in coarse steps: half the steps tell."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc


def line(masses, spring, play, rope, friction, stiction) -> fc.Model:
    """Ground, a spring with play, a mass, a rope just taut, a mass; both masses slide dry."""
    near, far = (fc.PointMass(name, (x, 0, 0), m) for name, x, m in zip("AB", (1, 2), masses, strict=True))
    held = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=spring)
    tow = fc.Rope("tow", (1, 0, 0), (2, 0, 0), EA=rope)
    joints = [fc.Support(held.start, "u v w"), fc.Support(near.node, "v w"), fc.Support(far.node, "v w")]
    joints += [fc.Pin(near.node, held.end), fc.Pin(near.node, tow.start), fc.Pin(far.node, tow.end)]
    outputs = [fc.Position("a", near.node, "x"), fc.Position("b", far.node, "x")]
    dry = {f"{name}.u": fc.Coulomb(F, static=S) for name, F, S in zip("AB", friction, stiction, strict=True)}
    effects = [fc.LargeRotation(), fc.RopeStretch(), fc.Backlash({"spring": play}), fc.CoulombFriction(dry)]
    return fc.assemble(fc.Structure([near, far, held, tow], joints, outputs=outputs), effects)


LATE = line((0.748431, 2.898641), 889.931, 0.00220263, 15356.5, (2.503438, 0.384738), (12.51719, 0.769476))
EARLY = line((0.593088, 1.676243), 58160.1, 0.00171313, 40369.7, (18.64833, 3.514501), (93.24164, 3.514501))


@pytest.mark.parametrize(("model", "speed"), [(LATE, 0.8436339), (EARLY, 1.3637287)], ids=["late", "early"])
def test_what_breaks_loose_by_a_little_is_told(model, speed):
    """Steps of 1 ms go the wrong way by 0.4 of the motion, as steps of 2 ms do; those of 0.5 ms do not."""
    how = {"until": 0.8, "start": model.drawn.with_(v=np.array([0.0, speed])), "every": 0.005}
    true = fc.simulate(model, method=fc.Unchecked(fc.ExplicitRungeKutta()), tolerance=fc.Tolerance(1e-8, 1e-11), **how)
    off = {}
    for step in (1e-3, 5e-4):
        run = fc.simulate(model, method=fc.GeneralizedAlpha(step), **how)
        off[step] = np.abs(run["a"] - true["a"]).max() / np.ptp(true["a"])
        told = any("by a finer run" in note for note in run.report.notes)
        assert told == (off[step] > 0.05), (step, off, run.report.notes)
    assert off[1e-3] > 0.3
    assert off[5e-4] < 0.02
