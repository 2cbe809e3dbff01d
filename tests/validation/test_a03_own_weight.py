"""A3: cantilever under its own weight.

Uniform dead load on a clamped horizontal beam, from the shape as drawn; shooting to 1e-12. The curvature at the root is
the moment of all weight about it, q ∫ x ds, over the cubics between the nodes: trapezoids and −h²/12 of the change of
slope.
"""

from __future__ import annotations

import numpy as np
import pytest
from statics import NONLINEAR, cantilever, slender

import flexctrl as fc

PAGE = "statics"
TABLE = {
    1.0: (0.12347140, 0.00875360, 0.16511556),
    2.0: (0.23850658, 0.03310705, 0.32159380),
    5.0: (0.49590504, 0.15334282, 0.69700478),
    10.0: (0.70019972, 0.34364624, 1.05264312),
}
"""q L³/EI → w/L, u/L, tip angle."""

CURVATURE = {1.0: 0.49693340, 2.0: 0.97674272, 5.0: 2.22689255, 10.0: 3.74219111}
"""q L³/EI → curvature at the root, times L."""


def sagging(load: float, elements: int) -> fc.Rest:
    model = cantilever(slender(1.0, 1.0), 1.0, elements, [], (*NONLINEAR, fc.Gravity((0.0, load, 0.0))))
    return fc.equilibrium(model)


@pytest.mark.parametrize("load", TABLE)
def test_own_weight(record, load):
    out = sagging(load, 20).outputs
    record(
        f"Own weight q L³/EI = {load:g}, 20 elements: w/L, u/L, angle",
        ours=(out["y"], 1.0 - out["x"], out["turn"]),
        reference=TABLE[load],
        source="shooting",
        tolerance=1e-4,
    )


@pytest.mark.parametrize("load", CURVATURE)
def test_curvature_at_the_root(record, load):
    rest, h = sagging(load, 20), 1.0 / 20
    slopes = np.cos(rest.outputs["turn"]) - 1.0
    record(
        f"Own weight q L³/EI = {load:g}, 20 elements: curvature at the root, times L",
        ours=load * (np.trapezoid(rest.state.x[:21, 0], dx=h) - h * h / 12.0 * slopes),
        reference=CURVATURE[load],
        source="shooting",
        tolerance=1e-6,
    )
