"""D21: a joint that slides over the borders of elements: no kink, no jump of energy or of the contact force.

The moving masses of B11 on 24 elements. At every node of the beam the state of the run is put just before and just
after it: the axis has one tangent there (C¹), its curvature jumps by what the mesh leaves, and with it the contact
force. Energies are over the largest that bends the beam; generalised alpha with ρ = 1 damps nothing.
"""

from __future__ import annotations

import numpy as np
import pytest
from crossing import Crossing
from recorder import Absolute

PAGE = "hard"
CASES = [(0.5, 0.5), (0.25, 1.0)]
ELEMENTS, ASIDE = 24, 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=str)
def test_over_every_node(case, record):
    crossing = Crossing(*case, ELEMENTS)
    model, run = crossing.run(480, rho=1.0, share=0.999)
    slide, under = model.coordinate("trolley_slide"), model.outputs.index("under")
    node = model.structure.number(model.structure.part("trolley").node)
    forces, speeds, energies = [], [], []
    for k in range(1, ELEMENTS):
        state = run.at(k / ELEMENTS / crossing.speed).state
        step = np.zeros(model.n)
        step[slide] = k / ELEMENTS - model.measure(state)[model.outputs.index("s")]
        sides = []
        for aside in (-ASIDE, ASIDE):
            step[slide] += aside
            sides.append(model.advance(state, step, state.v, state.t))
            step[slide] -= aside
        assert model.measure(sides[0])[under] == pytest.approx(model.measure(sides[1])[under], abs=1e-10)
        forces.append(np.subtract(*(crossing.contact(model, s) for s in sides)))
        speeds.append(np.subtract(*(model.rates(s)[6 * node + 2] for s in sides)))
        energies.append(np.subtract(*(sum(model.energy(s)[:2]) for s in sides)))
    head, source = f"D21 moving mass, α = {case[0]:g}, ε = {case[1]:g}", "one tangent at the nodes"
    fastest = max(abs(s.v[model.coordinate(f"beam_{ELEMENTS // 2}_w")]) for s in run.frames)
    energy, most = run.report.energy, max(model.energy(state)[1] for state in run.frames)
    for what, jumps, size, bound in (
        ("contact force over m g", forces, 1.0, 1e-3),
        ("speed across the beam over its largest", speeds, fastest, 1e-5),
        ("energy", energies, most, 1e-5),
    ):
        record(
            f"{head}: largest jump at a node of {what}",
            ours=np.abs(jumps).max() / size,
            reference=0.0,
            source=source,
            tolerance=Absolute(bound),
        )
    record(
        f"{head}: work less change of energy over the whole passage",
        ours=(energy.start + energy.work - energy.kinetic - energy.stored) / most,
        reference=0.0,
        source="nothing dissipates",
        tolerance=Absolute(2e-3),
    )
