"""Leave the choice of effects to the program."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from flexctrl.effects.effect import Effect
from flexctrl.errors import StructureError, shortened
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import check_finite, check_number

__all__ = ["Automatic", "Within"]


@dataclass(frozen=True, kw_only=True)
class Within:
    """How far an answer may change, each part of it by itself; what is not named is told but does not count.

    ``Within(outputs=0.01)`` asks for curves only, ``Within(poles=0.02, margins=0.05)`` for the linear loop only.

    Parameters
    ----------
    outputs : float
        Largest change of an output over its largest magnitude.
    poles : float
        Largest change of a slow pole over its magnitude.
    margins : float
        Largest change of a gain or phase margin over the larger of both.

    Raises
    ------
    StructureError
        For a number that is not positive, or if nothing is asked for.
    """

    outputs: float = math.inf
    poles: float = math.inf
    margins: float = math.inf

    def __post_init__(self) -> None:
        for name in (f.name for f in fields(self)):
            object.__setattr__(self, name, check_number(getattr(self, name), name, "Within", above=0.0))
        if math.isinf(min(self.outputs, self.poles, self.margins)):
            raise StructureError("Within: asks for nothing; give outputs, poles or margins a number, as outputs=0.01")

    @classmethod
    def of(cls, asked: float | Within, owner: str) -> Within:
        """Return what was asked for: a number is one of outputs, poles and margins alike.

        Parameters
        ----------
        asked : float or Within
        owner : str
            Who asks, for the message.

        Returns
        -------
        Within
        """
        if isinstance(asked, Within):
            return asked
        if isinstance(asked, bool) or not isinstance(asked, int | float):
            raise StructureError(
                f"{owner}: tolerance = {shortened(asked)}; expected a number > 0, as 0.01, or Within(outputs=0.01, …)"
            )
        number = check_finite(asked, "tolerance (relative, as 0.01)", owner, above=0.0)
        return cls(outputs=number, poles=number, margins=number)

    def __str__(self) -> str:
        asked = {f.name: getattr(self, f.name) for f in fields(self)}
        return ", ".join(f"{name} {100.0 * most:.3g} %" for name, most in asked.items() if math.isfinite(most))


@frozen
class Automatic(Effect):
    """Of the effects beside it, a run simulates only those that the scene's answer needs.

    It adds no physics of its own. `Scene.settled` draws up the ledger of the scene with all the effects named and
    keeps the smallest set that holds the answer within the tolerance. `Scene.run` and ``flexctrl run`` use it; a model
    that is given to `Scene.run`, and what is told of the linear machine (modes, Bode, root locus), is of the full set.

    Parameters
    ----------
    tolerance : float or Within
        Largest change of outputs, poles and margins alike, or of each.

    Raises
    ------
    StructureError
        For a tolerance that is not positive.
    """

    tolerance: float | Within = 0.01

    def __post_init__(self) -> None:
        Within.of(self.tolerance, "Automatic")

    @classmethod
    def within(cls, *, outputs: float = math.inf, poles: float = math.inf, margins: float = math.inf) -> Automatic:
        """Return the choice by tolerances of each; what is not named does not count.

        Parameters
        ----------
        outputs, poles, margins : float
            As of `Within`.

        Returns
        -------
        Automatic
        """
        return cls(Within(outputs=outputs, poles=poles, margins=margins))

    def parts(self) -> tuple[Effect, ...]:
        """Nothing that a model is made of."""
        return ()
