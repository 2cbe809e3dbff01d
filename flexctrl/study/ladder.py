"""The fidelity ladder: one scene under ever more physics, what each rung is worth and what it costs."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.alpha.method import AdaptiveAlpha, GeneralizedAlpha
from flexctrl.dynamics.linear_motion.exact import Exact
from flexctrl.dynamics.methods.checked import bare
from flexctrl.dynamics.run import Run, Tolerance
from flexctrl.dynamics.steps import Integrator
from flexctrl.errors import FlexctrlError, StructureError
from flexctrl.frozen import frozen
from flexctrl.study.reference import Reference, certified, error_of, finished
from flexctrl.study.settings import Fidelity, Setting, spacing_of, sweep
from flexctrl.study.subject import Subject, prepared
from flexctrl.study.tryouts import calibration

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Ladder", "Rung", "ladder", "rungs"]

_REPEATS = 3
_WORTH = 2.0
_STOPPED = "stopped before it was run"
_FINER = 4
_COARSER = 4.0
_NIMBLE = (Fidelity.RIGID, Fidelity.RIGID_WITH_SHAFTS, Fidelity.COMPONENT_MODES)
"""Rungs that leave out what moves fast."""


@frozen
class Rung:
    """A scene at one fidelity.

    Attributes
    ----------
    name : str
        ``rigid``, ``rigid, shafts``, ``linear``, ``component modes``, ``full`` or ``refined``.
    setting : Setting
    error : float
        Largest |Δy| of an output over its largest magnitude in the reference; infinite if the run failed.
    time_ratio : float
        Processor time of the run over that of a fixed calculation in the same process; infinite if it failed.
    freedoms, steps : int
        0 for a rung that cannot be.
    failure : str
        Why it cannot be (a law of force that switches is not linear, say) or its run ended early; empty if it ran.
    """

    name: str
    setting: Setting
    error: float
    time_ratio: float
    freedoms: int
    steps: int
    failure: str = ""


@frozen(eq=False)
class Ladder:
    """A scene from rigid to refined.

    Attributes
    ----------
    name : str
    rungs : tuple of Rung
        From the least physics to the most; what changes nothing of the scene is left out.
    reference : Reference
        What errors are measured against.
    complete : bool
        False if it was stopped: rungs that had not been run say so, and times are of fewer runs.
    """

    name: str
    rungs: tuple[Rung, ...]
    reference: Reference
    complete: bool = True

    def __getitem__(self, name: str) -> Rung:
        for rung in self.rungs:
            if rung.name == name:
                return rung
        raise StructureError(f"the ladder has no rung {name!r}; it has {', '.join(r.name for r in self.rungs)}")

    @property
    def gains(self) -> tuple[float, ...]:
        """How many times faster each rung is than the next that ran: one fewer than there are rungs.

        Infinite for a rung that could not be run itself, or none after it.
        """
        times = [rung.time_ratio for rung in self.rungs]
        after = [next(filter(np.isfinite, times[i:]), np.inf) for i in range(1, len(times))]
        return tuple(b / a if np.isfinite(a) else np.inf for a, b in zip(times, after, strict=False))

    @property
    def climb(self) -> tuple[Rung, ...]:
        """The rungs worth standing on, the cheapest first: each takes less than half the time of the next.

        From the last one downwards: the most accurate of those at least twice as fast. A rung that is left out saves
        too little, or another is as quick and nearer to the reference, or it is no nearer to that than no motion at
        all. Rungs whose errors are below what the reference is known to are as good as each other.
        """
        doubt = self.reference.uncertainty
        ran = [rung for rung in self.rungs if np.isfinite(rung.time_ratio)]
        found, near = ran[-1:], [rung for rung in ran if rung.error < 1.0]
        while cheaper := [r for r in near if _WORTH * r.time_ratio <= found[0].time_ratio]:
            found.insert(0, min(cheaper, key=lambda r: (max(r.error, doubt), r.time_ratio)))
        return tuple(found)

    def plot(self) -> Figure:
        """Draw error against time, rung by rung.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.ladder import ladder_figure

        return ladder_figure(self)

    def __str__(self) -> str:
        wide = max(len(r.name) for r in self.rungs)
        lines = [f"{'rung':<{wide}}  {'freedoms':>8}  {'steps':>7}  {'error':>9}  {'time':>8}  {'next takes':>10}"]
        for rung, gain in zip(self.rungs, (*self.gains, np.nan), strict=True):
            if rung.failure:
                lines.append(f"{rung.name:<{wide}}  {rung.failure}")
                continue
            told = f"{rung.freedoms:>8}  {rung.steps:>7}  {self.reference.told(rung.error):>9}  {rung.time_ratio:8.3g}"
            beyond = f"  {_times(gain):>10}" if np.isfinite(gain) else ""
            lines.append(f"{rung.name:<{wide}}  {told}{beyond}")
        lines.append(
            "error: largest of an output, over its largest magnitude; time: of a run, over that of a fixed calculation"
        )
        lines.append(f"worth standing on: {', '.join(rung.name for rung in self.climb) or 'none'}")
        lines += [] if self.complete else ["stopped before all had been run as often as they should be"]
        return "\n".join([*lines, f"reference: {self.reference.setting}; known to {self.reference.uncertainty:.1e}"])


def _times(factor: float) -> str:
    """A factor to one decimal, or two digits where that is less than 1."""
    return f"{factor:.1f} ×" if factor >= 1.0 else f"{factor:.2g} ×"


def rungs(scene: Subject) -> tuple[tuple[str, Setting], ...]:
    """Return the rungs that a scene has, by name, from the least physics to the most.

    Rungs are run as the scene is, but for the linear one, which is integrated exactly (of a scene that begins as drawn,
    from there too, to first order about the equilibrium; under a continuous law it is run as the scene is), and the
    refined one: four times the elements and half the
    steps. Where steps are controlled, these follow from an eighth of the tolerance, and none is longer than half a
    sample of the controller. Where they are not, rigid parts and component modes, which leave out what moves fast, take
    one step for four, none longer than a sample.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    tuple of (str, Setting)
    """
    method, tolerance = bare(scene.simulation.method or AdaptiveAlpha()), scene.simulation.tolerance
    found = [(s.fidelity.value, s) for s in sweep(scene, meshes=(1,), methods=[(method, tolerance)])]
    follows = scene.law is not None and not scene.law.sample_time
    exact = method if follows else Exact(spacing_of(scene))
    fewest = dict(reversed(found))  # component modes of the lowest order
    ways = {Fidelity.LINEAR: exact} | dict.fromkeys(_NIMBLE, _coarser(scene, method))
    named = [(n, replace(s, method=ways.get(s.fidelity, method))) for n, s in reversed(fewest.items())]
    return (*named, ("refined", Setting(Fidelity.FULL, _FINER, *_finer(scene, method, tolerance))))


def _coarser(scene: Subject, method: Integrator) -> Integrator:
    if not isinstance(method, GeneralizedAlpha):
        return method
    sample = scene.law.sample_time if scene.law is not None else 0.0
    return replace(method, step=max(method.step, min(_COARSER * method.step, sample or np.inf)))


def _finer(scene: Subject, method: Integrator, tolerance: Tolerance) -> tuple[Integrator, Tolerance]:
    if isinstance(method, GeneralizedAlpha):
        return replace(method, step=0.5 * method.step), tolerance
    if isinstance(method, AdaptiveAlpha) and scene.law is not None and scene.law.sample_time:
        method = replace(method, largest_step=min(method.largest_step, 0.5 * scene.law.sample_time))
    return method, Tolerance(tolerance.relative / 8.0, tolerance.absolute / 8.0)


def ladder(
    scene: Subject,
    *,
    rungs: Sequence[tuple[str, Setting]] = (),
    tolerance: float = 0.01,
    progress: Callable[[float], None] | None = None,
) -> Ladder:
    """Run a scene at every fidelity: rigid, with elastic shafts, linear, component modes, full, refined.

    All are the same scene with other effects. One that cannot be, as the linear one with Coulomb friction, backlash or
    no equilibrium, is told as such and takes nothing from the others. Errors are against a certified reference, finer
    than the refined rung. Times are the shortest of several runs, taken in turn, over that of a fixed calculation made
    in between. Ctrl-C after the reference has been found gives a ladder of the rungs run until then.

    Parameters
    ----------
    scene : Scene
    rungs : sequence of (str, Setting)
        Names and settings; default: `rungs` of the scene.
    tolerance : float
        The reference is to be known to a third of this, relative to each output's largest magnitude.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    Ladder

    Raises
    ------
    StructureError
        For a tolerance that is not positive, or a scene without a simulation.
    FlexctrlError
        If the reference cannot be certified; see `work_precision`.
    """
    base = prepared(scene, tolerance, "ladder")
    chosen, tell = tuple(rungs) or _rungs(base), progress or (lambda done: None)
    reference = certified(base, [setting for _, setting in chosen], tolerance)
    tried = [_Tried(name, setting, base) for name, setting in chosen]
    complete = _all_run(tried, tell)
    return Ladder(base.name, tuple(one.rung(reference) for one in tried), reference, complete)


def _all_run(tried: Sequence[_Tried], tell: Callable[[float], None]) -> bool:
    """Run all in turn, several times; tell whether that was not stopped."""
    try:
        for i in range(_REPEATS):
            for k, one in enumerate(tried):
                tell((1.0 + i * len(tried) + k) / (1.0 + _REPEATS * len(tried)))
                one.again()
        tell(1.0)
    except KeyboardInterrupt:
        if not any(np.isfinite(one.time) for one in tried):
            raise  # there is nothing to keep
        return False
    return True


_rungs = rungs


@dataclass
class _Tried:
    """A rung that is being tried."""

    name: str
    setting: Setting
    scene: Subject
    run: Run | None = None
    time: float = np.inf
    failure: str = ""

    def again(self) -> None:
        """Run it once more, unless it cannot be."""
        if self.failure:
            return
        try:
            if self.run is None:
                self.scene = self.setting.of(self.scene)
                self.run = finished(self.scene)  # compiles what is new
            unit = calibration()
            began = time.process_time()
            finished(self.scene)
            took = time.process_time() - began
            self.time = min(self.time, took / min(unit, calibration()))
        except FlexctrlError as error:
            self.failure = str(error).splitlines()[0].partition(";")[0]  # the remedy would be for the whole scene

    def rung(self, reference: Reference) -> Rung:
        """What was found."""
        if self.failure or self.run is None or not np.isfinite(self.time):
            return Rung(self.name, self.setting, np.inf, np.inf, 0, 0, self.failure or _STOPPED)
        error, report = error_of(reference.run, self.run), self.run.report
        return Rung(self.name, self.setting, error, self.time, report.dofs, report.steps)
