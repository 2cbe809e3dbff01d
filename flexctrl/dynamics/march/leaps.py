"""Steps of the exact method by compiled loops."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from flexctrl.dynamics.alpha.point import AlphaPoint, Coefficients
from flexctrl.dynamics.feed import Supply
from flexctrl.dynamics.linear_motion.exact import ExactStepper, ModalPoint
from flexctrl.dynamics.march.calling import Remembered
from flexctrl.dynamics.march.leaping import Leaps, Tables
from flexctrl.dynamics.march.making import Method
from flexctrl.dynamics.march.marching import Marcher
from flexctrl.dynamics.march.record import DONE
from flexctrl.dynamics.march.stepper import MarchingStepper, Memory
from flexctrl.dynamics.records.dense import Curve
from flexctrl.dynamics.scales import yardsticks
from flexctrl.dynamics.steps import Point
from flexctrl.frozen import frozen
from flexctrl.kernels.native import Packed
from flexctrl.model.model import Model
from flexctrl.model.state import State

__all__ = ["Leaper", "LeapingStepper"]

_MEMORY = Memory(None, Remembered(np.zeros(0), np.zeros(0), -1.0, ()))


@frozen
class LeapPoint(ModalPoint):
    """A point with the modal state as loops have it, and the inputs over the step that led to it."""

    leaping: np.ndarray


class Leaper(Marcher):
    """A linear model on a march of exact steps."""

    leaping = 1

    def __init__(self, model: Model, method: Method) -> None:
        super().__init__(model, method)
        self._tables: dict[tuple[float, int | None], Tables] = {}
        self._known: dict[int | None, tuple[Leaps, Packed]] = {}
        self._steps: ExactStepper | None = None

    def taking(self, steps: ExactStepper) -> Leaper:
        """Take such steps; return the march."""
        self._steps = steps
        if steps.modes not in self._known:
            leaps = Leaps(self.flattened, steps.equations)
            self._known[steps.modes] = leaps, Packed(leaps.record)
        self.leaps, self._numbers = self._known[steps.modes]
        self._numbers.reset()
        self.march.lend("leap", self._numbers)
        return self

    def recall(self, memory: Remembered) -> None:
        """There is nothing to go on from but the point."""
        return

    def _made(self, seeds: tuple[float, float, float], task: int) -> int:
        h, steps = self.march.h, self._steps
        assert steps is not None
        key = float(f"{h:.9e}"), steps.modes
        if key not in self._tables:
            self._tables[key] = Tables.of(steps.nominal(h), steps.propagator, steps.turnover)
        self._numbers.paired, self._numbers.parted = self.leaps.fill(self._tables[key])
        self._numbers.h = h
        return DONE


@dataclass
class LeapingStepper(MarchingStepper):
    """A stepper of exact steps that are marched. For linear models that `can_march`, without a continuous controller.

    Attributes
    ----------
    plain : ExactStepper
    """

    plain: Any

    @cached_property
    def marcher(self) -> Leaper:
        """The model on a march."""
        model = self.plain.model
        method = Method(Coefficients.of(1.0), 0.0, 1.0 / yardsticks(model), np.zeros(model.n, dtype=bool))
        found = Leaper.of(model, method)
        assert isinstance(found, Leaper)
        return found.taking(self.plain)

    @property
    def memory(self) -> Memory:
        """Nothing but the point matters to later steps."""
        return _MEMORY

    def recall(self, memory: Memory) -> None:
        """There is nothing to go on from but the point."""
        self._here = None

    def start(self, state: State, supply: Supply, step: float) -> Any:
        """Return the point of a state."""
        return self.plain.start(state, supply, step)

    def renew(self, point: Any, supply: Supply, step: float) -> Any:
        """Return the point under other inputs."""
        fresh = self.plain.renew(point, supply, step)
        if not isinstance(point, LeapPoint):
            return fresh
        return LeapPoint(fresh.state, fresh.rate, fresh.supply, point.modal, fresh.course, point.leaping)

    def step(self, point: Any, h: float) -> Any:
        """Return the point a step later."""
        return self.plain.step(point, h)

    def error(self, before: Any, after: Any, h: float, moved: np.ndarray, tolerance: Any) -> float:
        """Steps are of one length."""
        return 0.0

    def within(self, point: Any, h: float) -> np.ndarray:
        """Return how far outputs may go to and fro within steps: by vibrations that turn by much in one."""
        return self.marcher.leaps.within(point.modal, self.plain.forcing(point.supply.u), h)

    def enter(self, point: Any) -> None:
        """Put the march at a point, unless it is there."""
        if point is not self._here:
            zero = np.zeros(self.plain.model.n)
            self.marcher.entered(AlphaPoint(point.state, zero, point.supply, zero, zero))
            if isinstance(point, LeapPoint):
                self.marcher.leaps.record.state[:] = point.leaping
            else:
                self.marcher.leaps.modal = point.modal
            self._here = point

    def leave(self, supply: Supply) -> Any:
        """Return where the march stands."""
        m, marcher, first = self.marcher.march, self.marcher, self.plain.equations.first
        state, w = marcher.flattened.state(m.v, m.t, marcher.dry), self.plain.forcing(supply.u)
        modal, course = marcher.leaps.modal, np.zeros((4, len(w)))
        course[0] = w
        rate = first.C[self.plain.model.n :] @ (first.A @ modal + first.B @ w)
        leaping = marcher.leaps.record.state.copy()
        self._here = point = LeapPoint(state, rate, supply, modal, course, leaping)  # type: ignore[assignment]
        return point

    def curve(self, before: Point, after: Point) -> Curve:
        """Return the motion over a step, exact as the steps are."""
        if not isinstance(before, ModalPoint):
            before = self.plain.start(before.state, before.supply, 0.0)
        if not isinstance(after, ModalPoint):
            after = self.plain.step(before, after.state.t - before.state.t)
        return self.plain.curve(before, after)
