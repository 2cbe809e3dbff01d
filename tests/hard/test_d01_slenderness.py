"""D1: axial against bending stiffness up to 1e8 and beyond: no locking, no lost digits, no more iterations.

The arc of 45° of tests/validation/test_a04_bend.py has the values; here are other machines, and the iterations.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import flexctrl as fc

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
