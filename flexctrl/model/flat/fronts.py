"""Elimination by fronts: a sparse matrix factorised in compiled loops; see `solving`.

Unknowns with the same neighbours (a node's) are eliminated together, the ones with the fewest neighbours
first. Each group has a front: a small dense matrix of the group and the unknowns that it touches. Sweeping
its pivots leaves A₁₁⁻¹ and A₁₁⁻¹A₁₂ in their rows, −A₂₁A₁₁⁻¹ below, and the Schur complement, which is added
into the front of the next group that it touches. What solving reads is put down one after the other in the order
in which it is read: in large models that takes as long as memory does. Without exchange of rows: for matrices
ruled by masses and stiffnesses; a pivot that vanishes is reported and not worked around.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import KernelError
from flexctrl.frozen import frozen
from flexctrl.kernels.eights import eight, put
from flexctrl.kernels.native import Reals, Wholes, seldom

__all__ = ["LARGE", "NODE", "Fronts", "Plan", "factor", "plan_of", "seat", "whose"]

_VANISHING = 1e-13
NODE = 6
_MERGED = 2 * NODE
"""Unknowns of a front that small ones are joined to. Two nodes at once are quicker; one at a time takes less room."""
LARGE = 3_000
"""Unknowns from which on room counts: factors of half a megabyte share a near cache with all else that a step reads.
Those of what levers say are of other sizes, of which no loop is written out."""


@frozen(eq=False)
class Plan:
    """How matrices of a pattern are eliminated.

    Attributes
    ----------
    fronts : Fronts
    order : numpy.ndarray of int, shape (n,)
        The number of each degree of freedom, in the order of elimination. They are the first of the matrix' unknowns.
    seats : numpy.ndarray of int, shape (unknowns,)
        When each unknown is eliminated.
    length : int
        Number of entries of all fronts.
    widest : int
        Longest column of a front.
    """

    fronts: Fronts
    order: np.ndarray
    seats: np.ndarray
    length: int
    widest: int

    @cached_property
    def position(self) -> np.ndarray:
        """Place of each degree of freedom in their order of elimination."""
        place = np.empty_like(self.order)
        place[self.order] = np.arange(len(self.order))
        return place

    def places(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Return where entries of the matrix, by row and column, stand among those of the fronts.

        Raises
        ------
        KernelError
            For an entry that the pattern does not have.
        """
        f = self.fronts
        r, c = self.seats[rows], self.seats[columns]
        front = np.repeat(np.arange(f.count), f.pivots)[np.minimum(r, c)]
        return f.base[front] + self.rows(front, c) * f.lead[front] + self.rows(front, r)

    def rows(self, front: np.ndarray, unknown: np.ndarray) -> np.ndarray:
        """Return the rows of unknowns, in the order of elimination, in fronts."""
        f = self.fronts
        within = unknown - f.first[front]
        keys = np.repeat(np.arange(f.count), f.size - f.pivots) * f.n + f.others
        wanted, own = front * f.n + unknown, within < f.pivots[front]
        found = np.searchsorted(keys, wanted)
        if not (own | (np.append(keys, -1)[found] == wanted)).all():
            raise KernelError("an entry lies outside the pattern that the fronts were made for")
        return np.where(own, within, found - f.rest[front] + f.pivots[front])


@dataclass
class Fronts:
    """The fronts of a pattern, as compiled loops read them.

    Attributes
    ----------
    n, beyond : int
        Unknowns; they are numbered in the order in which they are eliminated. How many are no degrees of freedom.
    seats : Wholes, (n − beyond,)
        The unknown that each degree of freedom is, in their order.
    count : int
        Fronts.
    first, pivots, size, lead, base, rest, parent : Wholes, (count,)
        First pivot, number of pivots and of unknowns, length of a column (a multiple of eight), where the front
        begins in the entries (column by column) and where its other unknowns in ``others``, and the front that
        takes its Schur complement (−1: none).
    onto : Wholes, (count,)
        Of fronts of one or two nodes that touch one more, whose six unknowns follow each other, the first of these;
        −1 of others.
    others, into : Wholes
        The other unknowns of all fronts, and their rows in the fronts' parents.
    diagonal : Wholes, (n,)
        Where the diagonal stands in the entries.
    below, right : int
        How many numbers the columns of all pivots have, and the rows right of their blocks.
    """

    LASTING = ("beyond",)

    n: int
    beyond: int
    count: int
    seats: Wholes
    first: Wholes
    pivots: Wholes
    size: Wholes
    lead: Wholes
    base: Wholes
    rest: Wholes
    parent: Wholes
    onto: Wholes
    others: Wholes
    into: Wholes
    diagonal: Wholes
    below: int
    right: int


_NONE = (np.zeros(0, dtype=int), np.zeros(0, dtype=int))


def plan_of(
    rows: np.ndarray,
    columns: np.ndarray,
    n: int,
    own: int | None = None,
    after: tuple[np.ndarray, np.ndarray] = _NONE,
) -> Plan:
    """Return the plan for matrices with entries at some rows and columns (repeats allowed).

    Parameters
    ----------
    rows, columns : numpy.ndarray of int
    n : int
        Unknowns.
    own : int, optional
        How many of them are degrees of freedom; default: all.
    after : tuple of numpy.ndarray
        Pairs of unknowns of which the first is to be eliminated after the second.

    Returns
    -------
    Plan
    """
    pattern = sp.csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(n, n))
    pattern = (pattern + pattern.T + sp.identity(n)).tocsr()
    order = sp.csr_matrix((np.ones(len(after[0])), after), shape=(n, n))
    members, touching, group = _grouped(pattern, order)
    before = [set(found) - {i} for i, found in enumerate(_gathered(order, members, group))]
    fronts = _merged(*_eliminated(members, touching, before), NODE if own is None and n > LARGE else _MERGED)
    return _laid_out(n, n if own is None else own, fronts)


def _grouped(pattern: sp.csr_matrix, order: sp.csr_matrix) -> tuple[list[np.ndarray], list[set[int]], np.ndarray]:
    """Return groups of unknowns with the same neighbours, the groups that each touches, and the group of each unknown.

    Unknowns of which one waits for another are in groups of their own.
    """
    n = pattern.shape[0]
    pattern.data[:] = 1.0
    marks = pattern @ np.random.default_rng(0).random((n, 2))
    marks += 1e3 * (order @ np.random.default_rng(1).random((n, 2)))
    marks += 1e6 * (order.T @ np.random.default_rng(2).random((n, 2)))
    _, lead, group = np.unique(marks.round(9), axis=0, return_index=True, return_inverse=True)
    group = group.ravel()
    members = np.split(np.argsort(group, kind="stable"), np.cumsum(np.bincount(group))[:-1]) if n else []
    touching = [set(group[pattern.indices[pattern.indptr[i] : pattern.indptr[i + 1]]].tolist()) for i in lead]
    return members, [found - {i} for i, found in enumerate(touching)], group


def _gathered(pattern: sp.csr_matrix, members: list[np.ndarray], group: np.ndarray) -> list[set[int]]:
    """Return the groups that the rows of each group's members have entries of."""
    rows = ([pattern.indices[pattern.indptr[i] : pattern.indptr[i + 1]] for i in some] for some in members)
    return [set(group[np.concatenate(some)].tolist()) if some else set() for some in rows]


def _eliminated(
    groups: list[np.ndarray], touching: list[set[int]], before: list[set[int]]
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Return the groups in the order of elimination, and the unknowns each touches then: fewest first.

    None comes before those that it waits for.
    Among equals the one known longest comes first: branches are taken in turns, and the processor has
    independent work side by side.
    """
    weight = [len(g) for g in groups]
    costs = [sum(weight[k] for k in near) for near in touching]
    waiting = [(cost, i, i) for i, cost in enumerate(costs) if not before[i]]
    heapq.heapify(waiting)
    left, behind = [len(some) for some in before], _reversed(before)
    age, order, fronts = len(groups), [], []
    while waiting:
        cost, _, one = heapq.heappop(waiting)
        if cost != costs[one]:
            continue
        costs[one], near = -1, touching[one]
        order.append(groups[one])
        fronts.append(near)
        for k in near:
            touching[k] |= near
            touching[k] -= {one, k}
            costs[k], age = sum(weight[j] for j in touching[k]), age + 1
            if not left[k]:
                heapq.heappush(waiting, (costs[k], age, k))
        for k in behind.get(one, ()):
            left[k] -= 1
            if not left[k]:
                age += 1
                heapq.heappush(waiting, (costs[k], age, k))
    return order, [np.concatenate([groups[k] for k in sorted(near)]) if near else np.zeros(0, int) for near in fronts]


def _reversed(before: list[set[int]]) -> dict[int, list[int]]:
    """Which groups wait for each."""
    behind: dict[int, list[int]] = {}
    for k, some in enumerate(before):
        for i in some:
            behind.setdefault(i, []).append(k)
    return behind


def _merged(order: list[np.ndarray], touched: list[np.ndarray], most: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return (own unknowns, others) of fronts, small ones joined with the next that they touch, to so many."""
    holder = {int(i): k for k, own in enumerate(order) for i in own}
    when = {i: k for k, i in enumerate(int(i) for own in order for i in own)}
    own = [g.tolist() for g in order]
    gone = np.zeros(len(order), dtype=bool)
    for c, others in enumerate(touched):
        if not len(others):
            continue
        p = holder[min(others.tolist(), key=when.__getitem__)]
        if len(own[c]) + len(own[p]) <= most or len(others) == len(own[p]) + len(touched[p]):
            own[p] = own[c] + own[p]
            holder |= dict.fromkeys(own[c], p)
            gone[c] = True
    return [(np.array(own[k]), touched[k]) for k in range(len(order)) if not gone[k]]


def _laid_out(n: int, own: int, fronts: list[tuple[np.ndarray, np.ndarray]]) -> Plan:
    """Return the tables of fronts; the first of the unknowns are degrees of freedom."""
    order = np.concatenate([np.zeros(0, dtype=int), *(some for some, _ in fronts)])
    position = np.empty(n, dtype=int)
    position[order] = np.arange(n)
    others = [np.sort(position[rest]) for _, rest in fronts]
    pivots = np.array([len(some) for some, _ in fronts], dtype=int)
    rests = np.array([len(rest) for rest in others], dtype=int)
    front = np.repeat(np.arange(len(fronts)), pivots)
    size = pivots + rests
    lead = -(-size // 8) * 8
    starts = [np.concatenate([[0], np.cumsum(counts)[:-1]]) for counts in (pivots, lead * size, rests)]
    parent = np.array([front[rest[0]] if len(rest) else -1 for rest in others], dtype=int)
    tables = Fronts(
        n=n,
        beyond=n - own,
        count=len(fronts),
        seats=np.flatnonzero(order < own),
        first=starts[0],
        pivots=pivots,
        size=size,
        lead=lead,
        base=starts[1],
        rest=starts[2],
        parent=parent,
        onto=np.array([_onto(*one) for one in zip(pivots, others, strict=True)], dtype=int),
        others=np.concatenate([np.zeros(0, dtype=int), *others]),
        into=np.zeros(int(rests.sum()), dtype=int),
        diagonal=np.zeros(n, dtype=int),
        below=int((pivots * size).sum()),
        right=int((pivots * rests).sum()),
    )
    found = Plan(tables, order[order < own], position, int((lead * size).sum()), int(lead.max(initial=8)))
    up = np.repeat(parent, rests)
    tables.into[:] = found.rows(up, tables.others)
    tables.diagonal[:] = found.places(order, order)  # of all unknowns
    return found


def _onto(pivots: int, others: np.ndarray) -> int:
    """The first of a node's unknowns, where a front of one or two nodes touches these alone."""
    nodes = pivots in (NODE, 2 * NODE) and len(others) == NODE
    return int(others[0]) if nodes and others[-1] - others[0] == NODE - 1 else -1


@seldom
def factor(f: Fronts, entries: Reals, diagonal: Reals, down: Reals, up: Reals) -> int:
    """Factorise the matrix in ``entries``, which are used up; return the unknown whose pivot vanishes, or −1.

    The columns of pivots go to ``down``, front by front, and the rows right of them, by columns, to ``up``; each
    has eight places more than numbers. Where a front touches one node alone, that one's rows come first.
    With unknowns beyond the degrees of freedom, ``diagonal`` is left with the pivots: what such a degree of
    freedom carries stands in the rows of others.
    """
    for i in range(f.n):
        diagonal[i] = abs(entries[f.diagonal[i]])
    below = 0
    right = 0
    for s in range(f.count):
        size = f.size[s]
        lead = f.lead[s]
        pivots = f.pivots[s]
        a = entries[f.base[s] :]
        for k in range(pivots):
            pivot = a[k * lead + k]
            if not abs(pivot) > _VANISHING * diagonal[f.first[s] + k]:
                return f.first[s] + k
            if f.beyond > 0:
                diagonal[f.first[s] + k] = abs(pivot)
            sweep(size, lead, k, 1.0 / pivot, a, a[k * lead :])
        for k in range(pivots):
            # of nodes what the next one waits for comes first: it stays in a register
            if f.onto[s] >= 0:
                below = put_down(NODE, a[k * lead + pivots :], below, down)
                below = put_down(pivots, a[k * lead :], below, down)
            else:
                below = put_down(size, a[k * lead :], below, down)
        for k in range(pivots, size):
            right = put_down(pivots, a[k * lead :], right, up)
        if f.parent[s] >= 0:
            parent = f.parent[s]
            rest = size - pivots
            extend(
                rest, lead, a[pivots * lead + pivots :], f.lead[parent], f.into[f.rest[s] :], entries[f.base[parent] :]
            )
    return -1


def sweep(size: int, lead: int, k: int, inverse: float, a: Reals, column: Reals) -> None:
    """Exchange unknown k with its equation."""
    for j in range(size):
        if j != k:
            t = a[j * lead + k] * inverse
            if t != 0.0:
                other = a[j * lead :]
                for i in range(0, lead, 8):
                    put(other[i:], eight(other[i:]) - t * eight(column[i:]))
                other[k] = t
    for i in range(0, lead, 8):
        put(column[i:], -inverse * eight(column[i:]))
    column[k] = inverse


def put_down(rows: int, column: Reals, at: int, numbers: Reals) -> int:
    """Put some rows of a column behind those before; return where they end."""
    for i in range(0, rows, 8):
        put(numbers[at + i :], eight(column[i:]))
    return at + rows


def extend(rest: int, lead: int, a: Reals, wide: int, into: Wholes, parent: Reals) -> None:
    """Add a Schur complement into the parent's front."""
    for j in range(rest):
        column = parent[into[j] * wide :]
        for i in range(rest):
            column[into[i]] += a[j * lead + i]


def seat(f: Fronts, i: int) -> int:
    """Return which unknown a degree of freedom is."""
    if f.beyond > 0:
        return f.seats[i]
    return i


def whose(f: Fronts, where: int) -> int:
    """Return the degree of freedom that an unknown is, or the next that is eliminated."""
    if f.beyond > 0:
        for i in range(f.n - f.beyond):
            if f.seats[i] >= where:
                return i
    return where
