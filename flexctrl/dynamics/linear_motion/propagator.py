"""Linear equations over a step: exponentials, and the response to inputs that are polynomials in time."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import factorial

import numpy as np
import scipy.sparse as sp

from flexctrl.linear.statespace import FirstOrder

__all__ = ["NODES", "Propagator", "response"]

_ROOT = 5.0**0.5
NODES = np.array([0.0, 0.5 - 0.1 * _ROOT, 0.5 + 0.1 * _ROOT, 1.0])
"""Lobatto's points of a step."""

_POWERS = len(NODES)


@dataclass(eq=False)
class Propagator:
    """e^(A t) and ∫ e^(A (t − s)) B (s/h)^k ds of one system, kept for the few steps that turn up.

    Attributes
    ----------
    first : FirstOrder
    """

    first: FirstOrder
    _kept: dict[tuple[float, float], tuple[sp.csr_matrix, np.ndarray]] = field(default_factory=dict)

    def over(self, t: float, h: float) -> tuple[sp.csr_matrix, np.ndarray]:
        """Return the transition over a time t, and the responses to (s/h)^k, k = 0 … 3, shape (4, n, inputs)."""
        t, h = float(f"{t:.12e}"), float(f"{h:.12e}")  # steps to samples differ by round-off
        found = self._kept.get((t, h))
        if found is None:
            if len(self._kept) > 64:
                self._kept.clear()
            found = self._kept[t, h] = response(self.first, t, h)
        return found


def response(first: FirstOrder, t: float, h: float) -> tuple[sp.csr_matrix, np.ndarray]:
    """Return the transition over a time t, and the responses to (s/h)^k, k = 0 … 3, block by block."""
    n, m = first.B.shape
    powers = np.zeros((_POWERS, n, m))
    parts = []
    pairs = [b for b in first.blocks if b.stop - b.start == 2]
    together = len(pairs) > 1 and not any(first.B[b.start].any() for b in pairs)
    if together:
        starts = np.array([b.start for b in pairs])
        A = np.array([first.A[b, b] for b in pairs])
        unit = np.tile([[0.0], [1.0]], (len(pairs), 1, 1))
        E, shapes = _chain(A, unit, t, h)
        for k in range(_POWERS):
            powers[k, starts] = shapes[k][:, 0] * first.B[starts + 1]
            powers[k, starts + 1] = shapes[k][:, 1] * first.B[starts + 1]
        solved = dict(zip(starts.tolist(), E, strict=True))
    for block in first.blocks:
        if together and block.start in solved:
            parts.append(solved[block.start])
            continue
        E, shapes = _chain(first.A[block, block][None], first.B[block][None], t, h)
        parts.append(E[0])
        for k in range(_POWERS):
            powers[k, block] = shapes[k][0]
    return sp.csr_matrix(sp.block_diag(parts)) if parts else sp.csr_matrix((0, 0)), powers


def _chain(A: np.ndarray, B: np.ndarray, t: float, h: float) -> tuple[np.ndarray, list[np.ndarray]]:
    """Exponentials of many systems with a chain of integrators before the inputs (Van Loan 1978)."""
    from scipy.linalg import expm

    count, n, m = B.shape
    whole = np.zeros((count, n + _POWERS * m, n + _POWERS * m))
    whole[:, :n, :n], whole[:, :n, n : n + m] = A * t, B * t
    for k in range(_POWERS - 1):
        rows, columns = slice(n + k * m, n + (k + 1) * m), slice(n + (k + 1) * m, n + (k + 2) * m)
        whole[:, rows, columns] = np.eye(m)
    E = expm(whole)
    share = t / h
    shapes = [factorial(k) * share**k * E[:, :n, n + k * m : n + (k + 1) * m] for k in range(_POWERS)]
    return E[:, :n, :n], shapes
