"""Where the curves of a run go: into memory, or line by line into a file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np

from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import check_number, check_path, check_seconds

__all__ = ["CsvStream", "InMemory", "Record", "Recorder", "Table", "Unwritten", "writing"]

_BEFORE = "give the file that has them (run.save_csv makes it of rows in memory), or InMemory() for the others"


class Unwritten(Exception):
    """What a run records cannot be written, or not be told while it goes on; caused by the error of who was to."""


@contextmanager
def writing(path: str | Path) -> Iterator[None]:
    """Tell what cannot be written, and why, by `Unwritten`."""
    try:
        yield
    except OSError as error:
        raise Unwritten(f"{path} cannot be written: {error.strerror or error}") from error


class Recorder(Protocol):
    """A record being written."""

    def row(self, t: float, y: np.ndarray, u: np.ndarray) -> None:
        """Write the signals of an instant."""

    def rows(self, table: np.ndarray, u: np.ndarray) -> None:
        """Write many rows of (t, y) under the same inputs."""

    def table(self) -> np.ndarray:
        """Return what the run shall hold: rows of (t, y, u)."""

    def flush(self) -> None:
        """Put what has been written where it outlives the process."""

    def close(self) -> None:
        """Let go of what is held open; nothing is written afterwards."""


@runtime_checkable
class Record(Protocol):
    """Where the curves of a run go, as a value."""

    @property
    def every(self) -> float | None:
        """Spacing of the rows [s], if it is not to be the run's."""

    @property
    def states(self) -> float:
        """Bytes of states that may be kept for `Run.at`."""

    def start(self, signals: Sequence[str], after: int = 0) -> Recorder:
        """Return a recorder of time and some signals; ``after`` rows were written before the run was stopped."""


@frozen
class InMemory:
    """Curves are kept by the run: the default.

    Parameters
    ----------
    states : float
        Bytes of states that may be kept beside the curves, for `Run.at`; a run that needs more keeps none of them.

    Raises
    ------
    StructureError
        For a negative number.
    """

    states: float = 32e6

    def __post_init__(self) -> None:
        check_number(self.states, "bytes of states", "InMemory", least=0.0)

    @property
    def every(self) -> None:
        return None

    def start(self, signals: Sequence[str], after: int = 0) -> Table:
        return Table(1 + len(signals))


@frozen
class CsvStream:
    """Curves are written to a file as they come; the run itself holds their first and last rows.

    What is told of errors is told by all rows up to 8 MB of them, and beyond by every second, fourth, … one.

    A file that exists is replaced, unless the run goes on from a checkpoint: then it has to be there, lines follow
    those that were written until there, and what was written since is dropped. Lines are on the disk when the run
    ends, however it ends, and whenever it is saved by `Autosave`.

    Parameters
    ----------
    path : str or Path
    every : float, optional
        Spacing of the rows [s]; default: that of the run.
    states : float
        Bytes of states that may be kept in memory, as in `InMemory`.

    Raises
    ------
    StructureError
        If ``path`` names no file, its folder is not there, or ``every`` is not positive; by `simulate`, if it cannot
        be opened, or is not what the run goes on from. A run that cannot go on writing ends as failed.
    """

    path: str | Path
    every: float | None = None
    states: float = 32e6

    def __post_init__(self) -> None:
        check_path(self.path, "CsvStream")
        check_number(self.states, "bytes of states", "CsvStream", least=0.0)
        if self.every is not None:
            check_seconds(self.every, "every", "CsvStream", endless=True)

    def start(self, signals: Sequence[str], after: int = 0) -> _Stream:
        path, header, going_on = Path(self.path), ",".join(["t", *signals]) + "\n", bool(after)
        if going_on and not path.exists():
            raise StructureError(
                f"CsvStream: {path} is not there, and the run goes on behind the {after} rows that it has written; "
                f"{_BEFORE}"
            )
        try:
            file = path.open("r+" if going_on else "w", encoding="utf-8")
        except OSError as error:
            raise StructureError(f"CsvStream: {path} cannot be opened: {error.strerror}") from error
        if not going_on:
            file.write(header)
            return _Stream(file, 1 + len(signals))
        found, ends = file.readline(), ["", ""]
        for _ in range(after):
            line = file.readline()
            ends = [ends[0] or line, line]
        if found != header or not ends[1]:
            file.close()
            raise StructureError(
                f"CsvStream: {path} is not what the checkpoint goes on from: expected {after} rows of "
                f"{header.strip()}; {_BEFORE}"
            )
        file.seek(file.tell())
        file.truncate()
        return _Stream(file, 1 + len(signals), [[float(number) for number in line.split(",")] for line in ends])


class Table:
    """Rows in one array that grows by half: no object is kept per row."""

    def __init__(self, width: int) -> None:
        self.held = np.empty((64, width))
        self.count = 0

    def row(self, t: float, y: np.ndarray, u: np.ndarray) -> None:
        place = self._room(1)[0]
        place[0] = t
        place[1 : 1 + len(y)] = y
        place[1 + len(y) :] = u

    def rows(self, table: np.ndarray, u: np.ndarray) -> None:
        place = self._room(len(table))
        place[:, : table.shape[1]] = table
        place[:, table.shape[1] :] = u

    def _room(self, more: int) -> np.ndarray:
        """Return the place of the next rows."""
        start, self.count = self.count, self.count + more
        if self.count > len(self.held):
            self.held = np.concatenate([self.held, np.empty((more + start // 2, self.held.shape[1]))])
        return self.held[start : self.count]

    def table(self) -> np.ndarray:
        return self.held[: self.count].copy()

    def flush(self) -> None:
        return

    def close(self) -> None:
        self.held = self.held[: self.count]


class _Stream:
    """Lines of a file; numbers are written so that they read back the same."""

    def __init__(self, file: TextIOWrapper, width: int, ends: Sequence[list[float]] = ()) -> None:
        self.file, self.width = file, width
        self.ends = list(ends)

    def row(self, t: float, y: np.ndarray, u: np.ndarray) -> None:
        values = [float(t), *y.tolist(), *u.tolist()]
        self.ends = [self.ends[0] if self.ends else values, values]
        with writing(self.file.name):
            self.file.write(",".join(map(repr, values)) + "\n")

    def rows(self, table: np.ndarray, u: np.ndarray) -> None:
        for row, now in zip(table, np.broadcast_to(u, (len(table), u.shape[-1])), strict=True):
            self.row(row[0], row[1:], now)

    def table(self) -> np.ndarray:
        return np.array(self.ends).reshape(-1, self.width)

    def flush(self) -> None:
        with writing(self.file.name):
            self.file.flush()

    def close(self) -> None:
        with suppress(OSError):  # told when it was flushed
            self.file.close()
