"""Beams: straight, elastic, of one or several elements."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from flexctrl.errors import StructureError, shortened
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import Vector, check_name, check_whole, parse_direction
from flexctrl.structure.nodes import Node, check_length, position_of
from flexctrl.structure.sections import Section

__all__ = ["Beam"]


@frozen
class Beam:
    """A straight elastic beam of one or several elements, with inner nodes shared between them.

    Each element has the textbook stiffness and consistent mass matrix of a Euler–Bernoulli beam (Timoshenko where its
    section shears) in a frame that rides along with it (Crisfield, Galvanetto & Jelenić 1997): strains are small,
    motions as large as they like.

    Parameters
    ----------
    name : str
    start, end : sequence of 3 floats
        Ends at rest [m]. After construction ``beam.start`` and ``beam.end`` are the end `Node` s.
    section : Section
    elements : int
        Number of elements; the beam has ``elements + 1`` nodes.
    up : str or sequence of 3 floats, optional
        The beam's local z axis is the part of this direction across the beam. Default: global z,
        or global x for a beam along z. Local y completes the right-handed axes.

    Raises
    ------
    StructureError
        For zero length, a bad name or count, or ``up`` along the beam.

    Examples
    --------
    >>> import flexctrl as fc
    >>> wire = fc.Section(EA=1e5, EI_y=10, EI_z=10, GJ=8, rhoA=1, rhoJ=1e-4)
    >>> fc.Beam("girder", start=(0, -3, 0), end=(0, 3, 0), section=wire, elements=6).node(3).position
    (0.0, 0.0, 0.0)
    """

    name: str
    start: Node
    end: Node
    section: Section
    elements: int = 1
    up: Vector | None = None

    def __init__(
        self,
        name: str,
        start: Node | Sequence[float],
        end: Node | Sequence[float],
        section: Section,
        elements: int = 1,
        up: str | Sequence[float] | None = None,
    ) -> None:
        owner = f"Beam {check_name(name, 'Beam')!r}"
        if not isinstance(section, Section):
            raise StructureError(f"{owner}: section = {shortened(section)}; expected a flexctrl.Section")
        count = check_whole(elements, "elements", owner, least=1, most=10**6)
        a, b = position_of(start, owner), position_of(end, owner)
        check_length(a, b, owner)
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "section", section)
        object.__setattr__(self, "elements", count)
        object.__setattr__(self, "up", None if up is None else parse_direction(up, owner))
        object.__setattr__(self, "start", Node(name, 0, a))
        object.__setattr__(self, "end", Node(name, count, b))
        if np.linalg.norm(np.cross(self._axis, self._up)) < 1e-6:
            raise StructureError(f"{owner}: up = {up!r} points along the beam; choose a direction across it")

    @property
    def _axis(self) -> np.ndarray:
        return np.subtract(self.end.position, self.start.position) / self.length

    @property
    def _up(self) -> np.ndarray:
        if self.up is not None:
            return np.array(self.up)
        return np.array([1.0, 0.0, 0.0]) if abs(self._axis[2]) > 1.0 - 1e-6 else np.array([0.0, 0.0, 1.0])

    @property
    def axes(self) -> np.ndarray:
        """Local axes at rest, shape (3, 3): columns are the local x, y, z in global axes."""
        x = self._axis
        y = np.cross(self._up, x)
        y /= np.linalg.norm(y)
        return np.column_stack([x, y, np.cross(x, y)])

    @property
    def length(self) -> float:
        """Length at rest [m]."""
        return math.dist(self.start.position, self.end.position)

    @property
    def nodes(self) -> tuple[Node, ...]:
        """All nodes from start to end."""
        return tuple(self.node(i) for i in range(self.elements + 1))

    def node(self, index: int) -> Node:
        """Return the node ``index`` counted from the start (0), or from the end if negative.

        Parameters
        ----------
        index : int

        Returns
        -------
        Node

        Raises
        ------
        StructureError
            If the beam has no such node.
        """
        count = self.elements + 1
        if isinstance(index, bool) or not isinstance(index, (int, np.integer)) or not -count <= index < count:
            raise StructureError(f"Beam {self.name!r} has nodes 0…{count - 1}; there is no node {index!r}")
        index = int(index) % count
        if index in (0, self.elements):
            return self.start if index == 0 else self.end
        a, b = np.array(self.start.position), np.array(self.end.position)
        x, y, z = (a + (b - a) * (index / self.elements)).tolist()
        return Node(self.name, index, (x, y, z))
