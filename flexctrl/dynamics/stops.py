"""The instants at which inputs jump: steps end there."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["Stops"]


@dataclass
class Stops:
    """Sample instants or breaks of a command, one after the other.

    Attributes
    ----------
    sample : float
        Seconds between samples; 0 if nothing is sampled.
    breaks : tuple of float
        In order.
    passed : int
        How many are over.
    found : float
        An instant beside these at which a law was found to change with time [s]; infinity if there is none.
    """

    sample: float
    breaks: tuple[float, ...]
    passed: int = 0
    found: float = math.inf

    @property
    def next(self) -> float:
        """The next instant; infinity if there is none."""
        if self.sample:
            return (self.passed + 1) * self.sample
        return min(self.found, self.breaks[self.passed] if self.passed < len(self.breaks) else math.inf)

    def go_by(self, t: float) -> None:
        """Leave an instant behind."""
        if t == self.found:
            self.found = math.inf
        else:
            self.passed += 1

    def skip(self, t: float) -> None:
        """Leave out the breaks up to a time."""
        while not self.sample and self.next <= t:
            self.passed += 1
