"""From degrees of freedom to nodes: positions, rotations, velocities, and forces back.

The rates of the degrees of freedom are quasi-velocities: spatial angular velocities for rotations.
A raw vector holds six entries a node (displacement and spin in space axes), the last node being the
ground, then the drives' source angles. `Motion` carries own freedoms out to raw ones, master to
follower, and forces back again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import StructureError
from flexctrl.mechanics.rotation import exponential, orthonormal
from flexctrl.model.linkage import Link, Linkage, renumbered
from flexctrl.structure.drives import Drive, RotaryDrive
from flexctrl.structure.freedoms import FREEDOMS, IDENTIFIERS, Vector
from flexctrl.structure.join_table import JoinTable
from flexctrl.structure.joints import main_axis
from flexctrl.structure.structure import Structure
from flexctrl.structure.ties import Closure, Copy, Group, Ties, Turn, tie


@dataclass(frozen=True)
class State:
    """Where the machine is and how fast it moves.

    Attributes
    ----------
    x : numpy.ndarray, shape (nodes + 1, 3)
        Positions [m]; the last row is the ground.
    R : numpy.ndarray, shape (nodes + 1, 3, 3)
        Rotations since rest.
    q : numpy.ndarray, shape (n,)
        Each degree of freedom summed up over all steps: displacements [m], turns [rad], source angles [rad].
    v : numpy.ndarray, shape (n,)
        Rates of the degrees of freedom.
    driven : numpy.ndarray, shape (drives,)
        Driven coordinate of each drive, turns included [rad or m].
    t : float
        Time [s].
    """

    x: np.ndarray
    R: np.ndarray
    q: np.ndarray
    v: np.ndarray
    driven: np.ndarray
    t: float = 0.0

    def with_(self, *, v: np.ndarray | None = None, t: float | None = None) -> State:
        """Return a copy at another time or with other rates.

        Parameters
        ----------
        v : numpy.ndarray, optional
        t : float, optional

        Returns
        -------
        State
        """
        return replace(self, v=self.v if v is None else np.asarray(v, float), t=self.t if t is None else t)


@dataclass(frozen=True)
class Motion:
    """How the nodes and source angles move with the degrees of freedom.

    Attributes
    ----------
    names : tuple of str
        Names of the degrees of freedom, drives' source angles last.
    place : numpy.ndarray, shape (nodes + 1, 6)
        Number of each cell's degree of freedom; ``n`` stands for none (held, or computed by a follower).
    sources : numpy.ndarray, shape (drives,)
        Number of each source angle's degree of freedom; ``n`` behind a rigid shaft.
    drives : tuple of Drive
    linkage : Linkage
        The nodes that follow, lead or are driven.
    nodes : numpy.ndarray of int
        Their numbers.
    owns : numpy.ndarray of int
        Degrees of freedom of its hinges and slides.
    rest : State
    notes : tuple of str
        What was released or held so that rigid loops close.
    closures : tuple of Closure
        Conditions that the remaining freedoms meet to first order; watched during a run.
    """

    names: tuple[str, ...]
    place: np.ndarray
    sources: np.ndarray
    drives: tuple[Drive, ...]
    linkage: Linkage
    nodes: np.ndarray
    owns: np.ndarray
    rest: State
    notes: tuple[str, ...]
    closures: tuple[Closure, ...]

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return len(self.names)

    @property
    def source_base(self) -> int:
        """Place of the first source angle in a raw vector, after the nodes."""
        return self.place.size

    @property
    def raw(self) -> int:
        """Length of a raw vector."""
        return self.place.size + self.sources.size

    @cached_property
    def rigid(self) -> np.ndarray:
        """Which drives have a rigid shaft."""
        return self.sources >= self.n

    @cached_property
    def ratios(self) -> np.ndarray:
        """Motor angle per driven coordinate of each drive."""
        return np.array([d.effective_ratio for d in self.drives])

    @cached_property
    def plain(self) -> bool:
        """Whether every raw freedom is own, the same as another, or held."""
        return not self.linkage.follows and not self.linkage.lines and not self.rigid.any()

    @cached_property
    def cells(self) -> np.ndarray:
        """Number of each raw freedom's degree of freedom, ``n`` for none, shape (raw,)."""
        return np.append(self.place.ravel(), self.sources)

    @cached_property
    def _linked(self) -> np.ndarray:
        """Raw places of the linkage: its nodes, then source angles behind rigid shafts."""
        cells = (6 * self.nodes[:, None] + np.arange(6)).ravel()
        return np.append(cells, self.source_base + np.flatnonzero(self.rigid))

    @cached_property
    def _bases(self) -> np.ndarray:
        """Raw places of the linkage's nodes."""
        return self._linked[: 6 * len(self.nodes)]

    @cached_property
    def _rotary(self) -> np.ndarray:
        return np.array([isinstance(d, RotaryDrive) for d in self.drives], dtype=bool)

    def _pose(self, x: np.ndarray, R: np.ndarray) -> np.ndarray:
        return np.hstack([x[self.nodes], R[self.nodes].reshape(-1, 9)])

    def advance(self, state: State, step: np.ndarray, v: np.ndarray, t: float) -> State:
        """Return the state after a step of the degrees of freedom.

        Parameters
        ----------
        state : State
        step : numpy.ndarray, shape (n,)
            Displacements; rotation vectors in space axes for rotations.
        v : numpy.ndarray, shape (n,)
            New rates.
        t : float
            New time.

        Returns
        -------
        State
        """
        padded = np.append(step, 0.0)
        moved = padded[self.place]
        for node, axes in self.linkage.lines:
            moved[self.nodes[node], 3:] = state.R[self.nodes[node]] @ axes @ moved[self.nodes[node], 3:]
        x, R = state.x + moved[:, :3], orthonormal(exponential(moved[:, 3:]) @ state.R)
        if not self.plain:
            pose = self.linkage.place(self._pose(state.x, state.R), self._pose(x, R), padded[self.owns])
            x[self.nodes], R[self.nodes] = pose.reshape(-1, 12)[:, :3], pose.reshape(-1, 4, 3)[:, 1:]
        return State(x, R, state.q + step, v, self.unwound(x, R, state.driven), t)

    def unwound(self, x: np.ndarray, R: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Return the driven coordinates of a pose, with the whole turns that bring them next to those before."""
        if not self.drives:
            return before
        driven = self.linkage.driven(self._pose(x, R))
        return driven + 2.0 * np.pi * np.where(self._rotary, np.rint((before - driven) / (2.0 * np.pi)), 0.0)

    def turns(self, driven: np.ndarray) -> np.ndarray:
        """Return the whole turns in driven coordinates."""
        return np.where(self._rotary, np.rint(driven / (2.0 * np.pi)), 0.0)

    def rates(self, state: State, v: np.ndarray) -> np.ndarray:
        """Return the raw rates of own rates ``v``."""
        own = np.append(v, 0.0)
        raw = own[self.cells]
        if not self.plain:
            raw[self._linked] = self.linkage.rates(self._pose(state.x, state.R), raw[self._bases], own[self.owns])
        return raw

    def accelerations(self, state: State, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the raw accelerations of own rates ``v`` and accelerations ``a``."""
        rate = np.append(a, 0.0)
        raw = rate[self.cells]
        if not self.plain:
            own = np.append(v, 0.0)
            base = own[self.cells[self._bases]]
            raw[self._linked] = self.linkage.accelerations(
                self._pose(state.x, state.R), base, own[self.owns], raw[self._bases], rate[self.owns]
            )
        return raw

    def collect(self, state: State, raw: np.ndarray) -> np.ndarray:
        """Return Tᵀ F: raw forces on the degrees of freedom (n,)."""
        if self.plain:
            return np.bincount(self.cells, weights=raw, minlength=self.n + 1)[:-1]
        back = self.linkage.collect(self._pose(state.x, state.R), raw[self._linked])
        raw = raw.copy()
        raw[self._bases] = back[: self._bases.size]
        forces = np.bincount(self.cells, weights=raw, minlength=self.n + 1)
        np.add.at(forces, self.owns, back[self._bases.size :])
        return forces[:-1]

    def jacobian(self, state: State) -> sp.csr_matrix:
        """Return T (raw × n): raw rates from own rates."""
        if self.plain:
            return self._selection
        linked = self.linkage.matrix_at(self._pose(state.x, state.R)) @ self._lead
        return self._unlinked + self._spread @ sp.csr_matrix(linked)

    @cached_property
    def _unlinked(self) -> sp.csr_matrix:
        kept = np.ones(self.raw)
        kept[self._linked] = 0.0
        return sp.diags(kept) @ self._selection

    @cached_property
    def _spread(self) -> sp.csr_matrix:
        """Puts the rows of the linkage in their places of a raw vector."""
        count = self._linked.size
        return sp.csr_matrix((np.ones(count), (self._linked, np.arange(count))), shape=(self.raw, count))

    @cached_property
    def _selection(self) -> sp.csr_matrix:
        return _select(self.cells, self.n)

    @cached_property
    def _lead(self) -> sp.csr_matrix:
        """Base and own rates of the linkage from own rates."""
        return _select(np.append(self.cells[self._bases], self.owns), self.n)

    def dense_jacobian(self, state: State) -> np.ndarray:
        """Return T (raw × n) as an array: quicker while it is small."""
        T = self._dense_selection.copy()
        if not self.plain:
            T[self._linked] = self.linkage.matrix_at(self._pose(state.x, state.R)) @ self._dense_lead
        return T

    @cached_property
    def _dense_selection(self) -> np.ndarray:
        return self._selection.toarray()

    @cached_property
    def _dense_lead(self) -> np.ndarray:
        return self._lead.toarray()

    def stiffening(self, state: State, raw: np.ndarray) -> np.ndarray:
        """Return ∂(Tᵀ F)/∂(own freedoms) under constant raw forces F, shape (n, n): the levers turn."""
        pose, lead = self._pose(state.x, state.R), self._lead if self.n > DENSE_UP_TO else self._dense_lead
        motion = self.linkage.matrix_at(pose)[: self._bases.size] @ lead
        return lead.T @ (self.linkage.stiffening_at(pose, raw[self._linked]) @ motion)

    def closure_error(self, state: State) -> float:
        """Return how far the conditions that close rigid loops are violated [m or rad]."""
        worst = 0.0
        for c in self.closures:
            if c.freedom < 3:
                gap = state.x[c.node, c.freedom] - self.rest.x[c.node, c.freedom]
                if c.other >= 0:
                    gap -= state.x[c.other, c.freedom] - self.rest.x[c.other, c.freedom]
                worst = max(worst, abs(float(gap)))
        return worst


DENSE_UP_TO = 60
"""Degrees of freedom up to which matrices are worked as plain arrays."""


def motion_of(structure: Structure, rigid: tuple[Group, ...], elastic: tuple[str, ...]) -> Motion:
    """Work out how the nodes of a structure move.

    Parameters
    ----------
    structure : Structure
    rigid : tuple of Group
        Parts that do not deform, rigid bodies included.
    elastic : tuple of str
        Drives with an elastic shaft, whose source angle is a degree of freedom.

    Returns
    -------
    Motion

    Raises
    ------
    StructureError
        If rigid parts form a loop that only moves out of proportion to its freedoms.
    """
    ties = _ties(structure, rigid)
    open_loop = _motion(structure, ties, elastic, held=frozenset(), notes=())
    if not ties.closures:
        return open_loop
    held, notes = _close(structure, open_loop, ties.closures)
    return _motion(structure, ties, elastic, held, notes)


def _ties(structure: Structure, rigid: tuple[Group, ...]) -> Ties:
    if isinstance(structure.joints, JoinTable):
        if rigid:
            raise StructureError(
                f"structure {structure.name!r} is tied by a join table of numbers; rigid parts need joints to ride on"
            )
        table = structure.joints
        numbers = {n for row in table.rows for n in row}
        return Ties(table.rows, (), (), (), max(numbers, default=0))
    return tie(structure.nodes, structure.joints, rigid)


def _motion(
    structure: Structure, ties: Ties, elastic: tuple[str, ...], held: frozenset[int], notes: tuple[str, ...]
) -> Motion:
    names = [*_names(structure, ties), *(f"{name}_source" for name in elastic)]
    kept = [i for i in range(len(names)) if i not in held]
    number = np.full(len(names) + 1, len(kept))
    number[kept] = np.arange(len(kept))
    cells = np.array([*ties.cells, (0,) * 6])
    place = number[np.where(cells > 0, cells - 1, len(names))]
    x = np.array([*(n.position for n in structure.nodes), (0.0, 0.0, 0.0)])
    R = np.broadcast_to(np.eye(3), (len(x), 3, 3)).copy()
    zero = np.zeros(len(kept))
    after = {name: ties.free + i for i, name in enumerate(elastic)}
    sources = number[np.array([after.get(d.name, len(names)) for d in structure.drives], dtype=int)]
    linkage, nodes, owns = _linkage(structure, ties, elastic, x, number)
    return Motion(
        names=tuple(names[i] for i in kept),
        place=place,
        sources=sources,
        drives=structure.drives,
        linkage=linkage,
        nodes=nodes,
        owns=owns,
        rest=State(x, R, zero, zero, np.zeros(len(structure.drives))),
        notes=notes,
        closures=ties.closures,
    )


def _linkage(
    s: Structure, ties: Ties, elastic: tuple[str, ...], x: np.ndarray, number: np.ndarray
) -> tuple[Linkage, np.ndarray, np.ndarray]:
    """Return the linkage of a structure, the numbers of its nodes and of its own freedoms."""
    ground = len(s.nodes)
    sides = [(s.number(d.node), ground if d.against is None else s.number(d.against)) for d in s.drives]
    used = {n for f in ties.follows for n in (f.node, f.master)} | {n for n, _ in ties.lines}
    nodes = sorted(used | {n for pair in sides for n in pair})
    local = {n: i for i, n in enumerate(nodes)}
    free = len(number) and int(number[-1])
    follows = [f.own for f in ties.follows if not isinstance(f, Copy) and f.own and number[f.own - 1] < free]
    own = {o: i for i, o in enumerate(follows, 1)}
    links = tuple(
        Link(d, local[a], local[b], tuple((x[a] - x[b]).tolist()), d.name not in elastic)
        for d, (a, b) in zip(s.drives, sides, strict=True)
    )
    linkage = Linkage(
        count=len(nodes),
        rest=x[nodes],
        follows=tuple(renumbered(f, local, own) for f in ties.follows),
        lines=tuple((local[n], _line_axes(along)) for n, along in ties.lines),
        links=links,
        owns=len(follows),
    )
    return linkage, np.array(nodes, dtype=int), number[np.array(follows, dtype=int) - 1]


def _select(numbers: np.ndarray, n: int) -> sp.csr_matrix:
    """Return the matrix that picks entries by number; ``n`` picks nothing."""
    rows = np.flatnonzero(numbers < n)
    return sp.csr_matrix((np.ones(rows.size), (rows, numbers[rows])), shape=(numbers.size, n))


def _line_axes(along: Vector) -> np.ndarray:
    """Axes (columns) whose main one is the line; ties hold the turn about it."""
    main = main_axis(along)
    axes = np.eye(3)
    side = np.cross(along, axes[:, (main + 1) % 3])
    axes[:, (main + 2) % 3] = side / np.linalg.norm(side)
    axes[:, (main + 1) % 3] = np.cross(axes[:, (main + 2) % 3], along)
    axes[:, main] = along
    return axes


def _names(structure: Structure, ties: Ties) -> list[str]:
    """Name each degree of freedom after the first node that has it: ``part_index_freedom``."""
    names = [""] * ties.free
    for follow in ties.follows:
        if not isinstance(follow, Copy) and follow.own:
            node = structure.nodes[follow.node]
            kind = "turn" if isinstance(follow, Turn) else "slide"
            names[follow.own - 1] = f"{node.part}_{node.index}_{kind}"
    for node, row in zip(structure.nodes, ties.cells, strict=True):
        for f, number in enumerate(row):
            if number > 0 and not names[number - 1]:
                names[number - 1] = f"{node.part}_{node.index}_{IDENTIFIERS[f]}"
    return names


def _close(
    structure: Structure, motion: Motion, closures: tuple[Closure, ...]
) -> tuple[frozenset[int], tuple[str, ...]]:
    """Find which degrees of freedom rigid loops hold; conditions that others already meet are dropped with a note."""
    T = motion.jacobian(motion.rest)
    rows = T[[6 * c.node + c.freedom for c in closures]].toarray()
    for row, c in zip(rows, closures, strict=True):
        row -= T[6 * c.other + c.freedom].toarray().ravel() if c.other >= 0 else 0.0
    rows[np.abs(rows) < 1e-9 * max(1.0, structure.size)] = 0.0
    tied = np.flatnonzero(rows.any(axis=0))
    loose = tied[_undecided(rows[:, tied])]
    labels = [_label(structure, c) for c in closures]
    if loose.size:
        worst = int(np.argmax(rows[:, loose].any(axis=1)))
        names = ", ".join(motion.names[i] for i in loose if rows[worst, i])
        raise StructureError(
            f"rigid parts form a loop: {labels[worst]} ties {names} together. Loops of rigid parts are not "
            "eliminated; keep one of the parts in the loop flexible"
        )
    why = {i: ", ".join(label for row, label in zip(rows, labels, strict=True) if row[i]) for i in tied.tolist()}
    idle = [label for row, label in zip(rows, labels, strict=True) if not row.any()]
    notes = [f"{label} is held by rigid parts already; it is left free to second order" for label in idle]
    return frozenset(why), (*notes, *(f"{motion.names[i]} is held, because of {reason}" for i, reason in why.items()))


def _undecided(rows: np.ndarray) -> np.ndarray:
    """Tell which unknowns of rows @ q = 0 are not zero in every solution."""
    if not rows.size:
        return np.zeros(rows.shape[1], dtype=bool)
    _, values, right = np.linalg.svd(rows / np.abs(rows).max(axis=0))
    rank = int(np.count_nonzero(values > 1e-9 * values[0]))
    return np.abs(right[rank:]).max(axis=0, initial=0.0) > 1e-7


def _label(structure: Structure, c: Closure) -> str:
    return f"{FREEDOMS[c.freedom]} of {structure.nodes[c.node]}"
