"""Equilibria whose inputs bear what was held: those that a run can start from, and a law can act on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexctrl.model.braked import balance_of
from flexctrl.model.built_up import built_up
from flexctrl.model.equilibrium import Rest
from flexctrl.model.holding import raw_place
from flexctrl.structure.inputs import MotorTorque

__all__ = ["let_go"]

_ALONG = 1e-9


def let_go(rest: Rest) -> Rest:
    """Return an equilibrium whose inputs bear what was held; what no input bears by itself is held still.

    Parameters
    ----------
    rest : Rest

    Returns
    -------
    Rest
    """
    if not rest.held:
        return rest
    inputs, held = rest.inputs.copy(), []
    for name in rest.held:
        bearing = _bearing(rest, name)
        inputs += rest.holding[name] * bearing
        if not bearing.any():
            held.append(name)
    free = replace(rest, inputs=inputs, held=tuple(held), brakes=tuple(b for b in rest.brakes if b[0] in held))
    return replace(free, state=built_up(balance_of(free), free.state))


def _bearing(rest: Rest, name: str) -> np.ndarray:
    """Inputs that bear one unit on what is held: of one that acts on it and on nothing else, or none."""
    model = rest.model
    state = model.place(rest.state.loose)
    turned = model.motion.jacobian(state).T.tocsc()
    pushes = (turned @ model.reach(state, rest.inputs)).toarray()
    for i, signal in enumerate(model.structure.inputs):
        if isinstance(signal, MotorTorque):  # by way of its lag, too
            pushes[:, i] = turned[:, [raw_place(model, f"{signal.drive}_source")]].toarray().ravel()
    along = np.zeros(model.n)
    if name in model.coordinates:
        along[model.coordinate(name)] = 1.0
    else:
        along = turned[:, [raw_place(model, name)]].toarray().ravel()
    shares = along @ pushes / (along @ along)
    aside = np.abs(pushes - np.outer(along, shares)).max(axis=0) > _ALONG * np.abs(pushes).max(axis=0)
    bearers = np.flatnonzero((shares != 0.0) & ~aside)[:1]
    found = np.zeros(len(model.inputs))
    found[bearers] = 1.0 / shares[bearers]
    return found
