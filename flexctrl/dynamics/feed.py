"""Where a model's inputs come from: nothing, a sampled controller held between instants, or a continuous one."""

from __future__ import annotations

import math
from bisect import bisect_right, insort
from collections.abc import Callable
from dataclasses import field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from flexctrl.design.controller import Controller, as_controller
from flexctrl.design.piecewise import ROUND_OFF
from flexctrl.dynamics.law_state import error, softened, trapezoidal
from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.said import FAULTS, CommandError, blamed, reals, state_of
from flexctrl.errors import ControllerError
from flexctrl.frozen import frozen
from flexctrl.kernels.kernel import FLOAT, Compiled
from flexctrl.model.plant import Plant
from flexctrl.model.state import State

if TYPE_CHECKING:
    from flexctrl.design.answers import Answering
    from flexctrl.design.lowering import Lowered

_SMALL = 1e-7
_NEAR = 1e-10
_ENDLESS = 1e200
"""Commands from here on leave no energy that is a number."""


_NONE = np.zeros(0)


@frozen
class Supply:
    """Inputs at an instant: u, the controller's state, and how fast that changes.

    Attributes
    ----------
    u, x, rate : numpy.ndarray
    slid : bool
        Whether u is between what a continuous law says on both sides of a jump.
    trend, most : numpy.ndarray
        How fast the rate of a continuous law's state has changed over the last step, and how large the state has been;
        empty before the first one.
    """

    u: np.ndarray
    x: np.ndarray
    rate: np.ndarray
    slid: bool = False
    trend: np.ndarray = field(default_factory=lambda: _NONE)
    most: np.ndarray = field(default_factory=lambda: _NONE)

    def after(self, before: Supply, h: float) -> Supply:
        """Return these as inputs at the end of a step, with how the law's state went on over it."""
        if not self.x.size:
            return self
        far = np.abs(before.x) if not before.most.size else before.most
        return replace(self, trend=(self.rate - before.rate) / h, most=np.maximum(far, np.abs(self.x)))


@frozen
class Feed:
    """A controller on a model; without one the inputs stay as they are.

    Attributes
    ----------
    model : Plant
    base : numpy.ndarray, shape (inputs,)
        Constant inputs under the controller's.
    controller : Controller or None
    met : list of float
        The last instant at which a run has found the controller to jump [s].
    """

    model: Plant
    base: np.ndarray
    controller: Controller | None
    met: list[float] = field(default_factory=list, compare=False)

    @property
    def sample_time(self) -> float:
        """Seconds between samples; 0 if nothing is sampled."""
        return self.controller.sample_time if self.controller is not None else 0.0

    @property
    def continuous(self) -> bool:
        """Whether the inputs change between breaks."""
        return self.controller is not None and self.controller.sample_time == 0.0

    @cached_property
    def reacting(self) -> bool:
        """Whether inputs change with the motion within steps: those of a continuous law that reads it."""
        return self.continuous and self.reads.size > 0

    @cached_property
    def breaks(self) -> tuple[float, ...]:
        """Instants at which a continuous command jumps."""
        return tuple(getattr(self.controller, "breaks", ())) if self.continuous else ()

    @cached_property
    def _jumps(self) -> list[float]:
        """All instants at which the controller is known to jump: steps that are taken again feel what they felt."""
        return sorted(self.breaks)

    def meet(self, t: float) -> None:
        """Take note of an instant at which a run has found the controller to jump."""
        self.met[:] = [t]
        insort(self._jumps, t)

    @cached_property
    def untold(self) -> bool:
        """Whether inputs may change with time between breaks as nobody knows beforehand."""
        if not self.continuous:
            return False
        from flexctrl.design.untold import untold  # all kinds of controllers: not for runs without any

        return untold(self.controller)

    @property
    def told_law(self) -> str:
        """What the controller reads and commands, and when, in words."""
        if (c := self.controller) is None:
            return "none"
        when = "continuous" if self.continuous else f"sampled every {c.sample_time:.12g} s"
        aside = getattr(c, "aside", "")
        return f"{when}{aside}: {', '.join(c.inputs) or 'nothing'} to {', '.join(c.outputs)}"

    @cached_property
    def reads(self) -> np.ndarray:
        assert self.controller is not None
        return np.array([self.model.outputs.index(name) for name in self.controller.inputs], dtype=int)

    @cached_property
    def lowered(self) -> Lowered | None:
        """The controller as a kernel; None if it is not sampled, or cannot be one."""
        if self.controller is None or self.continuous:
            return None
        from flexctrl.design.lowering import lowered  # all kinds of controllers: not for runs without any

        return lowered(self.controller)

    @cached_property
    def answering(self) -> Answering | None:
        """The controller as a kernel over a step; None if it is not continuous, or cannot be one."""
        if self.controller is None or not self.continuous:
            return None
        from flexctrl.design.answers import answering

        return answering(self.controller)

    @cached_property
    def spoken(self) -> bool:
        """Whether the controller is continuous, and only Python can be asked for it."""
        return self.continuous and self.answering is None

    @cached_property
    def _asked(self) -> Callable[[np.ndarray, np.ndarray], None] | None:
        """The controller's kernel, where loops may use it too: so that it makes no difference who asks."""
        backend = getattr(self.model, "backend", None)
        if not isinstance(backend, Compiled) or self.lowered is None:
            return None
        return self.lowered.bound(backend, np.arange(self.lowered.kernel.n_in))

    def _said(
        self, asked: Callable[[np.ndarray, np.ndarray], None], t: float, x: np.ndarray, y: np.ndarray
    ) -> tuple[list[float], np.ndarray] | None:
        """What the kernel says; None if that is no number."""
        assert self.lowered is not None
        answer = np.zeros(self.lowered.kernel.n_out)
        asked(np.concatenate([y, x, self.lowered.now(t)]), answer)
        if not np.isfinite(answer).all():
            return None
        commands = len(answer) - self.lowered.states
        return self._total(answer[:commands]), answer[commands:]

    @cached_property
    def writes(self) -> tuple[int, ...]:
        """Numbers of the inputs commanded."""
        assert self.controller is not None
        return tuple(self.model.inputs.index(name) for name in self.controller.outputs)

    @cached_property
    def _base(self) -> list[float]:
        return self.base.tolist()

    def measured(self, state: State) -> np.ndarray:
        """What the controller reads of a state."""
        return self.model.measure(state)[self.reads] if self.reads.size else np.zeros(0)

    @property
    def beginning(self) -> np.ndarray:
        """The controller's state at the start."""
        assert self.controller is not None
        return state_of(self.controller, self.controller.initial(), "initial state")

    def first(self, state: State) -> Supply:
        """Return the inputs at the start."""
        if self.controller is None:
            return Supply(self.base, np.zeros(0), np.zeros(0))
        try:
            x = self.beginning
        except FAULTS as error:
            raise blamed(error, state.t)  # noqa: B904 - its cause is set
        return self.sample(state, Supply(self.base, x, x)) if not self.continuous else self.evaluate(state, x)

    def sample(self, state: State, supply: Supply) -> Supply:
        """Return the inputs from a sample instant on."""
        return self.sampled(state.t, self.measured(state), supply)

    def sampled(self, t: float, y: np.ndarray, supply: Supply) -> Supply:
        """Return the inputs from a sample instant on, of what the controller reads there."""
        u, x = self.told(t, supply.x, y)
        return Supply(np.array(u), x, supply.rate)

    def told(self, t: float, x: np.ndarray, y: np.ndarray) -> tuple[list[float], np.ndarray]:
        """Return the inputs from a sample instant on, and the controller's state."""
        c = self.controller
        assert c is not None
        try:
            if self._asked is not None and (said := self._said(self._asked, t, x, y)) is not None:
                return said
            u = self._total(c.command(t, x, y))
            return u, state_of(c, c.update(t, x, y), "update", x.size) if x.size else x
        except FAULTS as error:
            raise blamed(error, t)  # noqa: B904 - its cause is set

    def restart(self, state: State, supply: Supply) -> Supply:
        """Return the inputs after a break of a continuous command."""
        if not self.continuous:
            return supply
        return replace(self.evaluate(state, supply.x), trend=supply.trend, most=supply.most)

    def evaluate(self, state: State, x: np.ndarray) -> Supply:
        """Return the inputs that a continuous controller in state x gives from now on."""
        assert self.controller is not None
        return self._answered(state.t, self.measured(state), x)

    def renewed(self, t: float, y: np.ndarray, supply: Supply) -> Supply:
        """Return the inputs from a sample instant or a break on, of what the controller reads there."""
        if not self.continuous:
            return self.sampled(t, y, supply)
        return replace(self._answered(t, y, supply.x), trend=supply.trend, most=supply.most)

    def _answered(self, t: float, y: np.ndarray, x: np.ndarray) -> Supply:
        u, rate = self.answer(t, y, x)
        return Supply(np.array(u), x, rate)

    def answer(self, t: float, y: np.ndarray, x: np.ndarray) -> tuple[list[float], np.ndarray]:
        """Return the inputs that a continuous controller in state x gives, and how fast that changes."""
        c = self.controller
        assert c is not None
        rate = self.law_rate(t, y, x) if x.size else x
        try:
            return self._total(c.command(t, x, y)), rate
        except FAULTS as error:
            raise blamed(error, t)  # noqa: B904 - its cause is set

    def law_rate(self, t: float, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return how fast the state x of a continuous controller changes."""
        c = self.controller
        assert c is not None
        try:
            return state_of(c, c.rate(t, x, y), "rate", x.size)
        except FAULTS as error:
            raise blamed(error, t)  # noqa: B904 - its cause is set

    def within(self, state: State, x: np.ndarray) -> Supply:
        """Return these inputs within a step or at its end: one that ends where the command jumps does not feel it."""
        return self.evaluate(state.with_(t=self.short_of_break(state.t)), x)

    def between(self, before: Supply, after: Supply, share: tuple[float, float], state: State) -> Supply:
        """Return the inputs within a step: ``share`` of it done, and its length; the state there."""
        if not self.continuous:
            return before
        s, h = share
        first, last = h * before.rate, h * after.rate
        step = after.x - before.x
        x = before.x + s * (first + s * (3.0 * step - 2.0 * first - last + s * (first + last - 2.0 * step)))
        inside = self.within(state, x)
        if before.slid and after.slid:
            return replace(inside, u=before.u + s * (after.u - before.u), slid=True)
        return inside

    def _total(self, command: Any) -> list[float]:
        u = self._base.copy()
        if command is None:
            raise CommandError("the controller's command is None; return a number for each output (a missing return?)")
        column = type(command) is np.ndarray and command.ndim == 1 and command.dtype is FLOAT
        values = command.tolist() if column else reals(command, "command").ravel().tolist()
        writes = self.writes
        if len(values) != len(writes):
            raise ControllerError(
                f"the controller's command has {len(values)} values; expected one for each of its {len(writes)} outputs"
            )
        for i, value in zip(writes, values):  # noqa: B905 - a few numbers, often: quicker in a list, unchecked again
            u[i] += value
        if not abs(sum(u)) < _ENDLESS:
            name, value = max(zip(self.model.inputs, u, strict=True), key=lambda given: _size(given[1]))
            raise CommandError(
                f"the controller commands {value} for {name!r}; look at its gains and at what it divides by"
            )
        return u

    def at(self, state: State, before: Supply, h: float) -> Supply:
        """Return the inputs at the end of a step of length h; the controller's state follows the trapezoidal rule."""
        if not self.continuous:
            return before
        return self._answer(self.short_of_break(state.t), self.measured(state), before, h)

    def short_of_break(self, t: float) -> float:
        """Return t, or just before where the command jumps there: a step that ends at a jump does not feel it."""
        if not (known := self._jumps):
            return t
        near = _NEAR * abs(t) + 2.0 * ROUND_OFF  # what a trajectory takes for its break is a part of a second, too
        first = bisect_right(known, t - near)
        return t - near if first < len(known) and known[first] < t + near else t

    def _answer(self, t: float, y: np.ndarray, before: Supply, h: float) -> Supply:
        c = self.controller
        assert c is not None
        try:
            if not before.x.size:
                return Supply(np.array(self._total(c.command(t, before.x, y))), before.x, before.x)
            x, rate = trapezoidal(c, t, y, (before.x, before.rate), h)
            return Supply(np.array(self._total(c.command(t, x, y))), x, rate).after(before, h)
        except FAULTS as error:
            raise blamed(error, t)  # noqa: B904 - its cause is set

    def gains(self, state: State, supply: Supply, h: float, seeds: tuple[float, float, float]) -> np.ndarray:
        """Return ∂(inputs)/∂(own motion) through a continuous controller over a step, shape (inputs, n)."""
        n = self.model.n
        if not self.reacting:
            return np.zeros((len(self.base), n))
        rates = self.model.rates(state)
        on_place, on_rates = self.model.signals.slopes(state, rates, self.model.motion.raw)
        T = self.model.motion.jacobian(state)[: self.model.motion.raw]
        C = (seeds[0] * on_place + seeds[1] * on_rates)[self.reads] @ T
        return np.asarray(self._gain(state, supply, h) @ C)

    def slope(self, state: State, supply: Supply, h: float, seeds: tuple[float, float, float]) -> sp.csr_matrix:
        """Return ∂(generalised forces of the inputs)/∂(own motion) through a continuous controller."""
        return self.felt(state, supply, self.gains(state, supply, h, seeds))

    def felt(self, state: State, supply: Supply, gains: np.ndarray) -> sp.csr_matrix:
        """Return the generalised forces of inputs that change with own motion by gains, shape (n, n)."""
        n = self.model.n
        if not gains.any():
            return sp.csr_matrix((n, n))
        T = self.model.motion.jacobian(state)[: self.model.motion.raw]
        slope = (T.T @ self.model.reach(state, supply.u) @ sp.csr_matrix(gains)).tocsr()
        return self.model.switches.freed(state, slope) if self.model.switches.sticks(state) else slope

    def law_error(self, before: Supply, after: Supply, state: State, h: float, tolerance: Tolerance) -> float:
        """Return the local error of the law's state over a step that ends in a state, over what is allowed."""
        if not before.trend.size:
            return 0.0
        c = self.controller
        assert c is not None

        def soften(off: np.ndarray) -> np.ndarray:
            t, y = self.short_of_break(state.t), self.measured(state)
            return softened(c, t, y, (after.x, h), off)

        try:
            return error(before, after, (state.t, h), tolerance, soften)
        except FAULTS as fault:
            raise blamed(fault, state.t)  # noqa: B904 - its cause is set

    def _gain(self, state: State, supply: Supply, h: float) -> np.ndarray:
        """∂u/∂y over a step, by central differences of the controller itself."""
        y = self.measured(state)
        gain = np.zeros((len(self.base), len(y)))
        for i in range(len(y)):
            d = np.zeros(len(y))
            d[i] = _SMALL * max(1.0, abs(y[i]))
            up, down = (self._answer(state.t, y + s * d, supply, h).u for s in (1.0, -1.0))
            gain[:, i] = (up - down) / (2.0 * d[i])
        return gain


def feed_of(model: Plant, controller: Any, inputs: np.ndarray) -> Feed:
    """Return the feed of a controller, or of constant inputs if there is none.

    Raises
    ------
    ControllerError
        If the controller's names are not the model's.
    """
    if controller is None:
        return Feed(model, inputs, None)
    from flexctrl.design.hardware import bare  # all kinds of controllers: not for runs without any

    return Feed(model, inputs, bare(as_controller(controller, model.inputs, model.outputs)))


def _size(value: float) -> float:
    return math.inf if math.isnan(value) else abs(value)
