"""Continuous laws as pure functions over a step, so that compiled steps can ask them.

The state of a law follows the trapezoidal rule, x = x₀ + h/2 (ẋ₀ + f(t, x, y)); every call takes one step of Newton's
method towards it. What depends on time alone has to be polynomials in pieces.
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

_MOST, _STATES = 4000, 12


@frozen(eq=False)
class Answering:
    """A continuous law as a kernel.

    Attributes
    ----------
    kernel : Kernel
        From measurements y, a state x near the one at the end of the step, the state and its rate at the start, the
        length h and what depends on time, to commands, state and rate at the end. For h = 0 the state is that at the
        start, and commands are those there.
    values : numpy.ndarray
        Its parameters.
    clocks : tuple of PiecewisePolynomial
        What depends on time alone.
    states : int
    """

    kernel: Kernel
    values: np.ndarray
    clocks: tuple[PiecewisePolynomial, ...]
    states: int

    @property
    def commands(self) -> int:
        """How many there are."""
        return self.kernel.n_out - 2 * self.states


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
    if law.sample_time or n > _STATES:
        return None
    tracer = _Rates()
    x, y, x0, rate0 = (ca.SX.sym(*s) for s in (("x", n), ("y", len(law.inputs)), ("x0", n), ("rate0", n)))
    h = ca.SX.sym("h")
    try:
        u, rate = tracer.of(law, x, y)
    except NotLowered:
        return None
    paths = [simplified(c) for c in tracer.clocks if isinstance(c, Trajectory)]
    clocks = tuple(c for c in paths if isinstance(c, PiecewisePolynomial))
    if len(clocks) < len(tracer.clocks):
        return None
    after = _nearer(x, x0, rate0, rate, h) if n else x
    inputs, params = ca.vertcat(y, x, x0, rate0, h, *tracer.times), ca.vertcat(*tracer.symbols, ca.SX(0, 1))
    at_end = ca.substitute([u, rate], [x], [after]) if n else [u, rate]
    kernel = Kernel("law", inputs, params, ca.densify(ca.vertcat(at_end[0], after, at_end[1])))
    if kernel.instructions > _MOST:
        return None
    return Answering(kernel, np.array(tracer.values), clocks, n)


def _nearer(x: ca.SX, x0: ca.SX, rate0: ca.SX, rate: ca.SX, h: ca.SX) -> ca.SX:
    """One step of Newton's method towards the trapezoidal rule."""
    import casadi as ca

    slope = ca.SX.eye(x.numel()) - 0.5 * h * ca.jacobian(rate, x)
    return x - ca.solve(ca.densify(slope), x - x0 - 0.5 * h * (rate0 + rate))


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
