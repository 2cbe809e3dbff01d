"""B11, a force and a mass that travel over a simply supported beam.

At constant speed α v_cr, v_cr = (π/L) √(EI/μ); deflections over the static one, P L³/48 EI. A trolley on 20 elements,
driven by a motor too heavy to be slowed, under a dead load P: without mass, and with a mass ε of that of the beam whose
weight P is (all its inertia: m (ẅ + 2 v ẇ' + v² w'')). 800 steps of generalised alpha, ρ = 0.9.
"""

from __future__ import annotations

import numpy as np
import pytest
from crossing import LOAD, Crossing
from recorder import Absolute

PAGE = "dynamics"
FORCE = "Frýba's series, 201 terms"
MASS = "32 modes, all inertia terms"
LARGEST = {
    0.1: (1.09644, 0.544),
    0.25: (1.25761, 0.402),
    0.5: (1.70544, 0.667),
    0.6: (1.73113, 0.745),
    0.617: (1.73167, 0.758),
    0.75: (1.70161, 0.862),
    1.0: (1.54807, 1.0),
    2.0: (0.67097, 1.0),
}
"""α → largest deflection at mid-span while the force is on the beam; where the force is then, over L."""
MIDDLE = {0.25: 1.065792, 0.5: 1.328878, 1.0: 0.513112}
"""α → that when the force is there."""
LEFT = (0.1, 0.25, 0.5)
"""α at which the force leaves the middle of the beam undeflected."""
MASSES = {
    (0.25, 0.2): ((1.31816, 0.444), (1.30765, 0.457), 0.19678),
    (0.5, 0.2): ((1.82459, 0.745), (1.57907, 0.653), 0.56840),
    (0.5, 0.5): ((2.02212, 0.8545), (1.52453, 0.7015), 1.39501),
    (0.25, 1.0): ((1.57126, 0.5925), (1.53988, 0.5705), -0.80249),
}
"""(α, ε) → largest deflection at mid-span and under the mass, with the place of the mass; mid-span as it leaves."""


def passage(alpha: float, mass: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Place over L; deflections at mid-span and under the load over the static one."""
    crossing = Crossing(alpha, mass, 20)
    run = crossing.run(800)[1]
    return crossing.speed * run.t, -48.0 / LOAD * run["middle"], -48.0 / LOAD * run["under"]


@pytest.mark.slow
@pytest.mark.parametrize("alpha", LARGEST)
def test_moving_force(alpha, record):
    place, w, _ = passage(alpha, 0.0)
    largest, where = LARGEST[alpha]
    head = f"B11 moving force, α = {alpha:g}"
    record(f"{head}: largest deflection at mid-span", ours=w.max(), reference=largest, source=FORCE, tolerance=1e-3)
    if where < 1.0:
        at = place[np.argmax(w)]
        record(f"{head}: place of the force then", ours=at, reference=where, source=FORCE, tolerance=Absolute(2e-3))
    if alpha in MIDDLE:
        found = np.interp(0.5, place, w)
        case = f"{head}: deflection when it is at mid-span"
        record(case, ours=found, reference=MIDDLE[alpha], source=FORCE, tolerance=1e-3)
    if alpha in LEFT:
        case = f"{head}: deflection at mid-span as it leaves"
        record(case, ours=w[-1], reference=0.0, source=FORCE, tolerance=Absolute(1e-3))


@pytest.mark.slow
@pytest.mark.parametrize("case", MASSES, ids=str)
def test_moving_mass(case, record):
    place, *deflections = passage(*case)
    *largest, left = MASSES[case]
    head = f"B11 moving mass, α = {case[0]:g}, ε = {case[1]:g}"
    for what, w, (most, where) in zip(("at mid-span", "under the mass"), deflections, largest, strict=True):
        record(f"{head}: largest deflection {what}", ours=w.max(), reference=most, source=MASS, tolerance=1e-3)
        record(
            f"{head}: place of the mass then",
            ours=place[np.argmax(w)],
            reference=where,
            source=MASS,
            tolerance=Absolute(2e-3),
        )
    record(
        f"{head}: deflection at mid-span as it leaves",
        ours=deflections[0][-1],
        reference=left,
        source=MASS,
        tolerance=5e-3,
    )
