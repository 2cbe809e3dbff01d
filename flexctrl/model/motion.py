"""From degrees of freedom to nodes: positions, rotations, velocities, and forces back.

The rates of the degrees of freedom are quasi-velocities: spatial angular velocities for rotations. `Motion` carries own
freedoms out to raw ones (see `Coordinates`), master to follower, and forces back again.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from flexctrl.frozen import frozen
from flexctrl.kernels.kernel import Run
from flexctrl.mechanics.rotation import orthonormal, turn_kernel
from flexctrl.model.coordinates import Coordinates
from flexctrl.model.linkages.levers import Levers
from flexctrl.model.linkages.linkage import reciprocal_condition
from flexctrl.model.state import State
from flexctrl.model.unfolded import Unfolded
from flexctrl.structure.relations import Fit

DENSE_UP_TO = 60
"""Degrees of freedom up to which matrices are worked as plain arrays."""

_DEAD = 200.0
_BRANCHES = 1e-9
_OPEN = 1e-9
_UNSURE = 1e-3

APART = 1e-5
"""How far what is only watched may be open: round-off is far less; a girder across two rails skews by 4 mrad."""

FAST = 0.5
"""Steps of freedoms above which driven angles may turn by more than half a turn [rad]."""


@frozen
class Motion(Coordinates):
    """How the nodes and source angles move with the degrees of freedom; see `Coordinates`."""

    def pose(self, state: State) -> np.ndarray:
        """Return places and rotations of the linkage's nodes, shape (count, 12)."""
        return self._pose(state.x, state.R)

    def _pose(self, x: np.ndarray, R: np.ndarray) -> np.ndarray:
        pose = np.empty((len(self.nodes), 12))
        pose[:, :3], pose[:, 3:] = x[self.nodes], R[self.nodes].reshape(-1, 9)
        return pose

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
        x, R = state.x + moved[:, :3], self._turned(state.R, moved[:, 3:])
        if not self.plain:
            pose = self.linkage.placed(self._pose(state.x, state.R), step[self.linked])
            x[self.nodes] = pose.reshape(-1, 12)[:, :3]
            R[self.nodes] = orthonormal(pose.reshape(-1, 4, 3)[:, 1:])
        shown = self.shown(state, step, R)
        return State(x, R, state.q + step, v, self.unwound(x, R, self.wound(state, step)), t, state.dry, shown)

    def shown(self, before: State, step: np.ndarray, R: np.ndarray) -> np.ndarray:
        """Return the angles of outputs after a step to rotations R."""
        if not len(self.twists):
            return before.shown
        return self.twists.next_to(before.shown + self.twists.swept(before.R, R, self.winding @ step), R)

    def counted(self, state: State) -> State:
        """Return a state made elsewhere with the angles of outputs next to those it shows, or else to its sums."""
        about = state.shown if state.shown.size == len(self.twists) else self.winding @ state.q
        return replace(state, shown=self.twists.next_to(about, state.R))

    @cached_property
    def winding(self) -> sp.csr_matrix:
        """About what a step of the degrees of freedom adds to the angles of outputs: it tells whole turns apart."""
        T, twists = self.jacobian(self.rest), self.twists
        rows = [
            sp.csr_matrix(axis) @ (T[6 * at + 3 : 6 * at + 6] - T[6 * base + 3 : 6 * base + 6])
            for at, base, axis in zip(twists.at, twists.base, twists.axes, strict=True)
        ]
        return sp.csr_matrix(sp.vstack(rows)) if rows else sp.csr_matrix((0, self.n))

    def _turned(self, R: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Return rotations turned by rotation vectors in space axes."""
        new = np.zeros_like(R)
        self._turn(np.concatenate([R.ravel(), theta.ravel()]), new)
        return new

    @cached_property
    def _turn(self) -> Run:
        nodes = np.arange(len(self.place))[:, None]
        rows = 9 * nodes + np.arange(9)
        gather = np.hstack([rows, 9 * len(nodes) + 3 * nodes + np.arange(3)])
        return self.backend.bind(turn_kernel(), gather, np.zeros((len(nodes), 0)), rows)

    def wound(self, state: State, step: np.ndarray, at: State | None = None) -> np.ndarray:
        """Return about what the driven coordinates are after a step, its levers being those of the state or of another.

        Steps of any length turn what they turn: the pose alone does not tell whole turns.
        """
        own = step[self.linked]
        if not self.rotary.any() or np.abs(own).max(initial=0.0) < FAST:
            return state.driven
        levers = at or state
        return state.driven + self.linkage.wound(self._pose(levers.x, levers.R), own)

    def unwound(self, x: np.ndarray, R: np.ndarray, about: np.ndarray) -> np.ndarray:
        """Return the driven coordinates of a pose, with the whole turns that bring them next to what they are about."""
        if not self.drives:
            return about
        driven = self.linkage.driven(self._pose(x, R))
        return driven + 2.0 * np.pi * np.where(self.rotary, np.rint((about - driven) / (2.0 * np.pi)), 0.0)

    def turns(self, driven: np.ndarray) -> np.ndarray:
        """Return the whole turns in driven coordinates."""
        return np.where(self.rotary, np.rint(driven / (2.0 * np.pi)), 0.0)

    def rates(self, state: State, v: np.ndarray) -> np.ndarray:
        """Return the raw rates of own rates ``v``."""
        raw = np.append(v, 0.0)[self.cells]
        if not self.plain and v.any():
            raw[self.linked_cells] = self.linkage.rates(self._pose(state.x, state.R), v[self.linked])
        return raw

    def accelerations(self, state: State, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the raw accelerations of own rates ``v`` and accelerations ``a``."""
        raw = np.append(a, 0.0)[self.cells]
        if not self.plain and (v.any() or a.any()):
            pose = self._pose(state.x, state.R)
            raw[self.linked_cells] = self.linkage.accelerations(pose, v[self.linked], a[self.linked])
        return raw

    def collect(self, state: State, raw: np.ndarray) -> np.ndarray:
        """Return Tᵀ F: raw forces on the degrees of freedom (n,)."""
        if self.plain:
            return np.bincount(self.cells, weights=raw, minlength=self.n + 1)[:-1]
        rest = raw.copy()
        rest[self.linked_cells] = 0.0
        forces = np.bincount(self.cells, weights=rest, minlength=self.n + 1)[:-1]
        forces[self.linked] += self.linkage.collect(self._pose(state.x, state.R), raw[self.linked_cells])
        return forces

    def jacobian(self, state: State) -> sp.csr_matrix:
        """Return T (raw × n): raw rates from own rates."""
        if self.plain:
            return self._selection
        linked = sp.csr_matrix(self.linkage.matrix_at(self._pose(state.x, state.R)))
        return self._unlinked + self._spread @ linked @ self._lead

    @cached_property
    def _unlinked(self) -> sp.csr_matrix:
        kept = np.ones(self.raw)
        kept[self.linked_cells] = 0.0
        return sp.diags(kept) @ self._selection

    @cached_property
    def _spread(self) -> sp.csr_matrix:
        """Puts the rows of the linkage in their places of a raw vector."""
        count = self.linked_cells.size
        return sp.csr_matrix((np.ones(count), (self.linked_cells, np.arange(count))), shape=(self.raw, count))

    @cached_property
    def _selection(self) -> sp.csr_matrix:
        return _select(self.cells, self.n)

    @cached_property
    def _lead(self) -> sp.csr_matrix:
        """Independent rates of the linkage from own rates."""
        return _select(self.linked, self.n)

    def dense_jacobian(self, state: State) -> np.ndarray:
        """Return T (raw × n) as an array: quicker while it is small."""
        T = self._dense_selection.copy()
        if not self.plain:
            T[self.linked_cells] = self.linkage.matrix_at(self._pose(state.x, state.R)) @ self._dense_lead
        return T

    @cached_property
    def _dense_selection(self) -> np.ndarray:
        return self._selection.toarray()

    @cached_property
    def _dense_lead(self) -> np.ndarray:
        return self._lead.toarray()

    def stiffening(self, state: State, raw: np.ndarray) -> np.ndarray:
        """Return ∂(Tᵀ F)/∂(own freedoms) under constant raw forces F, shape (n, n): the levers turn."""
        if isinstance(self.linkage, Levers):
            return self._unfolded.stiffening(state, raw)
        pose = self._pose(state.x, state.R)
        motion = self.linkage.matrix_at(pose)[: 6 * len(self.nodes)]
        own = self.linkage.stiffening_at(pose, raw[self.linked_cells]) @ motion
        if self.n > DENSE_UP_TO:
            return self._lead.T @ sp.csr_matrix(own) @ self._lead
        return self._dense_lead.T @ own @ self._dense_lead

    @cached_property
    def _unfolded(self) -> Unfolded:
        return Unfolded(self, ())

    def drift(self, state: State, v: np.ndarray, a: np.ndarray) -> tuple[sp.csr_matrix | np.ndarray, ...]:
        """Return how raw rates and accelerations change as levers turn.

        Parameters
        ----------
        state : State
        v, a : numpy.ndarray, shape (n,)
            Own rates and accelerations, held.

        Returns
        -------
        tuple of 3 matrices, shape (raw, n), arrays while small
            ∂(raw rates)/∂(own motion), ∂(raw accelerations)/∂(own motion), ∂(raw accelerations)/∂(own rates) less
            what `jacobian` has.
        """
        pose = self._pose(state.x, state.R)
        slopes = self.linkage.drift_at(pose, v[self.linked], a[self.linked])
        if self.n > DENSE_UP_TO:
            return tuple(self._spread @ sp.csr_matrix(slope @ self._lead) for slope in slopes)
        spread = np.zeros((3, self.raw, self.n))
        spread[:, self.linked_cells] = slopes @ self._dense_lead
        return tuple(spread)

    def dead_point(self, before: State, after: State) -> bool:
        """Tell whether a step has come to a position from which its coordinates cannot move a loop of rigid parts.

        Near it small steps of the coordinates move other parts far. Where a loop may branch but moves on evenly
        (a parallelogram all in line) it is dead only in the very position.
        """
        return bool(self.linkage.loops) and (self._stuck(after) or self._sent_back(before, after))

    def _stuck(self, state: State) -> bool:
        pose = self._pose(state.x, state.R)
        onto, within = self.linkage.slopes_at(pose)
        if reciprocal_condition(within) < _BRANCHES or not np.abs(self.linkage.gaps(pose)).max() <= _OPEN:
            return True
        moved, reach = np.abs(np.linalg.solve(within, onto)).max(axis=0), np.abs(onto).max(axis=0)
        return bool((moved > _DEAD * reach).any())

    def _sent_back(self, before: State, after: State) -> bool:
        """Tell whether a loop is in another branch after a step than either end of it foretells.

        At a dead point the own freedoms turn back while the loop moves on into its other branch: the slopes of its
        openings with the dependent freedoms become singular there, at a rate that both ends tell. A step across it
        that stays in the branch sends back what moves fastest, which the own freedoms do not see.
        """
        h = after.t - before.t
        (first, change), (last, changed) = (self._turning(s) for s in (before, after))
        passed, ahead, behind = np.linalg.solve(first, last), h * change, -h * changed
        one = np.eye(len(first))
        if max(np.abs(far).sum(axis=1).max() for far in (passed - one, ahead, behind)) < 1.0:
            return False
        counts = [_reversals(seen) for seen in (passed, one + ahead, one + behind)]
        return max(sure for sure, _ in counts) > min(most for _, most in counts)

    def _turning(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """How fast loops open with their dependent freedoms, W, and W⁻¹Ẇ."""
        pose, raw = self._pose(state.x, state.R), self.rates(state, state.v)
        W, change = self.linkage.turning_at(pose, raw[: self.source_base].reshape(-1, 6)[self.nodes])
        return W, np.linalg.solve(W, change)

    def closure_error(self, state: State) -> float:
        """Return how far conditions on rigid parts are open, watched ones too [rad, or shares of what they span]."""
        if not self.linkage.loops:
            return self._apart(state)[0]
        return max(float(np.abs(self.linkage.gaps(self._pose(state.x, state.R))).max()), self._apart(state)[0])

    def apart(self, state: State) -> str:
        """Say which joint of rigid parts has come apart, held by nothing but their lengths; empty if none has."""
        gap, which = self._apart(state)
        if gap <= APART:
            return ""
        loop = self.linkage.spare[which]
        turns = loop.axis is not None if isinstance(loop, Fit) else loop.freedom >= 3
        size = f"{gap:.3g} rad" if turns else f"{gap * self.linkage.span:.3g} m"
        return (
            f"{self.spare[which]} has come apart by {size}: as drawn, in line, rigid parts hold it to first order "
            "only. Draw them off that line, leave one of them flexible (BeamFlexibility, RopeStretch), or free the end "
            "along it"
        )

    def _apart(self, state: State) -> tuple[float, int]:
        """How far the worst of the conditions that are only watched is open, and which one it is."""
        if not self.linkage.spare:
            return 0.0, 0
        gaps = np.abs(self.linkage.play(self._pose(state.x, state.R)))
        return float(gaps.max()), int(gaps.argmax())


def _reversals(A: np.ndarray) -> tuple[int, int]:
    """Return how many ways a change of slopes turns round for sure, and at most: eigenvalues that have passed zero."""
    left = np.linalg.eigvals(A).real
    return int(np.count_nonzero(left < -_UNSURE)), int(np.count_nonzero(left < _UNSURE))


def _select(numbers: np.ndarray, n: int) -> sp.csr_matrix:
    """Return the matrix that picks entries by number; ``n`` picks nothing."""
    rows = np.flatnonzero(numbers < n)
    return sp.csr_matrix((np.ones(rows.size), (rows, numbers[rows])), shape=(numbers.size, n))
