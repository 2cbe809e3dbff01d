"""What pulls along the line between its ends: ropes and springs."""

from __future__ import annotations

import math
from collections.abc import Sequence

from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import TRANSLATIONS, check_finite, check_name, check_whole
from flexctrl.structure.nodes import Node, check_length, position_of

__all__ = ["Rope", "RopePiece", "Spring"]


@frozen
class Rope:
    """A rope that pulls but does not push: tension (EA/ℓ₀)(ℓ − ℓ₀)₊; massless but for the effect `RopeMass`.

    Parameters
    ----------
    name : str
    start, end : sequence of 3 floats
        Ends at rest [m]; afterwards the end `Node` s, which have translations only.
    EA : float
        Axial stiffness [N], > 0.
    length : float, optional
        Unstretched length ℓ₀ [m]; default: the distance of the ends. Without `RopeStretch` these keep their distance
        as drawn, which may then not be shorter than ℓ₀.
    damping : float
        Axial damping [N s/m], ≥ 0, acting while the rope is taut.
    rhoA : float
        Mass per unstretched length [kg/m], ≥ 0.
    elements : int
        Number of elements where it has mass (`RopeMass`): 20 for 1e-4 of the first frequency and 1 % of the fifth.

    Raises
    ------
    StructureError
        For zero length or a value out of range.
    """

    name: str
    start: Node
    end: Node
    EA: float
    length: float
    damping: float
    rhoA: float
    elements: int

    def __init__(
        self,
        name: str,
        start: Node | Sequence[float],
        end: Node | Sequence[float],
        EA: float,
        length: float | None = None,
        damping: float = 0.0,
        rhoA: float = 0.0,
        elements: int = 1,
    ) -> None:
        owner = f"Rope {check_name(name, 'Rope')!r}"
        check_finite(EA, "EA", owner, above=0.0)
        _set_line(self, name, start, end, length, damping, owner)
        object.__setattr__(self, "EA", float(EA))
        object.__setattr__(self, "rhoA", check_finite(rhoA, "rhoA", owner, least=0.0))
        object.__setattr__(self, "elements", check_whole(elements, "elements", owner, least=1, most=10**6))

    @property
    def stiffness(self) -> float:
        """Axial stiffness EA/ℓ₀ [N/m]."""
        return self.EA / self.length

    @property
    def mass(self) -> float:
        """Its own mass ρA ℓ₀ [kg]."""
        return self.rhoA * self.length

    @property
    def nodes(self) -> tuple[Node, ...]:
        """Both ends."""
        return (self.start, self.end)


@frozen
class RopePiece(Rope):
    """One element of a rope that has several.

    Parameters
    ----------
    rope : Rope
        The whole, whose EA and mass per length it has.
    number : int
        Its place from the rope's start, from 0.
    start, end : sequence of 3 floats
        Its own ends at rest [m].
    """

    outer: tuple[bool, bool]
    """Whether its start is the rope's own, and its end."""

    def __init__(self, rope: Rope, number: int, start: Sequence[float], end: Sequence[float]) -> None:
        count = rope.elements
        length, damping = rope.length / count, rope.damping * count
        super().__init__(f"{rope.name}{number}", start, end, rope.EA, length, damping, rope.rhoA)
        object.__setattr__(self, "outer", (number == 0, number == count - 1))


@frozen
class Spring:
    """A massless straight spring with damper that pulls and pushes along its line: tension k (ℓ − ℓ₀) + d ℓ̇.

    Parameters
    ----------
    name : str
    start, end : sequence of 3 floats
        Ends at rest [m]; afterwards the end `Node` s, which have translations only.
    stiffness : float
        k [N/m], ≥ 0.
    length : float, optional
        Unstretched length ℓ₀ [m], > 0; default: the distance of the ends.
    damping : float
        d [N s/m], ≥ 0.

    Raises
    ------
    StructureError
        For zero length or a value out of range.
    """

    name: str
    start: Node
    end: Node
    stiffness: float
    length: float
    damping: float

    def __init__(
        self,
        name: str,
        start: Node | Sequence[float],
        end: Node | Sequence[float],
        stiffness: float,
        length: float | None = None,
        damping: float = 0.0,
    ) -> None:
        owner = f"Spring {check_name(name, 'Spring')!r}"
        check_finite(stiffness, "stiffness", owner, least=0.0)
        _set_line(self, name, start, end, length, damping, owner)
        object.__setattr__(self, "stiffness", float(stiffness))

    @property
    def nodes(self) -> tuple[Node, ...]:
        """Both ends."""
        return (self.start, self.end)


def _set_line(
    line: Rope | Spring,
    name: str,
    start: Node | Sequence[float],
    end: Node | Sequence[float],
    length: float | None,
    damping: float,
    owner: str,
) -> None:
    a, b = position_of(start, owner), position_of(end, owner)
    check_length(a, b, owner)
    rest = math.dist(a, b) if length is None else check_finite(length, "length", owner, above=0.0)
    check_finite(damping, "damping", owner, least=0.0)
    object.__setattr__(line, "name", name)
    object.__setattr__(line, "start", Node(name, 0, a, TRANSLATIONS))
    object.__setattr__(line, "end", Node(name, 1, b, TRANSLATIONS))
    object.__setattr__(line, "length", rest)
    object.__setattr__(line, "damping", float(damping))
