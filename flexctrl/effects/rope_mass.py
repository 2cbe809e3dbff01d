"""Ropes with mass of their own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from flexctrl.effects.effect import Effect
from flexctrl.errors import StructureError, did_you_mean
from flexctrl.frozen import frozen
from flexctrl.structure.elements import Part
from flexctrl.structure.freedoms import listed
from flexctrl.structure.lines import Rope
from flexctrl.structure.structure import Structure


@frozen
class RopeMass(Effect):
    """Ropes have their mass ρA, and as many elements as they are given: they sag, swing and carry waves.

    Without it a rope is one massless element. Each element has the mass matrix ρA ℓ₀/12 [[5, 1], [1, 5]], the mean
    of the lumped and the consistent one, but at either end of the rope ρA ℓ₀/24 [[8, 3], [3, 10]] (the one element of
    a rope is consistent). Frequencies of a taut rope held at both ends are then exact to fourth order in the
    element's length, those of one that hangs free, bears a load or vibrates along itself to third: 20 elements have the
    first mode of a rope that hangs free within 3e-6, the fifth within 5e-3. With `RopeStretch` the elements stretch,
    without it they are rigid links. In the model the elements of a rope are ropes of their own, ``rope0``, ``rope1`` …
    from its start; outputs name the rope as it is given. Its `Tension` is that of the first element, the support bears
    11/24 of that element's weight; where another is asked for, draw two ropes with a `Pin` between them, and measure
    the one that starts there.

    Parameters
    ----------
    of : sequence of str
        Names of the ropes that have mass; default: all that have ``rhoA``.

    Raises
    ------
    StructureError
        When the model is assembled, for a name that is no rope with mass.

    Examples
    --------
    >>> import flexctrl as fc
    >>> rope = fc.Rope("rope", (0, 0, 0), (0, 0, -10), EA=1e7, rhoA=2.0, elements=8)
    >>> chain = fc.Structure([rope], [fc.Support(rope.start)])
    >>> fc.assemble(chain, [fc.LargeRotation(), fc.Gravity(), fc.RopeMass(), fc.RopeStretch()]).n
    24
    """

    apart: ClassVar[bool] = True
    of: tuple[str, ...] = ()

    def __init__(self, of: Sequence[str] = ()) -> None:
        names = (of,) if isinstance(of, str) else listed(of, "RopeMass: of")
        if wrong := [n for n in names if not isinstance(n, str)]:
            raise StructureError(f"RopeMass: of holds {wrong[0]!r}; expected names of ropes")
        object.__setattr__(self, "of", tuple(names))

    def weighs(self, part: Part) -> bool:
        """Tell whether a part is a rope with a mass of its own.

        Parameters
        ----------
        part : Part or Drive

        Returns
        -------
        bool
        """
        return isinstance(part, Rope) and part.rhoA > 0.0 and (not self.of or part.name in self.of)

    def left_out(self, structure: Structure, beside: Sequence[Effect]) -> tuple[str, ...]:
        """Ropes that no mass is given of."""
        ropes = [p for p in structure.elements if isinstance(p, Rope) and not p.rhoA and not self.of]
        return tuple(
            f"mass of rope {p.name} is left out: it has none per length; give it Rope({p.name!r}, …, rhoA=…) in kg/m"
            for p in ropes
        )

    def check_on(self, structure: Structure) -> None:
        """Look for every rope."""
        known = [p.name for p in structure.elements if isinstance(p, Rope) and p.rhoA]
        for name in self.of:
            if name not in known:
                raise StructureError(
                    f"RopeMass: there is no rope {name!r} with rhoA, its mass per length{did_you_mean(name, known)}"
                )
