"""The ledger drawn up: every effect left out in turn, what may go left out together, and all of it timed."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from flexctrl.effects.automatic import Within
from flexctrl.study.answers import change_between
from flexctrl.study.ledger import Entry, Ledger
from flexctrl.study.omissions import Omission, omissions
from flexctrl.study.smallest_set import Choice, all_kept, smallest
from flexctrl.study.subject import Subject, prepared
from flexctrl.study.trials import LONG, Bench, Refused, Trial

__all__ = ["ledger"]

_NOISE = 0.05
_ROUNDS = 6


def ledger(
    scene: Subject, tolerance: float | Within = 0.01, *, progress: Callable[[float], None] | None = None
) -> Ledger:
    """Draw up the ledger of a scene.

    Every effect is left out in turn and the scene run again. Every run is held against one with shorter steps; if they
    are apart by more than a third of what is borne, and of the change, finer ones are compared (times are those of the
    scene's own). What keeps the answer (outputs, poles of the closed loop, margins) within ``tolerance`` is a candidate
    to go; candidates are left out together, as many as the answer bears, and every other effect is tried once more on
    top of that, one by one. Nothing goes whose absence makes the run dearer, and what has gone comes back where the run
    is cheaper with it: by the clock where that tells both runs clearly apart (1.5 times), else by what is counted, and
    by the clock beyond its scatter where as much is counted. No way to give goes that saves nothing: beams that are
    stiffer keep their freedoms. Where the equations are linear they are integrated exactly, with the fewest modes that
    keep the answer. The minimal set is timed against the full one: where it is slower, the full one is handed out.
    Differences of times that are less than times of one and the same run scatter by decide nothing.

    Ctrl-C after the full scene has been run gives a ledger of what has been tried until then, which keeps all.

    Parameters
    ----------
    scene : Scene
    tolerance : float or Within
        Largest change of the answer: of an output over its largest magnitude in the full run, of a slow pole and of a
        margin over the larger of both. A number holds for all of them; ``Within(outputs=0.01)`` asks for outputs only.
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
    within = Within.of(tolerance, "ledger")
    scene = prepared(scene, min(within.outputs, within.poles, within.margins), "ledger")
    return _Auditor(scene, within, progress or (lambda done: None)).drawn_up()


class _Auditor:
    """The ledger being drawn up."""

    def __init__(self, scene: Subject, within: Within, progress: Callable[[float], None]) -> None:
        self.progress = progress
        self.items = omissions(scene)
        self.done, self.expected = 0, 4 * len(self.items) + 5
        self.bench = Bench(scene, within, self._tick)
        self.full = self.bench.full

    def drawn_up(self) -> Ledger:
        trials: dict[str, Trial | Refused] = {}
        try:
            for omission in self.items:
                self._reference(omission)
                trials[omission.name] = self._alone(omission)
            choice, speedup = self._choice()
            references = [self._reference(o) for o in self.items]
            self._measure([choice.trial, *_tried([*references, *trials.values()]), choice.trial])
            self.progress(1.0)
            return self._ledger(trials, choice, speedup)
        except KeyboardInterrupt:
            if not trials:
                raise  # there is nothing to keep
            return self._ledger(trials, Choice([], self.full, self.full), 1.0, complete=False)

    def _ledger(
        self, trials: Mapping[str, Trial | Refused], choice: Choice, speedup: float, complete: bool = True
    ) -> Ledger:
        minimal = choice.trial
        entries = tuple(self._entry(o, trials[o.name], choice) for o in self.items if o.name in trials)
        return Ledger(
            self.full.scene.name,
            self.bench.within,
            entries,
            self.full.answer,
            self.full.size,
            minimal.answer,
            change_between(self.full.answer, minimal.answer),
            speedup,
            minimal.size,
            self._noise,
            self.bench.accuracy,
            minimal.scene,
            tuple(o.name for o in self.items if o.name not in trials),
            complete,
        )

    def _choice(self) -> tuple[Choice, float]:
        """The smallest set, and how many times faster it is; the full one if no other is as fast."""
        for exact in (True, False):  # a short run may be over before an exact one has begun
            choice = smallest(self.bench, self.items, exact)
            gain = self._gain(choice.trial)
            if gain * (1.0 + self._noise) >= 1.0:
                return choice, gain
        return all_kept(self.bench, self.items, choice), 1.0

    def _before(self, omission: Omission) -> list[Omission]:
        return [o for o in self.items if o.name in omission.first]

    def _reference(self, omission: Omission) -> Trial | Refused:
        """The scene with one thing, and without what cannot be without it."""
        return self.bench.without(self._before(omission))

    def _alone(self, omission: Omission) -> Trial | Refused:
        """The scene without one thing, and without what cannot be without it."""
        return self.bench.without([*self._before(omission), omission])

    def _entry(self, omission: Omission, trial: Trial | Refused, choice: Choice) -> Entry:
        name, base = omission.name, self._reference(omission)
        keep = name not in choice.names and omission.is_in(choice.trial.scene)
        for one in (trial, base):
            if isinstance(one, Refused):
                return Entry(name, None, np.nan, None, keep, one.reason)
        assert isinstance(trial, Trial)
        assert isinstance(base, Trial)
        change, why = change_between(base.answer, trial.answer), choice.stays.get(name, "") if keep else ""
        return Entry(name, change, base.time / trial.time, trial.size, keep, first=omission.first, stays=why)

    def _measure(self, trials: list[Trial]) -> None:
        """Time everything once more, the full scene before, amid and after."""
        others = [t for t in trials if t is not self.full]
        middle = len(others) // 2
        for trial in (self.full, *others[:middle], self.full, *others[middle:], self.full):
            trial.again()
            self._tick()

    def _gain(self, trial: Trial) -> float:
        """Time of the full scene over that of another, both run anew in turn, unless that takes long."""
        if trial is self.full or max(trial.times[0], self.full.times[0]) >= LONG:
            return self.full.time / trial.time
        both = (self.full, trial)
        before = [len(one.times) for one in both]
        for _ in range(_ROUNDS):
            for one in both:
                one.again()  # short runs several times: what runs between pushes them out of the caches
        full, other = (min(one.times[done:]) for one, done in zip(both, before, strict=True))
        return full / other

    @property
    def _noise(self) -> float:
        return max(_NOISE, self.full.scatter)

    def _tick(self) -> None:
        self.done += 1
        self.progress(min(0.99, self.done / self.expected))


def _tried(trials: list[Trial | Refused]) -> list[Trial]:
    """Those that were run, each once."""
    return list({id(t): t for t in trials if isinstance(t, Trial)}.values())
