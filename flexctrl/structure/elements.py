"""The parts of a machine. Every part has nodes of its own; the join table ties them together."""

from __future__ import annotations

from typing import TypeAlias

from flexctrl.structure.beams import Beam
from flexctrl.structure.bodies import PointMass, RigidBody
from flexctrl.structure.lines import Rope, Spring

__all__ = ["Part"]

Part: TypeAlias = Beam | Rope | Spring | PointMass | RigidBody
"""Any part of a structure; each has ``name`` and ``nodes``."""
