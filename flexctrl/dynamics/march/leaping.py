"""Exact steps of linear equations in compiled loops: one product with a matrix a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexctrl.dynamics.march.record import DONE, WANTS_TANGENT, Leap, March
from flexctrl.dynamics.modal_equations import ModalEquations
from flexctrl.dynamics.propagator import Propagator
from flexctrl.dynamics.quadratic import Turnover
from flexctrl.kernels.eights import Eight, eight, put, total
from flexctrl.kernels.native import Reals
from flexctrl.model.flat.layout import Flattened

__all__ = ["Tables", "fill", "leap", "leap_of"]

_ALIKE = 1e-9
_NOTHING = 1e-150
"""Below this a modal state is zero: processors are slow with the smallest numbers there are."""


@dataclass(frozen=True, eq=False)
class Tables:
    """What steps of one length need.

    Attributes
    ----------
    h : float
        [s]
    transition : numpy.ndarray, shape (modes, size)
        To the modal state at the end, from that at the start, the inputs and 1.
    losses : numpy.ndarray, shape (size, size)
        The energy dissipated, a quadratic form in these.
    """

    h: float
    transition: np.ndarray
    losses: np.ndarray

    @classmethod
    def of(cls, h: float, propagator: Propagator, turnover: Turnover) -> Tables:
        """Work them out."""
        return cls(h, _over(propagator, h, h), turnover.forms(h)[1])


def _over(propagator: Propagator, t: float, h: float) -> np.ndarray:
    transition, powers = propagator.over(t, h)
    return np.hstack([transition.toarray(), powers[0]])


def leap_of(F: Flattened, equations: ModalEquations) -> Leap:
    """Return the leaps of a model, ready for tables."""
    first, n, padded = equations.first, F.flat.n, F.flat.padded
    modes, size = len(first.A), sum(first.B.shape)
    wide = -(-size // 8) * 8
    both = np.hstack([first.C, first.D])
    places, rates = np.zeros((2, size, padded))
    for j in range(size):
        places[j], rates[j] = F.ordered(both[:n, j]), F.ordered(both[n:, j])
    return Leap(
        modes=modes,
        size=size,
        wide=wide,
        transition=np.zeros(size * wide),
        state=np.zeros(wide),
        after=np.zeros(wide),
        places=places.ravel(),
        rates=rates.ravel(),
        losses=np.zeros(size * wide),
    )


def fill(leap: Leap, tables: Tables) -> None:
    """Put tables where loops read them."""
    leap.transition.reshape(leap.size, leap.wide)[:, : leap.modes] = tables.transition.T
    leap.losses.reshape(leap.size, leap.wide)[:, : leap.size] = tables.losses


def leap(m: March) -> int:
    """Take a step, or ask for its tables."""
    f = m.flat
    e = m.leap
    if abs(m.h - e.h) > _ALIKE * m.h:
        return WANTS_TANGENT
    for k in range(e.modes, e.size - 1):
        e.state[k] = f.u[k - e.modes]
    e.state[e.size - 1] = 1.0
    if m.losing == 1:
        m.lost += lost(m)
    for i in range(0, e.wide, 8):
        put(e.after[i:], weighed_sum(e.size, e.wide, e.state, e.transition[i:]))
    for i in range(e.modes):
        e.state[i] = e.after[i] if abs(e.after[i]) > _NOTHING else 0.0
    for i in range(0, f.padded, 8):
        put(f.step[i:], weighed_sum(e.size, f.padded, e.state, e.places[i:]) - eight(f.q[i:]))
        put(f.v[i:], weighed_sum(e.size, f.padded, e.state, e.rates[i:]))
    return DONE


def weighed_sum(count: int, stride: int, weights: Reals, rows: Reals) -> Eight:
    """Return the sum of rows with weights, eight entries of it."""
    sums = 0.0 * eight(rows)
    for j in range(count):
        sums = sums + weights[j] * eight(rows[stride * j :])
    return sums


def lost(m: March) -> float:
    """Return the energy dissipated over the step that is about to be taken."""
    e = m.leap
    sums = 0.0 * eight(e.state)
    for i in range(0, e.wide, 8):
        sums = sums + eight(e.state[i:]) * weighed_sum(e.size, e.wide, e.state, e.losses[i:])
    return total(sums)
