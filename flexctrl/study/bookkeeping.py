"""The ledger drawn up: every effect left out in turn, what may go left out together, and all of it timed."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from time import thread_time
from typing import cast

import numpy as np

from flexctrl.dynamics.run import Run, Status
from flexctrl.errors import FlexctrlError
from flexctrl.structure.freedoms import check_number
from flexctrl.study.answers import Answer, answer_of, change_between
from flexctrl.study.exactly import exactly, fewer_modes
from flexctrl.study.ledger import Entry, Ledger, Size
from flexctrl.study.omissions import Omission, omissions
from flexctrl.study.subject import Subject, prepared

__all__ = ["ledger"]

_DEARER, _CHEAPER = 1.05, 0.95
_SLOWER = 1.15
_LONG, _SHORT = 5.0, 0.05
_REPEATS = 4
_NOISE = 0.05


def ledger(
    scene: Subject,
    tolerance: float = 0.01,
    *,
    margin_tolerance: float = np.inf,
    progress: Callable[[float], None] | None = None,
) -> Ledger:
    """Draw up the ledger of a scene.

    Every effect is left out in turn and the scene run again. What changes an output by no more than ``tolerance``
    is a candidate to go. All candidates are left out together; where they do more together than alone, they are
    taken back, the weightiest first, until the answer holds. An effect whose absence makes the run dearer stays, and
    so does a way to give that saves nothing: beams that are stiffer keep their freedoms. Where the minimal set is
    linear it is integrated exactly, with the fewest modes that keep the answer. Should it take longer than the full
    one all the same, by the clock, what is slowest to be without is taken back.

    Parameters
    ----------
    scene : Scene
    tolerance : float
        Largest change of an output over its largest magnitude in the full run.
    margin_tolerance : float
        Largest relative change of gain and phase margins; default: margins are told but do not count.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    Ledger

    Raises
    ------
    StructureError
        For a tolerance that is not positive, or a scene without a simulation.
    FlexctrlError
        If the full scene itself cannot be run.
    """
    scene = prepared(scene, tolerance, "ledger")
    check_number(margin_tolerance, "margin_tolerance (relative; infinite: margins do not count)", "ledger", least=0.0)
    return _Auditor(scene, tolerance, margin_tolerance, progress or (lambda done: None)).drawn_up()


@dataclass
class _Trial:
    """A scene that was run."""

    scene: Subject
    answer: Answer
    size: Size
    times: list[float]

    def again(self) -> None:
        """Run once more, unless that takes long: the first run may have compiled; short runs several times."""
        if self.times and self.times[0] >= _LONG:
            return
        for _ in range(_REPEATS if self.times and min(self.times) < _SHORT else 1):
            self.times.append(_timed(self.scene)[1])


@dataclass(frozen=True)
class _Refused:
    """A scene that cannot be run, and why."""

    reason: str


class _Auditor:
    """The ledger being drawn up."""

    def __init__(self, scene: Subject, tolerance: float, margins: float, progress: Callable[[float], None]) -> None:
        self.tolerance, self.margins, self.progress = tolerance, margins, progress
        self.items = omissions(scene)
        self.done, self.expected = 0, 2 * len(self.items) + 6
        self.full = self._tried(scene)
        self.bases: dict[tuple[str, ...], _Trial | _Refused] = {(): self.full}

    def drawn_up(self) -> Ledger:
        self.full.again()
        trials = {o.name: self._alone(o) for o in self.items}
        gone, minimal = self._quick(self._smallest(trials), trials)
        names = {o.name for o in gone}
        self._measure([minimal, *self.bases.values(), *trials.values(), minimal])
        entries = tuple(self._entry(o, trials[o.name], o.name not in names) for o in self.items)
        self.progress(1.0)
        return Ledger(
            self.full.scene.name,
            self.tolerance,
            entries,
            self.full.answer,
            self.full.size,
            minimal.answer,
            change_between(self.full.answer, minimal.answer),
            self._ratio(minimal, self.full),
            minimal.size,
            self._noise,
            minimal.scene,
        )

    def _smallest(self, trials: dict[str, _Trial | _Refused]) -> list[Omission]:
        """What may go, all at once."""
        fit = [o for o in self.items if self._may_go(o, trials[o.name])]
        able = {o.name for o in fit}
        fit = [o for o in fit if able.issuperset(o.first)]
        fit.sort(key=lambda o: self._weight(trials[o.name]))
        while fit:
            together = self._without(fit)
            if isinstance(together, _Trial) and self._holds(together) and self._work(together) <= _DEARER:
                return fit
            fit.pop()
            left = {o.name for o in fit}
            fit = [o for o in fit if left.issuperset(o.first)]
        return []

    def _quick(self, gone: list[Omission], trials: dict[str, _Trial | _Refused]) -> tuple[list[Omission], _Trial]:
        """What may go without making the run longer by the clock, and the scene without it.

        The clock tells what is not counted: a controller asked by Python at every stage of a step, or the levers of
        parts that have become rigid. What takes longest without it is taken back first.
        """
        while gone:
            found = self._without(gone)
            if isinstance(found, _Trial) and self._holds(found) and not self._slower(reduced := self._reduced(found)):
                return gone, reduced
            slowest = max(gone, key=lambda o: self._ratio(self.full, cast(_Trial, trials[o.name])))
            gone = [o for o in gone if o is not slowest and slowest.name not in o.first]
        return [], self._reduced(self.full)

    def _slower(self, trial: _Trial) -> bool:
        """Tell whether a run takes longer than the full one; first runs may have compiled."""
        for each in (trial, self.full, trial):
            if self._ratio(self.full, trial) > _SLOWER:
                each.again()
        return self._ratio(self.full, trial) > _SLOWER

    def _alone(self, omission: Omission) -> _Trial | _Refused:
        """The scene without one thing, and without what cannot be without it."""
        before = [o for o in self.items if o.name in omission.first]
        if omission.first not in self.bases:
            self.bases[omission.first] = self._without(before)
        return self._without([*before, omission])

    def _may_go(self, omission: Omission, trial: _Trial | _Refused) -> bool:
        if not isinstance(trial, _Trial) or not self._holds(trial):
            return False
        return self._work(trial) <= (_DEARER if omission.spares else _CHEAPER)

    def _work(self, trial: _Trial) -> float:
        """Counted work over that of the full scene."""
        return trial.size.work / max(self.full.size.work, 1e-300)

    def _weight(self, trial: _Trial | _Refused) -> float:
        assert isinstance(trial, _Trial)
        return change_between(self.full.answer, trial.answer).outputs_worst

    def _holds(self, trial: _Trial) -> bool:
        change = change_between(self.full.answer, trial.answer)
        return change.outputs_worst <= self.tolerance and not change.margins > self.margins

    def _entry(self, omission: Omission, trial: _Trial | _Refused, keep: bool) -> Entry:
        name, base = omission.name, self.bases[omission.first]
        for one in (trial, base):
            if isinstance(one, _Refused):
                return Entry(name, None, np.nan, None, True, one.reason)
        assert isinstance(trial, _Trial)
        assert isinstance(base, _Trial)
        change = change_between(base.answer, trial.answer)
        return Entry(name, change, self._ratio(trial, base), trial.size, keep, first=omission.first)

    def _without(self, gone: Iterable[Omission]) -> _Trial | _Refused:
        """Run the scene without some effects, or say why that cannot be done."""
        scene = self.full.scene
        try:
            for omission in gone:
                scene = omission.without(scene)
            return self._tried(scene)
        except FlexctrlError as error:
            self._tick()
            return _Refused(str(error).splitlines()[0])

    def _reduced(self, whole: _Trial) -> _Trial:
        """Integrated exactly, with the fewest modes that hold, where that can be; poles and margins stay the same."""
        exact = exactly(whole.scene)
        if exact is whole.scene:
            return whole
        for scene in (*fewer_modes(exact), exact):
            run, taken = _timed(scene)
            trial = _Trial(scene, replace(whole.answer, run=run), _size(scene, run), [taken])
            if run.status is Status.FINISHED and self._holds(trial):
                return trial
        return whole

    def _tried(self, scene: Subject) -> _Trial:
        run, taken = _timed(scene)
        if run.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        if run.status is not Status.FINISHED:
            raise FlexctrlError(f"the run ended early: {run.report.message}")
        trial = _Trial(scene, answer_of(scene, run), _size(scene, run), [taken])
        self._tick()
        return trial

    def _measure(self, trials: list[_Trial | _Refused]) -> None:
        """Time everything once more, the full scene before, amid and after."""
        others = [t for t in trials if isinstance(t, _Trial) and t is not self.full]
        middle = len(others) // 2
        for trial in (self.full, *others[:middle], self.full, *others[middle:], self.full):
            trial.again()
            self._tick()

    def _ratio(self, trial: _Trial, base: _Trial) -> float:
        """Time of a scene over that of a smaller one, each by its quickest run."""
        return min(base.times) / min(trial.times)

    @property
    def _noise(self) -> float:
        later = self.full.times[1:] or self.full.times
        return max(_NOISE, max(later) / min(later) - 1.0)

    def _tick(self) -> None:
        self.done += 1
        self.progress(min(0.99, self.done / self.expected))


def _timed(scene: Subject) -> tuple[Run, float]:
    """A run and its processor time [s], which other processes hardly disturb."""
    model = scene.model
    began = thread_time()
    run = scene.run(model)
    return run, max(thread_time() - began, 1e-9)


def _size(scene: Subject, run: Run) -> Size:
    model = scene.model
    still = np.zeros(model.n)
    slope = model.slope(model.rest, still, still, (1.0, 1.0, 1.0), np.zeros(len(model.inputs)))
    instructions = sum(f.count * f.kernels.force.instructions for f in model.forces.families) if model.large else 0
    states = 2 * model.n + (0 if scene.law is None else len(scene.law.initial()))
    return Size(states, int(slope.count_nonzero()), instructions, run.report.steps, run.report.newton_iterations)
