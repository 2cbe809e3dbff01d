"""The linear model about a true equilibrium."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import LinearizationError
from flexctrl.model.equilibrium import Rest, Search, equilibrium
from flexctrl.model.linear import LinearModel, PartMatrices
from flexctrl.model.model import Model
from flexctrl.model.motion import State

_BALANCED = 1e-6


def linearize(model: Model, at: Rest | State | None = None, inputs: Mapping[str, float] | None = None) -> LinearModel:
    """Return the linear model about an equilibrium: M q̈ + C q̇ + K q = B u, geometric stiffness in K.

    Parameters
    ----------
    model : Model
    at : Rest or State, optional
        The equilibrium; default: found from the drawn shape.
    inputs : mapping of str to float, optional
        Constant inputs it is in equilibrium with (a `Rest` knows its own).

    Returns
    -------
    LinearModel
        In the order of ``model.coordinates``; inputs and outputs are deviations.

    Raises
    ------
    LinearizationError
        If the state is not an equilibrium: says by how much and where.
    EquilibriumError
        If none was given and none is found.
    """
    rest = equilibrium(model, inputs=inputs) if at is None else at
    state = rest.state if isinstance(rest, Rest) else rest
    u = rest.inputs if isinstance(rest, Rest) and inputs is None else model.input_vector(inputs or {})
    free = _free(model, rest)
    _check_balance(model, state, u, free)
    zero = np.zeros(model.n)
    seeds = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    K, C, M = (-model.slope(state, zero, zero, seed, u)[free][:, free] for seed in seeds)
    T = model.motion.jacobian(state if model.large else model.rest)[: model.motion.raw][:, free]
    on_place, on_rates = model.signals.slopes(state, model.rates(state.with_(v=zero)), model.motion.raw)
    return LinearModel(
        M=_symmetric(M),
        C=C.tocsc(),
        K=_symmetric(K),
        B=(T.T @ model.signals.loads).toarray(),
        Cq=(on_place @ T).toarray(),
        Cv=(on_rates @ T).toarray(),
        D=np.zeros((len(model.outputs), len(model.inputs))),
        coordinates=tuple(model.coordinates[i] for i in free),
        inputs=model.inputs,
        outputs=model.outputs,
        name=model.structure.name,
        parts=_parts(model, state, free),
    )


def _free(model: Model, rest: Rest | State) -> np.ndarray:
    held = set(rest.held) if isinstance(rest, Rest) else set()
    return np.array([i for i, name in enumerate(model.coordinates) if name not in held], dtype=int)


def _check_balance(model: Model, state: State, u: np.ndarray, free: np.ndarray) -> None:
    if np.abs(state.v).max(initial=0.0) > 0.0:
        raise LinearizationError("linearize: the state moves; give one at rest, e.g. from equilibrium(model)")
    search = Search(model, u, free)
    force, scale = search.force(state), search.scale(state)
    if search.relative(force, scale) > _BALANCED + search.noise(state):
        worst = int(np.argmax(np.abs(force)))
        raise LinearizationError(
            f"linearize: not an equilibrium: {model.coordinates[free[worst]]} is pushed by {force[worst]:.4g} "
            f"(forces at work: {scale:.3g}); linearise about equilibrium(model), or name the inputs that balance it"
        )


def _symmetric(A: sp.spmatrix) -> sp.csc_matrix:
    return (0.5 * (A + A.T)).tocsc()


def _parts(model: Model, state: State, free: np.ndarray) -> dict[str, PartMatrices]:
    if not model.large:
        return {}
    zero = np.zeros(model.n)
    stiffness = model.forces.slope_by_part(state, zero, zero, (1.0, 0.0, 0.0))
    mass = model.forces.slope_by_part(state, zero, zero, (0.0, 0.0, 1.0))
    return {
        name: PartMatrices(_symmetric(-stiffness[name][free][:, free]), _symmetric(-mass[name][free][:, free]))
        for name in stiffness
    }
