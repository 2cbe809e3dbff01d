"""A closed loop cut open at one plant input: the loop whose margins tell how much gain and delay it bears there."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg as la

from flexctrl.design.controller import Controller, LinearController, as_controller
from flexctrl.design.hardware import Delayed, Noisy, Quantised, RateLimited, Saturated
from flexctrl.design.holding import Held
from flexctrl.design.tracking import Commanded, OpenLoop, Together
from flexctrl.design.wrapping import Wrapper
from flexctrl.errors import ControllerError, StructureError, check_kind, did_you_mean
from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.study.loop import Loop, open_loop

__all__ = ["broken_loop", "linear_law", "unlinear"]

_UNLINEAR: dict[type, tuple[str, str]] = {
    RateLimited: ("limits", "rate limits of {} act"),
    Saturated: ("limits", "limits of {} act"),
    Quantised: ("steps", "rounding of {} acts"),
    Noisy: ("std", "noise of {} acts"),
}
"""Hardware that is left out of a linear law: where its signals stand, and what is said of them."""


def linear_law(controller: Any) -> LinearController:
    """Return the linear law inside a controller's hardware.

    References, limits, rounding and noise are left out; sampling and whole-sample delays stay.

    Parameters
    ----------
    controller : Controller or python-control system

    Returns
    -------
    LinearController
        Continuous or sampled as the controller is.

    Raises
    ------
    ControllerError
        If there is a law in it that is not linear.
    """
    return _law(as_controller(controller))


def unlinear(controller: Any) -> tuple[str, ...]:
    """Say in words what `linear_law` leaves out of a controller: limits, rounding and noise, with their signals.

    Parameters
    ----------
    controller : Controller or python-control system

    Returns
    -------
    tuple of str
        From the outside inwards; empty for a law that is linear.
    """
    law = as_controller(controller)
    if isinstance(law, Together):
        return tuple(dict.fromkeys(said for part in law.parts for said in unlinear(part)))
    own = next((said for kind, said in _UNLINEAR.items() if isinstance(law, kind)), None)
    names = ", ".join(name for name, size in getattr(law, own[0]).items() if size) if own else ""
    said = (f"{own[1].format(names)} in simulations only",) if own and names else ()
    return (*said, *(unlinear(law.controller) if isinstance(law, Wrapper) else ()))


def _law(controller: Controller) -> LinearController:
    if isinstance(controller, LinearController):
        return controller
    if isinstance(controller, OpenLoop):
        return _static(np.zeros((len(controller.outputs), 0)), (), controller.outputs, controller.sample_time)
    if isinstance(controller, Together):
        return _together(controller)
    if isinstance(controller, Delayed):
        return _delayed(_law(controller.controller), controller.samples)
    if isinstance(controller, Held) and controller.every > 1:
        raise ControllerError(
            f"a law held over {controller.every} samples changes from one to the next and has no margins; ask for "
            "those of the faster loop, or of the slower one at its own samples with the faster one closed"
        )
    if isinstance(controller, Commanded):
        inner = _law(controller.controller)
        kept = [i for i, name in enumerate(inner.inputs) if name in controller.inputs]
        return LinearController(
            inner.A, inner.B[:, kept], inner.C, inner.D[:, kept], controller.inputs, inner.outputs, inner.sample_time
        )
    if isinstance(controller, Wrapper):
        return _law(controller.controller)
    raise ControllerError(
        f"a {type(controller).__name__} has no linear law; margins need a control.StateSpace or TransferFunction"
    )


def _static(D: np.ndarray, inputs: tuple[str, ...], outputs: tuple[str, ...], sample_time: float) -> LinearController:
    p, m = D.shape
    return LinearController(np.zeros((0, 0)), np.zeros((0, m)), np.zeros((p, 0)), D, inputs, outputs, sample_time)


def _together(controller: Together) -> LinearController:
    laws = [_law(part) for part in controller.parts]
    A = la.block_diag(*(law.A for law in laws))
    B, C = np.zeros((len(A), len(controller.inputs))), np.zeros((len(controller.outputs), len(A)))
    D = np.zeros((len(controller.outputs), len(controller.inputs)))
    first = 0
    for law in laws:
        own = slice(first, first := first + len(law.A))
        reads = [controller.inputs.index(name) for name in law.inputs]
        writes = [controller.outputs.index(name) for name in law.outputs]
        B[own, reads] += law.B
        C[writes, own] += law.C
        D[np.ix_(writes, reads)] += law.D
    return LinearController(A, B, C, D, controller.inputs, controller.outputs, controller.sample_time)


def _delayed(law: LinearController, samples: int) -> LinearController:
    """The law with its commands kept in a queue of so many samples."""
    p, n = len(law.outputs), len(law.A)
    for _ in range(samples):
        A = np.block([[law.A, np.zeros((len(law.A), p))], [law.C, np.zeros((p, p))]])
        B, C = np.vstack([law.B, law.D]), np.hstack([np.zeros((p, len(law.A))), np.eye(p)])
        D = np.zeros((p, len(law.inputs)))
        law = LinearController(A, B, C, D, law.inputs, law.outputs, law.sample_time)
    assert len(law.A) == n + samples * p
    return law


def broken_loop(plant: LinearModel, controller: Any, input: str) -> Loop:
    """Return the open loop of a controlled plant, cut at one plant input, every other one closed.

    L = −(what the controller sends back) / (what goes in), so that margins are those of negative feedback. A
    sampled controller samples the plant exactly.

    Parameters
    ----------
    plant : LinearModel
    controller : Controller, LinearController or python-control system
        Its signals are the plant's.
    input : str
        The plant input at which the loop is cut; the controller commands it.

    Returns
    -------
    Loop

    Raises
    ------
    StructureError
        If the controller does not command that input.
    ControllerError
        If the controller is not linear.
    """
    check_kind(plant, LinearModel, "broken_loop: plant", "a LinearModel, as linearize(model) gives")
    law = linear_law(controller)
    if input not in law.outputs:
        raise StructureError(f"the controller does not command {input!r}{did_you_mean(input, law.outputs)}")
    chosen = plant.select(law.outputs, law.inputs)
    system = chosen.discretize(law.sample_time) if law.sample_time else chosen.to_ss()
    return open_loop(_cut(system, law, law.outputs.index(input)).named(plant.name))


@frozen
class _States:
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    dt: float

    def named(self, name: str) -> Any:
        import control

        return control.StateSpace(
            self.A, self.B, self.C, self.D, self.dt, inputs=["sent"], outputs=["returned"], name=name
        )


def _cut(plant: Any, law: LinearController, place: int) -> _States:
    """States of plant and law; the plant's outputs do not depend on its inputs directly."""
    if np.any(plant.D):
        raise StructureError("a measured output depends directly on an input (an acceleration?); measure another one")
    others = np.array([i != place for i in range(len(law.outputs))], dtype=float)
    feed = plant.B * others  # the inputs that stay closed
    A = np.block([[plant.A + feed @ law.D @ plant.C, feed @ law.C], [law.B @ plant.C, law.A]])
    B = np.vstack([plant.B[:, [place]], np.zeros((len(law.A), 1))])
    C = -np.hstack([law.D[[place]] @ plant.C, law.C[[place]]])
    return _States(A, B, C, np.zeros((1, 1)), law.sample_time)
