"""A15: short cantilever that shears (Nachbagauer et al. 2011/2013).

L = 2, height 0.5, width 0.1, steel without weight, shear factor 10(1 + ν)/(12 + 11 ν), a load at the tip that bends it
by a third of its length. Reissner's rod equations; EXUDYN's ANCF beams give the same to 2e-6.
"""

from __future__ import annotations

import numpy as np
import pytest
from statics import cantilever

import flexctrl as fc

PAGE = "statics"
LENGTH, HEIGHT, WIDTH, E, NU = 2.0, 0.5, 0.1, 2.07e11, 0.3
TABLE = {6.25e4: (1.888491645e-7, 8.09903254e-4), 6.25e7: (0.1509711442, 0.7105685979)}
"""F → shortening, deflection."""


def moved(load: float, elements: int) -> np.ndarray:
    """Shortening, deflection."""
    area, second = HEIGHT * WIDTH, WIDTH * HEIGHT**3 / 12
    G = E / 2 / (1 + NU)
    shear = 10 * (1 + NU) / (12 + 11 * NU) * G * area
    section = fc.Section(E * area, E * second, E * second, G * second, 1.0, 1.0, GA_y=shear, GA_z=shear)
    model = cantilever(section, LENGTH, elements, [lambda beam: fc.Force("load", beam.end, "y")])
    out = fc.equilibrium(model, inputs={"load": load}).outputs
    return np.array([LENGTH - out["x"], out["y"]])


@pytest.mark.parametrize("load", TABLE)
def test_tip(record, load):
    case = f"Short cantilever, F = {load:g}"
    reference = {"reference": TABLE[load], "source": "rod shooting; EXUDYN ANCFBeamTest"}
    record(f"{case}, 32 elements: shortening, deflection", ours=moved(load, 32), tolerance=1e-5, **reference)
    limit = (4.0 * moved(load, 64) - moved(load, 32)) / 3.0
    record(f"{case}, 32 and 64 elements extrapolated", ours=limit, tolerance=1e-7, **reference)
