"""Slopes of machines with long linkages, unfolded: what levers say are unknowns of their own.

In the degrees of freedom alone the slope of a chain of rigid links is full. Written with the motion of each follower
and the force that it hands on to its masters beside them, it has as many entries as there are links, and as it is
eliminated from the followers to their masters, no more are added than a tree has: that is the recursion of articulated
bodies (Featherstone 1983) as an order of elimination.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from flexctrl.frozen import frozen
from flexctrl.kernels.kernel import Kernel, Run
from flexctrl.model.laws.kinds import NODE_SLOT
from flexctrl.model.linkages.levers import Group, Levers, Places, at_once
from flexctrl.model.state import State

if TYPE_CHECKING:
    from flexctrl.model.laws.families import Family
    from flexctrl.model.motion import Motion

__all__ = ["LEVELS", "Share", "Unfolded"]

LEVELS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""Seeds of what changes with places, with rates and with accelerations alone."""
_BLOCK = 256


@frozen(eq=False)
class Share:
    """What levers of one kind add to the slope.

    Attributes
    ----------
    group : Group
    rows, columns : numpy.ndarray of int, shape (levers, entries)
        Unknowns; −1 for entries left out.
    leads : numpy.ndarray of int, shape (levers, columns)
        With which of the seeds each column comes; −1 for those that are unknowns of their own.
    """

    group: Group
    rows: np.ndarray
    columns: np.ndarray
    leads: np.ndarray

    def gather(self, at: Places, seeds: np.ndarray, one: int) -> np.ndarray:
        """Return where a workspace holds what the slopes read; it has seeds and a one."""
        g = self.group
        force = at.force[g.said]
        poses, motions = at.poses(g), [at.motions(g, offset) for offset in (12, 18)]
        return np.hstack([poses, *motions, at.v[g.owns], at.a[g.owns], force, np.append(seeds, one)[self.leads]])

    def bound(self, backend: object, gather: np.ndarray, places: np.ndarray) -> list[Run]:
        """Return the runs that add the entries up in some places, as many as there are writes."""
        work = self.group.kind.sloping
        scatter = np.zeros((len(gather), self.group.kind.rows * self.group.kind.columns), dtype=int)
        scatter[:, work.writes] = places
        return at_once(backend, work, gather, self.group.parameters, scatter)  # type: ignore[arg-type]


class Unfolded:
    """The unknowns and entries of an unfolded slope.

    The degrees of freedom come first, then, of every raw freedom that a lever says, its place, rate and acceleration
    as far as forces hang on them, and less the force that is handed on from it.
    """

    def __init__(self, motion: Motion, families: Sequence[Family]) -> None:
        assert isinstance(motion.linkage, Levers)
        self.motion, self.families, self.levers = motion, families, motion.linkage
        self.own = motion.owned

    @cached_property
    def _local(self) -> np.ndarray:
        """Degree of freedom of each raw freedom of the linkage, −1 for none."""
        own = self.own[self.motion.linked_cells]
        return np.where(own < self.motion.n, own, -1)

    @cached_property
    def _free(self) -> np.ndarray:
        """Degree of freedom of each independent freedom of the linkage, −1 for none."""
        return np.append(self.motion.linked, -1)

    @cached_property
    def _needed(self) -> np.ndarray:
        """Whether forces hang on place, rate and acceleration of what levers say, shape (3, raw of the linkage)."""
        needed = np.zeros((3, self.motion.raw), dtype=bool)
        source = self.motion.source_base
        for f in self.families:
            cells = f.scatter(source)
            for level, columns in enumerate(_read(f)):
                needed[level, cells[:, columns]] = True
        needed = np.asarray(needed[:, self.motion.linked_cells] & self.levers.said)
        for group in reversed(self.levers.groups):
            kind, structure = group.kind, _structure(group)
            raw = [6 * group.nodes[:, i, None] + np.arange(6) for i in range(kind.nodes)]
            nodes = np.hstack(raw)
            forces = np.flatnonzero(structure[3 * kind.count :, : nodes.shape[1]].any(axis=0))
            for k in range(len(nodes) - 1, -1, -1):
                needed[0, nodes[k, forces]] = True
                for row in (2, 1, 0):
                    if needed[row, group.said[k]].any():
                        reads = np.asarray(structure[row * kind.count : (row + 1) * kind.count].any(axis=0))
                        for level in range(3):
                            own = reads[level * nodes.shape[1] : (level + 1) * nodes.shape[1]]
                            needed[level, nodes[k, own]] = True
        return needed & self.levers.said

    @cached_property
    def numbers(self) -> np.ndarray:
        """Unknowns of what levers say, −1 for none: place, rate, acceleration, force; shape (4, raw of the linkage)."""
        wanted = np.vstack([self._needed, self.levers.said])
        found = np.full(wanted.shape, -1)
        # those of a raw freedom one after the other
        found.T[wanted.T] = self.motion.n + np.arange(int(wanted.sum()))
        return found

    @cached_property
    def size(self) -> int:
        """Number of unknowns."""
        return max(int(self.numbers.max(initial=-1)) + 1, self.motion.n)

    @cached_property
    def balance(self) -> np.ndarray:
        """Equation in which each raw force stands, −1 for none."""
        found = np.where(self.own < self.motion.n, self.own, -1)
        cells = self.motion.linked_cells
        found[cells] = np.where(self.levers.said, self.numbers[3], found[cells])
        return found

    @cached_property
    def column(self) -> np.ndarray:
        """Unknowns that raw freedoms are, −1 for none, shape (4, raw): own ones; what levers say, by levels."""
        found = np.full((4, self.motion.raw), -1)
        found[0] = np.where(self.own < self.motion.n, self.own, -1)
        found[1:, self.motion.linked_cells] = self.numbers[:3]
        return found

    def pieces(self, rows: np.ndarray, columns: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        """Return rows and columns of the tangents of pieces, −1 where left out, from their raw ones.

        First those with the seeds of the slope, then those of what changes with the places, rates and accelerations of
        what levers say.
        """
        r = self.balance[rows]
        return tuple((r, np.where(r >= 0, c[columns], -1)) for c in self.column)

    @cached_property
    def shares(self) -> tuple[Share, ...]:
        """What levers add."""
        return tuple(self._share(group) for group in self.levers.groups)

    def _share(self, group: Group) -> Share:
        kind = group.kind
        nodes = np.hstack([6 * group.nodes[:, i, None] + np.arange(6) for i in range(kind.nodes)])
        own, frees = self._local[nodes], self._free[group.owns]
        levels = [np.where(own >= 0, own, self.numbers[level][nodes]) for level in range(3)]
        columns = np.hstack([*levels, frees, frees, frees, self.numbers[3][group.said]])
        forces = np.where(own >= 0, own, self.numbers[3][nodes])
        rows = np.hstack([*(self.numbers[level][group.said] for level in range(3)), forces, frees])
        which = kind.sloping.writes
        r, c = rows[:, which % kind.rows], columns[:, which // kind.rows]
        left_out = (r < 0) | (c < 0)
        led = [np.where(own >= 0, level, -1) for level in range(3)]
        ways = [np.full(frees.shape, level) for level in range(3)]
        return Share(group, np.where(left_out, -1, r), np.where(left_out, -1, c), np.hstack([*led, *ways]))

    @cached_property
    def pattern(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of all entries but those of pieces: of levers, and ones on the diagonal."""
        said = np.arange(self.motion.n, self.size)
        rows = np.concatenate([*(s.rows.ravel() for s in self.shares), said])
        columns = np.concatenate([*(s.columns.ravel() for s in self.shares), said])
        return rows, columns

    @cached_property
    def _together(self) -> sp.csr_matrix:
        """Which unknowns are of one node's displacements or turns, at one level, shape (unknowns, blocks).

        What has an entry with one of them is treated as if it had with all: they are eliminated together.
        """
        first, motion = np.arange(self.size), self.motion
        nodes = motion.owned[: motion.source_base].reshape(-1, 3)
        for row in nodes[(nodes < motion.n).any(axis=1)][::-1]:
            own = row[row < motion.n]
            first[own] = own.min()
        numbers = self.numbers[:, : 6 * len(motion.nodes)].reshape(4, -1, 3)
        for row in numbers[(numbers >= 0).any(axis=2)]:
            said = row[row >= 0]
            first[said] = said.min()
        return sp.csr_matrix((np.ones(self.size), (np.arange(self.size), first)), shape=(self.size, self.size))

    def filled(self, rows: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return pairs of unknowns with all others of their blocks."""
        size, blocks = self.size, self._together
        pairs = sp.csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(size, size))
        found = (blocks @ (blocks.T @ pairs @ blocks) @ blocks.T).tocoo()
        return found.row, found.col

    @cached_property
    def after(self) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of unknowns of which the first is eliminated after the second: masters after their followers."""
        n, size = self.motion.n, self.size
        force = np.zeros(size, dtype=bool)
        force[self.numbers[3][self.numbers[3] >= 0]] = True
        says = np.zeros(size, dtype=bool)
        says[n:] = ~force[n:]
        rows, columns = self.pattern
        kept = (rows >= 0) & (rows != columns)
        rows, columns = rows[kept], columns[kept]
        reads, hands = says[rows], ~says[rows] & force[columns]
        return self.filled(np.append(columns[reads], rows[hands]), np.append(rows[reads], columns[hands]))

    def stiffening(self, state: State, raw: np.ndarray) -> sp.csr_matrix:
        """Return ∂(Tᵀ F)/∂(own motion) under constant raw forces F, shape (n, n): the levers turn."""
        still = np.zeros(self.motion.n)
        seeds = LEVELS[0]
        return self._folded(*self._led(_slots(self.motion, state, still, still), still, still, seeds, raw))

    def slope(
        self,
        z: np.ndarray,
        v: np.ndarray,
        a: np.ndarray,
        seeds: tuple[float, float, float],
        raw: np.ndarray,
        blocks: Sequence[np.ndarray],
        cells: tuple[np.ndarray, np.ndarray],
    ) -> sp.csr_matrix:
        """Return the slope of the forces in the degrees of freedom, shape (n, n).

        Parameters
        ----------
        z : numpy.ndarray
            Slots of nodes and drives.
        v, a : numpy.ndarray, shape (n,)
        seeds : tuple of 3 floats
        raw : numpy.ndarray, shape (raw,)
            Forces that act.
        blocks : sequence of 4 numpy.ndarray
            Tangents of all pieces with these seeds, and with those of `LEVELS`.
        cells : tuple of numpy.ndarray
            Their raw rows and columns.
        """
        rows, columns, values = self._led(z, v, a, seeds, raw)
        found = self.pieces(*cells)
        return self._folded(
            np.concatenate([rows, *(r for r, _ in found)]),
            np.concatenate([columns, *(c for _, c in found)]),
            np.concatenate([values, *blocks]),
        )

    def _led(
        self, z: np.ndarray, v: np.ndarray, a: np.ndarray, seeds: tuple[float, float, float], raw: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the entries of levers and of the diagonal: rows, columns, values."""
        at, runs, size = self._work
        levers, motion = self.levers, self.motion
        pose = z[: NODE_SLOT * len(motion.place)].reshape(-1, NODE_SLOT)[motion.nodes, :12]
        carried = levers.carried(pose, raw[motion.linked_cells])
        tail = [[*seeds, 1.0], v[motion.linked], [0.0], a[motion.linked], [0.0], carried]
        workspace = np.concatenate([z[: at.v[0] - 4], *tail])
        values = np.zeros(size)
        for run in runs:
            run(workspace, values)
        values[-(self.size - motion.n) :] = 1.0
        return (*self.pattern, values)

    @cached_property
    def _work(self) -> tuple[Places, list[Run], int]:
        """The levers' slopes bound to slots of all nodes and what follows them, one entry after the other."""
        motion, levers = self.motion, self.levers
        base = NODE_SLOT * len(motion.place)
        slots, free = NODE_SLOT * motion.nodes, np.arange(levers.free + 1)
        v, a = base + 4 + free, base + 5 + levers.free + free
        force = base + 6 + 2 * levers.free + np.arange(levers.raw)
        none = np.zeros(0, dtype=int)
        at = Places(slots, none, none, v, a, none, none, force, none)
        runs, start = [], 0
        for share in self.shares:
            places = start + np.arange(share.rows.size).reshape(share.rows.shape)
            runs += share.bound(motion.backend, share.gather(at, base + np.arange(3), base + 3), places)
            start += share.rows.size
        return at, runs, start + self.size - motion.n

    def _folded(self, rows: np.ndarray, columns: np.ndarray, values: np.ndarray) -> sp.csr_matrix:
        """Return what is left of a matrix when all but the degrees of freedom are eliminated.

        Levers are led by few of these, whatever bends beside them: what they add is filled in there alone.
        """
        from scipy.sparse.linalg import splu

        n, kept = self.motion.n, (rows >= 0) & (columns >= 0)
        E = sp.csr_matrix((values[kept], (rows[kept], columns[kept])), shape=(self.size, self.size))
        led, back = E[n:, :n].tocsc(), E[:n, n:]
        leading, felt = np.flatnonzero(np.diff(led.indptr)), np.flatnonzero(np.diff(back.indptr))
        said, led, back = splu(E[n:, n:].tocsc()), led[:, leading], back[felt]
        added = np.empty((len(felt), len(leading)))
        for first in range(0, len(leading), _BLOCK):
            some = slice(first, first + _BLOCK)
            added[:, some] = back @ said.solve(led[:, some].toarray())
        at = sp.coo_matrix((added.ravel(), (np.repeat(felt, len(leading)), np.tile(leading, len(felt)))), shape=(n, n))
        return sp.csr_matrix(E[:n, :n] - at)


@cache
def one() -> Kernel:
    """Return the kernel that writes what it reads."""
    import casadi as ca

    x = ca.SX.sym("x", 1)
    return Kernel("one", x, ca.SX.sym("p", 0), x)


def _slots(motion: Motion, state: State, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Slots of all nodes."""
    z = np.zeros((len(motion.place), NODE_SLOT))
    z[:, :3], z[:, 3:12] = state.x, state.R.reshape(-1, 9)
    z[:, 12:18] = motion.rates(state, v)[: motion.source_base].reshape(-1, 6)
    z[:, 18:] = motion.accelerations(state, v, a)[: motion.source_base].reshape(-1, 6)
    return z.ravel()


def _read(family: Family) -> list[np.ndarray]:
    """Which raw freedoms of a piece its forces hang on, by place, by rate and by acceleration."""
    import casadi as ca

    kernel, width = family.kernels.tangent, family.kernels.kind.width
    found = ca.jacobian_sparsity(kernel.outputs, kernel.inputs[-3:])
    entries, levels = (np.array(some, dtype=int) for some in found.get_triplet())
    return [np.unique(entries[levels == level] // width) for level in range(3)]


def _structure(group: Group) -> np.ndarray:
    """Which entries the slopes of levers have, shape (rows, columns)."""
    kind = group.kind
    found = np.zeros(kind.rows * kind.columns, dtype=bool)
    found[kind.sloping.writes] = True
    return found.reshape(kind.columns, kind.rows).T
