"""Small motion of a loaded machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from flexctrl.effects.effect import Effect
from flexctrl.effects.large_rotation import LargeRotation
from flexctrl.errors import StructureError


@dataclass(frozen=True)
class GeometricStiffness(Effect):
    """Small motion about the equilibrium under the machine's own weight, with the stiffness that loads give.

    It stands in for `LargeRotation`: K, C and M are those of `linearize` at the equilibrium, constant, so ropes
    swing and chains hang, but a swing does not lift its load. ``Model.rest`` is that equilibrium. Without either
    effect K is as assembled, without prestress.

    Raises
    ------
    StructureError
        By `assemble`, beside `LargeRotation`, which has it already.
    """

    def check_beside(self, effects: Sequence[Effect]) -> None:
        """Refuse `LargeRotation`."""
        if any(isinstance(e, LargeRotation) for e in effects):
            raise StructureError("GeometricStiffness is part of LargeRotation; give one of them")
