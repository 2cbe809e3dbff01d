"""D20: on the way to buckling frequencies go to zero as a root, in the linear model and in motion.

A simply supported beam with ω/ω₀ = √(1 + N/P_E); a mast that buckles under its own weight.
"""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

PAGE = "hard"
SECTION = fc.Section(EA=1e7, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=1e-4)
EULER = np.pi**2


def column(elements: int = 12) -> fc.Model:
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), SECTION, elements=elements)
    structure = fc.Structure(
        [beam],
        [fc.Support(beam.start, "u v w rx"), fc.Support(beam.end, "v w rx")],
        inputs=[fc.Force("thrust", beam.end, "-x")],
        outputs=[fc.Position("middle", beam.node(elements // 2), "z")],
    )
    return fc.assemble(fc.planar(structure, "y"), [fc.LargeRotation(), fc.BeamFlexibility()])


@pytest.mark.parametrize(("share", "ratio"), [(0.5, 0.70710678), (0.9, 0.31622777), (0.99, 0.1)])
def test_frequencies(record, share, ratio):
    model = column()
    rest = fc.equilibrium(model, inputs={"thrust": share * EULER})
    found = fc.linearize(model, rest).modes().omega[0] / np.pi**2
    record(
        f"D20 column under {share:g} of Euler's load: ω/ω₀",
        ours=found,
        reference=ratio,
        source="√(1 + N/P_E)",
        tolerance=1e-3,
    )


def test_motion_under_nine_tenths_of_eulers_load(record):
    """A quarter of its slow period after it is let go from 1e-4 of its length it passes the middle."""
    model, share = column(8), 0.9
    rest = fc.equilibrium(model, inputs={"thrust": share * EULER})
    step = 1e-4 * fc.linearize(model, rest).modes().shapes[:, 0]
    start = model.advance(rest.state, step / np.abs(step).max() * 1e-4, np.zeros(model.n), 0.0)
    event = fc.Event("straight", "middle", terminal=True)
    run = fc.simulate(
        model,
        start=start,
        until=2.0,
        inputs={"thrust": share * EULER},
        events=[event],
        tolerance=fc.Tolerance(1e-6, 1e-10),
    )
    record(
        "D20 column under 0.9 of Euler's load, let go: quarter of the period [s]",
        ours=run.final.t,
        reference=0.5 * np.pi / (np.pi**2 * np.sqrt(0.1)),
        source="π/(2 ω₀ √(1 + N/P_E))",
        tolerance=2e-3,
    )


def test_beyond_eulers_load_it_is_flagged(record):
    rest = fc.equilibrium(column(), inputs={"thrust": 1.01 * EULER})
    record(
        "D20 straight column beyond Euler's load: directions in which it gives way",
        ours=rest.unstable,
        reference=1,
        source="one",
        tolerance=1e-12,
    )
