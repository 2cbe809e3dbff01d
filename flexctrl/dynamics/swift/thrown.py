"""Parts that a jump of forces would throw: so stiff, or so damped, that a step sees nothing of how they give way.

What a force F sets moving over its mass alone has the speed h F/m at the end of a step. If it is held by stiffness and
damping with hω ≫ 1 it has come to rest by then where F bends it to: the speed is nonsense, and dampers throw all else
by it. So of a jump Δ of the accelerations the share (1 − (1 − S)³) Δ is taken, with

    S = (M + γ h C + β h² K)⁻¹ M,

that is three corrections by forces held over a step. What a step resolves, S ≈ 1, has all of it but for (βh²ω²)³; what
it does not follows its balance. Where nothing is thrown, Δ stays as it is.
"""

from __future__ import annotations

import numpy as np

from flexctrl.dynamics.scales import once
from flexctrl.dynamics.swift.settling import weightless
from flexctrl.effects.wind import Wind
from flexctrl.errors import SingularMatrixError
from flexctrl.model.model import Model
from flexctrl.model.plant import Plant
from flexctrl.model.solve import factorise

__all__ = ["AT_HAND", "BLURRED", "CORRECTIONS", "THROWN", "holding_inputs", "may_throw"]

AT_HAND = 4.0
"""How much longer or shorter than a step one may be whose tangent tells what is held over it."""
BLURRED = 1e5
"""Radians of a line's vibration in a step from where on its force is but the last digits of places."""
CORRECTIONS = 3
THROWN = 10.0
"""How much more work forces do over the mass alone than held over a step, from where on they throw."""

_MARGIN = 4.0
"""Elsewhere than at rest parts may be held by more."""
_DUST = 1e-12
_PLACE = (1.0, 0.0, 0.0)


def may_throw(model: Plant) -> bool:
    """Tell whether parts of a model are held where forces jump.

    Others have rules of their own: what switches, what is of first order, what has no mass, what drag settles.

    Parameters
    ----------
    model : Plant

    Returns
    -------
    bool
    """
    windy = isinstance(model, Model) and any(isinstance(e, Wind) and e.acts(model.structure) for e in model.effects)
    return not (model.switches.names or model.motion.flows.size or windy or weightless(model).size)


def holding_inputs(model: Plant) -> tuple[float, float]:
    """Return what holds the motions that inputs bring about over the mass alone.

    Parameters
    ----------
    model : Plant

    Returns
    -------
    float, float
        The most damping over mass [1/s] and stiffness over mass [1/s²] that these may have, four times what they have
        at rest; infinite where corners of laws of force may bring about any.
    """
    damping, stiffness = once(model, _holding).tolist()
    return damping, stiffness


def _holding(model: Plant) -> np.ndarray:
    if not (may_throw(model) and model.inputs and model.n):
        return np.zeros(2)
    if model.kinks.names:
        return np.full(2, np.inf)
    zero, u = np.zeros(model.n), np.zeros(len(model.inputs))
    M, C, K = (-model.slope(model.rest, zero, zero, seeds, u) for seeds in ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), _PLACE))
    pushes = [model.loads(model.rest, unit) - model.loads(model.rest, u) for unit in np.eye(len(u))]
    try:
        solve = factorise(M)
    except SingularMatrixError:
        return np.full(2, np.inf)
    moved = np.array([solve(push) / np.linalg.norm(push) for push in pushes if push.any()]).reshape(-1, model.n).T
    if not moved.size:
        return np.zeros(2)
    sizes, ways = np.linalg.eigh(moved.T @ (M @ moved))
    kept = sizes > _DUST * sizes[-1]
    moved = moved @ (ways[:, kept] / np.sqrt(sizes[kept]))
    return np.array([_MARGIN * np.linalg.norm(moved.T @ (part @ moved), 2) for part in (C, K)])
