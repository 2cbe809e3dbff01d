"""Work against precision on the user's own scene: error and time of many settings, and the cheapest that will do."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.run import Run
from flexctrl.study.held_out import load_cases
from flexctrl.study.reference import Reference, certified, error_of, finest_of, finished, trusted
from flexctrl.study.settings import Setting, sweep
from flexctrl.study.store import Point, Store, fingerprint, timed
from flexctrl.study.subject import Subject, prepared
from flexctrl.study.tryouts import errors, time_of, workers_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Point", "WorkPrecision", "work_precision"]


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
    workers: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> WorkPrecision:
    """Try many settings on a scene: what accuracy costs.

    The reference is the full physics on a mesh twice as fine as the finest tried, with steps four times as short as
    the shortest; it is run again on the coarser mesh, with longer steps and with another integrator, and refined
    until these agree. Errors are found in several processes at once; times afterwards, one setting after the other on
    a core that does nothing else: the shortest of several runs over that of a fixed calculation made in between.

    Parameters
    ----------
    scene : Scene
    tolerance : float
        Largest error of an output over its largest magnitude.
    settings : sequence of Setting
        Default: `sweep` of the scene.
    store : str or Path, optional
        A file that keeps each point as it is found: a study that was stopped goes on from there.
    workers : int, optional
        Processes that find errors; default: one for each processor if joblib is there (``flexctrl[parallel]``), else
        one.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    WorkPrecision
        After Ctrl-C with what was tried until then.

    Raises
    ------
    StructureError
        For a tolerance that is not positive, a scene without a simulation, or several workers without joblib.
    FlexctrlError
        If the reference cannot be run, or the reference runs do not agree within a third of the tolerance.
    """
    base = prepared(scene, tolerance, "work_precision")
    tried = tuple(settings) or sweep(base)
    kept = Store(store, fingerprint(base))
    return _Study(base, tolerance, tried, kept, workers_of(workers), progress or (lambda done: None)).made()


class _Study:
    """The study under way."""

    def __init__(
        self,
        scene: Subject,
        tolerance: float,
        settings: Sequence[Setting],
        store: Store,
        workers: int,
        progress: Callable[[float], None],
    ) -> None:
        self.scene, self.tolerance, self.settings, self.store = scene, tolerance, settings, store
        self.workers, self.progress = workers, progress

    def made(self) -> WorkPrecision:
        reference = self._reference()
        chosen: Point | None = None
        held_out: dict[str, tuple[float, ...]] = {}
        complete = True
        try:
            self._errors(reference)
            self._times()
            chosen, held_out = self._choice(reference)
        except KeyboardInterrupt:
            complete = False
        self.progress(1.0)
        return WorkPrecision(self.scene.name, self.tolerance, self._points, reference, chosen, held_out, complete)

    def _reference(self) -> Reference:
        """The reference of an earlier study, if it is fine enough; else a new one."""
        finest = finest_of(self.settings)
        known = self.store.reference(finest)
        if known is not None and trusted(known, self.tolerance):
            return known
        return self.store.keep_reference(finest, certified(self.scene, self.settings, self.tolerance))

    @property
    def _points(self) -> tuple[Point, ...]:
        known = (self.store.known(setting) for setting in self.settings)
        return tuple(point for point in known if point is not None and timed(point))

    def _tick(self, done: int) -> None:
        """Errors and times of so many settings are found."""
        self.progress((done + 1.0) / (2.0 * len(self.settings) + 3.0))

    def _errors(self, reference: Reference) -> None:
        left = [setting for setting in self.settings if self.store.known(setting) is None]
        done = len(self.settings) - len(left)
        self._tick(done)
        for _, point in errors(self.scene, left, reference.run, self.workers):
            self.store.keep(point)
            self._tick(done := done + 1)

    def _times(self) -> None:
        """Of those that ran, on this processor alone."""
        for i, setting in enumerate(self.settings):
            point = self.store.known(setting)
            assert point is not None
            if not timed(point):
                self.store.keep(replace(point, time_ratio=time_of(self.scene, setting)))
            self._tick(len(self.settings) + i + 1)

    def _choice(self, reference: Reference) -> tuple[Point | None, dict[str, tuple[float, ...]]]:
        """The cheapest point that holds here and on cases it was not chosen on."""
        fit = sorted((p for p in self._points if p.error <= self.tolerance), key=lambda p: p.time_ratio)
        cases = load_cases(self.scene)
        references: list[Run] = []
        held_out: dict[str, tuple[float, ...]] = {}
        for point in fit:
            held = self.store.known_held(point.setting, reference.setting)
            if held is None:
                references = references or [finished(reference.setting.of(case)) for case in cases]
                found = (
                    error_of(r, finished(point.setting.of(case))) for r, case in zip(references, cases, strict=True)
                )
                held = self.store.keep_held(point.setting, reference.setting, tuple(found))
            held_out[str(point.setting)] = held
            if max(held, default=0.0) <= self.tolerance:
                return point, held_out
        return None, held_out
