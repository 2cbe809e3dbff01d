"""Scenes tried without some of their effects: run, judged against the full one, and timed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from time import thread_time

import numpy as np

from flexctrl.dynamics.linear_motion.exact import Exact
from flexctrl.dynamics.run import Run, Status
from flexctrl.effects.automatic import Within
from flexctrl.errors import FlexctrlError
from flexctrl.frozen import frozen
from flexctrl.model.model import Model
from flexctrl.study.accuracy import SHARE, accurate, refined, worst
from flexctrl.study.answers import Answer, answer_of, change_between, changes_known, outputs_apart
from flexctrl.study.exactly import exactly, fewer_modes
from flexctrl.study.ledger import Size
from flexctrl.study.omissions import Omission
from flexctrl.study.subject import Subject
from flexctrl.study.unstopped import unstopped

__all__ = ["LONG", "Bench", "Refused", "Trial"]

_COUNTED, _SLOWER, _CLEARLY = 1.05, 1.15, 1.5
"""By what factor runs must be apart: by what is counted, by the clock, and by the clock against the count."""
_ROUNDS, _SURELY = 3, 2.0
_SHORT = 0.05
_REPEATS = 4
LONG = 5.0
_ONCE = 0.2
"""What the processor time of a run that is not repeated is known to: a busy machine slows it by as much."""


@dataclass
class Trial:
    """A scene that was run.

    Attributes
    ----------
    scene : Scene
    run : Run
    times : list of float
        Processor times [s]; the first may have compiled.
    model : Model
    judged : Run
        What is compared: the run, or a finer one of the same scene.
    finer : Run or None
        What that is held against: how well it is known; None if nothing tells.
    whole : Trial or None
        The same machine with all its modes; it has the same poles and margins.
    rounds : list of float
        The shortest time of each round of runs one after the other, after the first run [s].
    """

    scene: Subject
    run: Run
    times: list[float]
    model: Model = field(repr=False)
    judged: Run
    finer: Run | None = None
    whole: Trial | None = None
    rounds: list[float] = field(default_factory=list)

    @cached_property
    def answer(self) -> Answer:
        """Curves, poles and margins."""
        if self.whole is not None:
            return replace(self.whole.answer, run=self.judged, finer=self.finer)
        return replace(answer_of(self.scene, self.judged), finer=self.finer)

    @cached_property
    def size(self) -> Size:
        """What the model is made of and what the run took."""
        model, still = self.model, np.zeros(self.model.n)
        slope = model.slope(model.rest, still, still, (1.0, 1.0, 1.0), np.zeros(len(model.inputs)))
        instructions = sum(f.count * f.kernels.force.instructions for f in model.forces.families) if model.large else 0
        states = 2 * model.n + (0 if self.scene.law is None else len(self.scene.law.initial()))
        report = self.run.report
        return Size(states, int(slope.count_nonzero()), instructions, report.steps, report.newton_iterations)

    @property
    def modes(self) -> int | None:
        """With how many vibrations it is integrated exactly; None if it is not."""
        method = self.scene.simulation.method
        return (method.modes or self.model.n) if isinstance(method, Exact) else None

    @property
    def time(self) -> float:
        """The shortest [s]."""
        return min(self.times)

    @property
    def scatter(self) -> float:
        """How far apart its times are, each the shortest of runs one after the other: the longest over the shortest."""
        return max(self.rounds) / min(self.rounds) - 1.0 if len(self.rounds) > 1 else _ONCE

    def again(self) -> float:
        """Run once more, unless that takes long, and return the time [s]: the shortest of several of a short run.

        The first run may have compiled.
        """
        if self.times[0] >= LONG:
            return self.time
        self.rounds.append(min(self.once() for _ in range(_REPEATS if self.time < _SHORT else 1)))
        return self.rounds[-1]

    def once(self) -> float:
        """Run once more and return the time [s]."""
        self.times.append(timed(self.scene, self.model)[1])
        return self.times[-1]


@frozen
class Refused:
    """A scene that cannot be run, and why."""

    reason: str


class Bench:
    """Where scenes are tried without some of their effects, each set once.

    Parameters
    ----------
    scene : Scene
        With all its effects.
    within : Within
        How far the answer may change.
    tick : callable
        Called after every set.
    """

    def __init__(self, scene: Subject, within: Within, tick: Callable[[], None]) -> None:
        self.within, self.tick = within, tick
        own = _ran(scene, scene.model)
        self.accuracy, held = accurate(scene, own.model, own.run, within.outputs)
        self.full = replace(own, judged=held.run, finer=held.finer)
        self.plain: dict[frozenset[str], Trial | Refused] = {frozenset(): self.full}
        self.quick: dict[tuple[frozenset[str], bool], Trial | None] = {}
        self.paces: dict[tuple[int, int], float] = {}

    def scene(self, gone: Sequence[Omission]) -> Subject:
        """Return the scene without some effects."""
        scene = self.full.scene
        for omission in gone:
            scene = omission.without(scene)
        return scene

    def without(self, gone: Sequence[Omission]) -> Trial | Refused:
        """Return a run of the scene, by its own method, without some effects, or why there is none."""
        names = frozenset(o.name for o in gone)
        if names not in self.plain:
            try:
                self.plain[names] = self._tried(self.scene(gone))
            except FlexctrlError as error:
                self.plain[names] = Refused(str(error).splitlines()[0])
            self.tick()
        return self.plain[names]

    def holding(self, gone: Sequence[Omission], exact: bool) -> Trial | None:
        """Return a run without some effects that keeps the answer; None if there is none.

        Where ``exact`` and the equations are linear then, they are integrated exactly, with the fewest modes that keep
        the answer.
        """
        key = frozenset(o.name for o in gone), exact
        if key not in self.quick:
            try:
                self.quick[key] = self._exact(gone) if exact else self._plain(gone)
            except FlexctrlError:
                self.quick[key] = None
            self.tick()
        return self.quick[key]

    def linear(self, gone: Sequence[Omission]) -> bool:
        """Tell whether the scene can be integrated exactly without some effects, if it can be run at all."""
        trial = self.without(gone)
        return isinstance(trial, Trial) and exactly(trial.scene) is not trial.scene

    def excess(self, trial: Trial) -> float:
        """Return the largest change over what is borne; infinite at once if outputs alone may be beyond it.

        What a change is known to is added where it is more than a third of what is borne.
        """
        outputs, known = self._change(trial.judged), self._known(trial.judged, trial.finer)
        outputs += known if known > SHARE * self.within.outputs else 0.0
        if outputs > self.within.outputs:
            return np.inf
        change = change_between(self.full.answer, trial.answer)
        changes = {"outputs": outputs, "poles": change.poles, "margins": change.margins}
        asked = (changes[f.name] / getattr(self.within, f.name) for f in fields(self.within))
        return max((float(e) for e in asked if not np.isnan(e)), default=0.0)

    def cheaper(self, trial: Trial, other: Trial) -> bool:
        """Tell whether a run costs less than another.

        Exact integration costs by its modes. Else the clock decides where it tells both clearly apart: what is not
        compiled, such as a controller that is asked by Python, is not counted. Less clearly, what is counted decides,
        and where that is as much, the clock, beyond the scatter of their times.
        """
        if trial.modes is not None and other.modes is not None:
            return trial.modes < other.modes
        pace, noise = self._pace(trial, other), max(_SLOWER, 1.0 + trial.scatter, 1.0 + other.scatter)
        if max(pace, 1.0 / pace) > max(_CLEARLY, noise):
            return pace > 1.0
        exact = trial.modes is not None or other.modes is not None
        saves = 1.0 if exact else other.size.work / max(trial.size.work, 1.0)
        return saves > 1.0 if max(saves, 1.0 / saves) > _COUNTED else pace > noise

    def _pace(self, trial: Trial, other: Trial) -> float:
        """How many times as fast as another a run is, both run in turn until that is clear; once for each two."""
        if (id(other), id(trial)) in self.paces:
            return 1.0 / self.paces[id(other), id(trial)]
        key = id(trial), id(other)
        if key not in self.paces:
            rounds: list[tuple[float, float]] = []
            while len(rounds) < _ROUNDS:
                rounds.append((other.again(), trial.again()))
                slow, fast = (min(times) for times in zip(*rounds, strict=True))
                apart = max(slow / fast, fast / slow)
                if apart <= _SLOWER or apart > _SURELY:
                    break
            self.paces[key] = slow / fast
        return self.paces[key]

    def _plain(self, gone: Sequence[Omission]) -> Trial | None:
        found = self.without(gone)
        return found if isinstance(found, Trial) and self.excess(found) <= 1.0 else None

    def _exact(self, gone: Sequence[Omission]) -> Trial | None:
        scene = self.scene(gone)
        exact = exactly(scene)
        if exact is scene:
            return self._plain(gone)
        whole = self._tried(exact)
        if self.excess(whole) > 1.0:
            return None
        for fewer in fewer_modes(exact):
            run, taken = timed(fewer, fewer.model)  # of its own, whose equilibrium is found once
            trial = Trial(fewer, run, [taken], fewer.model, run, run, whole)
            if run.status is Status.FINISHED and self.excess(trial) <= 1.0:
                return trial
        return whole

    def _tried(self, scene: Subject) -> Trial:
        """A scene's own run, and one that its change is known by: as fine as the full one, or finer where it must be.

        What is as accurate on the full scene need not be without some effect: it may hold the steps. A change is to be
        known to a third of itself, or of what is borne.
        """
        found = _ran(scene, scene.model)
        if scene.simulation != self.full.scene.simulation:  # integrated exactly
            return replace(found, finer=found.run)
        alike = self.accuracy.of(scene)
        begun = _ran(alike, found.model).run if self.accuracy.refinements else found.run
        held = refined(
            alike, found.model, begun, self._known, lambda run: SHARE * max(self.within.outputs, self._change(run))
        )
        return replace(found, judged=held.run, finer=held.finer)

    def _change(self, run: Run) -> float:
        return worst(outputs_apart(self.full.judged, run))

    def _known(self, run: Run, finer: Run | None) -> float:
        """To what the change of a run from the full one is known."""
        return worst(changes_known((self.full.judged, self.full.finer), (run, finer)))


def _ran(scene: Subject, model: Model) -> Trial:
    run, taken = timed(scene, model)
    if run.status is not Status.FINISHED:
        raise FlexctrlError(f"the run ended early: {run.report.message}")
    return Trial(scene, run, [taken], model, run)


def timed(scene: Subject, model: Model) -> tuple[Run, float]:
    """Return a run and its processor time [s], which other processes hardly disturb."""
    began = thread_time()
    run = unstopped(scene.run(model))
    return run, max(thread_time() - began, 1e-9)
