"""D1: axial against bending stiffness up to 1e8 and beyond: no locking, no lost digits, no more iterations.

The arc of 45° of tests/validation/test_a04_bend.py has the values; here are other machines, the iterations, and the
conditioning: cubic elements of a unit cantilever have cond K = 2.3e9 with 100 of them and 2.3e13 with 1000, where plain
factors leave 3.3e-6 of the deflection.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc

PAGE = "hard"
NONLINEAR = (fc.Flexible(), fc.LargeRotation())


def section(ratio: float, rhoA: float = 1.0) -> fc.Section:
    return fc.Section(EA=ratio, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=rhoA, rhoJ=1e-3)


def cantilever(ratio: float) -> fc.Rest:
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), section(ratio), elements=12)
    inputs = [fc.Force("load", beam.end, (0.3, 0.9, 0.3))]
    outputs = [fc.Position(axis, beam.end, axis) for axis in "xyz"]
    structure = fc.Structure([beam], [fc.Support(beam.start)], inputs=inputs, outputs=outputs)
    return fc.equilibrium(fc.assemble(structure, NONLINEAR), inputs={"load": 8.0})


def portal(ratio: float) -> fc.Rest:
    """A frame on two feet: pushed sideways, its girder cannot shorten freely."""
    left = fc.Beam("left", (0, 0, 0), (0, 0, 1), section(ratio), elements=6)
    girder = fc.Beam("girder", (0, 0, 1), (1.5, 0, 1), section(ratio), elements=8)
    right = fc.Beam("right", (1.5, 0, 1), (1.5, 0, 0), section(ratio), elements=6)
    joints = [fc.Support(left.start), fc.Support(right.end), fc.Weld(left.end, girder.start)]
    joints.append(fc.Weld(girder.end, right.start))
    inputs = [fc.Force("push", girder.start, "x"), fc.Force("weight", girder.node(4), "-z")]
    outputs = [fc.Position(axis, girder.node(4), axis) for axis in "xz"]
    structure = fc.Structure([left, girder, right], joints, inputs=inputs, outputs=outputs)
    return fc.equilibrium(fc.assemble(structure, NONLINEAR), inputs={"push": 8.0, "weight": 6.0})


@pytest.mark.parametrize("machine", [cantilever, portal])
def test_iterations_do_not_grow(machine):
    rests = {ratio: machine(ratio) for ratio in (1e4, 1e6, 1e8, 1e10)}
    counts = [rest.iterations for rest in rests.values()]
    assert max(counts) <= min(counts) + 2
    stiff, stiffer = (np.array(list(rests[ratio].outputs.values())) for ratio in (1e8, 1e10))
    assert np.abs(stiff - stiffer).max() < 1e-6


def test_a_pull_along_a_nearly_inextensible_rope_of_beams():
    """A hanging chain of light, pinned rods, EA L²/EI = 1e8, pulled aside: they lie along the force they carry."""
    rods = [fc.Beam(f"rod{i}", (0, 0, -i), (0, 0, -i - 1), section(1e8, 1e-6)) for i in range(5)]
    joints = [fc.Support(rods[0].start, "u v w rz")]
    joints += [fc.Pin(a.end, b.start) for a, b in pairwise(rods)]
    load = fc.PointMass("load", (0, 0, -5), 100.0)
    joints.append(fc.Pin(rods[-1].end, load.node))
    outputs = [fc.SwayAngle("sway", rods[0].start, load.node, "x")]
    structure = fc.Structure([*rods, load], joints, inputs=[fc.Force("pull", load.node, "x")], outputs=outputs)
    rest = fc.equilibrium(fc.assemble(structure, [*NONLINEAR, fc.Gravity()]), inputs={"pull": 500.0})
    assert np.tan(rest.outputs["sway"]) == pytest.approx(500.0 / (100.0 * 9.81), rel=1e-7)


CONDITION = {100: (2.3e9, 1.2e-9), 1000: (2.3e13, 3.3e-6)}
"""Elements → cond K and error of the deflection of a reference code."""


@pytest.mark.slow
@pytest.mark.parametrize("elements", CONDITION)
def test_conditioning(record, elements):
    """P L³/3EI, by equilibrium and as the response at rest."""
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), section(1e4), elements=elements)
    load, tip = fc.Force("load", beam.end, "y"), fc.Position("y", beam.end, "y")
    structure = fc.planar(fc.Structure([beam], [fc.Support(beam.start)], inputs=[load], outputs=[tip]), "z")
    model = fc.assemble(structure, [fc.Flexible()])
    linear = fc.linearize(model)
    bends = [i for i, name in enumerate(model.coordinates) if not name.endswith("_u")]
    values = np.linalg.eigvalsh(linear.K.toarray()[np.ix_(bends, bends)])
    condition, error = CONDITION[elements]
    record(
        f"D1 cantilever of {elements} elements: cond K",
        ours=values[-1] / values[0],
        reference=condition,
        source="cubic elements",
        tolerance=2.0,
    )
    record(
        f"D1 cantilever of {elements} elements: error of the deflection, by equilibrium, by the response at rest",
        ours=[
            3e3 * fc.equilibrium(model, inputs={"load": 1e-3}).outputs["y"] - 1.0,
            3.0 * linear.frequency_response([0.0]).values[0, 0, 0].real - 1.0,
        ],
        reference=[0.0, 0.0],
        source="closed form; three times the error of plain factors",
        tolerance=Absolute(3.0 * error),
    )
