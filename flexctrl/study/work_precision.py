"""Work against precision on the user's own scene: error and time of many settings, and the cheapest that will do."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.run import Run
from flexctrl.errors import FlexctrlError, StructureError
from flexctrl.study.held_out import load_cases
from flexctrl.study.omissions import Subject
from flexctrl.study.reference import Reference, certified, error_of, finished
from flexctrl.study.settings import Setting, sweep

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Point", "WorkPrecision", "work_precision"]

_REPEATS = 2


@dataclass(frozen=True)
class Point:
    """One setting that was tried.

    Attributes
    ----------
    setting : Setting
    error : float
        Largest |Δy| of an output over its largest magnitude in the reference; infinite if the run failed.
    time_ratio : float
        Processor time of the run over that of a fixed calculation in the same process; infinite if the run failed.
    steps : int
    failure : str
        Why the run ended early; empty if it did not.
    """

    setting: Setting
    error: float
    time_ratio: float
    steps: int
    failure: str = ""


@dataclass(frozen=True, eq=False)
class WorkPrecision:
    """Error and time of the settings that were tried on a scene.

    Attributes
    ----------
    name : str
    tolerance : float
    points : tuple of Point
        In the order in which they were tried.
    reference : Reference
    chosen : Point or None
        The cheapest that meets the tolerance on the scene and on every held-out case; None if none does.
    held_out : mapping of str to tuple of float
        Errors on the held-out load cases of the settings that were checked there, the cheapest first.
    complete : bool
        False if it was stopped before all settings were tried.
    """

    name: str
    tolerance: float
    points: tuple[Point, ...]
    reference: Reference
    chosen: Point | None
    held_out: dict[str, tuple[float, ...]] = field(default_factory=dict)
    complete: bool = True

    @cached_property
    def pareto(self) -> tuple[Point, ...]:
        """Points that no other beats in both error and time, the quickest first."""
        best, front = np.inf, []
        for point in sorted(self.points, key=lambda p: (p.time_ratio, p.error)):
            if point.error < best:
                best = point.error
                front.append(point)
        return tuple(front)

    def plot(self) -> Figure:
        """Draw error against time, with the front and the choice.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.work_precision import work_precision_figure

        return work_precision_figure(self)

    def __str__(self) -> str:
        front = set(map(id, self.pareto))
        wide = max(len(str(p.setting)) for p in self.points) if self.points else 7
        lines = [f"{'setting':<{wide}}  {'error':>9}  {'time':>8}  front"]
        for p in sorted(self.points, key=lambda p: p.time_ratio):
            told = f"{p.error:9.2e}  {p.time_ratio:8.3g}  {'*' if id(p) in front else ''}"
            lines.append(f"{p.setting!s:<{wide}}  {told if not p.failure else p.failure}".rstrip())
        agreed = ", ".join(f"{name} {value:.1e}" for name, value in self.reference.agreement.items())
        lines.append(f"reference: {self.reference.setting}; apart from {agreed}")
        lines.append(
            f"for {self.tolerance:g}: {self.chosen.setting}, error {self.chosen.error:.2e}"
            if self.chosen
            else f"no setting that was tried is within {self.tolerance:g}"
        )
        return "\n".join(lines)


def work_precision(
    scene: Subject,
    tolerance: float = 0.01,
    *,
    settings: Sequence[Setting] = (),
    store: str | Path | None = None,
    progress: Callable[[float], None] | None = None,
) -> WorkPrecision:
    """Try many settings on a scene: what accuracy costs.

    The reference is the full physics on a mesh twice as fine as the finest tried, with steps four times as short as
    the shortest; it is run again on the coarser mesh, with longer steps and with another integrator, and refined
    until these agree. Times are the shortest of several runs over that of a fixed calculation made in between.

    Parameters
    ----------
    scene : Scene
    tolerance : float
        Largest error of an output over its largest magnitude.
    settings : sequence of Setting
        Default: `sweep` of the scene.
    store : str or Path, optional
        A file that keeps each point as it is found: a study that was stopped goes on from there.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    WorkPrecision
        After Ctrl-C with what was tried until then.

    Raises
    ------
    StructureError
        For a tolerance that is not positive, or a scene without a simulation.
    FlexctrlError
        If the reference cannot be run, or the reference runs do not agree within a third of the tolerance.
    """
    if not tolerance > 0.0:
        raise StructureError(f"work_precision: tolerance = {tolerance}; expected a relative error > 0, e.g. 0.01")
    if scene.simulation is None:
        raise StructureError(
            f"work_precision: scene {scene.name!r} has no simulation; give at least until = … (seconds)"
        )
    every = scene.simulation.every or scene.simulation.until / 1000
    simulation = replace(scene.simulation, every=every, rigid_twin=False)
    base = scene.with_(controller=scene.law, simulation=simulation)
    tried = tuple(settings) or sweep(base)
    return _Study(base, tolerance, tried, _Store(store, base.name), progress or (lambda done: None)).made()


class _Study:
    """The study under way."""

    def __init__(
        self,
        scene: Subject,
        tolerance: float,
        settings: Sequence[Setting],
        store: _Store,
        progress: Callable[[float], None],
    ) -> None:
        self.scene, self.tolerance, self.settings, self.store = scene, tolerance, settings, store
        self.progress = progress

    def made(self) -> WorkPrecision:
        reference = certified(self.scene, self.settings, self.tolerance)
        points: list[Point] = []
        complete = True
        try:
            for i, setting in enumerate(self.settings):
                self.progress((i + 1.0) / (len(self.settings) + 2.0))
                points.append(self.store.known(setting) or self._point(setting, reference))
                self.store.keep(points[-1])
        except KeyboardInterrupt:
            complete = False
        chosen, held_out = self._choice(points, reference) if complete else (None, {})
        self.progress(1.0)
        return WorkPrecision(self.scene.name, self.tolerance, tuple(points), reference, chosen, held_out, complete)

    def _point(self, setting: Setting, reference: Reference) -> Point:
        try:
            scene = setting.of(self.scene)
            runs, times = [], []
            for _ in range(_REPEATS):
                unit, began = calibration(), time.process_time()
                runs.append(finished(scene))
                took = time.process_time() - began
                times.append(took / min(unit, calibration()))
        except FlexctrlError as error:
            return Point(setting, np.inf, np.inf, 0, str(error).splitlines()[0])
        return Point(setting, error_of(reference.run, runs[0]), min(times), runs[0].report.steps)

    def _choice(
        self, points: Sequence[Point], reference: Reference
    ) -> tuple[Point | None, dict[str, tuple[float, ...]]]:
        """The cheapest point that holds here and on cases it was not chosen on."""
        fit = sorted((p for p in points if p.error <= self.tolerance), key=lambda p: p.time_ratio)
        cases = load_cases(self.scene)
        references: list[Run] = []
        held_out: dict[str, tuple[float, ...]] = {}
        for point in fit:
            references = references or [finished(reference.setting.of(case)) for case in cases]
            errors = tuple(
                error_of(r, finished(point.setting.of(case))) for r, case in zip(references, cases, strict=True)
            )
            held_out[str(point.setting)] = errors
            if max(errors, default=0.0) <= self.tolerance:
                return point, held_out
        return None, held_out


def calibration() -> float:
    """Return the processor time of a fixed calculation [s]: small dense solves, as runs are made of."""
    A = np.eye(40) + 0.01 * np.arange(1600.0).reshape(40, 40) % 0.7
    b: np.ndarray = np.ones(40)
    began = time.process_time()
    for _ in range(100):
        b = np.linalg.solve(A, b)
        b = b / np.abs(b).max()
    return time.process_time() - began


class _Store:
    """Points on disk, one a line; nothing without a path."""

    def __init__(self, path: str | Path | None, name: str) -> None:
        self.path = None if path is None else Path(path)
        self.name = name
        self.lines: dict[str, dict[str, float | int | str]] = {}
        if self.path is not None and self.path.is_file():
            for line in self.path.read_text(encoding="utf-8").splitlines():
                found = json.loads(line)
                if found["scene"] == name:
                    self.lines[found["setting"]] = found

    def known(self, setting: Setting) -> Point | None:
        found = self.lines.get(repr(setting))
        if found is None:
            return None
        return Point(
            setting, float(found["error"]), float(found["time_ratio"]), int(found["steps"]), str(found["failure"])
        )

    def keep(self, point: Point) -> None:
        key = repr(point.setting)
        if self.path is None or key in self.lines:
            return
        line = {
            "scene": self.name,
            "setting": key,
            "error": point.error,
            "time_ratio": point.time_ratio,
            "steps": point.steps,
            "failure": point.failure,
        }
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
