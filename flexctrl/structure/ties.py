"""From joints to ties: where each nodal freedom gets its value.

A freedom is *held*, *own* (a numbered degree of freedom), the *same as* another node's, or it
*follows* a master node in the master's axes (Jelenić & Crisfield's master–slave joints).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from flexctrl.errors import StructureError
from flexctrl.structure.freedoms import Vector
from flexctrl.structure.joints import Hinge, Joint, Slide, Support, main_axis
from flexctrl.structure.nodes import Node
from flexctrl.structure.relations import (
    Closure,
    Copy,
    Fit,
    Follow,
    Group,
    Ride,
    Ties,
    Track,
    Turn,
    fits,
    in_order,
    own_column,
    reads,
    writes,
)


def tie(nodes: Sequence[Node], joints: Sequence[Joint], groups: Sequence[Group], tracks: Sequence[Track] = ()) -> Ties:
    """Work out the ties of some nodes.

    Parameters
    ----------
    nodes : sequence of Node
    joints : sequence of Joint
    groups : sequence of Group
        Rigid parts.
    tracks : sequence of Track
        What travels along beams.

    Returns
    -------
    Ties

    Raises
    ------
    StructureError
        For rigid parts that follow each other in a circle.
    """
    return _Tying(nodes, joints, groups, tracks).result()


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

    def __init__(
        self, nodes: Sequence[Node], joints: Sequence[Joint], groups: Sequence[Group], tracks: Sequence[Track]
    ) -> None:
        self.nodes, self.groups, self.tracks = nodes, groups, tracks
        self.place = {(n.part, n.index): i for i, n in enumerate(nodes)}
        self.ground = 6 * len(nodes)
        self.same = _Classes(self.ground + 1)
        self.definer: dict[int, int] = {}
        self.definers: set[int] = set()
        self.anchored: set[int] = set()
        self.follows: list[Follow] = []
        self.closures: list[Closure | Fit] = []
        self.writers: dict[tuple[int, bool], Follow] = {}
        self.read: set[tuple[int, bool]] = set()
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
        tied = [j.nodes for j in joints if not isinstance(j, Support)]
        tied += [(self.nodes[t.node], self.nodes[n]) for t in self.tracks for n in t.rail]
        for a, b in ([self._unit(n) for n in pair] for pair in tied):
            links[a].add(b)
            links[b].add(a)
        depth: dict[int, int] = {}
        for most in sorted(set(held.values()), reverse=True):
            units = [u for u in links if held[u] == most]
            for start in [units] if most else [[u] for u in units]:
                level, step = {u for u in start if u not in depth}, 0
                while level:
                    depth.update(dict.fromkeys(level, step))
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
        left, before = list(enumerate(moving)), len(moving) + 1
        while len(left) < before:  # to and fro: a chain is settled from either end
            before, left = len(left), [(i, j) for i, j in reversed(left) if not self._settled(j)]
        return [joint for _, joint in sorted(left, key=lambda one: one[0])]

    def _settled(self, joint: Hinge | Slide) -> bool:
        """Turn a joint into plain rows if its axis cannot move; tell whether it is."""
        if not self._axis_fixed(joint):
            return False
        a, b = (6 * self.place[n.part, n.index] for n in joint.nodes)
        for f in range(3, 6) if isinstance(joint, Hinge) else range(3):
            if f in joint.shared:
                self.same.unite(a + f, b + f)
        return True

    def _axis_fixed(self, joint: Hinge | Slide) -> bool:
        axis = joint.axis if isinstance(joint, Hinge) else joint.along
        main = main_axis(axis)
        if abs(axis[main]) < 1.0 - 1e-12:
            return False
        across = {3, 4, 5} - ({3 + main} if isinstance(joint, Hinge) else set())
        return any(all(self.held(self.place[n.part, n.index], f) for f in across) for n in joint.nodes)

    def _ordered(self) -> list[Hinge | Slide | Group | Track]:
        def key(item: Hinge | Slide | Group | Track) -> tuple[int, int]:
            if isinstance(item, Group):
                return (self.depth[item.nodes[0]], 1)
            if isinstance(item, Track):
                return (self.depth[self._unit(self.nodes[item.node])], 0)
            return (max(self.depth[self._unit(n)] for n in item.nodes), 0)

        return sorted([*self.tracks, *self.moving, *self.groups], key=key)

    def result(self) -> Ties:
        for item in self._ordered():
            if isinstance(item, Group):
                self._group(item)
            elif isinstance(item, Track):
                self._track(item)
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

    def _track(self, track: Track) -> None:
        if self._hangs(track):
            name = self.nodes[track.node].part
            raise StructureError(f"Trolley {name!r}: its rail is carried by the trolley itself; make a part flexible")
        self._follow(track)

    def _follow(self, follow: Follow) -> None:
        """Let a node follow; if its place is told already, or the master's hangs on it, demand that it fits."""
        if writes(follow) in self.writers or self._hangs(follow):
            self.closures += fits(follow)
            return
        self.follows.append(follow)
        self.writers[writes(follow)] = follow
        self.read.update(reads(follow))
        self._define(follow.node, range(3, 6) if isinstance(follow, Turn) else range(3))

    def _hangs(self, follow: Follow) -> bool:
        """Tell whether what a follower reads hangs on what it writes."""
        if writes(follow) not in self.read and writes(follow) not in reads(follow) and follow.node not in self.definers:
            return False
        todo, seen = list(reads(follow)), set()
        while todo:
            value = todo.pop()
            if value == writes(follow):
                return True
            if value not in seen:
                seen.add(value)
                node, turns = value
                cells = (self.cell(node, f) for f in (range(3, 6) if turns else range(3)))
                todo += [(self.definer[c], turns) for c in cells if self.definer.get(c, node) != node]
                todo += reads(self.writers[value]) if value in self.writers else ()
        return False

    def _define(self, node: int, freedoms: range) -> None:
        for f in freedoms:
            cell = self.cell(node, f)
            if self.held(node, f):
                self.closures.append(Closure(node, f, self._turns_with(node) if f >= 3 else -1))
            elif cell in self.definer or cell in self.anchored:
                self.closures.append(Closure(node, f, self._first(node, f)))
            else:
                self.definer[cell] = node
                self.definers.add(node)

    def _first(self, node: int, f: int) -> int:
        """The node that says what a freedom does which another node shares."""
        cell = self.cell(node, f)
        return self.definer.get(
            cell, next((i for i in range(len(self.nodes)) if i != node and self.cell(i, f) == cell), -1)
        )

    def _turns_with(self, node: int) -> int:
        """The node that a node turns with in all ways; -1 for none.

        A held turn is held against it: of what else turns, the ground would be told the angle, and the hold the rate.
        """
        turns = [self.cell(node, f) for f in range(3, 6)]
        shared = [f for f in range(3, 6) if self.cell(node, f) in self.definer or self.cell(node, f) in self.anchored]
        firsts = [self._first(node, f) for f in shared if not self.held(node, f)]
        alike = (i for i in firsts if i not in (node, -1) and turns == [self.cell(i, f) for f in range(3, 6)])
        return next(alike, -1)

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
                    if f == own_column(follow):
                        free += 1
                        owns[writes(follow)] = free
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
        return Ties(tuple(cells), in_order(follows), tuple(self.closures), tuple(self.lines), free)

    def _numbered(self, follow: Follow, owns: dict[tuple[int, bool], int]) -> Follow:
        return follow if isinstance(follow, Copy | Track) else replace(follow, own=owns.get(writes(follow), 0))


__all__ = ["tie"]
