"""B11, a force that travels over a simply supported beam.

Constant force and speed α v_cr, v_cr = (π/L) √(EI/μ); deflections over the static one, P L³/48 EI (Frýba's series). 40
elements; each node's share of the force rises and falls in a straight line as it passes. A travelling mass needs a
joint that slides along a beam, which there is not.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc
from flexctrl.design import Table

PAGE = "dynamics"
SOURCE = "Frýba's series, 201 terms"
LARGEST = {
    0.25: (1.25761, 0.402),
    0.5: (1.70544, 0.667),
    0.75: (1.70161, 0.862),
    1.0: (1.54807, 1.0),
    2.0: (0.67097, 1.0),
}
"""α → largest deflection at mid-span while the force is on the beam; where the force is then, over L."""
MIDDLE = {0.25: 1.065792, 0.5: 1.328878, 1.0: 0.513112}
"""α → that when the force is there."""
COUNT = 40


def crossing(alpha: float) -> tuple[np.ndarray, np.ndarray]:
    """Place of the force over L, and deflection at mid-span over the static one; L = EI = μ = 1."""
    section = fc.Section(EA=1e6, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=1e-3)
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), section, COUNT)
    passed = 1.0 / (alpha * np.pi)
    inner = range(1, COUNT)
    inputs = [fc.Force(f"push{i}", beam.node(i), "-z") for i in inner]
    joints = [fc.Support(beam.start, "u w"), fc.Support(beam.end, "w")]
    structure = fc.Structure([beam], joints, inputs=inputs, outputs=[fc.Position("w", beam.node(COUNT // 2), "z")])
    model = fc.assemble(fc.planar(structure, "y"), [fc.Flexible()])
    dt = passed / COUNT
    law = {f"push{i}": Table(((i - 1) * dt, i * dt, (i + 1) * dt), (0.0, 1.0, 0.0)) for i in inner}
    run = fc.simulate(model, fc.OpenLoop(law), until=passed, method=fc.GeneralizedAlpha(passed / 400, 0.9))
    return run.t / passed, -48.0 * run["w"]


@pytest.mark.slow
@pytest.mark.parametrize("alpha", LARGEST)
def test_deflection_at_mid_span(alpha, record):
    place, w = crossing(alpha)
    largest, where = LARGEST[alpha]
    record(
        f"B11 moving force, α = {alpha:g}: largest deflection over the static one",
        ours=w.max(),
        reference=largest,
        source=SOURCE,
        tolerance=5e-3,
    )
    if where < 1.0:
        record(
            f"B11 moving force, α = {alpha:g}: where the force is then, over L",
            ours=place[np.argmax(w)],
            reference=where,
            source=SOURCE,
            tolerance=Absolute(5e-3),
        )
    if alpha in MIDDLE:
        record(
            f"B11 moving force, α = {alpha:g}: deflection when the force is at mid-span",
            ours=np.interp(0.5, place, w),
            reference=MIDDLE[alpha],
            source=SOURCE,
            tolerance=5e-3,
        )
