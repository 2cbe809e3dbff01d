"""From joints to ties: where each nodal freedom gets its value.

A freedom is *held*, *own* (a numbered degree of freedom), the *same as* another node's, or it
*follows* a master node in the master's axes (Jelenić & Crisfield's master–slave joints).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from flexctrl.errors import StructureError
from flexctrl.structure.elements import Node
from flexctrl.structure.freedoms import Vector
from flexctrl.structure.joints import Hinge, Joint, Slide, Support, main_axis


@dataclass(frozen=True)
class Group:
    """Nodes of one part that keep their distances; ``line`` if they have no rotations of their own."""

    part: str
    nodes: tuple[int, ...]
    line: bool = False


@dataclass(frozen=True)
class Ride:
    """x_node = x_master + R_master (arm + s·along): a point of a body, or a slide in its axes."""

    node: int
    master: int
    along: Vector | None = None
    own: int = 0


@dataclass(frozen=True)
class Turn:
    """R_node = R_master exp(φ·axis): a hinge whose axis rides with the master; ``own`` numbers ω_node·axis."""

    node: int
    master: int
    axis: Vector
    own: int = 0


@dataclass(frozen=True)
class Copy:
    """Freedom ``freedom`` (0…2; 3 stands for all rotations) of ``node`` is that of ``master``."""

    node: int
    freedom: int
    master: int


Follow: TypeAlias = Ride | Turn | Copy


@dataclass(frozen=True)
class Closure:
    """A freedom that a follower may not have: held (``other`` = -1) or equal to that of ``other``."""

    node: int
    freedom: int
    other: int


@dataclass(frozen=True)
class Fit:
    """A ride or turn of a node whose place is told already: one condition on where it is against the master.

    ``across``, carried by the master, keeps its product with the arm between the two (a ride or slide), or
    stays square to ``axis`` as the node carries it (a turn).
    """

    node: int
    master: int
    across: Vector
    axis: Vector | None = None


@dataclass(frozen=True)
class Ties:
    """Where each nodal freedom gets its value.

    Attributes
    ----------
    cells : tuple of 6-tuples
        Number of the degree of freedom (from 1), 0 for held, -1 for one that follows.
    follows : tuple of Ride, Turn or Copy
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


def tie(nodes: Sequence[Node], joints: Sequence[Joint], groups: Sequence[Group]) -> Ties:
    """Work out the ties of some nodes.

    Parameters
    ----------
    nodes : sequence of Node
    joints : sequence of Joint
    groups : sequence of Group
        Rigid parts.

    Returns
    -------
    Ties
    """
    return _Tying(nodes, joints, groups).result()


class _Classes:
    """Disjoint sets of integers."""

    def __init__(self, count: int) -> None:
        self._parent = list(range(count))

    def root(self, i: int) -> int:
        while self._parent[i] != i:
            self._parent[i] = self._parent[self._parent[i]]
            i = self._parent[i]
        return i

    def unite(self, a: int, b: int) -> None:
        self._parent[self.root(b)] = self.root(a)


class _Tying:
    """The work in progress of `tie`: classes of same cells, and who defines each class."""

    def __init__(self, nodes: Sequence[Node], joints: Sequence[Joint], groups: Sequence[Group]) -> None:
        self.nodes, self.groups = nodes, groups
        self.place = {(n.part, n.index): i for i, n in enumerate(nodes)}
        self.ground = 6 * len(nodes)
        self.same = _Classes(self.ground + 1)
        self.definer: dict[int, int] = {}
        self.anchored: set[int] = set()
        self.follows: list[Follow] = []
        self.closures: list[Closure | Fit] = []
        self.writers: dict[tuple[int, bool], Follow] = {}
        self.lines: list[tuple[int, Vector]] = []
        self.unit = {i: g.nodes[0] for g in groups for i in g.nodes}
        self.moving = self._unite(joints)
        self.depth = self._depths(joints)
        self.at_cell: dict[int, set[int]] = {}
        for i, node in enumerate(nodes):
            self.at_cell.setdefault(self.cell(i, 0), set()).add(self._unit(node))

    def cell(self, node: int, freedom: int) -> int:
        return self.same.root(6 * node + freedom)

    def held(self, node: int, freedom: int) -> bool:
        return self.cell(node, freedom) == self.same.root(self.ground)

    def _unit(self, node: Node) -> int:
        """What moves as one with a node: its rigid part, by that part's first node, or only the node itself."""
        place = self.place[node.part, node.index]
        return self.unit.get(place, place)

    def _depths(self, joints: Sequence[Joint]) -> dict[int, int]:
        """Steps, joint by joint, from where most is held; what does not reach that hangs on its own best held node."""
        links: dict[int, set[int]] = {self._unit(n): set() for n in self.nodes}
        held = dict.fromkeys(links, 0)
        for place, node in enumerate(self.nodes):
            held[self._unit(node)] = max(held[self._unit(node)], sum(self.held(place, f) for f in range(6)))
        for a, b in ([self._unit(n) for n in j.nodes] for j in joints if not isinstance(j, Support)):
            links[a].add(b)
            links[b].add(a)
        depth: dict[int, int] = {}
        while left := [u for u in links if u not in depth]:
            most = max(held[u] for u in left)
            level, step = {u for u in left if held[u] == most} if most else {left[0]}, 0
            while level:
                depth |= dict.fromkeys(level, step)
                level = {q for p in level for q in links[p] if q not in depth}
                step += 1
        return depth

    def _unite(self, joints: Sequence[Joint]) -> list[Hinge | Slide]:
        """Unite the cells that are plainly the same; return the joints that need a moving axis."""
        moving: list[Hinge | Slide] = []
        for joint in joints:
            cells = [6 * self.place[n.part, n.index] for n in joint.nodes]
            if isinstance(joint, Support):
                for f in joint.held:
                    self.same.unite(self.ground, cells[0] + f)
            elif isinstance(joint, Hinge | Slide):
                rest = range(3, 6) if isinstance(joint, Slide) else range(3)
                for f in rest:
                    self.same.unite(cells[0] + f, cells[1] + f)
                moving.append(joint)
            else:
                for f in joint.shared & joint.nodes[0].freedoms & joint.nodes[1].freedoms:
                    self.same.unite(cells[0] + f, cells[1] + f)
        for group in self.groups:
            for node in group.nodes[1:]:
                for f in () if group.line else range(3, 6):
                    self.same.unite(6 * group.nodes[0] + f, 6 * node + f)
        return self._settle(moving)

    def _settle(self, moving: list[Hinge | Slide]) -> list[Hinge | Slide]:
        """Turn joints whose axis cannot move into plain rows; one may settle the next."""
        while fixed := [j for j in moving if self._axis_fixed(j)]:
            for joint in fixed:
                a, b = (6 * self.place[n.part, n.index] for n in joint.nodes)
                kept = range(3, 6) if isinstance(joint, Hinge) else range(3)
                for f in kept:
                    if f in joint.shared:
                        self.same.unite(a + f, b + f)
            moving = [j for j in moving if j not in fixed]
        return moving

    def _axis_fixed(self, joint: Hinge | Slide) -> bool:
        axis = joint.axis if isinstance(joint, Hinge) else joint.along
        main = main_axis(axis)
        if abs(axis[main]) < 1.0 - 1e-12:
            return False
        across = {3, 4, 5} - ({3 + main} if isinstance(joint, Hinge) else set())
        return any(all(self.held(self.place[n.part, n.index], f) for f in across) for n in joint.nodes)

    def _ordered(self) -> list[Hinge | Slide | Group]:
        def key(item: Hinge | Slide | Group) -> tuple[int, int]:
            if isinstance(item, Group):
                return (self.depth[item.nodes[0]], 1)
            return (max(self.depth[self._unit(n)] for n in item.nodes), 0)

        return sorted([*self.moving, *self.groups], key=key)

    def result(self) -> Ties:
        for item in self._ordered():
            if isinstance(item, Group):
                self._group(item)
            else:
                self._axis(item)
        return self._number()

    def _group(self, group: Group) -> None:
        root = min(group.nodes, key=self._rank)
        if group.line:
            end = next(n for n in group.nodes if n != root)
            d = [b - a for a, b in zip(self.nodes[root].position, self.nodes[end].position, strict=True)]
            length = math.hypot(*d)
            self.lines.append((root, (d[0] / length, d[1] / length, d[2] / length)))
        for node in group.nodes:
            if node != root:
                self._follow(Ride(node, root))
        self.anchored |= {self.cell(root, f) for f in range(6)}

    def _rank(self, node: int) -> tuple[int, int]:
        """The best root is the node nearest to the ground: most of its place is already known."""
        mine = self._unit(self.nodes[node])
        towards = min((self.depth[u] for u in self.at_cell[self.cell(node, 0)] - {mine}), default=self.depth[mine] + 1)
        return (-self._known(node, range(3)), towards)

    def _known(self, node: int, freedoms: range) -> int:
        """How many of the freedoms are held or have a value already."""
        cells = [self.cell(node, f) for f in freedoms]
        return sum(c == self.same.root(self.ground) or c in self.anchored or c in self.definer for c in cells)

    def _axis(self, joint: Hinge | Slide) -> None:
        freedoms = range(3, 6) if isinstance(joint, Hinge) else range(3)

        def rank(n: Node) -> tuple[int, int]:
            return (-self._known(self.place[n.part, n.index], freedoms), self.depth[self._unit(n)])

        master, node = (self.place[n.part, n.index] for n in sorted(joint.nodes, key=rank))
        if all(self.cell(master, f) == self.cell(node, f) for f in freedoms):
            return
        if isinstance(joint, Hinge):
            self._follow(Turn(node, master, joint.axis))
        else:
            self._follow(Ride(node, master, along=joint.along))

    def _follow(self, follow: Follow) -> None:
        """Let a node follow; if its place is told already, or the master's hangs on it, demand that it fits."""
        if _write(follow) in self.writers or self._hangs(follow):
            self.closures += _fits(follow)
            return
        self.follows.append(follow)
        self.writers[_write(follow)] = follow
        self._define(follow.node, range(3, 6) if isinstance(follow, Turn) else range(3))

    def _hangs(self, follow: Follow) -> bool:
        """Tell whether what a follower reads hangs on what it writes."""
        todo, seen = list(_reads(follow)), set()
        while todo:
            value = todo.pop()
            if value == _write(follow):
                return True
            if value not in seen:
                seen.add(value)
                node, turns = value
                cells = (self.cell(node, f) for f in (range(3, 6) if turns else range(3)))
                todo += [(self.definer[c], turns) for c in cells if self.definer.get(c, node) != node]
                todo += _reads(self.writers[value]) if value in self.writers else ()
        return False

    def _define(self, node: int, freedoms: range) -> None:
        for f in freedoms:
            cell = self.cell(node, f)
            if self.held(node, f):
                self.closures.append(Closure(node, f, -1))
            elif cell in self.definer or cell in self.anchored:
                other = self.definer.get(cell, -2)
                if other == -2:
                    other = next(i for i in range(len(self.nodes)) if i != node and self.cell(i, f) == cell)
                self.closures.append(Closure(node, f, other))
            else:
                self.definer[cell] = node

    def _number(self) -> Ties:
        """Number the own freedoms in the order of the nodes; what a follower computes is marked -1."""
        computed = {(f.node, k): f for f in self.follows for k in (range(3, 6) if isinstance(f, Turn) else range(3))}
        lines = dict(self.lines)
        numbers = {self.same.root(self.ground): 0}
        owns: dict[tuple[int, bool], int] = {}
        free = 0
        cells, copies = [], []
        for i, node in enumerate(self.nodes):
            row = []
            for f in range(6):
                cell = self.cell(i, f)
                follow = computed.get((i, f))
                if follow is not None:
                    if f == _own_column(follow):
                        free += 1
                        owns[_write(follow)] = free
                    row.append(-1)
                elif cell in self.definer:
                    copies.append(Copy(i, min(f, 3), self.definer[cell]))
                    row.append(-1)
                elif cell in numbers:
                    row.append(numbers[cell])
                elif f not in node.freedoms and i not in lines:
                    row.append(0)
                elif i in lines and f == 3 + main_axis(lines[i]):
                    row.append(numbers.setdefault(cell, 0))
                else:
                    free += 1
                    row.append(numbers.setdefault(cell, free))
            cells.append(tuple(row))
        follows = [self._numbered(f, owns) for f in self.follows] + list(dict.fromkeys(copies))
        return Ties(tuple(cells), _sorted(follows), tuple(self.closures), tuple(self.lines), free)

    def _numbered(self, follow: Follow, owns: dict[tuple[int, bool], int]) -> Follow:
        return follow if isinstance(follow, Copy) else replace(follow, own=owns.get(_write(follow), 0))


def _fits(follow: Follow) -> list[Fit]:
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


def _own_column(follow: Follow) -> int:
    if isinstance(follow, Turn):
        return 3 + main_axis(follow.axis)
    return main_axis(follow.along) if isinstance(follow, Ride) and follow.along else -1


def _write(follow: Follow) -> tuple[int, bool]:
    return (follow.node, isinstance(follow, Turn) or (isinstance(follow, Copy) and follow.freedom == 3))


def _reads(follow: Follow) -> tuple[tuple[int, bool], ...]:
    if isinstance(follow, Ride):
        return ((follow.master, False), (follow.master, True))
    return ((follow.master, isinstance(follow, Turn) or follow.freedom == 3),)


def _sorted(follows: Sequence[Follow]) -> tuple[Follow, ...]:
    """Order the followers so that every master is known before its follower."""
    left, done = list(follows), []
    while left:
        waiting = {_write(f) for f in left}
        ready = [f for f in left if waiting.isdisjoint(_reads(f))]
        if not ready:
            raise StructureError("rigid parts follow each other in a circle; make one of them flexible")
        done += ready
        left = [f for f in left if not waiting.isdisjoint(_reads(f))]
    return tuple(done)


__all__ = ["Closure", "Copy", "Fit", "Follow", "Group", "Ride", "Ties", "Turn", "tie"]
