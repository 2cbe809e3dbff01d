"""Evaluate H(s) = D + (Cq + s Cv) (s² M + s C + K)⁻¹ B at many s, by the cheapest accurate route."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexctrl.errors import LinearizationError
from flexctrl.linear.condense import Scaled, scaled
from flexctrl.linear.direct import direct_transfer
from flexctrl.linear.free_motion import with_free_motion_apart
from flexctrl.linear.modal import ModalSystem, rayleigh
from flexctrl.linear.modal_sum import divided, modal_sum, outer
from flexctrl.linear.model import LinearModel
from flexctrl.linear.modes import Modes
from flexctrl.linear.pencil import Pencil
from flexctrl.linear.sampled import sampled_transfer
from flexctrl.linear.undamped import COMPLETE, DEFAULT_COUNT, modes_of

__all__ = ["Transfer", "direct_transfer", "modal_transfer", "residual_transfer", "routed", "transfer"]

Transfer = Callable[[np.ndarray], np.ndarray]
"""s, shape (N,), 1/s ↦ H, shape (n_outputs, n_inputs, N)."""

MOST_MODES = 400
MOST_COUPLED = 150
FURTHER = 1.5
UNSYMMETRIC = 1e-9
COUPLED = 250


def transfer(linear: LinearModel, top: float) -> Transfer:
    """The evaluator that suits the model.

    Up to 1000 freedoms with classical damping: poles and residues of all modes. Up to 250 with a few dashpots beside
    it: a correction of low rank to that sum; with other damping that couples the modes: their eigenvectors or a Schur
    form. Larger ones with Rayleigh or no damping: the modes up to twice `top`, and the others by a power series that
    converges at least as 4⁻ʲ. With any other damping: a projection whose error is estimated at each s. With follower
    loads, or hundreds of modes below `top`: one sparse factorisation for each s.

    Parameters
    ----------
    linear : LinearModel
    top : float
        Largest |s| that will be asked for, rad/s.

    Returns
    -------
    callable
        s of shape (N,) to H of shape (n_outputs, n_inputs, N).
    """
    return routed(linear, top)[0]


def routed(linear: LinearModel, top: float) -> tuple[Transfer, bool]:
    """As :func:`transfer`, and whether many points are cheap.

    Parameters
    ----------
    linear : LinearModel
    top : float
        Largest |s|, rad/s.

    Returns
    -------
    evaluator : callable
    cheap : bool
    """
    base = scaled(linear)
    if len(linear.coordinates) <= COMPLETE:
        system = linear._modal
        if system.classical:
            return modal_transfer(system), True
        if len(system.modes) <= COUPLED:
            return linear._coupled, True
    fit = rayleigh(base)
    reach, most = (FURTHER, MOST_COUPLED) if fit is None else (2.0, MOST_MODES)
    count = _modes_below(base, (reach * top) ** 2)
    if base.stiffness[1] > UNSYMMETRIC:
        return direct_transfer(base), False
    if count > most:
        return direct_transfer(with_free_motion_apart(base, modes_of(linear, base, DEFAULT_COUNT))[0]), False
    if fit is None:
        modes = modes_of(linear, base, max(count + 2, DEFAULT_COUNT))
        return sampled_transfer(*with_free_motion_apart(base, modes), top), True
    return residual_transfer(base, modes_of(linear, base, count + 2), fit, top), False


def modal_transfer(system: ModalSystem) -> Transfer:
    """Sum over poles and residues of a classically damped model.

    Parameters
    ----------
    system : ModalSystem
        Classical.

    Returns
    -------
    callable
    """
    modes, relax = system.modes, system.relaxation
    series = modal_sum(modes, np.diag(system.damping))
    still = outer(relax.output, relax.input)
    moving = outer(relax.output_rate, relax.input)
    shape = system.feedthrough.shape

    def evaluate(s: np.ndarray) -> np.ndarray:
        s = np.asarray(s, dtype=complex)
        flat = series(s)
        if relax.rates.size:
            flat += divided(still, moving, s, s[:, None] + relax.rates, "a creeping freedom")
        H = flat.T.reshape(*shape, s.size)
        return H + system.feedthrough[:, :, None] + system.jump[:, :, None] * s

    return evaluate


def residual_transfer(base: Scaled, modes: Modes, fit: tuple[float, float], top: float) -> Transfer:
    """Some modes, and the rest of a Rayleigh-damped model as a power series.

    With C = α M + β K, s² M + s C + K = (1 + β s)(K - μ M), μ = -(s² + α s)/(1 + β s). Deflated by the modes
    kept, (K - μ M)⁻¹ B = Σ (μ - σ)ʲ x_j with x_j = (K - σ M)⁻¹ M x_(j-1), converging as (|μ - σ|/λ_next)ʲ.

    Parameters
    ----------
    base : Scaled
    modes : Modes
        The lowest of the same model, past twice `top`.
    fit : tuple of two floats
        α and β.
    top : float
        Largest |s|, rad/s.

    Returns
    -------
    callable
    """
    alpha, beta = fit
    model, phi = base.model, modes.shapes / base.scales[:, None]
    series = modal_sum(modes, alpha + beta * modes.omega_squared)
    sigma = -max(0.01 * top**2, 1e-3 * float(np.abs(modes.omega_squared).max(initial=1.0)))
    pencil = Pencil(model.K, model.M).at(sigma)
    MPhi = model.M @ phi
    x = pencil.solve(model.B - MPhi @ (phi.T @ model.B))
    still, moving = [], []
    for _ in range(_terms(top, sigma, modes)):
        x = x - phi @ (MPhi.T @ x)
        still.append((model.Cq @ x).ravel())
        moving.append((model.Cv @ x).ravel())
        x = pencil.iterate(x)
    powers = np.array(still), np.array(moving)

    def evaluate(s: np.ndarray) -> np.ndarray:
        s = np.asarray(s, dtype=complex)
        _check_top(s, top)
        scale = 1.0 + beta * s
        mu = -(s * s + alpha * s) / scale
        rest = [_horner(terms, mu - sigma) / scale[:, None] for terms in powers]
        flat = series(s) + rest[0] + s[:, None] * rest[1]
        return flat.T.reshape(*model.D.shape, s.size) + model.D[:, :, None]

    return evaluate


def _horner(terms: np.ndarray, x: np.ndarray) -> np.ndarray:
    total = np.zeros((x.size, terms.shape[1]), dtype=complex)
    for term in terms[::-1]:
        total = total * x[:, None] + term
    return total


def _terms(top: float, sigma: float, modes: Modes) -> int:
    """Terms until the ratio of convergence, to that power, is rounding."""
    ratio = (top**2 - sigma) / (float(modes.omega_squared[-1]) - sigma)
    return int(np.clip(np.ceil(np.log(1e-15) / np.log(min(ratio, 0.6))), 4, 70))


def _modes_below(base: Scaled, value: float) -> int:
    """Sturm count of λ < value; a large number where the factors do not tell."""
    below = Pencil(base.model.K, base.model.M).below(value)
    return MOST_MODES + 1 if below < 0 else below


def _check_top(s: np.ndarray, top: float) -> None:
    if s.size and np.abs(s).max() > 1.0001 * top:
        raise LinearizationError(f"this evaluator holds up to |s| = {top:.6g} rad/s; ask transfer() for more")
