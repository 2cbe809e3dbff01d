"""An open loop L = controller · plant, as python-control understands it but evaluated accurately."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import eigvals, matrix_balance

from flexctrl.errors import StructureError, did_you_mean, shortened
from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.linear.reduction import Reduced, ReducedModel, ReducedStates
from flexctrl.linear.reduction.states import states_transfer
from flexctrl.linear.transfer import transfer
from flexctrl.structure.freedoms import numbers
from flexctrl.study.channel import channel_states
from flexctrl.study.zeros import deflated_zeros, zeros

if TYPE_CHECKING:
    import control
    from matplotlib.figure import Figure

__all__ = ["Loop", "check_loop", "open_loop"]

AT_REST = 1e-8
BOUNDARY = 1e-10
Curve = Callable[[np.ndarray], np.ndarray]


@frozen(eq=False)
class Loop:
    """One open loop, closed by negative feedback u = −k y.

    Attributes
    ----------
    A, B, C, D : numpy.ndarray
        States of plant and controller, shapes (n, n), (n, 1), (1, n), (1, 1).
    curve : callable
        s (or z), shape (N,) to L, shape (N,), from the most accurate form known.
    find_zeros : callable
        Gives the finite zeros of L; see ``zeros``.
    dt : float
        Sampling time, s; 0 for continuous time.
    name : str
        For legends.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    curve: Curve
    find_zeros: Callable[[], np.ndarray]
    dt: float
    name: str

    @cached_property
    def zeros(self) -> np.ndarray:
        """Finite open-loop zeros."""
        return np.asarray(self.find_zeros(), complex)

    @cached_property
    def poles(self) -> np.ndarray:
        """Open-loop poles."""
        return np.asarray(eigvals(self.A)) if len(self.A) else np.zeros(0, complex)

    def closed_poles(self, gain: float = 1.0) -> np.ndarray:
        """Closed-loop poles, eig(A − k B (1 + k D)⁻¹ C).

        Parameters
        ----------
        gain : float
            Loop gain k.

        Returns
        -------
        numpy.ndarray of complex, shape (n,)
        """
        back = gain / (1.0 + gain * self.D[0, 0])
        return np.asarray(eigvals(self.A - back * self.B @ self.C)) if len(self.A) else np.zeros(0, complex)

    @cached_property
    def rest_radius(self) -> float:
        """Distance from s = 0 (z = 1) within which a pole is an integrator's, up to rounding."""
        far = abs(self.poles - (1.0 if self.dt else 0.0))
        largest = float(far.max(initial=0.0))
        return max(1e-12 * largest, 30.0 * float(far[far < AT_REST * largest].max(initial=0.0)))

    def at_rest(self, poles: np.ndarray) -> np.ndarray:
        """Which poles are those of free motion, at s = 0 (z = 1) to rounding.

        Parameters
        ----------
        poles : numpy.ndarray of complex

        Returns
        -------
        numpy.ndarray of bool
        """
        return np.asarray(abs(poles - (1.0 if self.dt else 0.0)) <= self.rest_radius)

    def is_stable(self, gain: float = 1.0) -> bool:
        """Whether every closed-loop pole is inside the stability region.

        Poles that stay at s = 0 (z = 1) do not count: the loop neither drives nor sees that free motion.

        Parameters
        ----------
        gain : float
            Loop gain k.

        Returns
        -------
        bool
        """
        poles = self.closed_poles(gain)
        poles = poles[~self.at_rest(poles)]
        return bool((abs(poles) < 1).all() if self.dt else (poles.real < 0).all())

    def is_marginal(self, gain: float = 1.0) -> bool:
        """Whether closed-loop poles lie on the stability boundary to round-off, and none beyond it.

        So it is for a machine without damping: its oscillations neither die nor grow.

        Parameters
        ----------
        gain : float
            Loop gain k.

        Returns
        -------
        bool
        """
        poles = self.closed_poles(gain)
        poles = poles[~self.at_rest(poles)]
        outside = abs(poles) - 1.0 if self.dt else poles.real
        # a pole that is double at rest splits by the root of its rounding
        split = 10.0 * AT_REST * float(abs(poles).max(initial=0.0))
        allowed = np.maximum(BOUNDARY * abs(poles), split)
        return bool((outside < allowed).all() and (outside > -allowed).any())

    def at(self, omega: np.ndarray) -> np.ndarray:
        """L on the stability boundary.

        Parameters
        ----------
        omega : numpy.ndarray, shape (N,)
            rad/s.

        Returns
        -------
        numpy.ndarray of complex, shape (N,)
        """
        omega = np.asarray(omega, float)
        return self.curve(np.exp(1j * omega * self.dt) if self.dt else 1j * omega)

    def plot(self) -> Figure:
        """Draw the loop with its margins: Bode, Nyquist, sensitivities.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.loops import loop_figure

        return loop_figure(self)

    def frd(self, omega: np.ndarray) -> control.FrequencyResponseData:
        """L as python-control's data object, for its Nyquist and Nichols plots.

        Parameters
        ----------
        omega : numpy.ndarray, shape (N,)
            rad/s.

        Returns
        -------
        control.FrequencyResponseData
        """
        import control

        wanted = numbers(omega)
        if not wanted or not np.isfinite(wanted).all():
            raise StructureError(f"Loop.frd: omega = {omega!r}; expected a list of angular frequencies, rad/s")
        return control.FrequencyResponseData(self.at(np.array(wanted)), np.array(wanted), dt=self.dt, name=self.name)


def check_loop(loop: Loop, owner: str) -> Loop:
    """Return a loop as it is; refuse what is none, with the remedy."""
    if not isinstance(loop, Loop):
        raise StructureError(
            f"{owner}: {shortened(loop)} is no loop; give what flexctrl.open_loop or broken_loop returns"
        )
    return loop


def open_loop(
    plant: LinearModel | Reduced | control.LTI,
    controller: control.LTI | float = 1.0,
    input: str = "",
    output: str = "",
) -> Loop:
    """The loop from one input of a plant to one output, times a controller.

    A proportional-derivative controller may be improper by one degree (``control.tf([kd, kp], [1])``): the
    derivative is then taken from the plant's own velocities.

    Parameters
    ----------
    plant : LinearModel, Reduced or control.LTI
    controller : control.StateSpace, control.TransferFunction or float
        One input, one output; L = controller · plant, closed by negative feedback. A sampled one samples a
        linear model exactly.
    input, output : str
        Signal names; may be left out where the plant has one only.

    Returns
    -------
    Loop

    Raises
    ------
    StructureError
        For a signal that does not exist or is not given, or a controller more improper than a derivative.
    """
    if isinstance(plant, ReducedModel):
        plant = plant.linear
    _check_names(plant, input, output)
    side = _Path.of_controller(controller)
    dt = side.dt
    if isinstance(plant, LinearModel) and not dt:
        chosen = plant.select([_only(input, plant.inputs, "input")], [_only(output, plant.outputs, "output")])
        body = _Path.of_linear(chosen)
    else:
        body = _Path.of_lti(_as_lti(plant, dt), input, output)
    return _series(body, side, getattr(plant, "name", "") or "loop")


@frozen(eq=False)
class _Path:
    """A single channel; ``rate`` and ``jump`` give the derivative of its output, where that is proper."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    curve: Curve
    find_zeros: Callable[[], np.ndarray]
    dt: float
    derivative: float = 0.0

    @classmethod
    def of_linear(cls, linear: LinearModel) -> _Path:
        return cls(*channel_states(linear), _accurate(linear), lambda: zeros(linear).finite, 0.0)

    @classmethod
    def of_lti(cls, system: Any, input: str, output: str) -> _Path:
        _refuse_unspecified(system, "plant")
        i = system.input_labels.index(_only(input, tuple(system.input_labels), "input"))
        j = system.output_labels.index(_only(output, tuple(system.output_labels), "output"))
        return cls.of_states(system.A, system.B[:, [i]], system.C[[j]], system.D[j : j + 1, i : i + 1], system.dt)

    @classmethod
    def of_states(cls, A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, dt: float | None) -> _Path:
        if len(A):
            A, (scale, _) = matrix_balance(A, permute=False, separate=True)
            B, C = B / scale[:, None], C * scale
        return cls(A, B, C, D, _rational(A, B, C, D), lambda: deflated_zeros(A, B, C, D), float(dt or 0.0))

    @classmethod
    def of_controller(cls, controller: control.LTI | float) -> _Path:
        import control

        if not isinstance(controller, control.LTI):
            if not isinstance(controller, int | float | np.number) or not np.isfinite(controller):
                raise StructureError(
                    f"open_loop: controller = {shortened(controller)}; expected a transfer function or state space of "
                    "python-control, or a finite number (1.0 for the plant alone)"
                )
            gain = np.array([[float(controller)]])
            return cls.of_states(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), gain, 0.0)
        _refuse_unspecified(controller, "controller")
        if controller.ninputs != 1 or controller.noutputs != 1:
            raise StructureError(
                f"open_loop: the controller has inputs {', '.join(controller.input_labels) or 'none'} and outputs "
                f"{', '.join(controller.output_labels) or 'none'}; a loop is closed with one signal: give a controller "
                "with one input and one output"
            )
        if isinstance(controller, control.TransferFunction):
            return cls._of_polynomials(controller)
        return cls.of_lti(control.ss(controller), "", "")

    @classmethod
    def _of_polynomials(cls, controller: control.TransferFunction) -> _Path:
        import control

        num, den = np.trim_zeros(controller.num[0][0], "f"), np.trim_zeros(controller.den[0][0], "f")
        quotient, rest = np.polydiv(num, den) if len(num) else (np.zeros(1), np.zeros(1))
        if len(quotient) > 2 or (len(quotient) == 2 and controller.dt):
            raise StructureError(
                f"the controller's numerator is {len(num) - len(den)} degrees above its denominator; a derivative "
                "(one degree) is the most a loop can take: add roll-off poles"
            )
        proper = control.ss(control.tf(rest, den, controller.dt))
        path = cls.of_states(proper.A, proper.B, proper.C, proper.D + quotient[-1], controller.dt)
        slope = float(quotient[0]) if len(quotient) == 2 else 0.0
        return replace(
            path,
            curve=lambda s: path.curve(s) + slope * s,
            find_zeros=lambda: np.roots(num),
            derivative=slope,
        )


def _refuse_unspecified(system: control.LTI, what: str) -> None:
    if system.dt is True:
        raise StructureError(
            f"open_loop: the {what} is sampled with an unspecified sample time (dt=True): give it in seconds, "
            "for example dt=0.01"
        )


def _series(body: _Path, side: _Path, name: str) -> Loop:
    """controller · plant; a derivative needs the plant's output to have no direct part."""
    rate, kick = body.C @ body.A, body.C @ body.B
    if side.derivative and body.D.any():
        raise StructureError("a derivative of an output with feedthrough is improper: add roll-off to the controller")
    A = np.block([[body.A, np.zeros((len(body.A), len(side.A)))], [side.B @ body.C, side.A]])
    B = np.vstack([body.B, side.B @ body.D])
    C = np.hstack([side.D @ body.C + side.derivative * rate, side.C])
    D = side.D @ body.D + side.derivative * kick
    return Loop(
        A,
        B,
        C,
        D,
        lambda s: body.curve(s) * side.curve(s),
        lambda: np.concatenate([body.find_zeros(), side.find_zeros()]),
        body.dt or side.dt,
        name,
    )


def _accurate(linear: LinearModel) -> Curve:
    """Second-order evaluation; a large model's evaluator grows with the frequencies asked for."""
    evaluate, top = transfer(linear, 1.0), 1.0

    def curve(s: np.ndarray) -> np.ndarray:
        nonlocal evaluate, top
        need = float(abs(s).max(initial=0.0))
        if need > top:
            top = 2.0 * need
            evaluate = transfer(linear, top)
        return evaluate(np.asarray(s, complex))[0, 0]

    return curve


def _rational(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray) -> Curve:
    evaluate = states_transfer(A, B, C, D)
    return lambda s: evaluate(s)[0, 0]


def _as_lti(plant: Any, dt: float) -> Any:
    import control

    if isinstance(plant, LinearModel):
        return plant.discretize(dt)
    if isinstance(plant, ReducedStates):
        plant = plant.to_ss()
    if not isinstance(plant, control.lti.LTI):
        raise StructureError(f"open_loop: {shortened(plant)} is no linear model; give what linearize or reduce returns")
    system = control.ss(plant)
    if dt and not system.dt:
        system = control.sample_system(system, dt)
    return system


def _check_names(plant: Any, input: str, output: str) -> None:
    """Whether the signals are given and there, before anything is looked at that hangs on more."""
    if isinstance(plant, ReducedStates):
        plant = plant.full
    signals = {
        kind: tuple(getattr(plant, f"{kind}s" if isinstance(plant, LinearModel) else f"{kind}_labels", ()))
        for kind in ("input", "output")
    }
    unsaid = [kind for kind, name in (("input", input), ("output", output)) if not name and len(signals[kind]) > 1]
    if unsaid:
        told = " and ".join(f"{kind}=, one of: {', '.join(signals[kind])}" for kind in unsaid)
        raise StructureError(f"open_loop: which {' and '.join(unsaid)} of the plant? Give {told}")
    for kind, name in (("input", input), ("output", output)):
        if name and signals[kind]:
            _only(name, signals[kind], kind)


def _only(name: str, known: tuple[str, ...], kind: str) -> str:
    if not name and len(known) == 1:
        return known[0]
    if not known:
        raise StructureError(f"open_loop: the plant has no {kind}s")
    if name not in known:
        raise StructureError(f"{kind} {name!r} is not a signal of the plant{did_you_mean(name, known)}")
    return name
