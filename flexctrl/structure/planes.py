"""Beams that their structure holds in a plane along their whole length."""

from __future__ import annotations

from flexctrl.structure.beams import Beam
from flexctrl.structure.join_table import JoinTable
from flexctrl.structure.joints import InPlane
from flexctrl.structure.structure import Structure

__all__ = ["held_across"]


def held_across(structure: Structure, beam: Beam) -> frozenset[int]:
    """Return the freedoms that lead out of the planes in which a beam is held along its whole length.

    Parameters
    ----------
    structure : Structure
    beam : Beam
        One of its parts.

    Returns
    -------
    frozenset of int
        Freedoms as in the columns of the join table; none without a plane.
    """
    held: list[set[int]] = [set() for _ in beam.nodes]
    for joint in () if isinstance(structure.joints, JoinTable) else structure.joints:
        if isinstance(joint, InPlane) and joint.node.part == beam.name:
            held[joint.node.index] |= joint.held
    return frozenset(set.intersection(*held))
