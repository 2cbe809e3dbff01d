"""Linear models of machines with shafts so stiff that K would hold nothing beside them: twists are coordinates.

A shaft adds k R² to the stiffness of what it drives. At 1e18 N m/rad the last digit of a double is 128 N m/rad, and
what bends beside it is lost. There the twist ψ = θ_d − R s takes the place of the motor's angle θ_d, and what is driven
takes the motor along. With W what the coordinates move by then, K₀ the stiffness without these shafts and D the
diagonal of theirs,

Wᵀ K W = Wᵀ K₀ W + D

has both to the last digit. K₀ is that of the same machine with shafts next to nothing, twisted until they bear the same
torques.

Each motor takes the place of its own angle, so any number of shafts may drive one body, or bear on one another in a
row. Whether they drown what they drive is asked of all together: without the first of two, the second still holds all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from flexctrl.linear.model import LinearModel
from flexctrl.linear.parts import with_springs
from flexctrl.linear.pattern import symmetric
from flexctrl.model.balance import Balance
from flexctrl.model.model import Model
from flexctrl.model.rounding import DIGITS, slope_terms
from flexctrl.model.softened import softened
from flexctrl.model.state import State
from flexctrl.model.tangents import tangents

__all__ = ["with_twists"]

_SOFT = 2.0**-100
_DROWNED = 2.0**-20
_DUST = 1e-12


@dataclass(frozen=True, eq=False)
class _Bare:
    """A machine whose shafts are next to nothing, and the stiffness and damping that they had.

    Attributes
    ----------
    model : Model
    state : State
        In which its shafts bear the torques that they bore.
    K, C : scipy.sparse.csr_matrix, shape (n, n)
        Of the free coordinates, without the shafts.
    springs, dampers : scipy.sparse.csr_matrix, shape (n, n)
        What the shafts add.
    """

    model: Model
    state: State
    K: sp.csr_matrix
    C: sp.csr_matrix
    springs: sp.csr_matrix
    dampers: sp.csr_matrix


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
    model = balance.model
    motors = _drowning(linear.K, np.flatnonzero(np.isin(balance.free, model.motion.sources)))
    if model.about or not motors.size:
        return linear
    names = tuple(linear.coordinates[i].removesuffix("_source") for i in motors)
    bare = _bare(linear, balance, state, names)
    W = _basis(bare.springs, motors)
    return _written(linear, bare, W, motors) if _drowned(bare, balance, W, motors) else linear


def _drowning(K: sp.csc_matrix, motors: np.ndarray) -> np.ndarray:
    """Motors of shafts that, together, are nearly all that holds something they drive."""
    own = K.diagonal()
    motors = motors[own[motors] > 0.0]
    borne = _borne(K, motors)
    left = own - borne.sum(axis=0)
    left[motors] = np.inf
    return motors[(borne[:, left < _DROWNED * own] > 0.0).any(axis=1)]


def _borne(K: sp.spmatrix, motors: np.ndarray) -> np.ndarray:
    """What each shaft alone adds to the stiffness of each coordinate, shape (motors, n)."""
    return K.tocsr()[motors].toarray() ** 2 / K.diagonal()[motors, None]


def _bare(linear: LinearModel, balance: Balance, state: State, names: tuple[str, ...]) -> _Bare:
    model, there = softened(balance.model, dict.fromkeys(names, _SOFT)), _twisted(balance.model, state, names)
    _, C, K = tangents(model, there, balance.u)
    if (held := balance.turning(state, balance.whole_force(state))).nnz:
        K = K - held
    C, K = (balance.seen(there, A) for A in (C, K))
    springs, dampers = (linear.K - K).tocsr(), (linear.C - C).tocsr()
    return _Bare(model, there, _without(K, springs), _without(C, dampers), springs, dampers)


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


def _basis(springs: sp.csr_matrix, motors: np.ndarray) -> sp.csc_matrix:
    """What the coordinates move by with twists, and with what takes the motors along."""
    W = sp.lil_matrix(sp.identity(springs.shape[0]))
    for i in motors:
        row = springs[i].tocoo()
        beside = row.col != i
        W[i, row.col[beside]] = -row.data[beside] / springs[i, i]
    return sp.csc_matrix(W)


def _drowned(bare: _Bare, balance: Balance, W: sp.csc_matrix, motors: np.ndarray) -> bool:
    """Whether there is anything beside the shafts that would be lost."""
    terms = DIGITS * balance.seen(bare.state, slope_terms(bare.model, bare.state, balance.u, bare.K))
    led = np.unique(W[motors].tocoo().col)
    led = np.setdiff1d(led, motors)
    own, shafts = np.abs(bare.K.diagonal()), bare.springs.diagonal()
    return bool(((own > np.abs(terms.diagonal())) & (own < _DROWNED * shafts))[led].any())


def _written(linear: LinearModel, bare: _Bare, W: sp.csc_matrix, motors: np.ndarray) -> LinearModel:
    """The model in other coordinates, its shafts on the diagonal of K and C."""
    chosen = np.isin(np.arange(W.shape[0]), motors)
    springs, dampers = (sp.diags(np.where(chosen, A.diagonal(), 0.0)) for A in (bare.springs, bare.dampers))
    K, C = sp.csc_matrix(W.T @ bare.K @ W + springs), sp.csc_matrix(W.T @ bare.C @ W + dampers)
    even = symmetric(linear.K)[1] == 0.0
    names = tuple(
        name.removesuffix("_source") + "_twist" if twists else name
        for name, twists in zip(linear.coordinates, chosen, strict=True)
    )
    written = linear.projected(W, names)
    assert written.place is not None
    place = replace(written.place, model=bare.model, state=bare.state, springs=sp.csc_matrix(springs))
    reach = bare.model.motion.jacobian(bare.model.place(bare.state)) @ place.basis
    parts = bare.model.forces.parts(bare.model.place(bare.state), reach)
    owners = {name.removesuffix("_twist"): int(i) for i, name in enumerate(names) if chosen[i]}
    return replace(
        written,
        K=symmetric(K)[0] if even else K,
        C=C,
        place=place,
        parts=with_springs(parts, owners, springs.diagonal()),
    )
