"""Leave the choice of effects to the program."""

from __future__ import annotations

from dataclasses import dataclass

from flexctrl.effects.effect import Effect
from flexctrl.structure.freedoms import check_finite


@dataclass(frozen=True)
class Automatic(Effect):
    """Of the effects beside it, a scene simulates only those that its answer needs.

    It adds no physics of its own. `Scene.settled` draws up the ledger of the scene with all the effects named and
    keeps the smallest set that holds every output within the tolerance.

    Parameters
    ----------
    tolerance : float
        Largest change of an output over its largest magnitude.

    Raises
    ------
    StructureError
        For a tolerance that is not positive.
    """

    tolerance: float = 0.01

    def __post_init__(self) -> None:
        object.__setattr__(self, "tolerance", check_finite(self.tolerance, "tolerance", "Automatic", above=0.0))

    def parts(self) -> tuple[Effect, ...]:
        """Nothing that a model is made of."""
        return ()
