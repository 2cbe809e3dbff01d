"""The effect ledger: what leaving out each effect changes, what it saves, and the smallest set that will do."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from time import thread_time
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.exact import Exact
from flexctrl.dynamics.run import Run, Status
from flexctrl.errors import FlexctrlError, StructureError, did_you_mean
from flexctrl.study.answers import Answer, Change, answer_of, change_between
from flexctrl.study.exactly import exactly, fewer_modes
from flexctrl.study.omissions import Omission, omissions
from flexctrl.study.subject import Subject, prepared

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Entry", "Ledger", "ledger"]

_DEARER, _CHEAPER = 1.05, 0.95
_LONG, _SHORT = 5.0, 0.05
_REPEATS = 4
_NOISE = 0.05


@dataclass(frozen=True)
class Size:
    """What a model is made of and what running it took.

    Attributes
    ----------
    states : int
        Of plant and controller.
    nonzeros : int
        Of the assembled tangent.
    instructions : int
        Of all force kernels, once over the machine.
    steps, newton_iterations : int
    work : float
        Newton iterations (steps, of a method without them) × (instructions + nonzeros): a cost that does not depend
        on the clock.
    """

    states: int
    nonzeros: int
    instructions: int
    steps: int
    newton_iterations: int

    @property
    def work(self) -> float:
        return float(self.newton_iterations or self.steps) * (self.instructions + self.nonzeros)


@dataclass(frozen=True)
class Entry:
    """One effect.

    Attributes
    ----------
    name : str
    change : Change or None
        What the answer loses without it; None if the scene cannot be run without it.
    cost_ratio : float
        Processor time of the full scene over that without the effect, in the same process; NaN if it cannot be run.
    size : Size or None
        Of the scene without it.
    keep : bool
        Whether the minimal set has it.
    failure : str
        Why the scene cannot do without it; empty if it can.
    first : tuple of str
        What cannot be without it (friction in a linear machine): left out before, and what the change is against.
    """

    name: str
    change: Change | None
    cost_ratio: float
    size: Size | None
    keep: bool
    failure: str = ""
    first: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Ledger:
    """Every effect of a scene, and the smallest set that keeps the answer.

    Attributes
    ----------
    name : str
        The scene's.
    tolerance : float
        Largest change of an output that is borne, over its largest magnitude.
    entries : tuple of Entry
        In the scene's order.
    full : Answer
    size : Size
        Of the full scene.
    minimal : Answer
        From the scene with the minimal set alone.
    minimal_change : Change
        Of the minimal set against the full one: interactions included.
    speedup : float
        Processor time of the full scene over that of the minimal set.
    minimal_size : Size
    noise : float
        Relative spread of the times of the full scene, run several times: smaller differences of times say nothing.
    scene : Scene
        The scene with the minimal set.
    """

    name: str
    tolerance: float
    entries: tuple[Entry, ...]
    full: Answer
    size: Size
    minimal: Answer
    minimal_change: Change
    speedup: float
    minimal_size: Size
    noise: float
    scene: Subject = field(repr=False)

    @property
    def pace(self) -> str:
        """How fast the minimal set is, in words: faster or slower where that was measured beyond the noise."""
        factor = max(self.speedup, 1.0 / self.speedup)
        if factor <= 1.0 + self.noise:
            return "as fast"
        return f"{factor:.1f} × {'faster' if self.speedup > 1.0 else 'slower'}"

    @property
    def modes(self) -> int | None:
        """How many vibrations the minimal set is run with; None if that is all there are."""
        method = self.scene.simulation.method
        return method.modes if isinstance(method, Exact) else None

    @property
    def _way(self) -> str:
        """How the minimal set is run, if that is not how the scene is."""
        if not isinstance(self.scene.simulation.method, Exact):
            return ""
        if self.modes is None:
            return "; linear: integrated exactly"
        return f"; linear: integrated exactly, free motion and {self.modes} vibration{'s' * (self.modes != 1)}"

    @property
    def minimal_set(self) -> tuple[str, ...]:
        """Names of the effects that are kept."""
        return tuple(e.name for e in self.entries if e.keep)

    def __getitem__(self, name: str) -> Entry:
        for entry in self.entries:
            if entry.name == name:
                return entry
        raise StructureError(f"the ledger has no effect {name!r}{did_you_mean(name, [e.name for e in self.entries])}")

    def plot(self) -> Figure:
        """Draw what each effect changes against what it costs.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.ledger import ledger_figure

        return ledger_figure(self)

    def __str__(self) -> str:
        wide = max([len(e.name) for e in self.entries], default=6)
        heads = ("outputs", "poles", "of pole", "margins", "time", "states", "nonzeros")
        lines = [f"{'without':<{wide}}" + "".join(f"  {head:>{_width(head)}}" for head in heads)]
        lines += [self._line(e, wide) for e in self.entries]
        kept = ", ".join(self.minimal_set) or "nothing"
        change, asked = _percent(self.minimal_change.outputs_worst), _percent(self.tolerance)
        size = f"{self.minimal_size.states} of {self.size.states} states"
        lines += [f"kept: {kept}", f"outputs within {change} (asked: {asked}), {self.pace}, {size}{self._way}"]
        return "\n".join(lines)

    def _line(self, e: Entry, wide: int) -> str:
        if e.change is None or e.size is None:
            return f"{e.name:<{wide}}  kept: {e.failure}"
        outputs, poles, margins = (_percent(c) for c in (e.change.outputs_worst, e.change.poles, e.change.margins))
        pole = f"{e.change.pole:.2g}" if e.change.poles > 0.0 else "–"
        cells = [f"{c:>10}" for c in (margins, f"{1.0 / e.cost_ratio:.2f}", e.size.states, e.size.nonzeros)]
        places = [f"{outputs:>10}", f"{poles:>10}", f"{pole:>{_width('of pole')}}"]
        line = "  ".join([f"{e.name:<{wide}}", *places, *cells])
        before = f"  (both without {', '.join(e.first)})" if e.first else ""
        return line + ("  keep" if e.keep else "") + before


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
    linear it is integrated exactly, with the fewest modes that keep the answer.

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


class _Auditor:
    """The ledger being drawn up."""

    def __init__(self, scene: Subject, tolerance: float, margins: float, progress: Callable[[float], None]) -> None:
        self.tolerance, self.margins, self.progress = tolerance, margins, progress
        self.items = omissions(scene)
        self.done, self.expected = 0, 2 * len(self.items) + 5
        self.full = self._tried(scene)
        self.bases: dict[tuple[str, ...], _Trial | str] = {(): self.full}

    def drawn_up(self) -> Ledger:
        trials = {o.name: self._alone(o) for o in self.items}
        gone = self._smallest(trials)
        minimal = self._without(gone) if gone else self.full
        assert isinstance(minimal, _Trial)
        minimal = self._reduced(minimal)
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

    def _smallest(self, trials: dict[str, _Trial | str]) -> list[Omission]:
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

    def _alone(self, omission: Omission) -> _Trial | str:
        """The scene without one thing, and without what cannot be without it."""
        before = [o for o in self.items if o.name in omission.first]
        if omission.first not in self.bases:
            self.bases[omission.first] = self._without(before)
        return self._without([*before, omission])

    def _may_go(self, omission: Omission, trial: _Trial | str) -> bool:
        if not isinstance(trial, _Trial) or not self._holds(trial):
            return False
        return self._work(trial) <= (_DEARER if omission.spares else _CHEAPER)

    def _work(self, trial: _Trial) -> float:
        """Counted work over that of the full scene."""
        return trial.size.work / max(self.full.size.work, 1e-300)

    def _weight(self, trial: _Trial | str) -> float:
        assert isinstance(trial, _Trial)
        return change_between(self.full.answer, trial.answer).outputs_worst

    def _holds(self, trial: _Trial) -> bool:
        change = change_between(self.full.answer, trial.answer)
        return change.outputs_worst <= self.tolerance and not change.margins > self.margins

    def _entry(self, omission: Omission, trial: _Trial | str, keep: bool) -> Entry:
        name, base = omission.name, self.bases[omission.first]
        if isinstance(trial, str) or isinstance(base, str):
            return Entry(name, None, np.nan, None, True, trial if isinstance(trial, str) else str(base))
        change = change_between(base.answer, trial.answer)
        return Entry(name, change, self._ratio(trial, base), trial.size, keep, first=omission.first)

    def _without(self, gone: Iterable[Omission]) -> _Trial | str:
        """Run the scene without some effects, or say why that cannot be done."""
        scene = self.full.scene
        try:
            for omission in gone:
                scene = omission.without(scene)
            return self._tried(scene)
        except FlexctrlError as error:
            self._tick()
            return str(error).splitlines()[0]

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

    def _measure(self, trials: list[_Trial | str]) -> None:
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


def _percent(value: float) -> str:
    return "–" if not np.isfinite(value) else f"{100.0 * value:.3g} %"  # at most 10 characters, of 1.23e-05 %


def _width(head: str) -> int:
    return 14 if head == "of pole" else 10
