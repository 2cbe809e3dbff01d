"""Linear models of machines with shafts so stiff that K would hold nothing beside them: twists are coordinates.

A shaft adds k R² to the stiffness of what it drives. At 1e18 N m/rad the last digit of a double is 128 N m/rad, and
what bends beside it is lost. There the twist ψ = θ_d − R s takes the place of the motor's angle θ_d, and what is driven
takes the motor along. With W what the coordinates move by then, K₀ the stiffness without these shafts and D the
diagonal of theirs,

Wᵀ K W = Wᵀ K₀ W + D

has both to the last digit. K₀ is that of the same machine with shafts next to nothing, twisted until they bear the same
torques.

Each twist takes the place of the angle of its own motor, so any number of shafts may drive one body, or bear on one
another in a row. A motor that is held has no angle, and one that is far heavier than what it drives (J beside R² J_m)
would drown its mass in M: there the twist takes the place of what it drives, of that coordinate whose stiffness and
mass the others bear best. Whether shafts drown what they drive is asked of all together: without the first of two, the
second still holds all.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.linear.parts import with_springs
from flexctrl.linear.pattern import symmetric
from flexctrl.model.balance import Balance
from flexctrl.model.model import Model
from flexctrl.model.rounding import DIGITS, slope_terms
from flexctrl.model.softened import shafts_of, softened
from flexctrl.model.state import State
from flexctrl.model.tangents import tangents

__all__ = ["with_twists"]

_SOFT = 2.0**-100
_DROWNED = 2.0**-20
_DUST, _ALIKE = 1e-12, 1e-12


@frozen(eq=False)
class _Shafts:
    """Shafts of drives, by how they twist with the free coordinates.

    Attributes
    ----------
    names : tuple of str
        Of the drives.
    rows : numpy.ndarray, shape (shafts, n)
        ∂ψ/∂q.
    stiffness, damping : numpy.ndarray, shape (shafts,)
        Of ψ.
    motors : numpy.ndarray of int, shape (shafts,)
        The coordinate that is the motor's angle; −1 where it is held.
    """

    names: tuple[str, ...]
    rows: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    motors: np.ndarray

    @property
    def borne(self) -> np.ndarray:
        """What each shaft alone adds to the stiffness of each coordinate, shape (shafts, n)."""
        return np.asarray(self.stiffness[:, None] * self.rows**2)

    @property
    def angles(self) -> np.ndarray:
        """The coordinates that are angles of motors."""
        return self.motors[self.motors >= 0]

    def among(self, chosen: np.ndarray) -> _Shafts:
        """Return some of them."""
        names = tuple(name for name, one in zip(self.names, chosen, strict=True) if one)
        return _Shafts(names, *(part[chosen] for part in (self.rows, self.stiffness, self.damping, self.motors)))

    def all_but_alone(self, whole: np.ndarray) -> np.ndarray:
        """Tell which hold far more than all shafts leave of K's diagonal, where that is of something they drive."""
        borne = self.borne
        left = whole - borne.sum(axis=0)
        return np.any((borne > 0.0) & (left < _DROWNED * borne) & self._led, axis=1)

    def drowning(self, own: np.ndarray) -> np.ndarray:
        """Tell which are far stiffer than something else that holds what they drive, or like one that is.

        Parameters
        ----------
        own : numpy.ndarray, shape (n,)
            What holds each coordinate beside the shafts.

        Returns
        -------
        numpy.ndarray of bool, shape (shafts,)
            A soft one beside a stiff one is none: it is among what the other drowns.
        """
        beside = np.vstack([self.borne, own])
        lost = np.array([(beside > 0.0) & (beside < _DROWNED * borne) & self._led for borne in self.borne])
        drowns, drowned = np.any(lost, axis=(1, 2)), np.any(lost[:, :-1], axis=(0, 2))
        return np.logical_and(drowns.any(), drowns | ~drowned)

    def as_one(self) -> _Shafts:
        """Return them with held ones that twist alike, side by side on one joint, as one."""
        size = np.linalg.norm(self.rows, axis=1)
        alike = np.abs(self.rows @ self.rows.T) >= (1.0 - _ALIKE) * np.outer(size, size)
        alike &= (self.motors[:, None] < 0) & (self.motors < 0)
        first = np.argmax(alike | np.eye(size.size, dtype=bool), axis=1)
        share = (size / size[first]) ** 2
        k, c = (np.bincount(first, share * part, size.size) for part in (self.stiffness, self.damping))
        return replace(self, stiffness=k, damping=c).among(first == np.arange(size.size))

    @property
    def _led(self) -> np.ndarray:
        return ~np.isin(np.arange(self.rows.shape[1]), self.motors)


@frozen(eq=False)
class _Bare:
    """A machine whose shafts are next to nothing.

    Attributes
    ----------
    model : Model
    state : State
        In which its shafts bear the torques that they bore.
    K, C : scipy.sparse.csr_matrix, shape (n, n)
        Of the free coordinates, without the shafts.
    rounding : numpy.ndarray, shape (n,)
        Of K's diagonal.
    """

    model: Model
    state: State
    K: sp.csr_matrix
    C: sp.csr_matrix
    rounding: np.ndarray

    @property
    def own(self) -> np.ndarray:
        """Stiffness of each coordinate without the shafts; none where that is rounding, shape (n,)."""
        own = np.abs(self.K.diagonal())
        return np.where(own > self.rounding, own, 0.0)


def with_twists(linear: LinearModel, balance: Balance, state: State) -> LinearModel:
    """Return a linear model with twists in place of the angles of motors whose shafts drown what they drive.

    Parameters
    ----------
    linear : LinearModel
        Of the free coordinates of a balance.
    balance : Balance
    state : State
        In which it is met.

    Returns
    -------
    LinearModel
        The same model if no shaft is that stiff.
    """
    if balance.model.about or not balance.model.motion.sources.size:
        return linear
    shafts = _shafts(linear, balance, state)
    shafts = shafts.among(shafts.all_but_alone(linear.K.diagonal()))
    if not shafts.names:
        return linear
    bare = _bare(linear, balance, state, shafts.names)
    if not (stiff := shafts.drowning(bare.own)).any():
        return linear
    if not stiff.all():
        shafts = shafts.among(stiff)
        bare = _bare(linear, balance, state, shafts.names)
    shafts = shafts.as_one()
    pivots = _pivots(shafts, bare.own, linear.M.diagonal())
    return _written(linear, bare, shafts, pivots) if pivots.size else linear


def _shafts(linear: LinearModel, balance: Balance, state: State) -> _Shafts:
    """Those of motors that move, and of those that are held where they are."""
    sources, K, C = list(shafts_of(balance.model)), linear.K.tocsr(), linear.C.diagonal()
    motors = np.flatnonzero(np.isin(balance.free, sources))
    motors = motors[K.diagonal()[motors] > 0.0]
    k, rows = K.diagonal()[motors], K[motors].toarray()
    names = [linear.coordinates[i] for i in motors]
    held, beside = _of_held(balance, state, np.intersect1d(balance.fixed, sources))
    stiffness, damping = (np.append(free, of_held) for free, of_held in zip((k, C[motors]), beside[1:], strict=True))
    names += [balance.model.coordinates[i] for i in held]
    motors = np.append(motors, np.full(held.size, -1))
    rows = np.vstack([rows, beside[0]]) / stiffness[:, None]
    return _Shafts(tuple(name.removesuffix("_source") for name in names), rows, stiffness, damping, motors)


def _of_held(balance: Balance, state: State, sources: np.ndarray) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
    """Motors that are held behind shafts that twist: their rows of K, stiffness and damping."""
    if not sources.size:
        return sources, (np.zeros((0, balance.free.size)), np.zeros(0), np.zeros(0))
    _, C, K = tangents(balance.model, state, balance.u)
    sources = sources[K.diagonal()[sources] > 0.0]
    rows = (K.tocsr()[sources] @ balance.basis(state)).toarray()
    return sources, (rows, K.diagonal()[sources], C.diagonal()[sources])


def _bare(linear: LinearModel, balance: Balance, state: State, names: tuple[str, ...]) -> _Bare:
    model, there = softened(balance.model, dict.fromkeys(names, _SOFT)), _twisted(balance.model, state, names)
    _, C, K = tangents(model, there, balance.u)
    terms = slope_terms(model, there, balance.u, K)
    if (held := balance.turning(state, balance.whole_force(state))).nnz:
        K = K - held
    C, K, terms = (balance.seen(there, A) for A in (C, K, terms))
    K, C = (_without(soft, whole - soft) for soft, whole in ((K, linear.K), (C, linear.C)))
    return _Bare(model, there, K, C, DIGITS * np.abs(terms.diagonal()))


def _without(K: sp.spmatrix, shafts: sp.csr_matrix) -> sp.csr_matrix:
    """What is left of K beside soft shafts; of round-off of theirs, nothing."""
    left, size = sp.coo_matrix(K - _SOFT * shafts), np.sqrt(np.abs(shafts.diagonal()))
    held = np.abs(left.data) > _SOFT * _DUST * size[left.row] * size[left.col]
    return sp.csr_matrix((left.data[held], (left.row[held], left.col[held])), left.shape)


def _twisted(model: Model, state: State, names: tuple[str, ...]) -> State:
    """The state with motors turned until soft shafts bear the torques of stiff ones."""
    if not model.large:
        return state
    still, motion, q = np.zeros(model.n), model.motion, state.q.copy()
    torques = model.forces.raw(state, still, still)[motion.source_base :]
    for drive, torque, source in zip(model.structure.drives, torques, motion.sources, strict=False):
        if drive.name in names:
            q[source] -= torque * (1.0 / _SOFT - 1.0) / drive.stiffness
    return replace(state, q=q)


def _pivots(shafts: _Shafts, own: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """Which coordinates the twists take the place of, one after the other; none where two shafts twist as one."""
    rows, pivots = shafts.rows.copy(), np.zeros(0, dtype=int)
    for i, motor in enumerate(shafts.motors):
        row = rows[i]
        row[pivots] = 0.0
        if not (np.abs(row) > _DUST * np.abs(shafts.rows[i]).max()).any():
            return np.zeros(0, dtype=int)
        others = np.setdiff1d(np.flatnonzero(row), shafts.angles)
        loss = {int(p): _loss(row, int(p), own, mass) for p in (*others, *([motor] if motor >= 0 else []))}
        best = motor if loss.get(int(motor), np.inf) < 1.0 / _DROWNED else min(loss, key=lambda p: loss[p])
        pivots = np.append(pivots, best)
        below = np.arange(len(rows)) != i
        rows[below] -= np.outer(rows[below, best] / row[best], row)
    return pivots


def _loss(row: np.ndarray, pivot: int, own: np.ndarray, mass: np.ndarray) -> float:
    """By how much a coordinate that is made of others would drown their stiffness, or their mass."""
    share = (row / row[pivot]) ** 2
    share[pivot] = 0.0
    over = [size[pivot] * share[size > 0.0] / size[size > 0.0] for size in (own, mass)]
    return float(np.concatenate(over).max(initial=0.0))


def _basis(shafts: _Shafts, pivots: np.ndarray) -> sp.csc_matrix:
    """What the coordinates move by with twists in place of some, and with the others."""
    twisted = np.linalg.inv(shafts.rows[:, pivots])
    W, led = sp.lil_matrix(sp.identity(shafts.rows.shape[1])), -twisted @ shafts.rows
    led[:, pivots] = twisted
    W[pivots] = led
    return sp.csc_matrix(W)


def _written(linear: LinearModel, bare: _Bare, shafts: _Shafts, pivots: np.ndarray) -> LinearModel:
    """The model in other coordinates, its shafts on the diagonal of K and C."""
    W, n = _basis(shafts, pivots), len(linear.coordinates)
    springs, dampers = (
        sp.csc_matrix((values, (pivots, pivots)), (n, n)) for values in (shafts.stiffness, shafts.damping)
    )
    K, C = sp.csc_matrix(W.T @ bare.K @ W + springs), sp.csc_matrix(W.T @ bare.C @ W + dampers)
    even = symmetric(linear.K)[1] == 0.0
    owners = dict(zip(shafts.names, pivots.tolist(), strict=True))
    twists = {at: f"{name}_twist" for name, at in owners.items()}
    written = linear.projected(W, tuple(twists.get(i, name) for i, name in enumerate(linear.coordinates)))
    assert written.place is not None
    place = replace(written.place, model=bare.model, state=bare.state, springs=springs)
    reach = bare.model.motion.jacobian(bare.model.place(bare.state)) @ place.basis
    parts = bare.model.forces.parts(bare.model.place(bare.state), reach)
    return replace(
        written,
        K=symmetric(K)[0] if even else K,
        C=C,
        place=place,
        parts=with_springs(parts, owners, springs.diagonal()),
    )
