"""What the nodes of a machine may be to each other: followers, and conditions that close loops of rigid parts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import Vector
from flexctrl.structure.joints import main_axis


@frozen
class Group:
    """Nodes of one part that keep their distances; ``line`` if they have no rotations of their own."""

    part: str
    nodes: tuple[int, ...]
    line: bool = False


@frozen
class Ride:
    """x_node = x_master + R_master (arm + s·along): a point of a body, or a slide in its axes."""

    node: int
    master: int
    along: Vector | None = None
    own: int = 0


@frozen
class Turn:
    """R_node = R_master exp(φ·axis): a hinge whose axis rides with the master; ``own`` numbers ω_node·axis."""

    node: int
    master: int
    axis: Vector
    own: int = 0


@frozen
class Copy:
    """Freedom ``freedom`` (0…2; 3 stands for all rotations) of ``node`` is that of ``master``."""

    node: int
    freedom: int
    master: int


@frozen
class Track:
    """x_node = r(s): a point of the bent axis of a rail, with s the place x of the node ``gauge``.

    ``rail`` are the rail's nodes in order, ``places`` their s; ``along`` is the axis of their sections at rest, and
    ``start`` the s at rest.
    """

    node: int
    gauge: int
    rail: tuple[int, ...]
    places: tuple[float, ...]
    along: Vector
    start: float

    @property
    def master(self) -> int:
        """The rail's node before it at rest."""
        return self.rail[max(sum(place <= self.start for place in self.places[:-1]) - 1, 0)]


Follow: TypeAlias = Ride | Turn | Copy | Track


@frozen
class Closure:
    """A freedom that a follower may not have: held (``other`` = -1) or equal to that of ``other``."""

    node: int
    freedom: int
    other: int


@frozen
class Fit:
    """A ride or turn of a node whose place is told already: one condition on where it is against the master.

    ``across``, carried by the master, keeps its product with the arm between the two (a ride or slide), or
    stays square to ``axis`` as the node carries it (a turn).
    """

    node: int
    master: int
    across: Vector
    axis: Vector | None = None


@frozen
class Ties:
    """Where each nodal freedom gets its value.

    Attributes
    ----------
    cells : tuple of 6-tuples
        Number of the degree of freedom (from 1), 0 for held, -1 for one that follows.
    follows : tuple of Ride, Turn, Copy or Track
        In an order in which they can be evaluated.
    closures : tuple of Closure or Fit
        Conditions on followers that close a loop of rigid parts.
    lines : tuple of (int, Vector)
        Nodes whose rotation is the direction of a line: turned about body axes across it only.
    free : int
    """

    cells: tuple[tuple[int, ...], ...]
    follows: tuple[Follow, ...]
    closures: tuple[Closure | Fit, ...]
    lines: tuple[tuple[int, Vector], ...]
    free: int


def fits(follow: Follow) -> list[Fit]:
    """Return what a follower's place must meet where it is told already."""
    axis = follow.axis if isinstance(follow, Turn) else follow.along if isinstance(follow, Ride) else None
    unit: list[Vector] = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    if axis is None:
        return [Fit(follow.node, follow.master, e) for e in unit]
    first = _square(axis, unit[(main_axis(axis) + 1) % 3])
    both = (first, _square(axis, first))
    return [Fit(follow.node, follow.master, e, axis if isinstance(follow, Turn) else None) for e in both]


def _square(a: Vector, b: Vector) -> Vector:
    """Return the direction of a × b."""
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    size = math.hypot(x, y, z)
    return (x / size, y / size, z / size)


def own_column(follow: Follow) -> int:
    """Return the join table's column of a follower's own freedom, −1 if it has none."""
    if isinstance(follow, Turn):
        return 3 + main_axis(follow.axis)
    return main_axis(follow.along) if isinstance(follow, Ride) and follow.along else -1


def writes(follow: Follow) -> tuple[int, bool]:
    """Return the node a follower places, and whether it is its rotation."""
    return (follow.node, isinstance(follow, Turn) or (isinstance(follow, Copy) and follow.freedom == 3))


def reads(follow: Follow) -> tuple[tuple[int, bool], ...]:
    """Return what a follower needs of its master: position, rotation or both."""
    if isinstance(follow, Track):
        return ((follow.gauge, False), *((node, turns) for node in follow.rail for turns in (False, True)))
    if isinstance(follow, Ride):
        return ((follow.master, False), (follow.master, True))
    return ((follow.master, isinstance(follow, Turn) or follow.freedom == 3),)


def in_order(follows: Sequence[Follow]) -> tuple[Follow, ...]:
    """Order the followers so that every master is known before its follower."""
    waiting, behind = dependencies(follows)
    level, done = [i for i, count in enumerate(waiting) if not count], []
    while level:
        done += level
        later = []
        for j in (j for i in level for j in behind.get(i, ())):
            waiting[j] -= 1
            later += [] if waiting[j] else [j]
        level = sorted(later)
    if len(done) < len(follows):
        raise StructureError("rigid parts follow each other in a circle; make one of them flexible")
    return tuple(follows[i] for i in done)


def dependencies(follows: Sequence[Follow]) -> tuple[list[int], dict[int, list[int]]]:
    """Return how many others each follower waits for, and who waits for each, by their places in the sequence."""
    writers: dict[tuple[int, bool], list[int]] = {}
    for i, f in enumerate(follows):
        writers.setdefault(writes(f), []).append(i)
    before = [{j for value in reads(f) for j in writers.get(value, ())} for f in follows]
    behind: dict[int, list[int]] = {}
    for i, some in enumerate(before):
        for j in some:
            behind.setdefault(j, []).append(i)
    return [len(some) for some in before], behind
