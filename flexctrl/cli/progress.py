"""A line on the terminal that says how far a run is."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from flexctrl.study.compare import Progress

_WIDTH = 30


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
    began = time.monotonic()

    def tell(done: float) -> None:
        full = round(_WIDTH * min(max(done, 0.0), 1.0))
        left = (time.monotonic() - began) * (1.0 / max(done, 1e-6) - 1.0)
        bar = "█" * full + "·" * (_WIDTH - full)
        sys.stderr.write(f"\r{what} {bar} {100 * done:3.0f} %  {left:5.0f} s left\033[K")
        sys.stderr.flush()

    try:
        yield tell
    finally:
        sys.stderr.write("\r\033[K")
        sys.stderr.flush()


__all__ = ["progress"]
