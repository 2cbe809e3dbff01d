"""Points of a study on disk, to go on from."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from flexctrl.dynamics.run import Tolerance
from flexctrl.errors import StructureError, shortened
from flexctrl.frozen import frozen
from flexctrl.study.answers import Curves
from flexctrl.study.fingerprint import digest_of
from flexctrl.study.reference import Traced
from flexctrl.study.settings import Setting
from flexctrl.study.subject import Subject

__all__ = ["Point", "Store", "fingerprint"]

_TELLS_NOTHING = ("name", "notes", "channel")


@frozen
class Point:
    """One setting that was tried.

    Attributes
    ----------
    setting : Setting
    error : float
        Largest |Δy| of an output over its largest magnitude in the reference; infinite if the run failed.
    time_ratio : float
        Processor time of the run over that of a fixed calculation in the same process; infinite if the run failed,
        NaN before it was timed.
    steps : int
    failure : str
        Why the run ended early; empty if it did not.
    """

    setting: Setting
    error: float
    time_ratio: float
    steps: int
    failure: str = ""


class Store:
    """Points and runs of a study on disk, one a line, the later line counts; in memory only without a path.

    Parameters
    ----------
    path : str or Path, optional
    scene : str
        Which scene the points are of, as `fingerprint` tells it; those of others are passed over.

    Raises
    ------
    StructureError
        If the file cannot be read and written, or holds something else.
    """

    def __init__(self, path: str | Path | None, scene: str) -> None:
        self.path = None if path is None else Path(path)
        self.scene = scene
        self.lines: dict[tuple[str, ...], dict[str, Any]] = {}
        self.torn = False
        if self.path is not None:
            content = _content(self.path)
            self.torn = bool(content) and not content.endswith("\n")
            for number, line in enumerate(content.splitlines(), 1):
                self._read(line, number)

    def _read(self, line: str, number: int) -> None:
        """A line that was cut off while it was written is passed over."""
        try:
            found = json.loads(line)
        except json.JSONDecodeError:
            found = {} if line.startswith("{") else None
        if not isinstance(found, dict):
            raise StructureError(
                f"store {self.path}: line {number} ({shortened(line)}) is no line of a study; give a file of its own"
            )
        if found.get("scene") == self.scene:
            self.lines[tuple(found["key"])] = found

    def known(self, setting: Setting, reference: Setting) -> Point | None:
        """Return what is known of a setting: its error against a reference, and its time if it was timed."""
        found = self.lines.get(("point", repr(setting)))
        if found is None or found["reference"] != repr(reference):
            return None
        return Point(setting, float(found["error"]), self.time(setting), int(found["steps"]), str(found["failure"]))

    def time(self, setting: Setting) -> float:
        """Return the time of a setting; NaN before it was timed."""
        return float(self.lines.get(("point", repr(setting)), {"time_ratio": np.nan})["time_ratio"])

    def keep(self, point: Point, reference: Setting) -> Point:
        """Write a point down, and which reference its error is against; return it."""
        told = {name: getattr(point, name) for name in ("error", "time_ratio", "steps", "failure")}
        self._write(("point", repr(point.setting)), {"reference": repr(reference)} | told)
        return point

    def run(self, setting: Setting) -> Traced | None:
        """Return what a setting's run gave, if it was kept."""
        found = self.lines.get(("run", repr(setting)))
        if found is None:
            return None
        curves = Curves(np.array(found["t"]), tuple(found["outputs"]), np.array(found["y"]), np.array(found["noise"]))
        return Traced(curves, int(found["steps"]))

    def keep_run(self, setting: Setting, run: Traced) -> Traced:
        """Write down what a setting's run gave; return it."""
        curves = run.curves
        rows = {name: getattr(curves, name).tolist() for name in ("t", "y", "noise")} | {"outputs": curves.outputs}
        self._write(("run", repr(setting)), {"steps": run.steps} | rows)
        return run

    def known_held(self, setting: Setting, reference: Setting) -> tuple[float, ...] | None:
        """Return the errors of a setting on the held-out cases against a reference, if they are known."""
        found = self.lines.get(("held out", repr(setting), repr(reference)))
        return None if found is None else tuple(found["errors"])

    def keep_held(self, setting: Setting, reference: Setting, errors: tuple[float, ...]) -> tuple[float, ...]:
        """Write the errors of a setting on the held-out cases down; return them."""
        self._write(("held out", repr(setting), repr(reference)), {"errors": list(errors)})
        return errors

    def notes(self, reference: Setting) -> tuple[str, ...]:
        """Return which held-out cases a reference cannot be run on, as far as is known."""
        return tuple(self.lines.get(("cases", repr(reference)), {"notes": ()})["notes"])

    def keep_notes(self, reference: Setting, notes: tuple[str, ...]) -> tuple[str, ...]:
        """Write down which held-out cases a reference cannot be run on; return it."""
        self._write(("cases", repr(reference)), {"notes": list(notes)})
        return notes

    def told_apart(self, settings: Sequence[Setting], reference: Setting) -> bool:
        """Tell whether settings of nearly the same time were timed in turn."""
        found = self.lines.get(("apart", repr(reference)), {"settings": ()})["settings"]
        return {repr(s) for s in settings} <= set(found)

    def tell_apart(self, settings: Sequence[Setting], reference: Setting) -> None:
        """Write down that settings of nearly the same time were timed in turn."""
        self._write(("apart", repr(reference)), {"settings": [repr(s) for s in settings]})

    @property
    def kept(self) -> int:
        """How many lines of the file are of the scene and count."""
        return 0 if self.path is None else len(self.lines)

    def _write(self, key: tuple[str, ...], content: dict[str, Any]) -> None:
        line = {"scene": self.scene, "key": list(key)} | content
        self.lines[key] = line
        if self.path is not None:
            with self.path.open("a", encoding="utf-8") as file:
                file.write("\n" * self.torn + json.dumps(line) + "\n")
            self.torn = False


def _content(path: Path) -> str:
    """What is in a file that can be written to; made if it is not there."""
    try:
        with path.open("a+", encoding="utf-8") as file:
            file.seek(0)
            return file.read()
    except UnicodeDecodeError:
        raise StructureError(f"store {path}: is no text, so no points of a study; give a file of its own") from None
    except OSError as error:
        raise StructureError(
            f"store {path}: {error.strerror}; give a file in a folder that is there and can be written to"
        ) from None


def fingerprint(scene: Subject) -> str:
    """Return a text that tells a scene from others: its name, and a digest of all that its runs depend on.

    That is the machine, the effects, the controller and the loads with what they enclose, how long it runs and from
    where; not the method and the tolerance, which settings replace, nor notes.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    str

    Raises
    ------
    Untold
        If something in it cannot be told from others; see `digest_of`.
    """
    plan = replace(scene.simulation, method=None, tolerance=Tolerance())
    parts = {f.name: getattr(scene, f.name) for f in fields(cast(Any, scene)) if f.name not in _TELLS_NOTHING}
    return f"{scene.name} {digest_of((type(scene), parts | {'simulation': plan}))[:16]}"


def timed(point: Point) -> bool:
    """Tell whether a point is complete."""
    return not np.isnan(point.time_ratio)
