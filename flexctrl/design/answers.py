"""Continuous laws as pure functions over a step, so that compiled steps can ask them.

The state of a law follows the trapezoidal rule, x = x₀ + h/2 (ẋ₀ + f(t, x, y)), by Newton's method: its slope ∂f/∂x is
told beside it, and what of that never changes as numbers. What depends on time alone has to be polynomials in pieces.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

from flexctrl.design.controller import Controller, LinearController
from flexctrl.design.hardware import AntiWindup, Quantised, Sampled, Saturated
from flexctrl.design.lowering import LAWS, NotLowered, Told, Tracer, once
from flexctrl.design.piecewise import PiecewisePolynomial, Trajectory, simplified
from flexctrl.design.tracking import Commanded, FeedForward, OpenLoop, Together, Tracking
from flexctrl.frozen import frozen
from flexctrl.kernels.kernel import Kernel

if TYPE_CHECKING:
    import casadi as ca

__all__ = ["Answering", "answering"]

_MOST = 35_000
"""Instructions: a law of 100 states, compiled in 0.7 s."""


@frozen(eq=False)
class Answering:
    """A continuous law as a kernel.

    Attributes
    ----------
    kernel : Kernel
        From measurements y, the state x and what depends on time, to commands and the rate of the state.
    slope : Kernel or None
        From the same to the entries of ∂f/∂x that are not the same for good; None where all are.
    places : numpy.ndarray of int
        Where these are in it.
    slopes : numpy.ndarray, shape (states²,)
        ∂f/∂x, column by column, without these.
    values : numpy.ndarray
        Parameters of both kernels.
    clocks : tuple of PiecewisePolynomial
        What depends on time alone.
    states : int
    """

    kernel: Kernel
    slope: Kernel | None
    places: np.ndarray
    slopes: np.ndarray
    values: np.ndarray
    clocks: tuple[PiecewisePolynomial, ...]
    states: int

    @property
    def commands(self) -> int:
        """How many there are."""
        return self.kernel.n_out - self.states


_known: WeakKeyDictionary[Any, Answering | None] = WeakKeyDictionary()


def answering(law: Controller) -> Answering | None:
    """Return a continuous controller as a kernel.

    Parameters
    ----------
    law : Controller

    Returns
    -------
    Answering or None
        None for one that cannot be written down, or is too large to gain by it.
    """
    return once(_known, _answering, law)


def _answering(law: Controller) -> Answering | None:
    import casadi as ca

    n = np.size(law.initial())
    if law.sample_time or n * n > _MOST:
        return None
    tracer = _Rates()
    x, y = ca.SX.sym("x", n), ca.SX.sym("y", len(law.inputs))
    try:
        u, rate = tracer.of(law, x, y)
    except NotLowered:
        return None
    paths = [simplified(c) for c in tracer.clocks if isinstance(c, Trajectory)]
    clocks = tuple(c for c in paths if isinstance(c, PiecewisePolynomial))
    if len(clocks) < len(tracer.clocks):
        return None
    inputs, params = ca.vertcat(y, x, *tracer.times), ca.vertcat(*tracer.symbols, ca.SX(0, 1))
    kernel = Kernel("law", inputs, params, ca.densify(ca.vertcat(u, rate) if n else u))
    if kernel.instructions > _MOST:
        return None
    values = np.array(tracer.values)
    return Answering(kernel, *_slope(rate, x, (inputs, params), values), values, clocks, n)


def _slope(
    rate: ca.SX, x: ca.SX, given: tuple[ca.SX, ca.SX], values: np.ndarray
) -> tuple[Kernel | None, np.ndarray, np.ndarray]:
    """∂f/∂x: a kernel for what of it may change, where that is, and the rest as numbers."""
    import casadi as ca

    n = x.numel()
    if not n:
        return None, np.zeros(0, dtype=int), np.zeros(0)
    whole = ca.vec(ca.densify(ca.jacobian(rate, x)))
    changing = np.flatnonzero(ca.which_depends(whole, given[0], 1, True))
    rest = ca.SX(whole)
    rest[changing.tolist()] = 0.0
    slopes = np.array(ca.Function("rest", [given[1]], [rest])(values)).ravel()
    if not changing.size:
        return None, changing, slopes
    return Kernel("slope", *given, whole[changing.tolist()], replaces=True), changing, slopes


class _Rates(Tracer):
    """Writes down the command of a law and the rate of its state."""

    def of(self, law: Any, x: ca.SX, y: ca.SX) -> Told:
        """Return the command of a law, and the rate of its state."""
        known = _RATES.get(type(law))
        if known is None:
            raise NotLowered
        return known(law, self, x, y)


def _held(law: AntiWindup, tracer: Tracer, x: ca.SX, y: ca.SX) -> Told:
    import casadi as ca

    wish, rate = tracer.of(law.controller, x, y)
    low, high = (tracer.number(bound) for bound in law.range)
    u = ca.fmin(ca.fmax(wish, low), high)
    places, effect = law.integrators
    push = tracer.number(effect).T @ (wish - u) if len(places) else ca.SX(0, 1)
    for k, i in enumerate(places.tolist()):
        rate[i] = ca.if_else(push[k] * rate[i] > 0.0, 0.0, rate[i])
    return u, rate


def _unrounded(law: Quantised, tracer: Tracer, x: ca.SX, y: ca.SX) -> Told:
    if not law.idle:
        raise NotLowered
    return tracer.of(law.controller, x, y)


_SAME = (LinearController, Sampled, Saturated, Tracking, FeedForward, Commanded, OpenLoop, Together)
_RATES: dict[type, Callable[[Any, Tracer, Any, Any], Told]] = {kind: LAWS[kind] for kind in _SAME} | {
    AntiWindup: _held,
    Quantised: _unrounded,
}
"""By the very type: what is derived from one of these has a say of its own."""
