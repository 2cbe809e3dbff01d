"""Work against precision on the user's own scene: error and time of many settings, and the cheapest that will do."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.errors import StructureError, shortened
from flexctrl.frozen import frozen
from flexctrl.structure.freedoms import check_path
from flexctrl.study.fingerprint import Untold
from flexctrl.study.on_held_out import HeldOut
from flexctrl.study.reference import Reference, Traced, certified, trace
from flexctrl.study.settings import Setting, sweep
from flexctrl.study.store import Point, Store, fingerprint, timed
from flexctrl.study.subject import Subject, prepared
from flexctrl.study.tryouts import Workshop, errors, time_of, workers_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Point", "WorkPrecision", "work_precision"]

_SCATTER = 1.2
_ROUNDS = 2


@frozen(eq=False)
class WorkPrecision:
    """Error and time of the settings that were tried on a scene.

    Attributes
    ----------
    name : str
    tolerance : float
    points : tuple of Point
        In the order in which they were tried; those that were not timed before a stop have a time of NaN.
    reference : Reference or None
        None if it was stopped before there was one.
    chosen : Point or None
        The cheapest that meets the tolerance on the scene and on every held-out case; None if none does.
    held_out : mapping of str to tuple of float
        Errors on the held-out load cases of the settings that were checked there, the cheapest first; infinite where
        a run ended early.
    complete : bool
        False if it was stopped before all settings were tried.
    notes : tuple of str
        What could not be kept or checked, and why.
    kept : int
        How many lines of the store are of this scene.
    """

    name: str
    tolerance: float
    points: tuple[Point, ...]
    reference: Reference | None
    chosen: Point | None
    held_out: dict[str, tuple[float, ...]] = field(default_factory=dict)
    complete: bool = True
    notes: tuple[str, ...] = ()
    kept: int = 0

    @cached_property
    def pareto(self) -> tuple[Point, ...]:
        """Points that no other beats in both error and time, the quickest first.

        Errors below what the reference is known to are as good as each other.
        """
        best, front, doubt = np.inf, [], self.reference.uncertainty if self.reference else 0.0
        for point in sorted(filter(timed, self.points), key=lambda p: (p.time_ratio, p.error)):
            if max(point.error, doubt) < best:
                best = max(point.error, doubt)
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
        rows = [*map(self._row, sorted(self._ran, key=lambda p: (not timed(p), p.time_ratio))), *self._refused]
        wide = max((len(name) for name, _ in rows), default=7)
        lines = [f"{'setting':<{wide}}  {'error':>9}  {'time':>8}  front"]
        lines += [f"{name:<{wide}}  {told}".rstrip() for name, told in rows]
        if self.reference is not None:
            agreed = ", ".join(f"{name} {value:.1e}" for name, value in self.reference.agreement.items())
            lines.append(f"reference: {self.reference.setting}; apart from {agreed}")
            lines.append(
                "error: largest of an output, over its largest magnitude; time: of a run, over that of a fixed "
                "calculation; *: none that was tried is both quicker and nearer"
            )
        return "\n".join([*lines, *self._passed_over, self._verdict, *self.notes])

    @property
    def _ran(self) -> list[Point]:
        return [p for p in self.points if not p.failure]

    def _row(self, p: Point) -> tuple[str, str]:
        """A setting that ran, and what was found of it."""
        time = f"{p.time_ratio:8.3g}" if timed(p) else "       –"
        star = "*" if any(p is one for one in self.pareto) else ""
        return str(p.setting), f"{self._told(p.error):>9}  {time}  {star}"

    def _told(self, error: float) -> str:
        return f"{error:.2e}" if self.reference is None else self.reference.told(error)

    @property
    def _refused(self) -> list[tuple[str, str]]:
        """Settings that could not be run, those of one fidelity for one reason together, and the reason."""
        alike: dict[tuple[str, str], list[str]] = {}
        for p in self.points:
            if p.failure:
                alike.setdefault((p.setting.fidelity.value, p.failure), []).append(str(p.setting))
        return [
            (names[0] if len(names) == 1 else f"{fidelity}: {len(names)} settings", why)
            for (fidelity, why), names in alike.items()
        ]

    @property
    def _verdict(self) -> str:
        if self.chosen is None:
            if not self.complete:
                return "stopped before a setting was chosen"
            return f"no setting that was tried is within {self.tolerance:g}"
        held = self.held_out.get(str(self.chosen.setting), ())
        none = "" if self.notes else "; there are no loads to hold out"
        others = f"; {self._told(max(held))} at most under held-out loads" if held else none
        return (
            f"cheapest within {self.tolerance:g}: {self.chosen.setting}, error {self._told(self.chosen.error)}{others}"
        )

    @property
    def _passed_over(self) -> list[str]:
        """Settings that are within the tolerance here, but not under loads they were not looked at for."""
        failed = {name: max(held, default=0.0) for name, held in self.held_out.items()}
        return [
            f"passed over: {name}, {worst:.2e} under held-out loads"
            for name, worst in failed.items()
            if worst > self.tolerance
        ]


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
    a core that does nothing else: the shortest of several runs over that of a fixed calculation made in between, of
    fewer runs, down to one, where a setting that is more accurate is clearly quicker. The cheapest that are as near as
    times scatter are timed again, in turn.

    Parameters
    ----------
    scene : Scene
    tolerance : float
        Largest error of an output over its largest magnitude.
    settings : sequence of Setting
        Default: `sweep` of the scene.
    store : str or Path, optional
        A file that keeps each run of the reference, point and time as it is found: a study that was stopped goes on
        from there. Points are taken up only for a scene that is the same in all that its runs depend on, functions
        and objects of the user's own included; where that cannot be told, nothing is kept, and the notes say so.
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
        For a tolerance that is not positive, a scene without a simulation, what is no setting, a store that cannot be
        written or holds something else, or several workers without joblib.
    FlexctrlError
        If the reference cannot be run, or the reference runs do not agree within a third of the tolerance.
    """
    base = prepared(scene, tolerance, "work_precision")
    tried, shared = _checked(settings) or sweep(base), workers_of(workers)
    kept, notes = _opened(store, base)
    return _Study(base, tolerance, tried, kept, shared, progress or (lambda done: None), notes).made()


def _checked(settings: Sequence[Setting]) -> tuple[Setting, ...]:
    given = settings if isinstance(settings, Iterable) else [settings]
    if not isinstance(settings, Sequence) or not all(isinstance(s, Setting) for s in given):
        wrong = next((s for s in given if not isinstance(s, Setting)), settings)
        raise StructureError(
            f"work_precision: settings holds {shortened(wrong)}; expected a sequence of Setting, as sweep(scene) gives"
        )
    return tuple(dict.fromkeys(settings))


def _opened(path: str | Path | None, scene: Subject) -> tuple[Store, tuple[str, ...]]:
    """The store, and a note where points of this scene could not be told from those of another."""
    if path is not None:
        check_path(path, "store")
        Store(path, scene.name)  # whether it can be read and written is known now, not after the first run
    try:
        return Store(path, fingerprint(scene) if path is not None else scene.name), ()
    except Untold as error:
        return Store(None, scene.name), (f"nothing was kept in {path}, nor taken up: {error}",)


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
        notes: tuple[str, ...],
    ) -> None:
        self.scene, self.tolerance, self.settings, self.store = scene, tolerance, settings, store
        self.workers, self.progress, self.notes = workers, progress, notes
        self.referred = 0.0
        self.shop = Workshop(scene.with_(simulation=replace(scene.simulation, every=scene.simulation.until)))

    def made(self) -> WorkPrecision:
        reference: Reference | None = None
        chosen: Point | None = None
        held_out: dict[str, tuple[float, ...]] = {}
        complete = False
        try:
            reference = certified(self.scene, self.settings, self.tolerance, self._traced)
            self._errors(reference)
            self._times(reference)
            self._close(reference)
            chosen, held_out = self._choice(reference)
            complete = True
            self.progress(1.0)
        except KeyboardInterrupt:
            pass
        points = () if reference is None else tuple(self._points(reference))
        found = self.scene.name, self.tolerance, points, reference, chosen, held_out
        return WorkPrecision(*found, complete, self.notes, self.store.kept)

    def _traced(self, setting: Setting) -> Traced:
        """A run of the reference, unless it is known."""
        known = self.store.run(setting)
        found = known if known is not None else self.store.keep_run(setting, trace(self.scene, setting))
        self.referred = min(self.referred + 0.25, 1.0)
        self._tick(self.referred - 1.0)
        return found

    def _points(self, reference: Reference) -> Iterator[Point]:
        """Those that are known."""
        known = (self.store.known(setting, reference.setting) for setting in self.settings)
        yield from (point for point in known if point is not None)

    def _tick(self, done: float) -> None:
        """Errors and times of so many settings are found, and before that the reference."""
        self.progress((done + 1.0) / (2.0 * len(self.settings) + 3.0))

    def _errors(self, reference: Reference) -> None:
        left = [s for s in self.settings if self.store.known(s, reference.setting) is None]
        done = len(self.settings) - len(left)
        self._tick(done)
        for setting, point in errors(self.scene, left, reference.run, self.workers):
            time = point.time_ratio if timed(point) else self.store.time(setting)  # against another reference, perhaps
            self.store.keep(replace(point, time_ratio=time), reference.setting)
            self._tick(done := done + 1)

    def _times(self, reference: Reference) -> None:
        """Of those that ran, on this processor alone; coarse meshes first: they show what the others are beaten by."""
        found = list(self._points(reference))
        order = sorted(range(len(found)), key=lambda i: found[i].setting.mesh)
        for done, i in enumerate(order, 1):
            if not timed(found[i]):
                better = (p.time_ratio for p in found if p.error <= found[i].error and timed(p))
                time = time_of(self.shop, found[i].setting, min(better, default=np.inf))
                found[i] = self.store.keep(replace(found[i], time_ratio=time), reference.setting)
            self._tick(len(self.settings) + done)

    def _close(self, reference: Reference) -> None:
        """Those between which the choice lies are timed again, in turn: their times are as near as times scatter."""
        fit = [p for p in self._points(reference) if p.error <= self.tolerance]
        least = min((p.time_ratio for p in fit), default=np.inf)
        near = [p.setting for p in fit if p.time_ratio <= _SCATTER * least]
        if len(near) < 2 or self.store.told_apart(near, reference.setting):
            return
        for setting in _ROUNDS * near:
            point = self.store.known(setting, reference.setting)
            assert point is not None
            time = min(point.time_ratio, time_of(self.shop, setting))
            self.store.keep(replace(point, time_ratio=time), reference.setting)
        self.store.tell_apart(near, reference.setting)

    def _choice(self, reference: Reference) -> tuple[Point | None, dict[str, tuple[float, ...]]]:
        """The cheapest point that holds here and on cases it was not chosen on."""
        points = (p for p in self._points(reference) if p.error <= self.tolerance)
        held_out: dict[str, tuple[float, ...]] = {}
        cases = HeldOut(self.scene, reference.setting, self.store)
        chosen = None
        for point in sorted(points, key=lambda p: p.time_ratio):
            held_out[str(point.setting)] = cases.errors(point.setting)
            if max(held_out[str(point.setting)], default=0.0) <= self.tolerance:
                chosen = point
                break
        self.notes = (*self.notes, *cases.notes)
        return chosen, held_out
