"""Sampled laws as pure functions of state, measurements and the clock, so that a run can evaluate them in machine code.

A law is written down once as a casadi expression; its numbers (gains, limits, steps) stay parameters, so that laws of
one form share their code. What depends on time alone (references, noise) is a table over the samples. A controller
of an own type can join in: it has ``lowered(tracer, x, y)``, which returns its command and next state as expressions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from flexctrl.design.controller import Controller, LinearController
from flexctrl.design.hardware import AntiWindup, Delayed, Noisy, Quantised, RateLimited, Sampled, Saturated
from flexctrl.design.holding import Held
from flexctrl.design.piecewise import Trajectory
from flexctrl.design.tracking import Commanded, FeedForward, OpenLoop, Pairs, Signal, Together, Tracking
from flexctrl.frozen import frozen
from flexctrl.kernels.kernel import Backend, Kernel, Run

if TYPE_CHECKING:
    import casadi as ca

__all__ = ["LAWS", "Lowered", "NotLowered", "Told", "Tracer", "lowered", "once"]

Told = tuple["ca.SX", "ca.SX"]
"""A command and the state at the next sample."""

T = TypeVar("T")

_MOST = 4000
_REMEMBERED = 8
_NEAREST = 1.5 * 2.0**52
"""What is added to this and taken off again is rounded to whole numbers, halves to even ones, as by `numpy.rint`."""


class NotLowered(Exception):
    """A law that cannot be written down."""


@dataclass
class Tracer:
    """What laws are written down with.

    Attributes
    ----------
    values : list of float
        Their numbers.
    symbols : list of casadi.SX
        These as symbols.
    clocks : list of callable
        Functions of time alone.
    times : list of casadi.SX
        These as symbols.
    """

    values: list[float] = field(default_factory=list)
    symbols: list[Any] = field(default_factory=list)
    clocks: list[Signal] = field(default_factory=list)
    times: list[Any] = field(default_factory=list)

    def number(self, array: Any) -> ca.SX:
        """Return numbers as parameters, in the shape they have; a vector becomes a column.

        Parameters
        ----------
        array : array_like
        """
        import casadi as ca

        array = np.asarray(array, dtype=float)
        shape = array.shape if array.ndim == 2 else (array.size, 1)
        symbol = ca.SX.sym(f"p{len(self.symbols)}", *shape)
        self.values += array.reshape(shape).ravel(order="F").tolist()
        self.symbols.append(ca.vec(symbol))
        return symbol

    def clock(self, signal: Signal) -> ca.SX:
        """Return a function of time alone, at the sample.

        Parameters
        ----------
        signal : Trajectory or function of time
        """
        import casadi as ca

        self.clocks.append(signal)
        self.times.append(ca.SX.sym(f"t{len(self.times)}"))
        return self.times[-1]

    def of(self, law: Any, x: ca.SX, y: ca.SX) -> Told:
        """Return the command of a law, and its state at the next sample.

        Parameters
        ----------
        law : Controller
        x : casadi.SX
            Its state, as in `Controller.initial`.
        y : casadi.SX
            What it reads.

        Raises
        ------
        NotLowered
            For a law that does not tell.
        """
        known = LAWS.get(type(law))
        if known is not None:
            return known(law, self, x, y)
        own = getattr(law, "lowered", None)
        if own is None:
            raise NotLowered
        return own(self, x, y)


@frozen(eq=False)
class Lowered:
    """A law as a kernel.

    Attributes
    ----------
    kernel : Kernel
        From measurements, states and what depends on time to commands and the states at the next sample.
    values : numpy.ndarray
        Its parameters.
    clocks : tuple of callable
        The functions of time alone.
    states : int
    """

    kernel: Kernel
    values: np.ndarray
    clocks: tuple[Signal, ...]
    states: int
    _kept: dict[tuple[int, int, float], np.ndarray] = field(default_factory=dict, repr=False)
    _bound: dict[tuple[Any, ...], Run] = field(default_factory=dict, repr=False)

    def bound(self, backend: Backend, gather: np.ndarray) -> Run:
        """Return the kernel on some entries of a vector; kept with the law.

        Parameters
        ----------
        backend : Backend
        gather : numpy.ndarray of int, shape (n_in,)

        Returns
        -------
        Run
        """
        key = (backend, *gather.tolist())
        if key not in self._bound:
            scatter = np.arange(self.kernel.n_out)
            self._bound[key] = backend.bind(self.kernel, gather[None], self.values[None], scatter[None])
        return self._bound[key]

    def now(self, t: float) -> np.ndarray:
        """Return what depends on time alone at an instant [s]."""
        return np.array([clock(t) for clock in self.clocks], dtype=float)

    def table(self, times: np.ndarray) -> np.ndarray:
        """Return what depends on time alone, at some instants.

        Parameters
        ----------
        times : numpy.ndarray, shape (n,)
            [s]

        Returns
        -------
        numpy.ndarray, shape (n, clocks)
        """
        columns = [_along(clock, times) for clock in self.clocks]
        return np.column_stack(columns) if columns else np.zeros((len(times), 0))

    def samples(self, first: int, count: int, period: float) -> np.ndarray:
        """Return what depends on time alone at some samples; what was asked last is remembered.

        Parameters
        ----------
        first, count : int
        period : float
            [s]

        Returns
        -------
        numpy.ndarray, shape (count, clocks)
        """
        key = first, count, period
        if key not in self._kept:
            while len(self._kept) >= _REMEMBERED:
                self._kept.pop(next(iter(self._kept)))
            self._kept[key] = self.table(np.arange(first, first + count) * period)
        return self._kept[key]


_known: WeakKeyDictionary[Any, Lowered | None] = WeakKeyDictionary()


def lowered(law: Controller) -> Lowered | None:
    """Return a sampled controller as a kernel.

    Parameters
    ----------
    law : Controller

    Returns
    -------
    Lowered or None
        None for one that cannot be written down, or is too large to gain by it.
    """
    return once(_known, _lowered, law)


def once(known: WeakKeyDictionary[Any, T], make: Callable[[Controller], T], law: Controller) -> T:
    """Return what is made of a law, made once as long as there is that law."""
    try:
        if law not in known:
            known[law] = make(law)
        return known[law]
    except TypeError:  # no weak reference to it can be had
        return make(law)


def _lowered(law: Controller) -> Lowered | None:
    import casadi as ca

    if not law.sample_time or np.size(law.initial()) * (np.size(law.initial()) + len(law.inputs)) > _MOST:
        return None
    tracer = Tracer()
    x, y = ca.SX.sym("x", np.size(law.initial())), ca.SX.sym("y", len(law.inputs))
    try:
        u, after = tracer.of(law, x, y)
    except NotLowered:
        return None
    inputs = ca.vertcat(y, x, *tracer.times, ca.SX(0, 1))
    kernel = Kernel("law", inputs, ca.vertcat(*tracer.symbols, ca.SX(0, 1)), ca.densify(ca.vertcat(u, after)))
    if kernel.instructions > _MOST:
        return None
    return Lowered(kernel, np.array(tracer.values), tuple(tracer.clocks), x.numel())


# -- the laws there are


def _linear(law: LinearController, tracer: Tracer, x: ca.SX, y: ca.SX) -> Told:
    A, B, C, D = (tracer.number(getattr(law, name)) for name in "ABCD")
    direct = D @ y
    return (direct + C @ x, A @ x + B @ y) if len(law.A) else (direct, x)


def _through(law: Sampled, tracer: Tracer, x: ca.SX, y: ca.SX) -> Told:
    return tracer.of(law.controller, x, y)


def _saturated(law: Saturated, tracer: Tracer, x: ca.SX, y: ca.SX) -> Told:
    u, after = tracer.of(law.controller, x, y)
    return _clipped(u, *(tracer.number(bound) for bound in law.range)), after


def _clipped(u: ca.SX, low: ca.SX, high: ca.SX) -> ca.SX:
    import casadi as ca

    return ca.fmin(ca.fmax(u, low), high)


def _held(law: AntiWindup, tracer: Tracer, x: ca.SX, y: ca.SX) -> Told:
    import casadi as ca

    wish, after = tracer.of(law.controller, x, y)
    u = _clipped(wish, *(tracer.number(bound) for bound in law.range))
    places, effect = law.integrators
    push = tracer.number(effect).T @ (wish - u) if len(places) else ca.SX(0, 1)
    for k, i in enumerate(places.tolist()):
        after[i] = ca.if_else(push[k] * (after[i] - x[i]) > 0.0, x[i], after[i])
    return u, after


def _rate_limited(law: RateLimited, tracer: Tracer, x: ca.SX, y: ca.SX) -> Told:
    import casadi as ca

    n = x.numel() - len(law.outputs)
    wish, after = tracer.of(law.controller, x[:n, :], y)
    down, up = (tracer.number(change) for change in law.changes)
    u = _clipped(wish, x[n:, :] + down, x[n:, :] + up)
    return u, ca.vertcat(after, u)


def _delayed(law: Delayed, tracer: Tracer, x: ca.SX, y: ca.SX) -> Told:
    import casadi as ca

    width = len(law.outputs)
    n = x.numel() - law.samples * width
    u, after = tracer.of(law.controller, x[:n, :], y)
    return (x[n : n + width, :], ca.vertcat(after, x[n + width :, :], u)) if law.samples else (u, after)


def _in_between(law: Held, tracer: Tracer, x: ca.SX, y: ca.SX) -> Told:
    import casadi as ca

    own, held, count = x[: law.states, :], x[law.states : -1, :], x[-1]
    u, after = tracer.of(law.controller, own, y)
    due, every = count < 0.5, tracer.number([law.every - 1.5])
    u = ca.if_else(due, u, held)
    return u, ca.vertcat(ca.if_else(due, after, own), u, ca.if_else(count > every, 0.0, count + 1.0))


def _quantised(law: Quantised, tracer: Tracer, x: ca.SX, y: ca.SX) -> Told:
    (read, steps), (sent, sizes) = law.grids
    u, after = tracer.of(law.controller, x, _rounded(tracer, y, read, steps))
    return _rounded(tracer, u, sent, sizes), after


def _rounded(tracer: Tracer, values: ca.SX, places: np.ndarray, sizes: np.ndarray) -> ca.SX:
    import casadi as ca

    rounded, nearest = ca.SX(values), tracer.number([_NEAREST, _NEAREST])
    for i, size in zip(places.tolist(), sizes, strict=True):
        step = tracer.number([size])
        rounded[i] = (rounded[i] / step + nearest[0] - nearest[1]) * step
    return rounded


def _noisy(law: Noisy, tracer: Tracer, x: ca.SX, y: ca.SX) -> Told:
    import casadi as ca

    def channel(place: int) -> Signal:
        return lambda t: float(law.noise(t)[place])

    read, sent = law.levels
    drawn = [tracer.clock(channel(i)) for i in range(len(read) + len(sent))]
    heard = ca.vertcat(*drawn[: len(read)], ca.SX(0, 1))
    u, after = tracer.of(law.controller, x, y + tracer.number(read) * heard)
    return u + tracer.number(sent) * ca.vertcat(*drawn[len(read) :], ca.SX(0, 1)), after


def _tracking(law: Tracking, tracer: Tracer, x: ca.SX, y: ca.SX) -> Told:
    return tracer.of(law.controller, x, _shifted(tracer, y, law.pairs, -1.0))


def _feed_forward(law: FeedForward, tracer: Tracer, x: ca.SX, y: ca.SX) -> Told:
    u, after = tracer.of(law.controller, x, y)
    return _shifted(tracer, u, law.pairs, 1.0), after


def _shifted(tracer: Tracer, values: ca.SX, pairs: Pairs, sign: float) -> ca.SX:
    import casadi as ca

    shifted = ca.SX(values)
    for place, signal in pairs:
        shifted[place] = shifted[place] + sign * tracer.clock(signal)
    return shifted


def _commanded(law: Commanded, tracer: Tracer, x: ca.SX, y: ca.SX) -> Told:
    import casadi as ca

    full = ca.SX(len(law.controller.inputs), 1)
    for i, place in enumerate(law.measured.tolist()):
        full[place] = y[i]
    for place, signal in law.pairs:
        full[place] = tracer.clock(signal)
    return tracer.of(law.controller, x, full)


def _open(law: OpenLoop, tracer: Tracer, x: ca.SX, y: ca.SX) -> Told:
    import casadi as ca

    return ca.vertcat(*[tracer.clock(signal) for signal in law.commands.values()], ca.SX(0, 1)), x


def _together(law: Together, tracer: Tracer, x: ca.SX, y: ca.SX) -> Told:
    import casadi as ca

    u, after = ca.SX.zeros(len(law.outputs)), []
    for part, own, reads, writes in law.places:
        command, state = tracer.of(part, x[own, :], y[reads.tolist(), :])
        for i, place in enumerate(writes.tolist()):
            u[place] = u[place] + command[i]
        after.append(state)
    return u, ca.vertcat(*after)


def _along(signal: Signal, times: np.ndarray) -> np.ndarray:
    if isinstance(signal, Trajectory):
        return signal.along(times)
    return np.array([float(signal(t)) for t in times.tolist()])


LAWS: dict[type, Callable[[Any, Tracer, Any, Any], Told]] = {
    LinearController: _linear,
    Sampled: _through,
    Saturated: _saturated,
    AntiWindup: _held,
    RateLimited: _rate_limited,
    Delayed: _delayed,
    Held: _in_between,
    Quantised: _quantised,
    Noisy: _noisy,
    Tracking: _tracking,
    FeedForward: _feed_forward,
    Commanded: _commanded,
    OpenLoop: _open,
    Together: _together,
}
"""By the very type: what is derived from one of these has a say of its own."""
