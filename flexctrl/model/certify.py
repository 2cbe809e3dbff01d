"""What a linear model must show before it is let out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, onenormest, splu

from flexctrl.errors import LinearizationError
from flexctrl.linear.certificate import Certificate
from flexctrl.linear.eigen import RIGID_NOISE, stiffness_noise
from flexctrl.linear.model import LinearModel
from flexctrl.linear.modes import Modes
from flexctrl.linear.pattern import symmetric
from flexctrl.linear.pencil import EPS
from flexctrl.linear.undamped import EXTENDED_EPS, LOST, UNSEEN, UNSURE, unseen
from flexctrl.model.motion import Motion
from flexctrl.model.rounding import stress_noise
from flexctrl.model.state import State

_ASYMMETRY = 1e-6
_SLOPE = 1.9
_ROUND_OFF = 1e-12
_LOWEST = 20
_VANISHING, _CAUTION = (1e-12, 3e-13), 100.0


def taylor_slope(force: Callable[[np.ndarray], np.ndarray], K: sp.spmatrix, scale: np.ndarray) -> float:
    """Return the slope of the Taylor remainder of a force along a fixed, mixed direction, to and fro.

    Both signs are tried, and the larger remainder counts: where the force has a corner, one of the two sides is
    wrong in the first order whatever K is.

    Parameters
    ----------
    force : callable
        Displacement (n,) ↦ force (n,); zero at zero.
    K : scipy.sparse matrix, shape (n, n)
        Minus the derivative of the force at zero.
    scale : numpy.ndarray, shape (n,)
        What counts as a displacement of one: metres for displacements, 1 for rotations.

    Returns
    -------
    float
        Infinite where the remainder never rises above round-off.
    """
    direction = scale * np.random.default_rng(0).uniform(0.5, 1.0, scale.size) * np.resize([1.0, -1.0, 1.0], scale.size)
    energy = np.abs(scale) * np.asarray(abs(K) @ np.abs(scale)).ravel()
    weight = np.abs(scale) / max(float(energy.max(initial=0.0)), 1e-300)
    push = K @ direction

    def left(size: float) -> float:
        sides = (force(e * direction) + e * push for e in (size, -size))
        return max(float(np.abs(side * weight).max(initial=0.0)) for side in sides)

    sizes = 10.0 ** np.arange(-1.5, -12.25, -0.5)
    rest = [left(size) for size in sizes]
    noise = max(np.finfo(float).eps, _CAUTION * max(map(left, _VANISHING)))
    clear = np.flatnonzero(np.array(rest[:-1]) > 30.0 * noise)
    if not clear.size:
        return np.inf
    last = int(clear[-1])
    # a kink farther away than the smallest displacements shows as a sudden fall: the derivative is right
    fall = np.log(rest[last]) - np.log(max(rest[last + 1], noise))
    return float(fall / (np.log(sizes[last]) - np.log(sizes[last + 1])))


def certify(
    linear: LinearModel,
    residual: float,
    asymmetry: float,
    slope: float,
    loads: tuple[str, ...],
    motion: Motion,
    state: State,
) -> Certificate:
    """Return the certificate of a linear model.

    Raises
    ------
    LinearizationError
        If a point of it fails: says which and what to do.
    """
    definiteness = _smallest_pivot(linear.M)
    if asymmetry > _ASYMMETRY and not loads:
        raise LinearizationError(
            f"linearize: K is not symmetric ({asymmetry:.1e} of its largest entry) though every load has a potential: "
            "an effect whose force is not the gradient of its energy"
        )
    if definiteness < -1e-10:
        raise LinearizationError(f"linearize: M is not positive (pivot {definiteness:.1e} after scaling)")
    if slope < _SLOPE:
        raise LinearizationError(
            f"linearize: the forces have no derivative here (Taylor slope {slope:.2f}, 2 expected): on one side of "
            "this place they are others than on the other. Linearise beside it; if what is next to such a corner is a "
            "taut line so stiff that its load hardly stretches it, as the last element of a rope whose end hangs free, "
            "make that softer, or rigid"
        )
    even, gap = symmetric(linear.K)
    linear = linear if gap == 0.0 else replace(linear, K=even)
    modes = linear.modes(min(linear.M.shape[0], _LOWEST))
    return Certificate(
        residual,
        asymmetry,
        definiteness,
        slope,
        rigid_modes(linear, modes, motion, state),
        _condition(linear.M),
        _condition(linear.K),
        loads,
        _skew_share(linear.C),
        _frequency_error(linear, modes),
    )


def _frequency_error(linear: LinearModel, modes: Modes) -> float:
    """The bound of the lowest frequencies' relative error; refuses what rounding of K or of places has swallowed."""
    noise, values = stiffness_noise(linear.K, modes.shapes), np.abs(modes.omega_squared)
    errors = _relative(noise, values)
    errors = np.where(errors > UNSURE, errors * EXTENDED_EPS / EPS, errors)
    stress = np.zeros_like(noise) if linear.place is None else stress_noise(linear.place, modes.shapes)
    noise, whole = np.maximum(noise, stress), errors + _relative(stress, values)
    hangs, slight = linear.place is not None and linear.place.pull > 0.0, unseen(linear, values)
    hidden = (values == 0.0) & (RIGID_NOISE * noise > slight) & hangs
    # near a critical load what is left is as little as one likes: it is lost if other motions do not dwarf its doubt
    first = float(values.min(initial=np.inf, where=(values > 0.0) & (whole <= LOST)))
    lost = hidden | (errors > LOST) | ((whole > LOST) & (stress > min(slight, UNSEEN * first)))
    if lost.any():
        i = int(np.argmax(lost))
        raise LinearizationError(
            f"linearize: the stiffness of the softest motions is lost in the rounding of the stiffest entries of K "
            f"({abs(linear.K).max():.1e}): the motion of {modes.dominant_coordinate(i)} shows "
            f"{modes.omega_squared[i]:.3g} (rad/s)², give or take {RIGID_NOISE * noise[i]:.1e}. "
            "Use fewer elements, or a rigid part in place of the stiffest one"
        )
    return float(whole.max(initial=0.0))


def _relative(noise: np.ndarray, values: np.ndarray) -> np.ndarray:
    """What noise in ω² is in ω, as a share of it; 0 for what is 0."""
    return np.divide(noise, 2.0 * values, out=np.zeros_like(noise), where=values > 0.0)


def _skew_share(C: sp.csc_matrix) -> float:
    largest = float(abs(C).max()) if C.nnz else 0.0
    share = float(abs(C - C.T).max()) / (2.0 * largest) if largest else 0.0
    return share if share > _ROUND_OFF else 0.0


def _scaled(A: sp.spmatrix) -> sp.csc_matrix:
    d = np.sqrt(np.abs(A.diagonal()))
    inverse = sp.diags(1.0 / np.where(d > 0.0, d, 1.0))
    return (inverse @ A @ inverse).tocsc()


def _smallest_pivot(M: sp.csc_matrix) -> float:
    kept = np.flatnonzero(M.diagonal() > 0.0)
    if not kept.size:
        return 0.0
    scaled = _scaled(M[kept][:, kept]) + 1e-14 * sp.identity(kept.size, format="csc")
    try:
        lu = splu(scaled, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:
        return 0.0
    return float(lu.U.diagonal().min())


def _condition(A: sp.csc_matrix) -> float:
    scaled = _scaled(A)
    try:
        lu = splu(scaled)
    except RuntimeError:
        return np.inf
    inverse = LinearOperator(A.shape, matvec=lu.solve, rmatvec=lambda b: lu.solve(b, trans="T"))
    norm = onenormest(inverse) if A.shape[0] > 1 else 1.0 / abs(scaled[0, 0])
    condition = float(abs(scaled).sum(axis=0).max() * norm)
    return condition if condition < 1e15 else np.inf


def rigid_modes(linear: LinearModel, modes: Modes, motion: Motion, state: State) -> tuple[str, ...]:
    """Say in words which motions have no stiffness: of the whole machine first, then of what is left."""
    if not modes.rigid:
        return ()
    shapes = modes.shapes[:, modes.unstable : modes.unstable + modes.rigid]
    left = shapes
    words = []
    for name, vector in whole_body(_jacobian(linear, motion, state), motion, state):
        momentum = linear.M @ vector
        size = float(np.sqrt(max(vector @ momentum, 0.0)))
        share = shapes.T @ momentum / (size or 1.0)
        if size > 0.0 and share @ share > 1.0 - 1e-6:
            words.append(name)
            left = _without(left, left.T @ momentum / size)
    for i in range(left.shape[1]):
        largest = np.argsort(-np.abs(left[:, i]))[:2]
        words.append("motion of " + ", ".join(linear.coordinates[k] for k in largest if abs(left[k, i]) > 0.0))
    return tuple(words)


def _without(shapes: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Take one direction, given by its shares, out of an orthonormal set."""
    if np.linalg.norm(share) < 1e-6 or not shapes.shape[1]:
        return shapes
    q, _ = np.linalg.qr(np.column_stack([share, np.eye(share.size)]))
    return shapes @ q[:, 1 : share.size]


def _jacobian(linear: LinearModel, motion: Motion, state: State) -> sp.csr_matrix:
    """Raw motion with the coordinates of a linear model."""
    assert linear.place is not None
    return sp.csr_matrix(motion.jacobian(state) @ linear.place.basis)


def whole_body(T: sp.csr_matrix, motion: Motion, state: State) -> list[tuple[str, np.ndarray]]:
    """Return displacements of coordinates in which the whole machine moves as one, with their names.

    Parameters
    ----------
    T : scipy.sparse.csr_matrix, shape (raw, k)
        Raw motion with the coordinates.
    motion : Motion
    state : State

    Returns
    -------
    list of tuple of str and numpy.ndarray, shape (k,)
    """
    x = state.x[:-1]
    center = x.mean(axis=0)
    found = []
    for axis in range(3):
        e = np.eye(3)[axis]
        found.append((f"translation along {'xyz'[axis]}", np.hstack([np.tile(e, (len(x), 1)), np.zeros_like(x)])))
    for axis in range(3):
        e = np.eye(3)[axis]
        turned = np.hstack([np.cross(e, x - center), np.tile(e, (len(x), 1))])
        found.append((f"rotation about {'xyz'[axis]}", turned))
    projected = []
    nodes = T[: 6 * len(x)]
    elsewhere = np.isin(np.arange(len(x)), motion.gauges)
    weights = nodes.T @ nodes + 1e-12 * sp.identity(T.shape[1])
    solve = splu(weights.tocsc()).solve
    for name, everywhere in found:
        field = np.where(elsewhere[:, None], 0.0, everywhere)
        vector = solve(nodes.T @ field.ravel())
        if np.abs(nodes @ vector - _reachable(nodes, field)).max() < 1e-6 * np.abs(field).max():
            projected.append((name, vector))
    return projected


def _reachable(nodes: sp.spmatrix, field: np.ndarray) -> np.ndarray:
    """The displacement field where some degree of freedom moves the cell; held cells stay."""
    moves = np.asarray(abs(nodes).sum(axis=1)).ravel() > 0.0
    return np.where(moves, field.ravel(), 0.0)
