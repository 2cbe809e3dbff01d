"""The parts of a machine. Every part has nodes of its own; the join table ties them together."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from flexctrl.errors import StructureError, did_you_mean, shortened
from flexctrl.structure.freedoms import (
    ALL,
    HUGE,
    TRANSLATIONS,
    Vector,
    check_finite,
    check_name,
    check_whole,
    numbers,
    parse_direction,
    parse_point,
)
from flexctrl.structure.sections import Section


@dataclass(frozen=True)
class Node:
    """A node of one part.

    Attributes
    ----------
    part : str
        Name of the part that owns the node.
    index : int
        Its place in the part, from 0.
    position : tuple of float
        (x, y, z) at rest [m].
    freedoms : frozenset of int
        The freedoms it has: all six (0…5), or translations only (0…2) for ropes, springs and points.
    """

    part: str
    index: int
    position: Vector
    freedoms: frozenset[int] = ALL

    def __str__(self) -> str:
        return f"node {self.index} of {self.part}"


def check_node(node: Node, owner: str) -> Node:
    """Return ``node`` if it is one."""
    if not isinstance(node, Node):
        raise StructureError(
            f"{owner}: {shortened(node)} is no node; give e.g. beam.start, beam.node(2) or body.point('hook')"
        )
    return node


def _position(at: Node | Sequence[float], owner: str) -> Vector:
    return at.position if isinstance(at, Node) else parse_point(at, owner)


@dataclass(frozen=True)
class Beam:
    """A straight elastic beam of one or several elements, with inner nodes shared between them.

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
        a, b = _position(start, owner), _position(end, owner)
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


@dataclass(frozen=True)
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
        Unstretched length ℓ₀ [m]; default: the distance of the ends.
    damping : float
        Axial damping [N s/m], ≥ 0, acting while the rope is taut.
    rhoA : float
        Mass per unstretched length [kg/m], ≥ 0.
    elements : int
        Number of elements where it has mass.

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


@dataclass(frozen=True)
class Spring:
    """A massless straight spring with damper that pulls and pushes along its line.

    Parameters
    ----------
    name : str
    start, end : sequence of 3 floats
        Ends at rest [m]; afterwards the end `Node` s, which have translations only.
    stiffness : float
        [N/m], ≥ 0.
    length : float, optional
        Unstretched length [m]; default: the distance of the ends.
    damping : float
        [N s/m], ≥ 0.

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


def check_length(a: Vector, b: Vector, owner: str) -> None:
    """Raise StructureError for ends that coincide."""
    if math.dist(a, b) <= 1e-12 * (1.0 + max(map(abs, (*a, *b)))):
        raise StructureError(f"{owner}: start {a} and end {b} coincide; a part needs a length > 0")


def _set_line(
    line: Rope | Spring,
    name: str,
    start: Node | Sequence[float],
    end: Node | Sequence[float],
    length: float | None,
    damping: float,
    owner: str,
) -> None:
    a, b = _position(start, owner), _position(end, owner)
    check_length(a, b, owner)
    rest = math.dist(a, b) if length is None else check_finite(length, "length", owner, above=0.0)
    check_finite(damping, "damping", owner, least=0.0)
    object.__setattr__(line, "name", name)
    object.__setattr__(line, "start", Node(name, 0, a, TRANSLATIONS))
    object.__setattr__(line, "end", Node(name, 1, b, TRANSLATIONS))
    object.__setattr__(line, "length", rest)
    object.__setattr__(line, "damping", float(damping))


@dataclass(frozen=True)
class PointMass:
    """A mass without size: one node with translations only.

    Parameters
    ----------
    name : str
    at : sequence of 3 floats or Node
        Position at rest [m].
    mass : float
        [kg], ≥ 0.

    Raises
    ------
    StructureError
        For a negative or undefined mass.
    """

    name: str
    at: Vector
    mass: float

    def __init__(self, name: str, at: Node | Sequence[float], mass: float) -> None:
        owner = f"PointMass {check_name(name, 'PointMass')!r}"
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "at", _position(at, owner))
        object.__setattr__(self, "mass", check_finite(mass, "mass", owner, least=0.0))

    @property
    def node(self) -> Node:
        """The mass's only node."""
        return Node(self.name, 0, self.at, TRANSLATIONS)

    @property
    def nodes(self) -> tuple[Node, ...]:
        """The only node, as for every part."""
        return (self.node,)


@dataclass(frozen=True)
class RigidBody:
    """A body that does not bend: its first node is the centre of mass, the others ride on it.

    Parameters
    ----------
    name : str
    at : sequence of 3 floats or Node
        Centre of mass at rest [m].
    mass : float
        [kg], ≥ 0.
    inertia : sequence of 3 floats or 3 × 3 array
        Moments of inertia about the centre of mass in global axes at rest [kg m²]; three numbers
        are the diagonal. Symmetric, positive semidefinite, and no moment larger than the sum of
        the other two.
    points : mapping of str to 3 floats, optional
        Named points of the body at rest [m], reached by ``body.point(name)``.

    Raises
    ------
    StructureError
        For an inertia no body can have, or a bad name or number.
    """

    name: str
    at: Vector
    mass: float
    inertia: tuple[Vector, Vector, Vector]
    points: Mapping[str, Vector] = field(default_factory=dict)

    def __init__(
        self,
        name: str,
        at: Node | Sequence[float],
        mass: float,
        inertia: Sequence[float] | Sequence[Sequence[float]] | np.ndarray,
        points: Mapping[str, Sequence[float]] | None = None,
    ) -> None:
        owner = f"RigidBody {check_name(name, 'RigidBody')!r}"
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "at", _position(at, owner))
        object.__setattr__(self, "mass", check_finite(mass, "mass", owner, least=0.0))
        object.__setattr__(self, "inertia", _check_inertia(inertia, owner))
        if not isinstance(points, Mapping | None):
            raise StructureError(
                f"{owner}: points = {shortened(points)}; expected a mapping of names to places (x, y, z)"
            )
        named = {check_name(k, f"{owner}, point"): parse_point(p, owner) for k, p in (points or {}).items()}
        object.__setattr__(self, "points", named)

    @property
    def node(self) -> Node:
        """The centre of mass."""
        return Node(self.name, 0, self.at)

    @property
    def nodes(self) -> tuple[Node, ...]:
        """The centre of mass, then the named points in order."""
        return (self.node, *(self.point(name) for name in self.points))

    def point(self, name: str) -> Node:
        """Return the node at a named point.

        Parameters
        ----------
        name : str

        Returns
        -------
        Node

        Raises
        ------
        StructureError
            If the body has no point of that name.
        """
        if not isinstance(name, str) or name not in self.points:
            raise StructureError(f"RigidBody {self.name!r} has no point {name!r}{did_you_mean(name, self.points)}")
        return Node(self.name, 1 + list(self.points).index(name), self.points[name])


def _check_inertia(inertia: object, owner: str) -> tuple[Vector, Vector, Vector]:
    flat = numbers(inertia)
    rows = [numbers(row) for row in inertia] if flat else []  # type: ignore[attr-defined]
    full = np.array(rows) if [len(row) for row in rows] == [3, 3, 3] else np.full((3, 3), np.nan)
    tensor = np.diag(flat) if len(flat) == 3 and np.isfinite(flat).all() else full
    if not np.abs(tensor - tensor.T).max() <= 1e-9 * np.abs(tensor).max() < HUGE:
        raise StructureError(
            f"{owner}: inertia = {shortened(inertia)}; expected 3 moments or a symmetric 3 × 3 tensor [kg m²]"
        )
    moments = np.linalg.eigvalsh(tensor)
    if moments[0] < -1e-9 * abs(moments[2]) or moments[2] > (moments[0] + moments[1]) * (1 + 1e-9):
        raise StructureError(
            f"{owner}: principal moments {moments.tolist()} kg m² belong to no body: none may be negative "
            "or larger than the sum of the other two"
        )
    a, b, c = tensor.tolist()
    return (tuple(a), tuple(b), tuple(c))


Part: TypeAlias = Beam | Rope | Spring | PointMass | RigidBody
"""Any part of a structure; each has ``name`` and ``nodes``."""

__all__ = ["Beam", "Node", "Part", "PointMass", "RigidBody", "Rope", "Spring"]
