"""A3: cantilever under its own weight.

Uniform dead load on a clamped horizontal beam, from the shape as drawn; shooting to 1e-12.
"""

from __future__ import annotations

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


@pytest.mark.parametrize("load", TABLE)
def test_own_weight(record, load):
    model = cantilever(slender(1.0, 1.0), 1.0, 20, [], (*NONLINEAR, fc.Gravity((0.0, load, 0.0))))
    out = fc.equilibrium(model).outputs
    record(
        f"Own weight q L³/EI = {load:g}, 20 elements: w/L, u/L, angle",
        ours=(out["y"], 1.0 - out["x"], out["turn"]),
        reference=TABLE[load],
        source="shooting",
        tolerance=1e-4,
    )
