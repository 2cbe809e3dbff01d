"""Audit of a machine's freedoms before anything is computed with it."""

from __future__ import annotations

from types import NoneType

import numpy as np

from flexctrl.errors import check_kind
from flexctrl.linear.condense import Audit, Freedom
from flexctrl.linear.condense import audit as audit_linear
from flexctrl.linear.model import LinearModel
from flexctrl.model.equilibrium import Rest
from flexctrl.model.model import Model
from flexctrl.model.state import State
from flexctrl.model.tangents import tangents

__all__ = ["Audit", "Freedom", "audit"]


def audit(model: Model, at: Rest | State | None = None) -> Audit:
    """Label every freedom of a machine dynamic, mechanism, or massless but stiff, but damped, on negative stiffness.

    Mass, damping and stiffness (geometric stiffness included) are those of the given shape, which need not
    be an equilibrium.

    Parameters
    ----------
    model : Model
    at : Rest or State, optional
        Default: the shape as drawn.

    Returns
    -------
    Audit
        Names of the freedoms by label; ``mechanisms`` lists what moves in each motion that has neither mass
        nor stiffness. Never raises for one; `linearize` and `simulate` do.
    """
    check_kind(model, Model, "audit: model", "a Model, as flexctrl.assemble(structure, effects) gives")
    check_kind(at, (Rest, State, NoneType), "audit: at", "a Rest or a State")
    state = (model.rest if at is None else at.state if isinstance(at, Rest) else at).loose
    u, n = at.inputs if isinstance(at, Rest) else np.zeros(len(model.inputs)), model.n
    M, C, K = tangents(model, state, u)
    none = np.zeros((n, 0)), np.zeros((0, n)), np.zeros((0, n)), np.zeros((0, 0))
    return audit_linear(LinearModel(M, C, 0.5 * (K + K.T), *none, model.coordinates, (), ()))
