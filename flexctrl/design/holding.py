"""A slower law beside faster ones: asked at every k-th of their samples, its command held in between."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from flexctrl.design.controller import Controller
from flexctrl.design.wrapping import Wrapper, in_turn_of
from flexctrl.errors import ControllerError
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import numbers

__all__ = ["Held"]

_WHOLE = 1e-9
"""Shares by which a ratio of sample times may miss a whole number."""


@frozen(eq=False)
class Held(Wrapper):
    """A sampled law in a faster loop: asked at its own samples, its command held over the shorter ones.

    At its own samples it does what it does alone. `Together` takes it beside laws of the shorter sample time::

        Together(Held(position_loop, 0.001), speed_loop)

    Attributes
    ----------
    controller : Controller
        Sampled at a whole multiple of ``sample_time``.
    sample_time : float
        Of the faster loop [s].

    Raises
    ------
    ControllerError
        If the law is continuous, or its sample time no whole multiple.
    """

    sample_time: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        own, fast = self.controller.sample_time, numbers([self.sample_time])[0]
        if not own:
            raise ControllerError("Held: the law inside is continuous; give Sampled(law, seconds)")
        ratio = own / fast if 0.0 < fast < np.inf else np.nan
        if not (ratio >= 1.0 - _WHOLE and abs(ratio - round(ratio)) <= _WHOLE * ratio):
            raise ControllerError(
                f"Held: the law inside is sampled every {own} s, no whole multiple of {self.sample_time!r} s; give a "
                "sample time that goes into it"
            )

    @cached_property
    def every(self) -> int:
        """Samples of the faster loop to one of the law."""
        return round(self.controller.sample_time / self.sample_time)

    @property
    def in_turn(self) -> int:
        return self.every * in_turn_of(self.controller)

    @cached_property
    def states(self) -> int:
        """Of the law inside; its command and the count of samples since follow."""
        return len(self.controller.initial())

    def initial(self) -> np.ndarray:
        return np.concatenate([self.controller.initial(), np.zeros(len(self.outputs)), [0.0]])

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.controller.command(t, x[: self.states], y) if _due(x) else x[self.states : -1]

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        own = x[: self.states]
        after = self.controller.update(t, own, y) if _due(x) and own.size else own
        count = 0.0 if x[-1] > self.every - 1.5 else x[-1] + 1.0
        return np.concatenate([after, self.command(t, x, y), [count]])

    def sampled(self, sample_time: float) -> Controller:
        return Held(self.controller, sample_time)


def _due(x: np.ndarray) -> bool:
    return bool(x[-1] < 0.5)
