"""Rows in memory that is bounded: what runs are laid beside each other by, wherever their curves go."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexctrl.dynamics.records.record import Record, Recorder, Table
from flexctrl.frozen import frozen

__all__ = ["Digest", "Watched", "watched"]

_BYTES = 8e6


@frozen
class Digest:
    """Curves in 8 MB: of rows beyond that every second one is dropped, again and again.

    Attributes
    ----------
    states : float
        Bytes of states that may be kept beside the curves.
    """

    states: float = 32e6

    @property
    def every(self) -> None:
        return None

    def start(self, signals: Sequence[str], after: int = 0) -> Digested:
        """Return a recorder; rows are told apart by their numbers in the whole run."""
        return Digested(1 + len(signals), after, max(4, int(_BYTES / 8 / (1 + len(signals)))))


class Digested:
    """A digest being written.

    Parameters
    ----------
    width : int
        Numbers in a row.
    after : int
        Rows that were written before.
    most : int
        How many are kept.
    """

    def __init__(self, width: int, after: int, most: int) -> None:
        self.kept, self.last = Table(width), np.zeros((0, width))
        self.next, self.most, self.stride = after, most, 1

    def row(self, t: float, y: np.ndarray, u: np.ndarray) -> None:
        self.rows(np.array([[t, *y]]), u)

    def rows(self, table: np.ndarray, u: np.ndarray) -> None:
        if not len(table):
            return
        whole = np.hstack([table, np.broadcast_to(u, (len(table), np.shape(u)[-1]))])
        numbers = np.arange(self.next, self.next + len(table))
        self.next, self.last = self.next + len(table), whole[-1:]
        self.kept.rows(whole[numbers % self.stride == 0], np.zeros(0))
        while self.kept.count > self.most:
            self._thin()

    def _thin(self) -> None:
        last = (self.next - 1) // self.stride  # of those kept, counted from the beginning of the run
        odd = (last - self.kept.count + 1) % 2
        rows = self.kept.held[odd : self.kept.count : 2]
        self.kept.held[: len(rows)], self.kept.count = rows.copy(), len(rows)
        self.stride *= 2

    def table(self) -> np.ndarray:
        rows = self.kept.table()
        seen = len(rows) > 0 and rows[-1, 0] == self.last[0, 0]
        return rows if seen else np.vstack([rows, self.last])

    def flush(self) -> None:
        return

    def close(self) -> None:
        return


class Watched:
    """A recorder whose rows are kept as a digest, too: that is what its table is.

    Parameters
    ----------
    recorder : Recorder
    digested : Digested
    """

    def __init__(self, recorder: Recorder, digested: Digested) -> None:
        self.recorder, self.digested = recorder, digested

    def row(self, t: float, y: np.ndarray, u: np.ndarray) -> None:
        self.recorder.row(t, y, u)
        self.digested.row(t, y, u)

    def rows(self, table: np.ndarray, u: np.ndarray) -> None:
        self.recorder.rows(table, u)
        self.digested.rows(table, u)

    def table(self) -> np.ndarray:
        rows = self.digested.table()
        return rows if len(rows) else self.recorder.table()  # those before a run goes on

    def flush(self) -> None:
        self.recorder.flush()

    def close(self) -> None:
        self.recorder.close()


def watched(record: Record, signals: Sequence[str], after: int) -> Recorder:
    """Return a recorder of some signals whose table is enough to tell how far a run is off.

    Parameters
    ----------
    record : Record
    signals : sequence of str
    after : int
        Rows that were written before.

    Returns
    -------
    Recorder
        That of the record itself, if it keeps its rows.
    """
    recorder = record.start(signals, after)
    if isinstance(recorder, Table | Digested):
        return recorder
    return Watched(recorder, Digest().start(signals, after))
