"""Equilibria that hold freedoms by name, among them the motors of winches whose ropes do not stretch.

Such a motor turns with the length of its rope, which is no coordinate: of a rope that leans, it is held by a torque on
it that is found with the shape, K δq − Gᵀ δτ = f, G δq = θ − θ(q), with the angle's slope G.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy.linalg as la

from flexctrl.model.equilibrium import Rest, equilibrium
from flexctrl.model.holding import held_at, own_coordinate
from flexctrl.model.model import Model
from flexctrl.model.state import State
from flexctrl.structure.drives import Winch
from flexctrl.structure.inputs import MotorTorque

__all__ = ["rest_held", "with_brakes"]

_STEPS = 60
_REACH = 0.2
_CLOSE = 1e-12


def rest_held(model: Model, hold: Mapping[str, float], inputs: Mapping[str, float]) -> Rest:
    """Return the equilibrium of a model with freedoms held by name.

    Parameters
    ----------
    model : Model
    hold : mapping of str to float
        ``"girder.start.u"`` or a coordinate's name, and where; see `held_at`.
    inputs : mapping of str to float

    Returns
    -------
    Rest
        Where a rope that does not stretch hangs from a motor that is held, all that the rope moves is held in it.

    Raises
    ------
    EquilibriumError, StructureError
        As `equilibrium` and `held_at`.
    """
    places, winches = held_at(model, hold), _winches(model, hold)
    if winches and model.large:
        own = {model.coordinate(n): at for n, at in held_at(model, _others(model, hold, winches)).items()}
        if (hung := _hung(model, places, own, winches, inputs)) is not None:
            state, torques = hung
            led = np.flatnonzero(_slope(model, state, list(winches)).any(axis=0))
            places = {model.coordinates[i]: float(state.q[i]) for i in {*led.tolist(), *own}}
            names = (model.structure.drives[i].name for i in winches)
            brakes = tuple(zip(names, torques.tolist(), strict=True))
            return replace(equilibrium(model, hold=places, inputs=inputs, start=state), brakes=brakes)
    return equilibrium(model, hold=places, inputs=inputs)


def with_brakes(rest: Rest) -> Rest:
    """Return an equilibrium whose brakes are torques of motors, inputs behind those that its model has.

    Parameters
    ----------
    rest : Rest

    Returns
    -------
    Rest
        Itself without brakes.
    """
    if not rest.brakes:
        return rest
    drives, torques = zip(*rest.brakes, strict=True)
    model = _with_torques(rest.model, drives)
    return replace(rest, model=model, inputs=np.concatenate([rest.inputs, torques]), brakes=())


def _with_torques(model: Model, drives: Sequence[str]) -> Model:
    """The machine with a torque on the motor of each of some drives, the last of its inputs."""
    from flexctrl.model.assemble import assemble  # which finds equilibria itself

    brakes = [MotorTorque(f"brake_of_{name}", name) for name in drives]
    return assemble(model.structure.with_(inputs=[*model.structure.inputs, *brakes]), model.effects, model.backend)


def _winches(model: Model, hold: Mapping[str, float]) -> dict[int, float]:
    """Numbers of the drives that are held, lead a rope and have no coordinate of their own, and where."""
    drives = enumerate(model.structure.drives)
    names = {f"{d.name}_source": i for i, d in drives if isinstance(d, Winch)}
    return {names[name]: at for name, at in hold.items() if name in names and not own_coordinate(model, name)}


def _others(model: Model, hold: Mapping[str, float], winches: Mapping[int, float]) -> dict[str, float]:
    led = {f"{model.structure.drives[i].name}_source" for i in winches}
    return {name: at for name, at in hold.items() if name not in led}


def _slope(model: Model, state: State, drives: list[int]) -> np.ndarray:
    """How motor angles follow the coordinates."""
    rows = [model.motion.source_base + i for i in drives]
    return np.asarray(model.motion.jacobian(state)[rows].toarray())


def _hung(
    model: Model,
    places: Mapping[str, float],
    own: Mapping[int, float],
    winches: Mapping[int, float],
    inputs: Mapping[str, float],
) -> tuple[State, np.ndarray] | None:
    """Return the shape in which brakes hold the winches, and their torques; None if Newton's method finds none."""
    structure, drives, wanted = model.structure, list(winches), np.array(list(winches.values()))
    held = _with_torques(model, [structure.drives[i].name for i in drives])
    u, still = held.input_vector(dict(inputs)), np.zeros(held.n)
    free = np.setdiff1d(np.arange(held.n), list(own))
    state, motion, k = held.displace(dict(places)), held.motion, len(drives)
    force = (held.balance(state, still, still) + held.loads(state, u))[free]
    u[-k:] = -la.lstsq(_slope(held, state, drives)[:, free].T, force)[0]
    for _ in range(_STEPS):
        force = (held.balance(state, still, still) + held.loads(state, u))[free]
        G = _slope(held, state, drives)[:, free]
        K = -held.slope(state, still, still, (1.0, 0.0, 0.0), u).toarray()[np.ix_(free, free)]
        gap = wanted - (motion.ratios * (state.driven - held.rest.driven))[drives]
        system = np.block([[K, -G.T], [G, np.zeros((k, k))]])
        step = la.lstsq(system, np.concatenate([force, gap]))[0]
        share = min(1.0, _REACH * structure.size / max(float(np.abs(step[:-k]).max(initial=0.0)), 1e-300))
        u[-k:] += share * step[-k:]
        moved = still.copy()
        moved[free] = share * step[:-k]
        state = held.advance(state, moved, still, 0.0)
        if not np.isfinite(state.x).all():
            return None
        if np.abs(moved).max(initial=0.0) <= _CLOSE * structure.size:
            return state, u[-k:]
    return None
