"""Responses of models whose damping is proportional but for a few dashpots.

With C = α M + β K + L Lᵀ, L of few columns, and G(s) the response of the model without L, a sum over undamped modes,

    H = G_cb − s G_cl (1 + s G_ll)⁻¹ G_lb

(M. A. Woodbury, Memorandum 42, Statistical Research Group, Princeton, 1950). G is passive: with s in the right half
plane or on the axis, the Hermitian part of 1 + s G_ll is at least 1, and elimination needs no exchange of rows.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexctrl.errors import LinearizationError
from flexctrl.frozen import frozen
from flexctrl.linear.modal import ModalSystem
from flexctrl.linear.modal_sum import ModalSum
from flexctrl.linear.model import LinearModel

__all__ = ["Dashpots", "dashpots_of"]

MOST = 6
TOUCHED = 24
ROUNDING = 1e-13
BLIND = 1e-14
TRUSTED = 1e4
NEAREST = 1e-10
FAINTEST = 1e-6
FEW = 100
EPS = float(np.finfo(float).eps)

Response = Callable[[np.ndarray], np.ndarray]


@frozen(eq=False)
class Dashpots:
    """Φᵀ C Φ = diag(damping) + pull pullᵀ.

    Attributes
    ----------
    system : ModalSystem
    damping : numpy.ndarray, shape (k,)
        α + β ω².
    pull : numpy.ndarray, shape (k, r)
        Φᵀ L.
    """

    system: ModalSystem
    damping: np.ndarray
    pull: np.ndarray

    def transfer(self, plain: Callable[[], Response], fine: Response | None) -> Response:
        """H(s).

        Parameters
        ----------
        plain : callable
            Makes another evaluator, for poles of G.
        fine : callable, optional
            One that refines, for where what is left is little beside what was taken away, as next to poles of G.

        Returns
        -------
        callable
            s of shape (N,) to H of shape (n_outputs, n_inputs, N).
        """
        modes, pull = self.system.modes, self.pull
        p, m, r = len(modes.outputs), len(modes.inputs), pull.shape[1]
        left = np.vstack([modes.output_gain, pull.T])
        rate = np.vstack([modes.output_rate_gain, np.zeros_like(pull.T)])
        right = np.hstack([modes.input_gain, pull])
        still, moving = ((rows.T[:, :, None] * right[:, None, :]).reshape(len(modes), -1) for rows in (left, rate))
        series = ModalSum(modes.omega_squared, self.damping, modes.omega, modes.growth**2, still, moving)
        direct = self.system.feedthrough[:, :, None]

        def evaluate(s: np.ndarray) -> np.ndarray:
            s = np.asarray(s, dtype=complex)
            try:
                G = np.ascontiguousarray(series(s).T).reshape(p + r, m + r, s.size)
            except LinearizationError:
                return _one_by_one(s, plain(), fine or plain())
            free, taken = G[:p, :m], _through(G[p:, m:], G[p:, :m], G[:p, m:], s)
            H = free - taken
            faint = (np.abs(free) + np.abs(taken) > TRUSTED * np.abs(H)).any(axis=(0, 1))
            H = H + direct
            if faint.any():
                H[..., faint] = (fine or plain())(s[faint])
            return H

        return evaluate

    def state(self, s: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """Loads ↦ displacements, both of shape (n, m, N), for s of shape (N,); rough next to poles of G."""
        modes, pull = self.system.modes, self.pull
        r, N = pull.shape[1], s.size
        below = (modes.omega_squared + self.damping * s[:, None]).T + s * s
        least = NEAREST * np.maximum(np.abs(s * s), 1e-300)
        alone = 1.0 / np.where(np.abs(below) < least, least, below)
        G = ((pull[:, :, None] * pull[:, None, :]).reshape(-1, r * r).T @ alone).reshape(r, r, N)

        def solve(loads: np.ndarray) -> np.ndarray:
            n, m, _ = loads.shape
            q = (modes.shapes.T @ loads.reshape(n, m * N)).reshape(-1, m, N) * alone[:, None]
            push = s * _divided(G, (pull.T @ q.reshape(-1, m * N)).reshape(r, m, N), s)
            q -= (pull @ push.reshape(r, m * N)).reshape(-1, m, N) * alone[:, None]
            return np.asarray((modes.shapes @ q.reshape(-1, m * N)).reshape(n, m, N))

        return solve


def dashpots_of(linear: LinearModel, system: ModalSystem) -> Dashpots | None:
    """What of a model's damping is not proportional, if that is some dashpots.

    Parameters
    ----------
    linear : LinearModel
    system : ModalSystem
        Of the same model.

    Returns
    -------
    Dashpots or None
        None for massless freedoms, loads that follow, damping that is not symmetric or gives energy, or many dashpots.
    """
    base, modes = linear._scaled, system.modes
    if base.massless.every.shape[1] or system.circulatory.any():
        return None
    shared, C = base.proportional, base.matched[1]
    left = np.flatnonzero(shared.rest)
    columns = np.repeat(np.arange(len(modes.shapes)), np.diff(C.indptr))[left]
    rows = C.indices[left]
    marked = np.zeros(len(modes.shapes), dtype=bool)
    marked[rows] = marked[columns] = True
    touched = np.flatnonzero(marked)
    if not 0 < touched.size <= TOUCHED:
        return None
    block = np.zeros((touched.size, touched.size))
    block[np.searchsorted(touched, rows), np.searchsorted(touched, columns)] = shared.rest[left]
    root = _root(block, float(np.abs(C.data).max()))
    if root is None:
        return None
    shapes = modes.shapes[touched] / base.scales[touched, None]
    pull = shapes.T @ root
    pull[np.abs(pull) <= BLIND * (np.abs(shapes.T) @ np.abs(root))] = 0.0
    return Dashpots(system, shared.alpha + shared.beta * modes.omega_squared, pull)


def _root(block: np.ndarray, most: float) -> np.ndarray | None:
    """L of L Lᵀ = a small matrix, a rest of numbers as large as `most`; None if there is none to nine digits."""
    noise = ROUNDING * np.abs(block).max() + EPS * len(block) * most
    if np.abs(block - block.T).max() > noise:
        return None
    values, vectors = np.linalg.eigh(0.5 * (block + block.T))
    kept = np.abs(values) > 4.0 * noise
    if (values[kept] < FAINTEST * most).any() or not 0 < np.count_nonzero(kept) <= MOST:
        return None
    return np.asarray(vectors[:, kept] * np.sqrt(values[kept]))


def _one_by_one(s: np.ndarray, plain: Response, fine: Response) -> np.ndarray:
    """H(s) where some s are poles of G; the response at s = 0 may be infinite indeed."""
    still = s == 0.0
    if still.all():
        return plain(s)
    H = fine(s[~still])
    return np.insert(H, np.flatnonzero(still) - np.arange(np.count_nonzero(still)), plain(s[still]), axis=-1)


def _through(G: np.ndarray, inward: np.ndarray, outward: np.ndarray, s: np.ndarray) -> np.ndarray:
    """s G_cl (1 + s G_ll)⁻¹ G_lb; the last axes are along s."""
    push = s * _divided(G, inward, s)
    return np.asarray((outward[:, :, None] * push[None]).sum(axis=1))


def _divided(G: np.ndarray, rhs: np.ndarray, s: np.ndarray) -> np.ndarray:
    """(1 + s G)⁻¹ rhs for G of shape (r, r, N), rhs of shape (r, m, N)."""
    r = len(G)
    A = s * G
    A[range(r), range(r)] += 1.0
    if s.size < FEW:
        return np.linalg.solve(A.transpose(2, 0, 1), rhs.transpose(2, 0, 1)).transpose(1, 2, 0)
    x = rhs.copy()
    for i in range(r):
        for j in range(i + 1, r):
            share = A[j, i] / A[i, i]
            A[j, i + 1 :] -= share * A[i, i + 1 :]
            x[j] -= share * x[i]
    for i in range(r - 1, -1, -1):
        for j in range(i + 1, r):
            x[i] -= A[i, j] * x[j]
        x[i] /= A[i, i]
    return x
