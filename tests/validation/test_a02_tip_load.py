"""A2: large deflection of a cantilever under a dead load at its tip.

Elliptic integrals (Mattiasson 1981). The last lines are the same problem told in metres, millimetres and micrometres:
the answers over L agree to round-off, and the search takes the same number of iterations.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute
from statics import cantilever, slender

import flexctrl as fc

PAGE = "statics"
TABLE = {
    0.2: (0.06636448, 0.00264655, 0.09963616),
    0.4: (0.13097524, 0.01035392, 0.19715462),
    0.6: (0.19235028, 0.02248767, 0.29073777),
    0.8: (0.24945154, 0.03816561, 0.37906301),
    1.0: (0.30172077, 0.05643324, 0.46135195),
    2.0: (0.49345748, 0.16064172, 0.78174983),
    3.0: (0.60325344, 0.25442018, 0.98601695),
    4.0: (0.66996418, 0.32894124, 1.12123935),
    5.0: (0.71379152, 0.38762836, 1.21536812),
    6.0: (0.74457115, 0.43458883, 1.28369729),
    8.0: (0.78498237, 0.50482773, 1.37443151),
    10.0: (0.81060902, 0.55499560, 1.43028554),
}
"""P L²/EI → w/L, u/L, tip angle."""

UNITS = {"m, kg, s": (1.0, 1.0, 1.0), "mm, t, s": (1e3, 1e-3, 1.0), "µm, µg, ms": (1e6, 1e9, 1e3)}
"""Metre, kilogram and second in other units."""


def bent(load: float, length: float = 2.0, EI: float = 3.0, elements: int = 16, mass: float = 1.0) -> fc.Rest:
    section = slender(EI, length, 1e8)
    section = fc.Section(section.EA, EI, EI, EI, rhoA=mass / length, rhoJ=1e-3 * mass * length)
    model = cantilever(section, length, elements, [lambda beam: fc.Force("load", beam.end, "y")])
    return fc.equilibrium(model, inputs={"load": load * EI / length**2})


def dimensionless(rest: fc.Rest, length: float) -> np.ndarray:
    out = rest.outputs
    return np.array([out["y"] / length, 1.0 - out["x"] / length, out["turn"]])


@pytest.mark.parametrize("load", TABLE)
def test_tip_load(record, load):
    record(
        f"Tip load P L²/EI = {load:g}, 16 elements: w/L, u/L, angle",
        ours=dimensionless(bent(load), 2.0),
        reference=TABLE[load],
        source="elliptic integrals",
        tolerance=1e-4,
    )


@pytest.mark.parametrize("unit", UNITS)
def test_units(record, unit):
    metre, kilogram, second = UNITS[unit]
    length, newton = 2.0 * metre, kilogram * metre / second**2
    rest, known = bent(5.0, length, 3.0 * newton * metre**2, mass=2.0 * kilogram), bent(5.0, mass=2.0)
    gap = dimensionless(rest, length) - dimensionless(known, 2.0)
    record(
        f"P L²/EI = 5 in {unit}: differences of w/L, u/L, angle and of the iterations",
        ours=[*gap, rest.iterations - known.iterations],
        reference=np.zeros(4),
        source="the run in m, kg, s",
        tolerance=Absolute(1e-8),
    )
