"""One sparse factorisation for each s, and a step of refinement with a residual of extended precision."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as sla

from flexctrl.errors import LinearizationError
from flexctrl.linear.condense import Scaled
from flexctrl.linear.model import LinearModel
from flexctrl.linear.pattern import aligned

__all__ = ["direct_transfer", "infinite", "state_at"]


def direct_transfer(base: Scaled) -> Callable[[np.ndarray], np.ndarray]:
    """One sparse LU for each s.

    Parameters
    ----------
    base : Scaled

    Returns
    -------
    callable
        s of shape (N,) to H of shape (n_outputs, n_inputs, N).
    """
    model = base.model
    state = state_at(model)

    def evaluate(s: np.ndarray) -> np.ndarray:
        values = [model.D + (model.Cq + z * model.Cv) @ state(complex(z)) for z in np.asarray(s)]
        return np.stack(values, axis=-1) if values else np.zeros((*model.D.shape, 0), dtype=complex)

    return evaluate


def state_at(model: LinearModel) -> Callable[[complex], np.ndarray]:
    """s ↦ (s² M + s C + K)⁻¹ B.

    Parameters
    ----------
    model : LinearModel
        Scaled.

    Returns
    -------
    callable
        Of shape (n, n_inputs); it raises LinearizationError at an undamped pole.
    """
    M, C, K = aligned(model.M, model.C, model.K)
    B = model.B.astype(complex)

    def state(s: complex) -> np.ndarray:
        z = np.clongdouble(s)
        A = sp.csc_matrix((K.data + z * C.data + z * z * M.data, K.indices, K.indptr), K.shape)
        try:
            lu = sla.splu(A.astype(complex), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.1)
        except RuntimeError as error:
            raise infinite(s, "the model") from error
        x = lu.solve(B)
        return np.asarray(x + lu.solve((B - A @ x).astype(complex)))

    return state


def infinite(s: complex, who: str) -> LinearizationError:
    """The error of a response asked for at a pole.

    Parameters
    ----------
    s : complex
        1/s.
    who : str
        What has the pole.

    Returns
    -------
    LinearizationError
    """
    return LinearizationError(
        f"the response at s = {s:.6g} is infinite: {who} has an undamped pole there; leave that frequency out"
        + (" (an integrator: start above 0)" if s == 0 else " or give damping")
    )
