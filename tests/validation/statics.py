"""Machines that several static cases share."""

from __future__ import annotations

import flexctrl as fc

NONLINEAR = (fc.Flexible(), fc.LargeRotation())


def slender(EI: float, length: float, ratio: float = 1e8) -> fc.Section:
    """A section of one bending stiffness, stiff along its axis: EA L²/EI = ratio; no mass to speak of."""
    return fc.Section(EA=ratio * EI / length**2, EI_y=EI, EI_z=EI, GJ=EI, rhoA=1.0, rhoJ=1e-3)


def cantilever(
    section: fc.Section, length: float, elements: int, inputs: list, effects: tuple = NONLINEAR, planar: bool = False
) -> fc.Model:
    """A beam along x from a clamp at the origin, which measures where its end is; inputs take the beam."""
    beam = fc.Beam("beam", (0, 0, 0), (length, 0, 0), section, elements=elements)
    structure = fc.Structure(
        [beam],
        [fc.Support(beam.start), *([] if not planar else out_of_plane(beam.nodes[1:]))],
        inputs=[make(beam) for make in inputs],
        outputs=[*[fc.Position(axis, beam.end, axis) for axis in "xyz"], fc.Rotation("turn", beam.end, "z")],
    )
    return fc.assemble(structure, effects)


def out_of_plane(nodes: tuple[fc.Node, ...]) -> list[fc.Support]:
    """Supports that leave nodes their motion in the x-y plane only."""
    return [fc.Support(node, held="w rx ry") for node in nodes]
