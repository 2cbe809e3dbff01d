"""Hardware round a controller: sampling, limits, delay, quantisation, noise.

A wrapper is a controller like the one inside it, so they nest: ``Saturated(Sampled(law, 0.01), {"torque": 80})``.
With zero strength (no limit, no delay, zero step, zero noise) each equals what it is wrapped around.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from functools import cached_property, lru_cache

import numpy as np

from flexctrl.design.controller import Controller, LinearController
from flexctrl.design.wrapping import Wrapper, by_name, check_names, discretised
from flexctrl.errors import ControllerError, shortened
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import numbers

__all__ = ["AntiWindup", "Delayed", "Noisy", "Quantised", "RateLimited", "Sampled", "Saturated", "bare"]

Limits = Mapping[str, float | tuple[float, float]]


@frozen(eq=False)
class Sampled(Wrapper):
    """A continuous controller run by a computer: measured, computed and held every ``sample_time`` seconds.

    u(t_k) comes from y(t_k) with no delay (add `Delayed` for one). Between samples the controller sees y held
    (zero-order hold): a linear one, also inside other wrappers, is discretised exactly; any other has its state
    integrated numerically (`IntegratedController`).

    Attributes
    ----------
    controller : Controller
        Continuous; replaced by its sampled form.
    sample_time : float
        Seconds; 0.0 leaves it continuous.
    original : Controller
        As it was given: what runs without a computer in between.

    Raises
    ------
    ControllerError
        For a time that is negative or not finite, and a controller that is sampled at another rate.
    """

    sample_time: float = 0.0
    original: Controller = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= numbers([self.sample_time])[0] < np.inf:
            raise ControllerError(f"Sampled: the sample time {self.sample_time!r} must be 0 or more seconds")
        object.__setattr__(self, "original", self.controller)
        object.__setattr__(self, "controller", discretised(self.controller, self.sample_time))

    def sampled(self, sample_time: float) -> Controller:
        return Sampled(self.controller, sample_time)


@frozen(eq=False)
class Saturated(Wrapper):
    """Commands cut off at limits; the states inside do not notice (see `AntiWindup`).

    Attributes
    ----------
    controller : Controller
        Any.
    limits : mapping of str to float or (float, float)
        Command → largest magnitude, or (lowest, highest); commands left out are free.

    Raises
    ------
    ControllerError
        For a name that is no command, and what is no limit.
    """

    limits: Limits = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        _ = self.range

    @cached_property
    def range(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest commands."""
        return _bounds(self.limits, self.outputs, type(self).__name__)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        low, high = self.range
        return np.minimum(np.maximum(self.controller.command(t, x, y), low), high)


@frozen(eq=False)
class AntiWindup(Saturated):
    """A linear controller with limits that stops integrating while that would push a command further out.

    Conditional integration: every pure integrator among its states (as in `pid`) stands still while
    Σ_j (u_j − sat u_j) C_ji ẋ_i > 0. Otherwise as `Saturated`.

    Attributes
    ----------
    controller : Controller
        Linear: a control.StateSpace or TransferFunction, `Sampled` or not. References and other wrappers go
        outside: ``Tracking(AntiWindup(pid(...), limits), reference)``.
    limits : mapping of str to float or (float, float)
        As for `Saturated`.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        _ = self.integrators

    @cached_property
    def integrators(self) -> tuple[np.ndarray, np.ndarray]:
        """The states that are pure integrators, and their columns of C."""
        law = self.controller.controller if isinstance(self.controller, Sampled) else self.controller
        if not isinstance(law, LinearController):
            raise ControllerError(
                f"AntiWindup needs a linear controller, not {type(law).__name__}: put it inside, "
                "Tracking(AntiWindup(pid(...), limits), reference)"
            )
        drift = np.abs(law.A - (np.eye(len(law.A)) if law.sample_time else 0.0))
        moved = drift.max(axis=1, initial=0.0) > 1e-12 * drift.max(initial=1.0)
        places = np.flatnonzero(~moved)
        return places, law.C[:, places]

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        slope = np.array(self.controller.rate(t, x, y))
        slope[self._stopped(t, x, y, slope)] = 0.0
        return slope

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        after = np.array(self.controller.update(t, x, y))
        stopped = self._stopped(t, x, y, after - x)
        after[stopped] = x[stopped]
        return after

    def _stopped(self, t: float, x: np.ndarray, y: np.ndarray, change: np.ndarray) -> np.ndarray:
        (low, high), (places, effect) = self.range, self.integrators
        wish = self.controller.command(t, x, y)
        excess = wish - np.minimum(np.maximum(wish, low), high)
        return places[excess.dot(effect) * change[places] > 0]


@frozen(eq=False)
class RateLimited(Wrapper):
    """Commands that change by no more than a rate allows from one sample to the next.

    Attributes
    ----------
    controller : Controller
        Sampled.
    limits : mapping of str to float or (float, float)
        Command → largest rate of change per second, or (most negative, most positive).
    before : mapping of str to float
        Commands before the first sample; 0 for those left out.
    """

    limits: Limits = field(default_factory=dict)
    before: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_samples(self.controller, "RateLimited")
        _ = self.changes, self.initial()

    @cached_property
    def changes(self) -> tuple[np.ndarray, np.ndarray]:
        """Most negative and most positive change of the commands from a sample to the next."""
        low, high = _bounds(self.limits, self.outputs, "RateLimited")
        return low * self.sample_time, high * self.sample_time

    def initial(self) -> np.ndarray:
        before = by_name(self.before, self.outputs, 0.0, "RateLimited.before")
        return np.concatenate([self.controller.initial(), before])

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        down, up = self.changes
        n = len(x) - len(up)
        wish, last = self.controller.command(t, x[:n], y), x[n:]
        return np.minimum(np.maximum(wish, last + down), last + up)

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        n = len(x) - len(self.outputs)
        return np.concatenate([self.controller.update(t, x[:n], y), self.command(t, x, y)])


@frozen(eq=False)
class Delayed(Wrapper):
    """Commands that reach the plant a whole number of samples late.

    Attributes
    ----------
    controller : Controller
        Sampled.
    samples : int
        d ≥ 0: what is computed at t_k acts from t_{k+d}.
    before : mapping of str to float
        Commands until the first one arrives; 0 for those left out.
    """

    samples: int = 0
    before: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_samples(self.controller, "Delayed")
        _require_whole(self.samples, "Delayed: samples")
        _ = self.initial()

    def initial(self) -> np.ndarray:
        before = by_name(self.before, self.outputs, 0.0, "Delayed.before")
        return np.concatenate([self.controller.initial(), np.tile(before, self.samples)])

    @cached_property
    def _width(self) -> int:
        return len(self.outputs)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        if not self.samples:
            return self.controller.command(t, x, y)
        oldest = len(x) - self.samples * self._width
        return x[oldest : oldest + self._width]

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        if not self.samples:
            return self.controller.update(t, x, y)
        n = len(x) - self.samples * self._width
        own, waiting = x[:n], x[n + self._width :]
        return np.concatenate([self.controller.update(t, own, y), waiting, self.controller.command(t, own, y)])


@frozen(eq=False)
class Quantised(Wrapper):
    """Measurements or commands rounded to whole steps: encoder counts, converter bits.

    Attributes
    ----------
    controller : Controller
        Any.
    steps : mapping of str to float
        Signal it reads or commands → size of a step; 0 leaves it as it is.
    """

    steps: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        _ = self.grids

    @cached_property
    def grids(self) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        """Places and sizes of the steps among the signals read, and among those commanded."""
        sizes = _signal_values(self.steps, self, "Quantised")
        return tuple((np.flatnonzero(s), s[np.flatnonzero(s)]) for s in sizes)

    @property
    def idle(self) -> bool:
        """Whether nothing is rounded."""
        return not any(len(places) for places, _ in self.grids)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        read, sent = self.grids
        return _rounded(self.controller.command(t, x, _rounded(y, *read)), *sent)

    def rate(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.controller.rate(t, x, _rounded(y, *self.grids[0]))

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.controller.update(t, x, _rounded(y, *self.grids[0]))


@frozen(eq=False)
class Noisy(Wrapper):
    """White Gaussian noise on measurements or commands, the same in every run.

    The noise of sample k depends on the seed, k and the signal's place only: command and update see the same
    one, and it does not matter how often or in what order they are called.

    Attributes
    ----------
    controller : Controller
        Sampled; sample k is the one at t = k · sample_time.
    std : mapping of str to float
        Signal it reads or commands → standard deviation.
    seed : int
        0 or more.
    """

    std: Mapping[str, float] = field(default_factory=dict)
    seed: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_samples(self.controller, "Noisy")
        _require_whole(self.seed, "Noisy: seed")
        _ = self.levels

    @cached_property
    def levels(self) -> tuple[np.ndarray, np.ndarray]:
        """Standard deviations of the signals read, and of those commanded."""
        return _signal_values(self.std, self, "Noisy")

    @cached_property
    def _period(self) -> float:
        return self.sample_time

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        (read, sent), noise = self.levels, self.noise(t)
        return self.controller.command(t, x, y + read * noise[: len(read)]) + sent * noise[len(read) :]

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        read = self.levels[0]
        return self.controller.update(t, x, y + read * self.noise(t)[: len(read)])

    def noise(self, t: float) -> np.ndarray:
        """Return the noise of a sample, of unit deviation.

        Parameters
        ----------
        t : float
            Its instant [s].

        Returns
        -------
        numpy.ndarray, shape (n_inputs + n_outputs,)
            Of the signals read, then of those commanded.
        """
        block, row = divmod(round(t / self._period), _BLOCK)
        return _normals(self.seed, block, sum(map(len, self.levels)))[row]


def bare(controller: Controller) -> Controller:
    """Return a controller without wrappers of no strength around it: no sample time, nothing that is rounded.

    Parameters
    ----------
    controller : Controller

    Returns
    -------
    Controller
    """
    while (type(controller) is Sampled and not controller.sample_time) or (
        type(controller) is Quantised and controller.idle
    ):
        controller = controller.controller
    return controller


_BLOCK = 1024


@lru_cache(maxsize=64)
def _normals(seed: int, block: int, signals: int) -> np.ndarray:
    key = 2 * block if block >= 0 else -2 * block - 1  # a generator takes no negative number
    normals = np.random.default_rng((seed, key)).standard_normal((_BLOCK, signals))
    normals.flags.writeable = False
    return normals


def _rounded(values: np.ndarray, places: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    if not places.size:
        return values
    rounded = np.array(values, dtype=float)
    rounded[places] = np.rint(rounded[places] / sizes) * sizes
    return rounded


def _bounds(limits: Limits, names: Sequence[str], what: str) -> tuple[np.ndarray, np.ndarray]:
    check_names(limits, names, what)
    pairs = {name: _pair(value, f"{what}: the limit of {name!r}") for name, value in limits.items()}
    low = by_name({name: pair[0] for name, pair in pairs.items()}, names, -np.inf, what)
    high = by_name({name: pair[1] for name, pair in pairs.items()}, names, np.inf, what)
    for name, (lowest, highest) in pairs.items():
        if lowest > highest:
            raise ControllerError(
                f"{what}: the limits of {name!r} are ({lowest}, {highest}); give a magnitude > 0 or (lowest, highest)"
            )
    return low, high


def _pair(limit: float | Sequence[float], what: str) -> tuple[float, float]:
    size = numbers([limit])[0]
    pair = numbers(limit) if np.isnan(size) else (-size, size)
    if len(pair) != 2 or np.isnan(pair).any():
        raise ControllerError(f"{what} is {limit!r}; give a magnitude > 0 or (lowest, highest)")
    return pair


def _signal_values(values: Mapping[str, float], of: Controller, what: str) -> tuple[np.ndarray, np.ndarray]:
    """Values by name as two arrays: for the signals read and for those commanded."""
    check_names(values, (*of.inputs, *of.outputs), what)
    for name, value in values.items():
        if name in of.inputs and name in of.outputs:
            raise ControllerError(f"{what}: {name!r} is both read and commanded; rename one of the plant's signals")
        if not 0 <= numbers([value])[0] < np.inf:
            raise ControllerError(f"{what}: {name!r} is given {value}, which must be 0 or more")
    read = {name: value for name, value in values.items() if name in of.inputs}
    sent = {name: value for name, value in values.items() if name in of.outputs}
    return by_name(read, of.inputs, 0.0, what), by_name(sent, of.outputs, 0.0, what)


def _require_samples(controller: Controller, what: str) -> None:
    if not controller.sample_time:
        raise ControllerError(
            f"{what} counts samples, and the controller inside is continuous: {what}(Sampled(controller, 0.01), …)"
        )


def _require_whole(value: int, what: str) -> None:
    number = numbers([value])[0]
    if not number >= 0 or number % 1.0 != 0.0:
        raise ControllerError(f"{what} = {shortened(value)} must be a whole number, 0 or more")
