"""A line on the terminal that says how far a run is."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from flexctrl.study.compare import Progress

_WIDTH = 30
_AT_ONCE = 5e-3
"""Within this, what is told was known before [s]."""


@dataclass
class Pace:
    """How fast something goes on: what an earlier run has left is done at once, and tells nothing of it.

    Attributes
    ----------
    done : float
        Fraction that was done when it began to take time.
    began : float
        When that was [s].
    last : float
        When it was last told [s].
    """

    done: float = 0.0
    began: float = -math.inf
    last: float = -math.inf

    def left(self, done: float, now: float) -> float:
        """Return how long it will go on [s]; infinite while that is not known.

        Parameters
        ----------
        done : float
            Fraction done.
        now : float
            [s]
        """
        at_once = self.last == self.began and now - self.last < _AT_ONCE
        if math.isinf(self.began) or at_once:
            self.done, self.began = done, now
        self.last = now
        gained = done - self.done
        return (now - self.began) / gained * (1.0 - done) if gained > 0.0 else math.inf


@contextmanager
def progress(what: str) -> Iterator[Progress | None]:
    """Show a bar on the error stream while a run goes on, if that is a terminal.

    Parameters
    ----------
    what : str
        What is going on.

    Yields
    ------
    callable or None
        To be told the fraction done; None if there is nobody to see it.
    """
    if not sys.stderr.isatty():
        yield None
        return
    pace = Pace()

    def tell(done: float) -> None:
        full = round(_WIDTH * min(max(done, 0.0), 1.0))
        left = pace.left(done, time.monotonic())
        told = f"  {left:5.0f} s left" if math.isfinite(left) else ""
        bar = "█" * full + "·" * (_WIDTH - full)
        sys.stderr.write(f"\r{what} {bar} {100 * done:3.0f} %{told}\033[K")
        sys.stderr.flush()

    try:
        yield tell
    finally:
        sys.stderr.write("\r\033[K")
        sys.stderr.flush()


__all__ = ["Pace", "progress"]
