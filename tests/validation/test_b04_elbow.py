"""B4, right-angle cantilever in space: pushed square to its plane, it bends and twists far.

Two legs of 10 m with 12 elements each, generalised alpha of 40 ms, ρ = 0.8. Reference: 8 quadratic and 6 cubic
geometrically exact elements a leg. The energy after the push is kept with ρ = 0.95 and 10 ms.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc
from flexctrl.design import Table

PAGE = "dynamics"
SOURCE = "8 quadratic and 6 cubic geometrically exact elements a leg"
PUSH = fc.OpenLoop({"push": Table((0.0, 1.0, 2.0), (0.0, 50.0, 0.0))})
EARLY = {
    1: (-0.0030, -0.0234, 0.0540, 0.9513),
    2: (0.1063, -0.6922, 0.0692, 4.1152),
    3: (0.7885, -1.0615, 1.5072, 5.5017),
    4: (0.4420, -0.7062, 3.5089, 4.6420),
    5: (-0.5407, -1.0625, 5.4794, 3.1114),
    7.5: (-0.4006, -2.6579, 8.2471, 2.2903),
    10: (0.0043, -1.9703, 4.4632, -3.0960),
}
LATE = {
    12.5: (-1.4604, -0.4695, -5.7283, -0.8255),
    15: (-2.2067, -7.2868, -9.2044, 0.1599),
    20: (4.0930, -0.9568, 0.4960, -2.6019),
    25: (-3.372, 0.350, 6.638, 6.054),
    30: (-1.736, -1.501, 0.168, -0.224),
}
"""Time → displacement of the tip in x, y, z, and of the elbow in z."""


@cache
def elbow() -> fc.Model:
    section = fc.Section(
        EA=1e6, EI_y=1e3, EI_z=1e3, GJ=1e3, rhoA=1.0, rhoJ=20.0, rhoI_y=10.0, rhoI_z=10.0, GA_y=1e6, GA_z=1e6
    )
    first = fc.Beam("first", (0, 0, 0), (10, 0, 0), section, 12)
    second = fc.Beam("second", (10, 0, 0), (10, 10, 0), section, 12)
    joints = [fc.Support(first.start), fc.Weld(first.end, second.start)]
    outputs = [
        *[fc.Position(f"tip_{axis}", second.end, axis) for axis in "xyz"],
        fc.Position("elbow_z", first.end, "z"),
    ]
    structure = fc.Structure([first, second], joints, inputs=[fc.Force("push", first.end, "z")], outputs=outputs)
    return fc.assemble(structure, [fc.LargeRotation(), fc.Flexible()])


@pytest.mark.slow
def test_tip_and_elbow(record):
    model = elbow()
    run = fc.simulate(model, PUSH, until=30.0, method=fc.GeneralizedAlpha(0.04, 0.8), every=0.5)
    moved = run.y - run.y[0]
    for t, places in {**EARLY, **LATE}.items():
        record(
            f"B4 elbow, tip in x, y, z and elbow in z at {t:g} s [m]",
            ours=moved[np.argmin(np.abs(run.t - t))],
            reference=places,
            source=SOURCE,
            tolerance=Absolute(1e-2 if t <= 10 else 5e-2),
        )


@pytest.mark.slow
def test_energy_after_the_push(record):
    model, method = elbow(), fc.GeneralizedAlpha(0.01, 0.95)
    pushed = fc.simulate(model, PUSH, until=2.0, method=method).final
    swinging = fc.simulate(model, until=28.0, start=pushed, method=method)
    energy = [sum(model.energy(state)[:2]) for state in swinging.frames]
    record(
        "B4 elbow, energy at the end of the push [J]",
        ours=energy[0],
        reference=114.8806,
        source=SOURCE,
        tolerance=5e-4,
    )
    record(
        "B4 elbow, energy over 28 s after the push, largest change over its value",
        ours=np.ptp(energy) / energy[0],
        reference=0.0,
        source="conserved",
        tolerance=Absolute(1e-4),
    )
