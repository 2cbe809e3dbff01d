"""Where a run stands, as a value: to be kept in a file and gone on from, bit for bit."""

from __future__ import annotations

import hashlib
import importlib
import json
import os
import zlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, is_zipfile

import numpy as np

from flexctrl.dynamics.origin import Origin
from flexctrl.dynamics.records.books import Sums
from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.steps import Counts, Mark, Pace, Point
from flexctrl.errors import StructureError, did_you_mean
from flexctrl.frozen import frozen
from flexctrl.model.plant import Plant
from flexctrl.structure.freedoms import check_path, check_seconds, written

__all__ = ["Autosave", "Checkpoint", "check_same", "load_checkpoint", "machine_of"]

_FORMAT = 21
_HOUSE = "flexctrl."
_UNREADABLE = (KeyError, ValueError, TypeError, AttributeError, ImportError, EOFError, BadZipFile, zlib.error)


@frozen(eq=False)
class Checkpoint:
    """All that the rest of a run depends on beside model, controller and method: from ``run.checkpoint``.

    ``simulate(model, controller, until=…, start=checkpoint)`` goes on as if the run had not been stopped.

    Attributes
    ----------
    machine : str
        Digest of the model it belongs to.
    method : str
        The method, as text.
    pace : Fixed or Controlled
        How long its steps are.
    tolerance : Tolerance
        That of the run.
    base : numpy.ndarray, shape (inputs,)
        Constant inputs under the controller's.
    law : str
        What its controller reads and commands, and when.
    events : tuple of str
        What is looked for, each in words.
    point : Point
        State of the machine, its accelerations, state of the controller.
    memory : object
        What the stepper goes on from.
    passed : int
        Sample instants or breaks that are over.
    found : float
        The next instant found at which a law changes with time alone [s]; infinity if none is.
    mark : Mark
        Step length, and what is left to the next stop.
    rows : int
        Rows written.
    every : float or None
        Their spacing [s]; None: every step.
    sums : Sums
        The energy books.
    first : numpy.ndarray, shape (n,)
        Where the run began.
    sides, sizes : numpy.ndarray
        Of the gauges of events.
    span : int
        Steps taken at once before it is looked at whether an event has happened.
    counts : Counts
    told : float
        Events up to this time have been told [s].
    balked : bool
        Whether the next step is to be taken by itself.
    read : numpy.ndarray, shape (outputs,)
        What compiled loops have read at a sample that is due, which may differ in the last digit from what is read
        elsewhere; empty if they have not.
    origin : Origin
        Where the whole run began.
    """

    machine: str
    method: str
    pace: Pace
    tolerance: Tolerance
    base: np.ndarray
    law: str
    events: tuple[str, ...]
    point: Point
    memory: Any
    passed: int
    found: float
    mark: Mark
    rows: int
    every: float | None
    sums: Sums
    first: np.ndarray
    sides: np.ndarray
    sizes: np.ndarray
    span: int
    counts: Counts
    told: float
    balked: bool
    read: np.ndarray
    origin: Origin

    @property
    def t(self) -> float:
        """Time [s]."""
        return self.point.state.t

    def save(self, path: str | Path) -> None:
        """Write to a file (numpy's .npz; nothing in it is executed when it is read).

        The file is complete or not there at all: it is written beside and then moved.

        Parameters
        ----------
        path : str or Path
            Name of the file; no ending is added.

        Raises
        ------
        StructureError
            If ``path`` names no file, its folder is not there, or it cannot be written.
        """
        with written(path, "Checkpoint.save"):
            self.put(path)

    def put(self, path: str | Path) -> None:
        """Write to a file as `save` does, with the system's own word where that cannot be.

        Parameters
        ----------
        path : str or Path
        """
        arrays: dict[str, np.ndarray] = {}
        tree = _packed(self, arrays)
        text = json.dumps({"format": _FORMAT, "checkpoint": tree})
        beside = Path(f"{path}.part")
        try:
            with beside.open("wb") as file:
                np.savez(file, allow_pickle=False, tree=np.frombuffer(text.encode(), dtype=np.uint8), **arrays)
            os.replace(beside, path)
        finally:
            with suppress(OSError):
                beside.unlink(missing_ok=True)


def load_checkpoint(path: str | Path) -> Checkpoint:
    """Read what :meth:`Checkpoint.save` wrote.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Checkpoint

    Raises
    ------
    StructureError
        If the file is not there, or no checkpoint of this version.
    """
    check_path(path, "load_checkpoint")
    try:
        with Path(path).open("rb") as opened:
            if not is_zipfile(opened):
                raise ValueError("it is no archive of numpy's (.npz), or only part of one")
        with np.load(Path(path), allow_pickle=False) as file:
            content = json.loads(file["tree"].tobytes().decode())
            version = content["format"]
            found = _unpacked(content["checkpoint"], file) if version == _FORMAT else None
    except OSError as error:
        raise StructureError(
            f"load_checkpoint: {path} cannot be read: {error.strerror or error}{_beside(Path(path))}"
        ) from error
    except _UNREADABLE as error:
        raise StructureError(f"{path} is no checkpoint: {error}; give a file that Checkpoint.save wrote") from error
    if version != _FORMAT:
        raise StructureError(
            f"{path} is a checkpoint of another version of flexctrl (format {version}; expected {_FORMAT}); go on with "
            "that version, or begin the run anew"
        )
    if not isinstance(found, Checkpoint):
        raise StructureError(f"{path} holds a {type(found).__name__}; give a file that Checkpoint.save wrote")
    return found


def _beside(path: Path) -> str:
    """What to give in place of a file: one of those in its folder."""
    others = sorted(other.name for other in path.parent.glob("*.npz") if other != path)
    return did_you_mean(path.name, others) or "; give a file that Checkpoint.save wrote"


@frozen
class Autosave:
    """Checkpoints written while a run goes on, each replacing the one before.

    The first is written ``seconds`` after the run has begun; one that ends sooner writes none. The clock is looked at
    between steps, or between stretches of those that compiled loops take at once. A file takes some milliseconds to
    write: a run that is to save more often does little else.

    Parameters
    ----------
    path : str or Path
    seconds : float
        Wall-clock time between them [s].

    Raises
    ------
    StructureError
        If ``path`` names no file, its folder is not there, or ``seconds`` is not positive.
    """

    path: str | Path
    seconds: float = 60.0

    def __post_init__(self) -> None:
        check_path(self.path, "Autosave")
        check_seconds(self.seconds, "seconds", "Autosave", endless=True)


def check_same(what: str, now: object, before: object) -> None:
    """Raise where a run is asked for another way than the one that its checkpoint was taken from.

    Parameters
    ----------
    what : str
        What of it, in words.
    now, before : object
        Here, and there.

    Raises
    ------
    StructureError
    """
    if now != before:
        raise StructureError(
            f"simulate: the checkpoint is of another {what} ({before} there, {now} here); give what the run had"
        )


def machine_of(model: Plant) -> str:
    """Return a digest of a model: its names, its effects and its parts' numbers."""
    known = model.__dict__.get("_digest")
    if known is None:
        known = model.__dict__["_digest"] = _digest(model)
    return known


def _digest(model: Plant) -> str:
    digest = hashlib.sha256(repr((model.coordinates, model.inputs, model.outputs, model.effects)).encode())
    for numbers in model.numbers:
        digest.update(np.ascontiguousarray(numbers).tobytes())
    return digest.hexdigest()


def _packed(value: Any, arrays: dict[str, np.ndarray]) -> Any:
    """Return a value as JSON; arrays are put aside under a number."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        arrays[f"a{len(arrays)}"] = value
        return {"array": f"a{len(arrays) - 1}"}
    kind = type(value)
    if is_dataclass(value) and kind.__module__.startswith(_HOUSE):
        parts = {f.name: _packed(getattr(value, f.name), arrays) for f in fields(value)}
        return {"kind": f"{kind.__module__}:{kind.__qualname__}", "fields": parts}
    if isinstance(value, tuple) and hasattr(value, "_fields") and kind.__module__.startswith(_HOUSE):
        parts = {name: _packed(getattr(value, name), arrays) for name in value._fields}
        return {"kind": f"{kind.__module__}:{kind.__qualname__}", "fields": parts}
    if isinstance(value, tuple | list):
        return {"items": [_packed(item, arrays) for item in value]}
    raise StructureError(f"a checkpoint cannot hold a {kind.__name__}")


def _unpacked(tree: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    if not isinstance(tree, dict):
        return tree
    if "array" in tree:
        return arrays[tree["array"]]
    if "items" in tree:
        return tuple(_unpacked(item, arrays) for item in tree["items"])
    module, _, name = tree["kind"].partition(":")
    kind = getattr(importlib.import_module(module), name) if module.startswith(_HOUSE) else None
    if kind is None or not (is_dataclass(kind) or hasattr(kind, "_fields")):
        raise ValueError(f"{tree['kind']} is not a value of flexctrl")
    return kind(**{key: _unpacked(part, arrays) for key, part in tree["fields"].items()})
