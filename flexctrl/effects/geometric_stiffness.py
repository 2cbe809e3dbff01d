"""Small motion of a loaded machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from flexctrl.effects.effect import Effect
from flexctrl.effects.large_rotation import LargeRotation
from flexctrl.effects.places import by_place, finite
from flexctrl.errors import StructureError
from flexctrl.frozen import frozen


@frozen
class GeometricStiffness(Effect):
    """Small motion about the equilibrium under the machine's loads, with the stiffness that these give.

    It stands in for `LargeRotation`: K, C and M are those of `linearize` at the equilibrium, constant, so ropes
    swing and chains hang, but a swing does not lift its load. Outputs are linear as well: a rope that swings pulls by
    the weight, and one that is pressed has a negative tension. ``Model.rest`` is that equilibrium. Without either
    effect K is as assembled, without prestress. A `Scene` fills in its own ``hold`` and ``rest_inputs``.

    Parameters
    ----------
    hold : mapping of str to float, optional
        Freedoms held in the equilibrium, ``"girder.start.u"`` or a coordinate's name, and where [m or rad]; in motion
        they are free, and pushed by what held them no more.
    inputs : mapping of str to float, optional
        Constant inputs it is in equilibrium with, in their units.

    Raises
    ------
    StructureError
        For what is no number; by `assemble`, beside `LargeRotation`, which has it already, and for names that the
        machine does not have.
    """

    hold: tuple[tuple[str, float], ...]
    inputs: tuple[tuple[str, float], ...]

    def __init__(self, hold: Mapping[str, float] | None = None, inputs: Mapping[str, float] | None = None) -> None:
        for name, what, given in (("hold", "place", hold), ("inputs", "value", inputs)):
            object.__setattr__(self, name, by_place(given or {}, f"GeometricStiffness: {name}", what, finite))

    def everywhere(self) -> Effect:
        """Kernels do not know about equilibria."""
        return GeometricStiffness()

    def check_beside(self, effects: Sequence[Effect]) -> None:
        """Refuse `LargeRotation`."""
        if any(isinstance(e, LargeRotation) for e in effects):
            raise StructureError("GeometricStiffness is part of LargeRotation; give one of them")
