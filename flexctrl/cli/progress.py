"""How far a run is: a bar on a terminal, a line now and then in a log."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from flexctrl.study.compare import Progress

_WIDTH = 30
_SILENT = 10.0
"""Between lines of a log, and before the first [s]."""
_AT_ONCE = 5e-3
"""Within this, what is told was known before [s]."""
_SPANS = ((1.0, "s"), (60.0, "min"), (3600.0, "h"), (86400.0, "days"))
"""Units that a time to wait is told in, from two of them on [s]."""
_LONGEST = 1000 * 86400.0
"""What will take longer is not told any closer [s]."""


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
def progress(what: str) -> Iterator[Progress]:
    """Show on the error stream how far a run is: a bar if that is a terminal, else a line every ten seconds.

    Parameters
    ----------
    what : str
        What is going on.

    Yields
    ------
    callable
        To be told the fraction done.
    """
    if sys.stderr.isatty():
        with _bar(what) as tell:
            yield tell
    else:
        yield _lines(what)


def _lines(what: str) -> Progress:
    """What writes lines into a log, none of what is over soon."""
    pace, written = Pace(), [time.monotonic()]

    def tell(done: float) -> None:
        now = time.monotonic()
        left = pace.left(done, now)
        if now - written[0] >= _SILENT:
            written[0] = now
            print(f"{what}: {100 * done:.0f} % done{_told(left)}", file=sys.stderr, flush=True)

    return tell


def _told(left: float) -> str:
    return f", {spoken(left)} left" if math.isfinite(left) else ""


def spoken(seconds: float) -> str:
    """Return a time to wait in the unit one would say it in.

    Parameters
    ----------
    seconds : float

    Returns
    -------
    str
        ``"25 s"``, ``"12 min"``, ``"5 h"``, ``"3 days"``, at most ``"over 1000 days"``.
    """
    if seconds > _LONGEST:
        return f"over {_LONGEST / _SPANS[-1][0]:.0f} days"
    span, word = next((span, word) for span, word in reversed(_SPANS) if seconds >= 2 * span or span == 1.0)
    return f"{seconds / span:.0f} {word}"


@contextmanager
def _bar(what: str) -> Iterator[Progress]:
    pace = Pace()

    def tell(done: float) -> None:
        full = round(_WIDTH * min(max(done, 0.0), 1.0))
        left = pace.left(done, time.monotonic())
        told = f"  {spoken(left):>7} left" if math.isfinite(left) else ""
        bar = "█" * full + "·" * (_WIDTH - full)
        sys.stderr.write(f"\r{what} {bar} {100 * done:3.0f} %{told}\033[K")
        sys.stderr.flush()

    try:
        yield tell
    finally:
        sys.stderr.write("\r\033[K")
        sys.stderr.flush()


__all__ = ["Pace", "progress", "spoken"]
