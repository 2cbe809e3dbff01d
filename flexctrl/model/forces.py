"""All kernels of a model on one flat vector: forces, their slopes, energies."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse as sp

from flexctrl.frozen import frozen
from flexctrl.kernels.extended import EXTENDED, evaluate
from flexctrl.kernels.kernel import Backend, Run
from flexctrl.linear.parts import Parts, parts_of
from flexctrl.model.laws.families import Family
from flexctrl.model.laws.gusts import Gusts
from flexctrl.model.laws.kinds import DRIVE_SLOT, NODE_SLOT
from flexctrl.model.laws.wind_kinds import WIND
from flexctrl.model.linkages.levers import Levers
from flexctrl.model.mixed import Excess, Mixed
from flexctrl.model.motion import DENSE_UP_TO, Motion
from flexctrl.model.state import State
from flexctrl.model.unfolded import LEVELS, Unfolded

_ROUND_OFF = 1e-14


@frozen(eq=False)
class Terms:
    """Sizes of what is added up over the pieces.

    Attributes
    ----------
    forces : numpy.ndarray, shape (raw,)
        A piece's force on a node counts in every direction, and as a moment over the length of the piece.
    slopes : scipy.sparse.csr_matrix, shape (raw, raw)
        Of the tangents at rest.
    """

    forces: np.ndarray
    slopes: sp.csr_matrix


@frozen
class Forces:
    """The sum of all families.

    Attributes
    ----------
    motion : Motion
    families : tuple of Family
    backend : Backend
    """

    motion: Motion
    families: tuple[Family, ...]
    backend: Backend

    @property
    def drive_base(self) -> int:
        """Place of the first drive's slot."""
        return NODE_SLOT * len(self.motion.place)

    @property
    def slot_count(self) -> int:
        """Length of the vector that the kernels read, seeds left out."""
        return self.drive_base + DRIVE_SLOT * (len(self.motion.drives) + self.motion.inner.size)

    def slots(self, state: State, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the flat vector the kernels read."""
        return self._slots(state, self.motion.rates(state, v), self.motion.accelerations(state, v, a))

    def _slots(self, state: State, rates: np.ndarray, accelerations: np.ndarray) -> np.ndarray:
        """The same of raw rates and accelerations."""
        motion = self.motion
        nodes = len(motion.place)
        z = np.empty(self.slot_count)
        slots = z[: self.drive_base].reshape(nodes, NODE_SLOT)
        slots[:, :3] = state.x
        slots[:, 3:12] = state.R.reshape(nodes, 9)
        slots[:, 12:18] = rates[: motion.source_base].reshape(nodes, 6)
        slots[:, 18:24] = accelerations[: motion.source_base].reshape(nodes, 6)
        if motion.drives:
            drives = z[self.drive_base :].reshape(-1, DRIVE_SLOT)[: len(motion.drives)]
            own = np.append(state.q, 0.0)[motion.sources]
            drives[:, 0] = np.where(motion.rigid, motion.ratios * state.driven, own)
            drives[:, 1] = rates[motion.source_base : motion.inner_base]
            drives[:, 2] = accelerations[motion.source_base : motion.inner_base]
            drives[:, 3] = motion.turns(state.driven)
        if motion.inner.size:
            inner = z[-DRIVE_SLOT * motion.inner.size :].reshape(-1, DRIVE_SLOT)
            inner[:, 0] = np.append(state.q, 0.0)[motion.inner]
            inner[:, 1] = rates[motion.inner_base :]
            inner[:, 2] = accelerations[motion.inner_base :]
            inner[:, 3] = state.dry.phase
        return z

    def raw(self, state: State, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the raw forces of all families, inertia included."""
        z = self.slots(state, v, a)
        raw = np.zeros(self.motion.raw)
        for batch in self._force:
            batch(z, raw)
        return raw

    def balance(self, state: State, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the forces on the degrees of freedom, inertia included."""
        return self.motion.collect(state, self.raw(state, v, a))

    def slope(
        self,
        state: State,
        v: np.ndarray,
        a: np.ndarray,
        seeds: tuple[float, float, float],
        loads: np.ndarray | None = None,
        excess: Excess | None = None,
        gusts: tuple[Gusts, np.ndarray] | None = None,
    ) -> sp.csr_matrix:
        """Return ∂(balance)/∂(own motion) for increments that add ``seeds`` × to place, rates and accelerations.

        ``loads`` are raw forces of the inputs; ``excess`` stresses are borne beside those of the state; ``gusts``
        blow with the inputs beside them.
        """
        z = self.slots(state, v, a)
        blocks = self._blocks(z, seeds, gusts)
        if excess is not None:
            blocks += excess.blocks
        if self.motion.plain:
            places, indices, indptr = self._table
            data = np.bincount(places, weights=blocks, minlength=len(indices) + 1)[:-1]
            return sp.csr_matrix((data, indices, indptr), shape=(self.motion.n, self.motion.n), copy=False)
        acting = np.zeros(self.motion.raw)
        if seeds[0] != 0.0:
            acting = self.raw(state, v, a) + (0.0 if loads is None else loads)
            acting = acting if excess is None else acting + excess.raw
        if isinstance(self.motion.linkage, Levers):
            levels = [self._blocks(z, level, gusts) for level in LEVELS]
            if excess is not None:
                levels[0] += excess.blocks
            return self.unfolded.slope(z, v, a, seeds, acting, [blocks, *levels], self.pattern)
        slope = self._led(state, v, a, seeds, z, blocks, gusts)
        if seeds[0] != 0.0:
            slope = slope + seeds[0] * self.motion.stiffening(state, acting)
        return sp.csr_matrix(slope)

    def _led(
        self,
        state: State,
        v: np.ndarray,
        a: np.ndarray,
        seeds: tuple[float, float, float],
        z: np.ndarray,
        blocks: np.ndarray,
        gusts: tuple[Gusts, np.ndarray] | None,
    ) -> sp.csr_matrix | np.ndarray:
        """Return the slope through the levers of followers; in motion rates and accelerations turn with these."""
        motion = self.motion
        T = motion.dense_jacobian(state) if motion.n <= DENSE_UP_TO else motion.jacobian(state)
        raw = self._raw_matrix(blocks) @ T
        if (seeds[0] or seeds[1]) and (v.any() or a.any()):
            speed, pull, coriolis = motion.drift(state, v, a)
            on_rates, on_pull = (
                self._raw_matrix(self._blocks(z, s, gusts)) for s in ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
            )
            raw = raw + on_rates @ (seeds[0] * speed) + on_pull @ (seeds[0] * pull + seeds[1] * coriolis)
        return T.T @ raw

    def _raw_matrix(self, blocks: np.ndarray) -> sp.csr_matrix:
        """Return the tangent blocks added up over the raw freedoms."""
        places, indices, indptr = self._raw_table
        data = np.bincount(places, weights=blocks, minlength=len(indices))
        return sp.csr_matrix((data, indices, indptr), shape=(self.motion.raw, self.motion.raw), copy=False)

    @cached_property
    def unfolded(self) -> Unfolded:
        """How slopes are made of machines with long linkages."""
        return Unfolded(self.motion, self.families)

    @cached_property
    def mixed(self) -> Mixed:
        """The stresses of the pieces that strain."""
        return Mixed(self)

    def parts(self, state: State, reach: sp.csr_matrix) -> Parts:
        """Return each part's own share of K and M at rest, levers of followers left out.

        Parameters
        ----------
        state : State
        reach : scipy.sparse.csr_matrix, shape (raw, k)
            Raw motion with the coordinates wanted.

        Returns
        -------
        Parts
        """
        still = np.zeros(self.motion.n)
        z = self.slots(state, still, still)
        stiffness, mass = (-self._blocks(z, seed) for seed in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
        owners = np.concatenate([np.array(f.parts) for f in self.families])
        return parts_of(owners, [f.scatter(self.motion.source_base) for f in self.families], stiffness, mass, reach)

    def strain(self, state: State, motions: np.ndarray) -> np.ndarray:
        """Return ΦᵀKΦ of raw motions Φ, piece by piece in extended precision; levers of followers left out.

        Entries of K grow as the cube of the number of elements, what they leave to a motion that bends nothing
        does not.

        Parameters
        ----------
        state : State
        motions : numpy.ndarray, shape (raw, k)

        Returns
        -------
        numpy.ndarray, shape (k, k)
        """
        still = np.zeros(self.motion.n)
        z = np.append(self.slots(state, still, still), (1.0, 0.0, 0.0))
        seeds, reach = self.slot_count + np.arange(3), np.vstack([motions, 0.0 * motions[:1]])
        total = np.zeros((motions.shape[1],) * 2, dtype=EXTENDED)
        for f in self.families:
            gather = np.hstack([f.gather(self.drive_base), np.tile(seeds, (f.count, 1))])
            blocks = evaluate(f.kernels.tangent, z[gather], f.parameters).reshape(f.count, f.kernels.kind.width, -1)
            own = reach[f.scatter(self.motion.source_base)].astype(EXTENDED)
            total -= np.tensordot(blocks @ own, own, axes=((0, 1), (0, 1)))
        return total.astype(float)

    def terms(self, state: State) -> Terms:
        """Return how large the forces and tangents of single pieces are at rest: rounding comes of them."""
        still, motion = np.zeros(self.motion.n), self.motion
        z = self.slots(state, still, still)
        slopes = self._raw_matrix(np.abs(self._blocks(z, (1.0, 0.0, 0.0))))
        total = np.zeros(motion.raw)
        for f, run in zip(self.families, self._apart, strict=True):
            cells = f.scatter(motion.source_base)
            own = np.zeros(cells.size)
            run(z, own)
            size = _in_every_direction(f, np.abs(own.reshape(cells.shape)), state.x)
            total += np.bincount(cells.ravel(), weights=size.ravel(), minlength=motion.raw)
        return Terms(total, slopes)

    def drags(self, state: State) -> sp.csr_matrix:
        """Return how large the tangents of single pieces by rates are at rest, shape (raw, raw)."""
        still = np.zeros(self.motion.n)
        return self._raw_matrix(np.abs(self._blocks(self.slots(state, still, still), (0.0, 1.0, 0.0))))

    @cached_property
    def _apart(self) -> tuple[Run, ...]:
        """The forces of each family, piece by piece."""
        base = self.drive_base
        tables = [np.arange(f.count * f.kernels.kind.width).reshape(f.count, -1) for f in self.families]
        return tuple(
            self.backend.bind(f.kernels.force, f.gather(base), f.parameters, table)
            for f, table in zip(self.families, tables, strict=True)
        )

    def inertias(self, state: State) -> np.ndarray:
        """Return the largest inertia about any axis at each raw freedom: of its node's three displacements or turns.

        What an inertia about one axis may be the rounding of.

        Parameters
        ----------
        state : State

        Returns
        -------
        numpy.ndarray, shape (raw,)
            [kg] or [kg m²].
        """
        return self._largest(state, (0.0, 0.0, 1.0))

    def rounding(self, seeds: tuple[float, float, float]) -> np.ndarray:
        """Return what is left by rounding, at most, on the diagonal of a matrix where nothing should be, shape (n,).

        Told from the terms of each entry alone: whatever the units, and however large the entries of other parts.

        Parameters
        ----------
        seeds : tuple of 3 floats
            Which matrix, as of `slope`: (0, 1, 0) is the damping, (0, 0, 1) the mass.

        Returns
        -------
        numpy.ndarray, shape (n,)
        """
        motion, raw = self.motion, np.arange(self.motion.raw)
        three = np.where(raw < motion.source_base, raw - raw % 3, raw)
        alike = sp.csr_matrix((np.ones(motion.raw), (three, raw)), shape=(motion.raw, motion.raw))
        T = motion.jacobian(motion.rest)
        levers = np.sqrt(alike @ T.multiply(T))  # of a node's three: the same in all its poses
        return np.asarray(_ROUND_OFF * (levers.T @ np.sqrt(self._largest(motion.rest, seeds))) ** 2)

    def _largest(self, state: State, seeds: tuple[float, float, float]) -> np.ndarray:
        still, (rows, columns), motion = np.zeros(self.motion.n), self.pattern, self.motion
        blocks = np.abs(self._blocks(self.slots(state, still, still), seeds))
        own = rows == columns
        sizes = np.bincount(rows[own], weights=blocks[own], minlength=motion.raw)
        nodes = sizes[: motion.source_base].reshape(-1, 3)
        nodes[:] = nodes.max(axis=1, keepdims=True)
        return sizes

    def _blocks(
        self, z: np.ndarray, seeds: tuple[float, float, float], gusts: tuple[Gusts, np.ndarray] | None = None
    ) -> np.ndarray:
        seeded, blocks = np.append(z, seeds), np.zeros(self.pattern[0].size)
        for batch in self._tangent:
            batch(seeded, blocks)
        if gusts is not None:
            blocks[self.wind_blocks] += gusts[0].slope(z, gusts[1], seeds)
        return blocks

    @cached_property
    def wind_blocks(self) -> slice:
        """Which entries of all tangent blocks are those of nodes in the wind."""
        for f, start in zip(self.families, self.block_starts, strict=True):
            if f.kernels.kind is WIND:
                return slice(start, start + f.count * f.kernels.kind.width**2)
        return slice(0, 0)

    def energy(self, state: State, v: np.ndarray) -> tuple[float, float, float]:
        """Return kinetic energy, stored energy and dissipated power."""
        rates = self.motion.rates(state, v)
        z, total = self._slots(state, rates, np.zeros_like(rates)), np.zeros(3)
        for batch in self._energy:
            batch(z, total)
        return float(total[0]), float(total[1]), float(total[2])

    @cached_property
    def _force(self) -> tuple[Run, ...]:
        base, sources = self.drive_base, self.motion.source_base
        return tuple(
            self.backend.bind(f.kernels.force, f.gather(base), f.parameters, f.scatter(sources)) for f in self.families
        )

    @cached_property
    def _energy(self) -> tuple[Run, ...]:
        base = self.drive_base
        return tuple(
            self.backend.bind(f.kernels.energy, f.gather(base), f.parameters, np.tile(np.arange(3), (f.count, 1)))
            for f in self.families
        )

    @cached_property
    def _tangent(self) -> tuple[Run, ...]:
        found = []
        for f, start in zip(self.families, self.block_starts, strict=True):
            size = f.kernels.kind.width**2
            scatter = start + np.arange(f.count * size).reshape(f.count, size)
            seeds = np.tile(self.slot_count + np.arange(3), (f.count, 1))
            gather = np.hstack([f.gather(self.drive_base), seeds])
            found.append(self.backend.bind(f.kernels.tangent, gather, f.parameters, scatter))
        return tuple(found)

    @cached_property
    def block_starts(self) -> tuple[int, ...]:
        """Where the tangent blocks of each family begin."""
        sizes = [f.count * f.kernels.kind.width**2 for f in self.families]
        return tuple(np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(int).tolist()) if sizes else ()

    @property
    def entries(self) -> int:
        """Entries of all tangent blocks together."""
        return int(self.pattern[0].size)

    @cached_property
    def pattern(self) -> tuple[np.ndarray, np.ndarray]:
        """Raw rows and columns of all tangent blocks, in the order in which they are written (column by column)."""
        rows, columns = [np.zeros(0, dtype=int)], [np.zeros(0, dtype=int)]
        for f in self.families:
            cells = f.scatter(self.motion.source_base)
            rows.append(np.tile(cells, (1, cells.shape[1])).ravel())
            columns.append(np.repeat(cells, cells.shape[1], axis=1).ravel())
        return np.concatenate(rows), np.concatenate(columns)

    @cached_property
    def _raw_table(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where each entry of the tangent blocks goes in the matrix over the raw freedoms (CSR)."""
        return _table_of(*self.pattern, self.motion.raw)

    @cached_property
    def _table(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where each entry of the tangent blocks goes in the assembled matrix (CSR): the join table at work."""
        rows, columns = (self.motion.cells[cells] for cells in self.pattern)
        return _table_of(rows, columns, self.motion.n)


def _in_every_direction(family: Family, size: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Forces of pieces, shape (pieces, width), as they may point, and as moments over the length of each piece."""
    kind = family.kernels.kind
    if kind.nodes:
        nodes = size[:, : kind.nodes * kind.freedoms].reshape(len(size), kind.nodes, -1, 3)
        nodes[:] = np.linalg.norm(nodes, axis=3, keepdims=True)
        ends = x[family.nodes]
        span = np.linalg.norm(ends - ends[:, :1], axis=2).max(axis=1)
        nodes[:, :, 1:] += (span * nodes[:, :, 0].max(axis=(1, 2)))[:, None, None, None]
        size[:, : kind.nodes * kind.freedoms] = nodes.reshape(len(size), -1)
    return size


def _table_of(rows: np.ndarray, columns: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the place of each entry among the stored ones (one past the last: left out), their columns and rows."""
    kept = (rows < size) & (columns < size)
    keys, inverse = np.unique(rows[kept] * size + columns[kept], return_inverse=True)
    places = np.full(len(rows), len(keys))
    places[kept] = inverse
    indptr = np.concatenate([[0], np.cumsum(np.bincount(keys // size, minlength=size))])
    return places, (keys % size).astype(np.int32), indptr.astype(np.int32)
