"""A sampled controller on a python-control system."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from flexctrl.design.controller import Controller, as_controller
from flexctrl.dynamics.said import state_of
from flexctrl.errors import ControllerError, StructureError, check_kind, did_you_mean, shortened
from flexctrl.structure.freedoms import check_finite, check_seconds, check_whole, numbers

if TYPE_CHECKING:
    import control
    from scipy.integrate import OdeSolver

__all__ = ["sampled_response"]


def sampled_response(
    plant: control.InputOutputSystem,
    controller: Any,
    *,
    until: float,
    initial_state: np.ndarray | None = None,
    inputs: Mapping[str, float] | None = None,
    points: int = 4,
    method: type[OdeSolver] | None = None,
    rtol: float = 1e-6,
    atol: float = 1e-9,
) -> control.TimeResponseData:
    """Run a continuous python-control system under a sampled controller.

    python-control cannot interconnect the two time bases. Here `control.input_output_response` runs from each
    sample instant to the next with the command held, so no sample falls inside a step of its integrator.

    Parameters
    ----------
    plant : control.NonlinearIOSystem or control.StateSpace
        Continuous, e.g. from ``model.to_nlsys()`` or ``linear.to_ss()``.
    controller : Controller or python-control system
        Sampled; its signals are the plant's by name. At t_k it reads the outputs under the command in force.
    until : float
        End [s].
    initial_state : numpy.ndarray, shape (states,), optional
        Of the plant; default: zero.
    inputs : mapping of str to float, optional
        Constant inputs; commands add to them.
    points : int
        Results in each sample.
    method : scipy.integrate.OdeSolver class, optional
        Default: ``scipy.integrate.RK45``; where the fastest motion of the plant at the start would make that creep,
        the implicit ``Radau``. `flexctrl.simulate` is quicker on a stiff machine than either.
    rtol, atol : float
        Of the integrator.

    Returns
    -------
    control.TimeResponseData
        Outputs, states and the inputs in force from each instant on.

    Raises
    ------
    ControllerError
        If the controller is continuous (use `control.interconnect`) or a name is unknown.
    StructureError
        For an end or a number of points that is not positive, or an input that does not exist.
    """
    import control

    check_kind(plant, control.InputOutputSystem, "sampled_response: plant", "a control system, as linear.to_ss() gives")
    law = as_controller(controller, plant.input_labels, plant.output_labels)
    _check(law, until, points)
    base = _base(plant, inputs or {})
    for name, share in (("rtol", rtol), ("atol", atol)):
        check_finite(share, name, "sampled_response", above=0.0)
    x = np.zeros(plant.nstates) if initial_state is None else _checked_state(initial_state, plant.nstates)
    solver = {"method": method or _fitting(plant, x, base, law.sample_time), "rtol": rtol, "atol": atol}
    *stretches, last = _stretches(plant, law, x, base, until, points, solver)
    pieces = [*([values[..., :-1] for values in stretch] for stretch in stretches), last]
    t, y, states, used = (np.concatenate(rows, axis=-1) for rows in zip(*pieces, strict=True))
    return control.TimeResponseData(
        t,
        y,
        states,
        used,
        issiso=False,
        output_labels=plant.output_labels,
        input_labels=plant.input_labels,
        state_labels=plant.state_labels,
        sysname=plant.name,
        title=f"Response of {plant.name} under a sampled controller",
    )


def _stretches(
    plant: control.InputOutputSystem,
    law: Controller,
    x: np.ndarray,
    base: np.ndarray,
    until: float,
    points: int,
    solver: Mapping[str, Any],
) -> Iterator[tuple[np.ndarray, ...]]:
    """Instants, outputs, states and inputs from each sample to the next, both ends included."""
    import control

    reads = [plant.output_labels.index(name) for name in law.inputs]
    writes = [plant.input_labels.index(name) for name in law.outputs]
    z, u = state_of(law, law.initial(), "initial state"), base
    for k in range(math.ceil(until / law.sample_time - 1e-9)):
        now = k * law.sample_time
        measured = np.asarray(plant.output(now, x, u), dtype=float)[reads]
        u = base.copy()
        u[writes] += np.asarray(law.command(now, z, measured), dtype=float)
        z = state_of(law, law.update(now, z, measured), "update", z.size) if z.size else z
        t = np.linspace(now, min(now + law.sample_time, until), points + 1)
        held = np.repeat(u[:, None], points + 1, axis=1)
        run = control.input_output_response(
            plant, t, held, x, squeeze=False, return_states=True, solve_ivp_kwargs=solver
        )
        y, states = (values.reshape(-1, points + 1) for values in (run.outputs, run.states))
        yield t, y, states, held
        x = states[:, -1]


def _fitting(plant: control.InputOutputSystem, x: np.ndarray, u: np.ndarray, span: float) -> type[OdeSolver]:
    """An explicit integrator, or an implicit one where the explicit would call the plant more often in a sample.

    It does so 6 times in a step, as long at most as 3.3 over the largest eigenvalue (the edge of its stability); the
    other for each column of the Jacobian, and some 150 times for a step or two.
    """
    from scipy.integrate import RK45, Radau

    here = np.asarray(plant.dynamics(0.0, x, u), dtype=float)
    size = 1e-7 * np.maximum(np.abs(x), 1.0)
    moved = [np.asarray(plant.dynamics(0.0, x + step, u), dtype=float) - here for step in np.diag(size)]
    slopes = np.array(moved).T / size if len(x) else np.zeros((0, 0))
    if not np.isfinite(slopes).all():
        return RK45
    fastest = float(np.abs(np.linalg.eigvals(slopes)).max(initial=0.0))
    return Radau if 6.0 * span * fastest / 3.3 > len(x) + 150 else RK45


def _checked_state(given: object, count: int) -> np.ndarray:
    state = numbers(given)
    if len(state) != count or not np.isfinite(state).all():
        raise StructureError(
            f"sampled_response: initial_state = {shortened(given)}; expected {count} finite numbers, one for each state"
        )
    return np.array(state)


def _check(law: Controller, until: float, points: int) -> None:
    if not law.sample_time:
        raise ControllerError(
            "sampled_response: the controller is continuous; connect it with control.interconnect, or sample it: "
            "Sampled(controller, 0.01)"
        )
    check_seconds(until, "until", "sampled_response")
    check_whole(points, "points", "sampled_response", least=1)


def _base(plant: control.InputOutputSystem, inputs: Mapping[str, float]) -> np.ndarray:
    check_kind(inputs, Mapping, "sampled_response: inputs", "a mapping of names to values")
    base = np.zeros(plant.ninputs)
    for name, value in inputs.items():
        if name not in plant.input_labels:
            raise StructureError(f"the plant has no input {name!r}{did_you_mean(name, plant.input_labels)}")
        base[plant.input_labels.index(name)] = check_finite(value, f"input {name!r}", "sampled_response")
    return base
