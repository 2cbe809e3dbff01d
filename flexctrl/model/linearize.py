"""The linear model about a true equilibrium."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import LinearizationError, MechanismError, StructureError, shortened
from flexctrl.linear.model import LinearModel
from flexctrl.linear.place import Place
from flexctrl.model.audit import audit
from flexctrl.model.balance import Balance
from flexctrl.model.braked import balance_of, bearing
from flexctrl.model.built_up import built_up
from flexctrl.model.certify import certify, taylor_slope
from flexctrl.model.consistent import admitted
from flexctrl.model.eased import eased
from flexctrl.model.equilibrium import Rest, equilibrium
from flexctrl.model.modal_region import beyond_modes
from flexctrl.model.model import Model
from flexctrl.model.shafts import with_twists
from flexctrl.model.stability import without_energy
from flexctrl.model.state import State
from flexctrl.model.tangents import tangents
from flexctrl.model.units import TURNS
from flexctrl.structure.beams import Beam

_BALANCED, _ROUND_OFF = 1e-6, 1e-12


def linearize(model: Model, at: Rest | State | None = None, inputs: Mapping[str, float] | None = None) -> LinearModel:
    """Return the linear model about an equilibrium: M q̈ + C q̇ + K q = B u, geometric stiffness in K.

    K is symmetric unless loads without a potential are at work (`FollowerForce`, `FollowerTorque`, a `Torque`
    about a fixed axis, or `Wind` in a `RotatingFrame`): then what they add is kept, the certificate names them, and
    the damped poles tell flutter from divergence.

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
        In the order of ``model.coordinates``; inputs and outputs are deviations. Its ``certificate`` tells why it can
        be trusted. What a `Rest` holds is held, and the certificate tells which inputs do nothing by that;
        ``at=rest.state`` under inputs that bear what ``rest.holding`` tells lets go of it. Where the shaft of a drive
        is so stiff that K would hold nothing of what it drives, the coordinate ``<drive>_twist``, θ_d − R s, stands in
        place of the motor's angle ``<drive>_source``; of a motor that is held, or far heavier than what it drives, in
        place of a coordinate of what it drives.

    Raises
    ------
    MechanismError
        If something moves that has neither mass nor stiffness.
    LinearizationError
        If the state is not an equilibrium (says by how much and where), rigid parts drawn in line have come
        apart there, another point of the certificate fails, or nothing in the machine can move or is left free to.
    EquilibriumError
        If none was given and none is found.
    """
    if not isinstance(model, Model):
        raise StructureError(f"linearize: {shortened(model)} is no Model; give what flexctrl.assemble returns")
    if at is not None and not isinstance(at, Rest | State):
        raise LinearizationError(f"linearize: at = {shortened(at)}; expected a Rest (from equilibrium) or a State")
    if not model.n:
        raise LinearizationError(
            "linearize: the machine has no degrees of freedom, so there is nothing to linearise: its supports hold all "
            "that no effect lets bend"
        )
    rest = equilibrium(model, inputs=inputs) if at is None else at
    u = rest.inputs if isinstance(rest, Rest) and inputs is None else model.input_vector(inputs or {})
    state = rest.state if isinstance(rest, Rest) else rest
    _refuse_spins(model, () if not isinstance(rest, Rest) else rest.held)
    state = admitted(model, state, "linearize: at").loose
    if isinstance(rest, Rest):
        balance = balance_of(replace(rest, model=model, inputs=u))
        return _about(balance, built_up(balance, state))
    return _about(Balance(model, u, _frozen(model, state)), state)


def _frozen(model: Model, state: State) -> dict[int, float]:
    """Where coordinates are that stay as they are in linear models."""
    return {i: float(state.q[i]) for i in model.motion.frozen}


def _about(balance: Balance, state: State) -> LinearModel:
    """The certified linear model about a state in which a balance is met."""
    model, free = balance.model, balance.free
    if wrong := model.apart(state) or beyond_modes(model, [state]):
        raise LinearizationError(f"linearize: {wrong}")
    if not free.size:
        raise LinearizationError(
            f"linearize: every coordinate is held ({', '.join(model.coordinates)}), so there is nothing to linearise; "
            "linearise about an equilibrium that leaves one free"
        )
    residual = _check_balance(balance, state)
    _refuse_corners(model, state, free)
    loads = without_energy(model, balance.u)
    linear, asymmetry = _derivative(balance, state, bool(loads))
    slope = taylor_slope(_push(balance, state), linear.K, balance.unit[free])
    idle = _idle(linear, balance, state)
    linear = with_twists(linear, balance, state)
    found = certify(linear, residual, asymmetry, slope, loads, model.motion, state)
    return linear.certified(replace(found, idle=idle))


def _idle(linear: LinearModel, balance: Balance, state: State) -> tuple[str, ...]:
    """Inputs that act on what is held, and on nothing else, if not by way of a motor's lag."""
    model, lever = balance.model, balance.lever[:, None]
    whole = model.motion.jacobian(model.place(state)).T @ model.reach(state, balance.u)
    felt = np.abs(whole.toarray() / lever).max(axis=0, initial=0.0)
    moved = np.abs(linear.B / lever[balance.free])
    moved[_pushing_nothing(linear, np.isin(balance.free, model.motion.inner))] = 0.0
    left = moved.max(axis=0, initial=0.0)
    return tuple(linear.inputs[i] for i in np.flatnonzero((felt > 0.0) & (left <= _ROUND_OFF * felt)))


def _pushing_nothing(linear: LinearModel, inner: np.ndarray) -> np.ndarray:
    """Which of the inner coordinates nothing feels or reads but inner ones."""
    feel = abs(linear.M) + abs(linear.C) + abs(linear.K)
    read = np.abs(linear.Cq).sum(axis=0) + np.abs(linear.Cv).sum(axis=0)
    return inner & (np.asarray(feel[~inner].sum(axis=0)).ravel() + read == 0.0)


def all_free(linear: LinearModel, rest: Rest) -> LinearModel:
    """Return what was linearised about an equilibrium with nothing held any more.

    Parameters
    ----------
    linear : LinearModel
        By `linearize`.
    rest : Rest
        The equilibrium.

    Returns
    -------
    LinearModel
        In the order of the model's coordinates, all of them; not certified where something was held.
    """
    if len(linear.coordinates) == rest.model.n:
        return linear
    return _derivative(Balance(bearing(rest), rest.inputs), rest.state.loose, _unsymmetric(rest))[0]


def released(rest: Rest) -> LinearModel:
    """Linearise about an equilibrium under the forces that hold it, constant, with nothing held any more.

    Parameters
    ----------
    rest : Rest
        The equilibrium.

    Returns
    -------
    LinearModel
        Of all coordinates. A force that holds a coordinate adds nothing to K; that on a motor behind a rigid shaft, or
        on a rope that does not stretch, turns with what they drive, and is in K. The certificate names what was held.
        There is none where a force that holds it has no potential (a moment on a node that may turn about every axis).

    Raises
    ------
    LinearizationError, MechanismError
        As `linearize`.
    """
    if not rest.held:
        return linearize(rest.model, at=rest)
    model, state = bearing(rest), rest.state.loose
    frozen = _frozen(model, state)
    free = Balance(model, rest.inputs, frozen)
    state = built_up(free, state)
    held = np.array([model.coordinates[i] in rest.held for i in free.free], dtype=bool)
    _refuse_spins(model, ())
    try:
        linear = _about(replace(free, kept=np.where(held, free.force(state), 0.0)), state)
    except LinearizationError:
        if balance_of(rest).free.size:
            linearize(rest.model, at=rest)  # whose reasons are those of the machine, not of letting go
        return _derivative(free, state, _unsymmetric(rest))[0]
    assert linear.certificate is not None
    let_go = tuple(name for name in rest.held if name not in {model.coordinates[i] for i in frozen})
    return linear.certified(replace(linear.certificate, held=let_go))


def _unsymmetric(rest: Rest) -> bool:
    return bool(without_energy(rest.model, rest.inputs))


def _refuse_spins(model: Model, held: Sequence[str]) -> None:
    """Refuse beams that spin about themselves without inertia; bent by a load they seem to have a trace of it."""
    beams = (p for p in model.structure.elements if isinstance(p, Beam) and model.bends(p))
    if not any(beam.section.rhoJ == 0.0 for beam in beams):
        return
    found = audit(model)
    spins = [
        f"{' with '.join(names)} ({said})"
        for names, said in zip(found.mechanisms, found.motions, strict=True)
        if all(name.endswith(TURNS) for name in names) and not set(names) & set(held)
    ]
    if spins:
        raise MechanismError(
            f"{len(spins)} motion(s) with neither mass nor stiffness: {'; '.join(spins)}. "
            "Hold the freedom, or give the section a rotary inertia rhoJ."
        )


def _derivative(balance: Balance, state: State, unsymmetric: bool) -> tuple[LinearModel, float]:
    model, u, unit = balance.model, balance.u, sp.diags(balance.unit[balance.free])
    M, C, K = tangents(model, state, u)
    if (held := balance.turning(state, balance.whole_force(state))).nnz:
        K = K - held
    M, C, K = (balance.seen(state, A) for A in (M, C, K))
    largest = float(abs(unit @ K @ unit).max()) if K.nnz else 0.0
    asymmetry = float(abs(unit @ (K - K.T) @ unit).max()) / max(largest, 1e-300) if K.nnz else 0.0
    at_work = balance.loaded or balance.heavy or not balance.idle(model.rest)
    pull = balance.pull(state) if at_work else 0.0
    basis = balance.basis(state)
    T = model.motion.jacobian(model.place(state)) @ basis
    on_place, on_rates = model.signals.slopes(state, model.rates(state.with_(v=np.zeros(model.n))), model.motion.raw)
    linear = LinearModel(
        M=_symmetric(M),
        C=C.tocsc(),
        K=K.tocsc() if unsymmetric and asymmetry > _ROUND_OFF else _symmetric(K),
        B=(T.T @ model.reach(state, u)).toarray(),
        Cq=(on_place @ T).toarray(),
        Cv=(on_rates @ T).toarray(),
        D=np.zeros((len(model.outputs), len(model.inputs))),
        coordinates=tuple(model.coordinates[i] for i in balance.free),
        inputs=model.inputs,
        outputs=model.outputs,
        name=model.structure.name,
        parts=model.forces.parts(model.place(state), T),
        place=Place(model, state, basis, u, pull),
    )
    return linear, asymmetry


def _push(balance: Balance, state: State) -> Callable[[np.ndarray], np.ndarray]:
    """Force on the free coordinates after a displacement of them."""
    model, rest = balance.model, balance.force(state)

    def force(d: np.ndarray) -> np.ndarray:
        step = np.zeros(model.n)
        step[balance.free] = d
        return balance.force(model.advance(state, balance.whole(state, step), balance.still, 0.0)) - rest

    return force


def _check_balance(balance: Balance, state: State) -> float:
    if np.abs(state.v).max(initial=0.0) > 0.0:
        raise LinearizationError("linearize: the state moves; give one at rest, e.g. from equilibrium(model)")
    if not balance.settled(state, _BALANCED):
        _refuse_hidden_torques(balance, state)
        force, scale = balance.force(state), balance.scale(state)
        worst = int(np.argmax(np.abs(force)))
        name = balance.model.coordinates[balance.free[worst]]
        raise LinearizationError(
            f"linearize: not an equilibrium: {name} is pushed by {force[worst]:.4g} (forces at work: {scale:.3g}); "
            "linearise about equilibrium(model), or name the inputs that balance it"
        )
    return balance.beyond_noise(state)


def _refuse_hidden_torques(balance: Balance, state: State) -> None:
    """Refuse an equilibrium in which angles do not tell what shafts bear."""
    ease = eased(balance, state)
    if ease and ease.balanced(state, _BALANCED):
        raise LinearizationError(
            f"linearize: the shafts of {ease} are so stiff that the last digits of angles hide the "
            "torques that they bear in this equilibrium; leave them out of ShaftElasticity: rigid, they differ by "
            "nothing that can be seen"
        )


def _refuse_corners(model: Model, state: State, free: np.ndarray) -> None:
    standing = model.kinks.standing(state, free) if model.large else ()
    if standing:
        raise LinearizationError(
            "linearize: the forces have no derivative here, one way they are others than the other way: "
            + "; ".join(standing)
        )


def _symmetric(A: sp.spmatrix) -> sp.csc_matrix:
    return (0.5 * (A + A.T)).tocsc()
