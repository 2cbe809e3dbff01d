"""Plants whose poles, zeros and margins are known."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from flexctrl.linear.model import LinearModel

G = 9.81


def plant(M, K, B, Cq, C=None, Cv=None, inputs=("force",), outputs=("position",)) -> LinearModel:
    """Wrap dense matrices."""
    M, K, B, Cq = (np.atleast_2d(np.asarray(A, float)) for A in (M, K, B, Cq))
    C = np.zeros_like(K) if C is None else np.atleast_2d(C)
    return LinearModel(
        sp.csc_matrix(M),
        sp.csc_matrix(C),
        sp.csc_matrix(K),
        B,
        Cq,
        np.zeros_like(Cq) if Cv is None else np.atleast_2d(np.asarray(Cv, float)),
        np.zeros((len(Cq), B.shape[1])),
        tuple(f"q{i + 1}" for i in range(len(M))),
        tuple(inputs),
        tuple(outputs),
    )


def crane(trolley: float, load: float, rope: float, drag: float = 0.0) -> LinearModel:
    """(x, sway): trolley force in; trolley position, sway and load position out."""
    M = np.array([[trolley + load, load * rope], [load * rope, load * rope**2]])
    return plant(
        M,
        np.diag([0.0, load * G * rope]),
        [[1.0], [0.0]],
        [[1.0, 0.0], [0.0, 1.0], [1.0, rope]],
        C=np.diag([drag, 0.0]),
        outputs=("trolley", "sway", "load"),
    )


def chain(masses: int, stiffness: float = 1.0, beta: float = 0.0, ground: float = 1.0) -> LinearModel:
    """Masses of 1 kg in a row, the first tied to the ground; force on the first, every position out."""
    K = 2 * np.eye(masses) - np.eye(masses, k=1) - np.eye(masses, k=-1)
    K[-1, -1], K[0, 0] = 1.0, 1.0 + ground
    K *= stiffness
    return plant(
        np.eye(masses),
        K,
        np.eye(masses)[:, :1],
        np.eye(masses),
        C=beta * K,
        outputs=tuple(f"x{i + 1}" for i in range(masses)),
    )


def cantilever(elements: int, beta: float = 0.0) -> LinearModel:
    """Hermite beam, EI = rhoA = L = 1; tip force in; deflection at the tip, the middle and a fifth out."""
    h, n = 1.0 / elements, 2 * (elements + 1)
    k = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]]) / h**3
    m = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]) * h / 420.0
    size = np.array([1, h, 1, h])
    K, M = np.zeros((n, n)), np.zeros((n, n))
    for e in range(elements):
        at = slice(2 * e, 2 * e + 4)
        K[at, at] += size[:, None] * k * size
        M[at, at] += size[:, None] * m * size
    K, M, unit = K[2:, 2:], M[2:, 2:], np.eye(n - 2)
    seen = [n - 4, 2 * (elements // 2) - 2, 2 * (elements // 5) - 2]
    return plant(M, K, unit[:, [n - 4]], unit[seen], C=beta * K, outputs=("tip", "middle", "fifth"))


def constrained_frequencies(linear: LinearModel, coordinate: int) -> np.ndarray:
    """Frequencies with one coordinate held: the zeros of a force and position both there."""
    import scipy.linalg as la

    keep = np.delete(np.arange(len(linear.coordinates)), coordinate)
    K, M = (A.toarray()[np.ix_(keep, keep)] for A in (linear.K, linear.M))
    return np.sort(np.sqrt(1.0 / la.eigh(M, K, eigvals_only=True)))
