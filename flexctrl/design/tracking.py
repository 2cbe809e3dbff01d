"""How commands enter: references followed, reference signals bound, plant inputs driven as functions of time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field
from functools import cached_property
from itertools import pairwise
from numbers import Real

import numpy as np

from flexctrl.design.controller import Controller, as_controller
from flexctrl.design.piecewise import distinct
from flexctrl.design.shaping import check_grid
from flexctrl.design.wrapping import Stateless, Wrapper, breaks_of, check_mapping, check_names, discretised, in_turn_of
from flexctrl.errors import ControllerError
from flexctrl.frozen import frozen

__all__ = ["Commanded", "FeedForward", "OpenLoop", "Together", "Tracking"]

Signal = Callable[[float], float]  # a Trajectory, or any function of time
Pairs = tuple[tuple[int, Signal], ...]  # place in the vector, what is added there


@frozen(eq=False)
class Tracking(Wrapper):
    """Feedback on the deviation from a reference: u = F(y − r(t)).

    With u = −kp y − kd ẏ inside this is u = kp (r − y) + kd (ṙ − ẏ), given the references of both signals::

        move = Shaped(TrapezoidalVelocity(5.0, 1.0, 0.3), zvd(omega))
        Tracking(pd(kp, kd, measured="travel", rate="travel_rate", command="torque"),
                 {"travel": move, "travel_rate": move.derivative})

    A constant reference is an operating point: a law designed on a model linearised there works about it.

    Attributes
    ----------
    controller : Controller
        A regulator from measured signals to plant inputs.
    reference : mapping of str to Trajectory
        For some of its inputs (any function of t will do); the others are fed back as they are.
    """

    reference: Mapping[str, Signal] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        _ = self.pairs

    @cached_property
    def pairs(self) -> Pairs:
        """Places of the signals that functions of time are for, and these."""
        return _indexed(self.reference, self.inputs, "Tracking")

    @property
    def breaks(self) -> tuple[float, ...]:
        return _merged(self.controller, *self.reference.values())

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.controller.command(t, x, self._deviation(t, y))

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.controller.rate(t, x, self._deviation(t, y)) if x.size else x

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.controller.update(t, x, self._deviation(t, y)) if x.size else x

    def sampled(self, sample_time: float) -> Controller:
        _check_grids(self.reference, sample_time)
        return Tracking(discretised(self.controller, sample_time), self.reference)

    def _deviation(self, t: float, y: np.ndarray) -> np.ndarray:
        deviation = np.array(y, dtype=float)
        for place, reference in self.pairs:
            deviation[place] -= reference(t)
        return deviation


@frozen(eq=False)
class Commanded(Wrapper):
    """A controller some of whose inputs are reference signals, bound to functions of time: u = F(y, r(t)).

    For laws that take references beside the measurements, such as those of
    ``control.create_statefbk_iosystem``.

    Attributes
    ----------
    controller : Controller
        Reads plant outputs and reference signals.
    signals : mapping of str to Trajectory
        What each reference signal is; the inputs left over must be plant outputs.
    """

    signals: Mapping[str, Signal] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        _ = self.pairs

    @cached_property
    def pairs(self) -> Pairs:
        """Places of the signals that functions of time are for, and these."""
        return _indexed(self.signals, self.controller.inputs, "Commanded")

    @cached_property
    def measured(self) -> np.ndarray:
        """Places of what is measured among what the controller inside reads."""
        return _places(self.inputs, self.controller.inputs)

    @property
    def inputs(self) -> tuple[str, ...]:
        return tuple(name for name in self.controller.inputs if name not in self.signals)

    @property
    def breaks(self) -> tuple[float, ...]:
        return _merged(self.controller, *self.signals.values())

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.controller.command(t, x, self._completed(t, y))

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.controller.rate(t, x, self._completed(t, y)) if x.size else x

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.controller.update(t, x, self._completed(t, y)) if x.size else x

    def sampled(self, sample_time: float) -> Controller:
        _check_grids(self.signals, sample_time)
        return Commanded(discretised(self.controller, sample_time), self.signals)

    def _completed(self, t: float, y: np.ndarray) -> np.ndarray:
        full = np.empty(len(self.measured) + len(self.pairs))
        full[self.measured] = y
        for place, signal in self.pairs:
            full[place] = signal(t)
        return full


@frozen(eq=False)
class OpenLoop(Stateless):
    """Plant inputs driven as functions of time, nothing measured.

    Attributes
    ----------
    commands : mapping of str to Trajectory
        Plant input → function of t.
    sample_time : float
        0.0 = continuous; else evaluated at the samples and held.
    """

    commands: Mapping[str, Signal]
    sample_time: float = 0.0

    def __post_init__(self) -> None:
        _check_functions(self.commands, "OpenLoop")
        if isinstance(self.sample_time, Real) and self.sample_time > 0.0:
            _check_grids(self.commands, self.sample_time)

    @cached_property
    def _signals(self) -> tuple[Signal, ...]:
        return tuple(self.commands.values())

    @property
    def inputs(self) -> tuple[str, ...]:
        return ()

    @property
    def outputs(self) -> tuple[str, ...]:
        return tuple(self.commands)

    @property
    def breaks(self) -> tuple[float, ...]:
        return _merged(*self.commands.values())

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([signal(t) for signal in self._signals], dtype=float)

    def sampled(self, sample_time: float) -> Controller:
        """Return the same commands evaluated every ``sample_time`` seconds and held.

        Parameters
        ----------
        sample_time : float
            Seconds.

        Returns
        -------
        OpenLoop
        """
        return OpenLoop(self.commands, sample_time)


@frozen(eq=False)
class FeedForward(Wrapper):
    """Functions of time added to what a controller commands: u = F(y) + u_ff(t).

    Attributes
    ----------
    controller : Controller
        Any.
    commands : mapping of str to Trajectory
        For some of the plant inputs it commands; a constant is the load that holds an operating point.
    """

    commands: Mapping[str, Signal] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        _ = self.pairs

    @cached_property
    def pairs(self) -> Pairs:
        """Places of the signals that functions of time are for, and these."""
        return _indexed(self.commands, self.outputs, "FeedForward")

    @property
    def breaks(self) -> tuple[float, ...]:
        return _merged(self.controller, *self.commands.values())

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        u = np.array(self.controller.command(t, x, y), dtype=float)
        for place, signal in self.pairs:
            u[place] += signal(t)
        return u

    def sampled(self, sample_time: float) -> Controller:
        _check_grids(self.commands, sample_time)
        return FeedForward(discretised(self.controller, sample_time), self.commands)


class Together:
    """Several controllers side by side, one per drive say; what they command to the same input adds up.

    Parameters
    ----------
    *controllers : Controller
        All continuous or all sampled alike; `Held` brings a slower one to the samples of the fastest.

    Raises
    ------
    ControllerError
        If their sample times differ.
    """

    def __init__(self, *controllers: Controller) -> None:
        parts = tuple(as_controller(c) for c in controllers)
        times = {part.sample_time for part in parts}
        if len(times) != 1:
            raise ControllerError(_unlike(sorted(times)))
        self.parts = parts
        self.sample_time = times.pop()
        self.inputs = _united(part.inputs for part in parts)
        self.outputs = _united(part.outputs for part in parts)
        ends = np.cumsum([0, *(len(part.initial()) for part in parts)]).tolist()
        self._slices = tuple(slice(a, b) for a, b in pairwise(ends))
        self._reads = tuple(_places(part.inputs, self.inputs) for part in parts)
        self._writes = tuple(_places(part.outputs, self.outputs) for part in parts)

    @property
    def places(self) -> tuple[tuple[Controller, slice, np.ndarray, np.ndarray], ...]:
        """Each part with its share of the states, of what is read and of what is commanded."""
        return tuple(zip(self.parts, self._slices, self._reads, self._writes, strict=True))

    @property
    def breaks(self) -> tuple[float, ...]:
        return _merged(*self.parts)

    @property
    def in_turn(self) -> int:
        return math.lcm(*map(in_turn_of, self.parts))

    def initial(self) -> np.ndarray:
        return np.concatenate([part.initial() for part in self.parts])

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        u = np.zeros(len(self.outputs))
        for part, own, reads, writes in self.places:
            u[writes] += part.command(t, x[own], y[reads])
        return u

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        if not x.size:
            return x
        parts = zip(self.parts, self._slices, self._reads, strict=True)
        return np.concatenate([part.rate(t, x[own], y[reads]) for part, own, reads in parts])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        if not x.size:
            return x
        parts = zip(self.parts, self._slices, self._reads, strict=True)
        return np.concatenate([part.update(t, x[own], y[reads]) for part, own, reads in parts])

    def sampled(self, sample_time: float) -> Controller:
        """Return the same controllers, each sampled.

        Parameters
        ----------
        sample_time : float
            Seconds.

        Returns
        -------
        Together
        """
        return Together(*(discretised(part, sample_time) for part in self.parts))


def _unlike(times: list[float]) -> str:
    """What is to be said of controllers whose sample times differ, 0 among them where one is continuous."""
    fast, *others = (time for time in times if time)
    said = [f"sample the continuous one, or the functions of time, too: Sampled(law, {fast})"] if not times[0] else []
    said += [f"hold the command of a slower one: Held(law, {fast})"] if others else []
    return f"Together needs controllers of one sample time, not {times} s; {', and '.join(said)}"


def _indexed(signals: Mapping[str, Signal], names: tuple[str, ...], what: str) -> Pairs:
    check_names(signals, names, what)
    _check_functions(signals, what)
    return tuple((names.index(name), signal) for name, signal in signals.items())


def _check_functions(signals: Mapping[str, Signal], what: str) -> None:
    check_mapping(signals, what)
    for name, signal in signals.items():
        if not callable(signal):
            held = signal if isinstance(signal, float | int) else 1.0
            use = f"use Constant({held!r})" if held is signal else f"use Constant({held!r}), Table or any f(t)"
            raise ControllerError(f"{what}: {name!r} is given {signal!r}, no function of time; {use}")


def _merged(*parts: object) -> tuple[float, ...]:
    return distinct(instant for part in parts for instant in breaks_of(part))


def _united(groups: Iterable[tuple[str, ...]]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for group in groups for name in group))


def _places(names: tuple[str, ...], among: tuple[str, ...]) -> np.ndarray:
    return np.array([among.index(name) for name in names], dtype=int)


def _check_grids(signals: Mapping[str, Signal], sample_time: float) -> None:
    for signal in signals.values():
        check_grid(getattr(signal, "shortest_period", np.inf), sample_time)
