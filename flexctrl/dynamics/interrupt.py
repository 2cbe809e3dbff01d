"""Ctrl-C between steps: a run stops where everything it holds fits together."""

from __future__ import annotations

import signal
import threading
from types import FrameType
from typing import Any

__all__ = ["Interruption", "heed"]


class Interruption:
    """While it is entered, the first Ctrl-C is kept until `check`; a second one comes through at once.

    One that is entered within another one knows what that has kept. Signals reach the main thread only: elsewhere there
    is nothing to keep.
    """

    def __init__(self) -> None:
        self._asked = False
        self._before: Any = None
        self._around: Interruption | None = None

    def __enter__(self) -> Interruption:
        if threading.current_thread() is not threading.main_thread():
            return self
        handler = signal.getsignal(signal.SIGINT)
        if handler is signal.default_int_handler:
            self._before = signal.signal(signal.SIGINT, self._note)
        elif isinstance(around := getattr(handler, "__self__", None), Interruption):
            self._around = around
        return self

    def __exit__(self, *error: object) -> None:
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)

    @property
    def asked(self) -> bool:
        """Whether Ctrl-C has been pressed."""
        return self._asked or (self._around is not None and self._around.asked)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self._asked:
            signal.default_int_handler(number, frame)
        self._asked = True

    def check(self) -> None:
        """Raise KeyboardInterrupt if Ctrl-C has been pressed."""
        if self.asked:
            raise KeyboardInterrupt


def heed() -> None:
    """Raise KeyboardInterrupt if Ctrl-C has been pressed and is kept."""
    with Interruption() as kept:
        kept.check()
