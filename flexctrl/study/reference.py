"""A reference that can be trusted: refinements and integrators that agree."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from functools import cache
from typing import NamedTuple

from flexctrl.dynamics.alpha.method import AdaptiveAlpha, GeneralizedAlpha
from flexctrl.dynamics.run import Run, Status, Tolerance
from flexctrl.dynamics.steps import Fixed, Integrator
from flexctrl.errors import FlexctrlError
from flexctrl.frozen import frozen
from flexctrl.study.answers import Curves, outputs_apart
from flexctrl.study.settings import Fidelity, Setting
from flexctrl.study.subject import Subject
from flexctrl.study.unstopped import unstopped

__all__ = ["Reference", "Traced", "certified", "error_of", "finest_of", "finished", "trace"]

_REFINEMENTS = 4
_MESH = "a coarser mesh"


@frozen(eq=False)
class Reference:
    """A run that others are measured against.

    Attributes
    ----------
    run : Curves
        Its outputs.
    setting : Setting
    agreement : mapping of str to float
        How far it is from a coarser mesh, from longer steps and from another integrator: largest change of an
        output over its magnitude; infinite from a run that ended early.
    refined : tuple of str
        What the disagreements were over which it was refined, in turn.
    ended : mapping of str to str
        Why runs that it was held against ended early.
    """

    run: Curves
    setting: Setting
    agreement: dict[str, float]
    refined: tuple[str, ...] = ()
    ended: Mapping[str, str] = field(default_factory=dict)

    @property
    def uncertainty(self) -> float:
        """The largest of the disagreements."""
        return max(self.agreement.values(), default=0.0)

    def told(self, error: float) -> str:
        """Return an error against it in words: of one below what it is known to, that it is.

        Parameters
        ----------
        error : float

        Returns
        -------
        str
            At most nine characters.
        """
        return f"{error:.2e}" if error > self.uncertainty else f"< {self.uncertainty:.1e}"


class Traced(NamedTuple):
    """What is wanted of a run.

    Attributes
    ----------
    curves : Curves
    steps : int
    """

    curves: Curves
    steps: int


def finest_of(settings: Sequence[Setting]) -> Setting:
    """Return a setting finer than all of some: the reference's.

    Its steps are fixed if those of most settings are, else controlled.

    Parameters
    ----------
    settings : sequence of Setting

    Returns
    -------
    Setting
    """
    mesh = 2 * max(s.mesh for s in settings)
    steps = [s.method.step for s in settings if isinstance(s.method, GeneralizedAlpha)]
    controlled = [s.tolerance for s in settings if not isinstance(s.method.pace, Fixed)]
    if steps and len(steps) >= len(controlled):
        return Setting(Fidelity.FULL, mesh, GeneralizedAlpha(0.25 * min(steps)), Tolerance())
    least = min(controlled or [s.tolerance for s in settings], key=lambda t: t.relative)
    largest = min((s.method.largest_step for s in settings if isinstance(s.method, AdaptiveAlpha)), default=math.inf)
    finest = AdaptiveAlpha(largest_step=0.5 * largest)
    return Setting(Fidelity.FULL, mesh, finest, Tolerance(0.1 * least.relative, 0.1 * least.absolute))


def certified(
    scene: Subject,
    settings: Sequence[Setting],
    tolerance: float,
    run: Callable[[Setting], Traced] | None = None,
) -> Reference:
    """Return a reference whose refinements and integrators agree.

    Parameters
    ----------
    scene : Scene
    settings : sequence of Setting
        What it has to be finer than.
    tolerance : float
        They must agree within a third of it.
    run : callable, optional
        What runs the scene at a setting, or knows what that gave.

    Returns
    -------
    Reference

    Raises
    ------
    FlexctrlError
        If the finest run fails, or the others do or disagree however it is refined; says why or by how much.
    """
    refined: tuple[str, ...] = ()
    traced = cache(run or (lambda setting: trace(scene, setting)))
    for _ in range(_REFINEMENTS):
        reference = _reference(traced, _refined_by(finest_of(settings), refined), refined)
        if _trusted(reference, tolerance):
            return reference
        worst = max(reference.agreement, key=lambda name: reference.agreement[name])
        refined = (*refined, worst)
    if worst in reference.ended:
        raise FlexctrlError(
            f"{scene.name}: the reference ({reference.setting}) was refined {_REFINEMENTS - 1} times, and {worst} to "
            f"hold it against still fails: {reference.ended[worst]}"
        )
    raise FlexctrlError(
        f"{scene.name}: the reference ({reference.setting}) is {reference.uncertainty:.2g} from {worst}, more than a "
        f"third of the tolerance {tolerance:g}; give settings with finer meshes or shorter steps, or a larger tolerance"
    )


def _trusted(reference: Reference, tolerance: float) -> bool:
    """Whether it is good enough to judge errors of the size of a tolerance."""
    return reference.uncertainty <= tolerance / 3.0


def _refined_by(setting: Setting, disagreements: Sequence[str]) -> Setting:
    """A setting refined for each of some disagreements, in turn."""
    for worst in disagreements:
        setting = replace(setting, mesh=2 * setting.mesh) if worst == _MESH else _shorter(setting)
    return setting


def trace(scene: Subject, setting: Setting) -> Traced:
    """Return what a setting's run gives, which must come to its end.

    Parameters
    ----------
    scene : Scene
    setting : Setting

    Returns
    -------
    Traced
    """
    run = finished(setting.of(scene))
    return Traced(Curves.of(run), run.report.steps)


def _reference(traced: Callable[[Setting], Traced], finest: Setting, refined: tuple[str, ...]) -> Reference:
    run = traced(finest)
    others = {
        _MESH: replace(finest, mesh=finest.mesh // 2),
        "longer steps": _longer(finest),
        "another integrator": _other(finest, run),
    }
    agreement, ended = {}, {}
    for name, setting in others.items():
        try:
            agreement[name] = error_of(run.curves, traced(setting).curves)
        except FlexctrlError as failure:  # too coarse for the scene: refined as one that disagrees
            agreement[name], ended[name] = math.inf, str(failure)
    return Reference(run.curves, finest, agreement, refined, ended)


def _shorter(setting: Setting) -> Setting:
    method = setting.method
    if isinstance(method, GeneralizedAlpha):
        return replace(setting, method=replace(method, step=0.5 * method.step))
    t = setting.tolerance
    return replace(setting, method=_held(method, 0.5), tolerance=Tolerance(0.1 * t.relative, 0.1 * t.absolute))


def _longer(setting: Setting) -> Setting:
    method = setting.method
    if isinstance(method, GeneralizedAlpha):
        return replace(setting, method=replace(method, step=2.0 * method.step))
    t = setting.tolerance
    return replace(setting, method=_held(method, 2.0), tolerance=Tolerance(5.0 * t.relative, 5.0 * t.absolute))


def _held(method: Integrator, factor: float) -> Integrator:
    """A method whose largest step is held to another length."""
    return replace(method, largest_step=factor * method.largest_step) if isinstance(method, AdaptiveAlpha) else method


def _other(setting: Setting, run: Traced) -> Setting:
    """The same accuracy by other means: controlled steps for fixed ones, fixed for controlled."""
    if isinstance(setting.method, GeneralizedAlpha):
        return replace(setting, method=AdaptiveAlpha(rho=0.6), tolerance=Tolerance(1e-6, 1e-9))
    mean = float(run.curves.t[-1]) / max(run.steps, 1)
    return replace(setting, method=GeneralizedAlpha(mean, rho=0.6))


def finished(scene: Subject) -> Run:
    """Return a scene's run, which must come to its end.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    Run

    Raises
    ------
    FlexctrlError
        If it ends early.
    """
    run = unstopped(scene.run())
    if run.status is not Status.FINISHED:
        raise FlexctrlError(f"the run ended early: {run.report.message}")
    return run


def error_of(reference: Run | Curves, run: Run | Curves) -> float:
    """Return the largest error of an output over its largest magnitude in the reference.

    Parameters
    ----------
    reference, run : Run or Curves

    Returns
    -------
    float
    """
    return max(outputs_apart(reference, run).values(), default=0.0)
