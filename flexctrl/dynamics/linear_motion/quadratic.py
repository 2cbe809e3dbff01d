"""Integrals of quadratic forms along the motion of linear equations: exact energy books of their inputs."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from flexctrl.dynamics.linear_motion.modal_equations import ModalEquations
from flexctrl.dynamics.linear_motion.propagator import response
from flexctrl.model.plant import Plant

__all__ = ["Turnover"]

_RESOLVED = 0.5
_KEPT = 16


@dataclass(eq=False)
class Turnover:
    """Work of the inputs and losses over a step: zᵀ G(h) z, z = (x, w, h ẇ, h² ẅ, h³ w⃛) at its start, ż = Â z.

    G(h) = ∫ e^(Âᵀ t) Q e^(Â t) dt by Gauss's rule over a time that resolves every mode, and from there by doubling,
    G(2 t) = G(t) + e^(Âᵀ t) G(t) e^(Â t): as exact as the motion, however many periods a step holds.

    Attributes
    ----------
    model : Plant
    equations : ModalEquations
    """

    model: Plant
    equations: ModalEquations
    _kept: dict[tuple[float, int], tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)

    def over(self, x: np.ndarray, course: np.ndarray, h: float) -> tuple[float, float]:
        """Return work and losses over a step.

        Parameters
        ----------
        x : numpy.ndarray
            State at its start.
        course : numpy.ndarray, shape (4, inputs)
            Inputs: powers of the share of the step done.
        h : float
            Its length [s].
        """
        rows = len(course) if course[1:].any() else 1
        rates = np.array([math.factorial(k) for k in range(rows)])[:, None] * course[:rows]
        z = np.append(x, rates.ravel())
        work, lost = (float(z @ G @ z) for G in self.forms(h, rows))
        return work, lost

    def forms(self, h: float, rows: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """Return work and losses over a step as quadratic forms of (x, w, h ẇ, …) at its start.

        Parameters
        ----------
        h : float
            Its length [s].
        rows : int
            1 for inputs that are held, 4 for cubic ones.
        """
        key = float(f"{h:.12e}"), rows  # steps to samples differ by round-off
        found = self._kept.get(key)
        if found is None:
            if len(self._kept) >= _KEPT:
                self._kept.clear()
            found = self._kept[key] = self._doubled(*key)
        return found

    def _powers(self) -> tuple[np.ndarray, np.ndarray]:
        """Powers of the inputs and of what dampens, as forms of (x, w)."""
        model, e, n = self.model, self.equations, self.model.n
        still, none = np.zeros(n), np.zeros(len(model.inputs))
        damping = -model.slope(model.rest, still, still, (0.0, 1.0, 0.0), none)
        rates = np.hstack([e.first.C[n:], e.first.D[n:]])
        loads = np.array([model.loads(model.rest, unit) for unit in np.eye(len(none))]).reshape(-1, n).T
        work = rates.T @ (loads @ np.hstack([e.gain, e.direct]))
        lost = rates.T @ (damping @ rates)
        return 0.5 * (work + work.T), 0.5 * (lost + lost.T)

    def _doubled(self, h: float, rows: int) -> tuple[np.ndarray, np.ndarray]:
        first = self.equations.first
        fastest = max((float(np.abs(np.linalg.eigvals(first.A[b, b])).max()) for b in first.blocks), default=0.0)
        doublings = max(0, math.ceil(math.log2(max(h * fastest / _RESOLVED, 1.0))))
        tau, beyond = h / 2**doublings, (rows - 1) * first.B.shape[1]
        forms = [np.pad(form, (0, beyond)) for form in self._powers()]
        sums = [np.zeros_like(form) for form in forms]
        for share, weight in zip(*np.polynomial.legendre.leggauss(6), strict=True):
            step = self._transition(0.5 * (1.0 + share) * tau, h, rows)
            sums = [G + 0.5 * tau * weight * _turned(step, form) for G, form in zip(sums, forms, strict=True)]
        for k in range(doublings):
            step = self._transition(tau * 2**k, h, rows)
            sums = [G + _turned(step, G) for G in sums]
        return sums[0], sums[1]

    def _transition(self, t: float, h: float, rows: int) -> sp.csr_matrix:
        """Over a time t, of a step of h over which inputs are polynomials."""
        E, powers = response(self.equations.first, t, t)
        taylor = [(t / h) ** k / math.factorial(k) for k in range(rows)]
        eye = sp.identity(powers.shape[2])
        felt = sp.csr_matrix(np.hstack([share * held for share, held in zip(taylor, powers, strict=False)]))
        chain = [[taylor[k - j] * eye if k >= j else None for k in range(rows)] for j in range(rows)]
        return sp.bmat([[E, felt], [None, sp.bmat(chain)]], format="csr")


def _turned(step: sp.csr_matrix, form: np.ndarray) -> np.ndarray:
    return np.asarray(step.T @ (step.T @ form.T).T)
