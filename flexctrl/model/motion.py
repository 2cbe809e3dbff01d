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
from flexctrl.mechanics.rotation import exponential, orthonormal, skew_arrays
from flexctrl.model.followers import Batch, Blocks, Pose, batches
from flexctrl.model.gears import Gears, gears_of
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
    gears : Gears
    lines : numpy.ndarray of int, line_axes : numpy.ndarray, shape (lines, 3, 3)
        Nodes whose rotation is the direction of a line: they turn about body axes.
    followers : tuple of Batch
    rest : State
    notes : tuple of str
        What was released or held so that rigid loops close.
    closures : tuple of Closure
        Conditions that the remaining freedoms meet to first order; watched during a run.
    """

    names: tuple[str, ...]
    place: np.ndarray
    sources: np.ndarray
    gears: Gears
    lines: np.ndarray
    line_axes: np.ndarray
    followers: tuple[Batch, ...]
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
    def plain(self) -> bool:
        """Whether every raw freedom is own, the same as another, or held."""
        return not self.followers and not self.lines.size and not self.gears.rigid.any()

    @cached_property
    def cells(self) -> np.ndarray:
        """Number of each raw freedom's degree of freedom, ``n`` for none, shape (raw,)."""
        return np.append(self.place.ravel(), self.sources)

    def _nodes(self, raw: np.ndarray) -> np.ndarray:
        return raw[: self.source_base].reshape(-1, 6)

    def _turn_out(self, R: np.ndarray, nodes: np.ndarray) -> None:
        """Take spins of lines from body axes to space axes."""
        if self.lines.size:
            nodes[self.lines, 3:] = np.einsum("kij,kj->ki", R[self.lines] @ self.line_axes, nodes[self.lines, 3:])

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
        self._turn_out(state.R, moved)
        new = Pose(state.x + moved[:, :3], orthonormal(exponential(moved[:, 3:]) @ state.R))
        for batch in self.followers:
            batch.place(new, Pose(state.x, state.R), padded)
        driven = self.gears.unwind(new, state.driven)[0] if self.gears.count else state.driven
        return State(new.x, new.R, state.q + step, v, driven, t)

    def rates(self, state: State, v: np.ndarray) -> np.ndarray:
        """Return the raw rates of own rates ``v``."""
        own, pose = np.append(v, 0.0), Pose(state.x, state.R)
        raw = own[self.cells]
        V = self._nodes(raw)
        self._turn_out(state.R, V)
        for batch in self.followers:
            batch.rates(pose, V, own)
        if self.gears.rigid.any():
            raw[self.source_base :] = np.where(self.gears.rigid, self.gears.rates(pose, V), raw[self.source_base :])
        return raw

    def accelerations(self, state: State, rates: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the raw accelerations, given the raw rates, the own rates and own accelerations."""
        own, rate, pose = np.append(v, 0.0), np.append(a, 0.0), Pose(state.x, state.R)
        raw = rate[self.cells]
        A, V = self._nodes(raw), self._nodes(rates)
        self._turn_out(state.R, A)
        for batch in self.followers:
            batch.accelerations(pose, A, V, own, rate)
        if self.gears.rigid.any():
            raw[self.source_base :] = np.where(
                self.gears.rigid, self.gears.accelerations(pose, A, V), raw[self.source_base :]
            )
        return raw

    def collect(self, state: State, raw: np.ndarray) -> np.ndarray:
        """Return Tᵀ F: raw forces on the degrees of freedom (n,). The raw vector is used up."""
        own, pose, F = np.zeros(self.n + 1), Pose(state.x, state.R), self._nodes(raw)
        if self.gears.rigid.any():
            self.gears.collect(pose, F, raw[self.source_base :])
        for batch in reversed(self.followers):
            batch.collect(pose, F, own)
        if self.lines.size:
            F[self.lines, 3:] = np.einsum("kji,kj->ki", state.R[self.lines] @ self.line_axes, F[self.lines, 3:])
        own += np.bincount(self.cells, weights=raw, minlength=self.n + 1)
        return own[:-1]

    def jacobian(self, state: State) -> sp.csr_matrix:
        """Return T (raw + n × n): raw rates, then the own ones, from own rates."""
        return self._selection if self.plain else self._jacobian(state)

    @cached_property
    def _selection(self) -> sp.csr_matrix:
        return self._jacobian(self.rest)

    def _jacobian(self, state: State) -> sp.csr_matrix:
        size, pose = self.raw + self.n, Pose(state.x, state.R)
        own = np.flatnonzero(self.cells < self.n)
        rows = np.append(own, self.raw + np.arange(self.n))
        columns = np.append(self.cells[own], np.arange(self.n))
        T = sp.csr_matrix((np.ones(rows.size), (rows, columns)), shape=(size, self.n))
        if self.lines.size:
            T = self._turn_lines(state) @ T
        for batch in self.followers:
            out = Blocks()
            batch.rows(pose, self.raw, out)
            T = T + self._matrix(out) @ T
        if self.gears.rigid.any():
            out = Blocks()
            self.gears.rows(pose, self.source_base, out)
            T = T + self._matrix(out) @ T
        return T

    def _turn_lines(self, state: State) -> sp.csr_matrix:
        size = self.raw + self.n
        turn = sp.lil_matrix(sp.identity(size))
        for node, axes in zip(self.lines, self.line_axes, strict=True):
            block = slice(6 * node + 3, 6 * node + 6)
            turn[block, block] = state.R[node] @ axes
        return turn.tocsr()

    def _matrix(self, out: Blocks) -> sp.csr_matrix:
        """Return collected blocks as a matrix; the number n, for no own freedom, is dropped."""
        size = self.raw + self.n
        rows, columns, values = (np.concatenate(part) for part in (out.rows, out.columns, out.values))
        kept = (rows < size) & (columns < size)
        return sp.csr_matrix((values[kept], (rows[kept], columns[kept])), shape=(size, size))

    def stiffening(self, state: State, raw: np.ndarray) -> sp.csr_matrix:
        """Return ∂(Tᵀ F)/∂(own freedoms) under constant raw forces F, shape (n, n): the levers turn."""
        out, pose, raw = Blocks(), Pose(state.x, state.R), raw.copy()
        F, own = self._nodes(raw), np.zeros(self.n + 1)
        if self.gears.rigid.any():
            self.gears.stiffen(pose, raw[self.source_base :], out)
            self.gears.collect(pose, F, raw[self.source_base :])
        for batch in reversed(self.followers):
            batch.stiffen(pose, F, self.raw, out)
            batch.collect(pose, F, own)
        if self.lines.size:
            # a moment on body axes that turn with the line: δ(Eᵀ Rᵀ M) = Eᵀ Rᵀ (M × δθ)
            cells = 6 * self.lines[:, None] + 3 + np.arange(3)
            out.add(cells, cells, skew_arrays(F[self.lines, 3:]))
        if not out.rows:
            return sp.csr_matrix((self.n, self.n))
        T = self.jacobian(state)
        return (T.T @ self._matrix(out) @ T).tocsr()

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
    followers = tuple(
        replace(b, own=number[b.own]) if hasattr(b, "own") else b  # type: ignore[type-var]
        for b in batches(ties.follows, x, len(names))
    )
    return Motion(
        names=tuple(names[i] for i in kept),
        place=place,
        sources=sources,
        gears=gears_of(structure, elastic),
        lines=np.array([node for node, _ in ties.lines], dtype=int),
        line_axes=np.array([_line_axes(along) for _, along in ties.lines]).reshape(-1, 3, 3),
        followers=followers,
        rest=State(x, R, zero, zero, np.zeros(len(structure.drives))),
        notes=notes,
        closures=ties.closures,
    )


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
    labels = [_label(structure, c) for c in closures]
    rows = []
    for c in closures:
        row = T[6 * c.node + c.freedom].toarray().ravel()
        rows.append(row - T[6 * c.other + c.freedom].toarray().ravel() if c.other >= 0 else row)
    held: dict[int, str] = {}
    notes = []
    scale = 1e-9 * max(1.0, structure.size)
    for row, label in sorted(
        zip(rows, labels, strict=True), key=lambda item: np.count_nonzero(np.abs(item[0]) > scale)
    ):
        left = [int(i) for i in np.flatnonzero(np.abs(row) > scale) if i not in held]
        if not left:
            notes.append(f"{label} is held by rigid parts already; it is left free to second order")
        elif len(left) == 1:
            held[left[0]] = label
            notes.append(f"{motion.names[left[0]]} is held, because {label} is")
        else:
            names = ", ".join(motion.names[i] for i in left)
            raise StructureError(
                f"rigid parts form a loop: {label} ties {names} together. Loops of rigid parts are not "
                "eliminated; keep one of the parts in the loop flexible"
            )
    return frozenset(held), tuple(notes)


def _label(structure: Structure, c: Closure) -> str:
    return f"{FREEDOMS[c.freedom]} of {structure.nodes[c.node]}"
