"""Points of a study on disk, to go on from."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from flexctrl.dynamics.checkpoint import machine_of
from flexctrl.study.answers import Curves
from flexctrl.study.reference import Reference, refined_by
from flexctrl.study.settings import Setting
from flexctrl.study.subject import Subject

__all__ = ["Point", "Store", "fingerprint"]


@dataclass(frozen=True)
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
    """Points and references on disk, one a line, the later line of a setting counts; in memory only without a path.

    Parameters
    ----------
    path : str or Path, optional
    scene : str
        Which scene the points are of, as `fingerprint` tells it; those of others are passed over.
    """

    def __init__(self, path: str | Path | None, scene: str) -> None:
        self.path = None if path is None else Path(path)
        self.scene = scene
        self.lines: dict[str, dict[str, Any]] = {}
        self.references: dict[str, dict[str, Any]] = {}
        self.held: dict[tuple[str, str], tuple[float, ...]] = {}
        if self.path is not None and self.path.is_file():
            for line in self.path.read_text(encoding="utf-8").splitlines():
                self._read(line)

    def _read(self, line: str) -> None:
        """A line that was cut off while it was written is passed over."""
        try:
            found = json.loads(line)
        except json.JSONDecodeError:
            return
        if found.get("scene") != self.scene:
            return
        if "outputs" in found:
            self.references[found["reference"]] = found
        elif "held_out" in found:
            self.held[found["setting"], found["reference"]] = tuple(found["held_out"])
        else:
            self.lines[found["setting"]] = found

    def known(self, setting: Setting) -> Point | None:
        """Return what is known of a setting: its error, and its time if it was timed."""
        found = self.lines.get(repr(setting))
        if found is None:
            return None
        numbers = float(found["error"]), float(found["time_ratio"]), int(found["steps"])
        return Point(setting, *numbers, str(found["failure"]))

    def keep(self, point: Point) -> Point:
        """Write a point down; return it."""
        line = {"scene": self.scene, "setting": repr(point.setting)} | {
            name: getattr(point, name) for name in ("error", "time_ratio", "steps", "failure")
        }
        self.lines[repr(point.setting)] = line
        self._write(line)
        return point

    def reference(self, finest: Setting) -> Reference | None:
        """Return the reference that was found when a setting was the first tried for it."""
        found = self.references.get(repr(finest))
        if found is None or "noise" not in found:
            return None
        curves = Curves(np.array(found["t"]), tuple(found["outputs"]), np.array(found["y"]), np.array(found["noise"]))
        refined = tuple(found["refined"])
        return Reference(curves, refined_by(finest, refined), dict(found["agreement"]), refined)

    def keep_reference(self, finest: Setting, reference: Reference) -> Reference:
        """Write a reference down under the setting that was the first tried for it; return it."""
        line = {
            "scene": self.scene,
            "reference": repr(finest),
            "refined": list(reference.refined),
            "agreement": reference.agreement,
            "outputs": list(reference.run.outputs),
            "t": reference.run.t.tolist(),
            "y": reference.run.y.tolist(),
            "noise": reference.run.noise.tolist(),
        }
        self.references[repr(finest)] = line
        self._write(line)
        return reference

    def known_held(self, setting: Setting, reference: Setting) -> tuple[float, ...] | None:
        """Return the errors of a setting on the held-out cases against a reference, if they are known."""
        return self.held.get((repr(setting), repr(reference)))

    def keep_held(self, setting: Setting, reference: Setting, errors: tuple[float, ...]) -> tuple[float, ...]:
        """Write the errors of a setting on the held-out cases down; return them."""
        self.held[repr(setting), repr(reference)] = errors
        line = {"setting": repr(setting), "reference": repr(reference), "held_out": list(errors)}
        self._write({"scene": self.scene} | line)
        return errors

    def _write(self, line: dict[str, Any]) -> None:
        if self.path is not None:
            with self.path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")


def fingerprint(scene: Subject) -> str:
    """Return a text that tells a scene from others: its name, and a digest of machine, effects, loads and run.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    str
        Controllers and loads that are functions have no part in it.
    """
    loads = {name: float(load) for name, load in scene.loads.items() if not callable(load)}
    plan = replace(scene.simulation, method=None)
    text = repr((machine_of(scene.model), sorted(loads.items()), plan))
    return f"{scene.name} {hashlib.sha256(text.encode()).hexdigest()[:12]}"


def timed(point: Point) -> bool:
    """Tell whether a point is complete."""
    return not np.isnan(point.time_ratio)
