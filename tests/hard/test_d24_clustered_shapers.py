"""D24: a double-pendulum crane whose lower pendulum is a thousandth of the upper: a shaper for modes far apart."""

from __future__ import annotations

import math

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc
from flexctrl.design import convolve, zv
from flexctrl.design.shaping import CoarseGridWarning, fir

PAGE = "hard"
G = 9.81


def frequencies(upper: float, lower: float, ratio: float) -> np.ndarray:
    first = fc.Rope("upper", (0, 0, 0), (0, 0, -upper), EA=1.0)
    hook = fc.PointMass("hook", first.end, 1.0)
    second = fc.Rope("lower", first.end, (0, 0, -upper - lower), EA=1.0)
    payload = fc.PointMass("payload", second.end, ratio)
    joints = [fc.Support(first.start), fc.Pin(first.end, hook.node), fc.Pin(hook.node, second.start)]
    joints.append(fc.Pin(second.end, payload.node))
    structure = fc.planar(fc.Structure([first, hook, second, payload], joints), "y")
    return fc.linearize(fc.assemble(structure, [fc.LargeRotation(), fc.Gravity()])).modes().omega


@pytest.mark.parametrize("share", [1e-1, 1e-2, 1e-3])
def test_residuals(record, share):
    upper, ratio = 10.0, 5.0
    omega = frequencies(upper, share * upper, ratio)
    record(
        f"D24 L₂ = {share:g} L₁: ω₂ over √(g (1 + R)/L₂)",
        ours=omega[1] / math.sqrt(G * (1 + ratio) / (share * upper)),
        reference=1.0,
        source="limit L₂ → 0",
        tolerance=2.0 * share,
    )
    shaper = convolve(*(zv(w) for w in omega))
    record(
        f"D24 L₂ = {share:g} L₁: residual of the two-mode ZV on both modes",
        ours=[shaper.residual(w) for w in omega],
        reference=[0, 0],
        source="zeros of the shaper",
        tolerance=Absolute(1e-10),
    )
    period = 2.0 * math.pi / omega[1]
    with pytest.warns(CoarseGridWarning):
        fir(shaper, period / 15, source="wish", shaped="command")
    fir(shaper, period / 25, source="wish", shaped="command")
