"""How accurately the full run of a ledger is known, and how finely runs are integrated to be compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from flexctrl.dynamics.alpha.method import AdaptiveAlpha
from flexctrl.dynamics.methods.checked import bare
from flexctrl.dynamics.methods.extrapolation import Richardson
from flexctrl.dynamics.run import Run, Status, Tolerance
from flexctrl.dynamics.steps import Fixed, Integrator
from flexctrl.errors import FlexctrlError
from flexctrl.frozen import frozen
from flexctrl.model.model import Model
from flexctrl.study.answers import outputs_apart
from flexctrl.study.subject import Subject
from flexctrl.study.unstopped import unstopped

__all__ = ["SHARE", "Accuracy", "Held", "accurate", "finer_plan", "refined", "worst"]

_REFINEMENTS = 5
SHARE = 1.0 / 3.0
"""Of the largest change that is borne: what runs may be off by to judge changes."""


@frozen(eq=False)
class Accuracy:
    """How well the full run is known that others are compared with.

    Attributes
    ----------
    own : float
        How far the scene's own run is from one with at least twice as many steps and a tenth of the tolerance:
        largest change of an output over its magnitude; infinite if that run ended early.
    known : float
        The same of the full run that others are compared with.
    needed : float
        What that must not exceed to judge changes: a third of those that are borne.
    refinements : int
        How many times runs that are compared were refined so; 0: they are the scene's own.
    method : Integrator or None
        Of the runs that are compared.
    tolerance : Tolerance
    steps : int
        Of the full one.
    """

    own: float
    known: float
    needed: float
    refinements: int
    method: Integrator | None
    tolerance: Tolerance
    steps: int

    def of(self, scene: Subject) -> Subject:
        """Return a scene integrated as finely as the full one."""
        return scene.with_(simulation=replace(scene.simulation, method=self.method, tolerance=self.tolerance))

    @property
    def note(self) -> str:
        """What cannot be told apart from errors of the integrator; empty if all that counts can be."""
        if self.known <= self.needed:
            return ""
        known = f"to {100.0 * self.known:.2g} % only" if np.isfinite(self.known) else "no further: finer ones end early"
        return (
            f"the full run is known {known}, not to a third of what is asked of outputs: changes of outputs may be "
            "the integrator's; give a tighter tolerance or shorter steps"
        )

    def __str__(self) -> str:
        known = f"outputs known to {100.0 * self.known:.2g} %"
        if not self.refinements:
            return f"full run: {known}"
        return f"full run: with {self.steps} steps, {known}; the scene's own is {100.0 * self.own:.2g} % off"


@frozen(eq=False)
class Held:
    """A run that is held against a finer one.

    Attributes
    ----------
    run : Run
    finer : Run or None
        With at least twice as many steps and a tenth of the tolerance; None if it ended early.
    plan : Simulation
        Of the run.
    apart : float
        How far they are apart; infinite without the finer one.
    own : float
        The same of the run that was begun with.
    refinements : int
        How many times the run was replaced by a finer one.
    """

    run: Run
    finer: Run | None
    plan: Any
    apart: float
    own: float
    refinements: int


def accurate(scene: Subject, model: Model, run: Run, bearable: float) -> tuple[Accuracy, Held]:
    """Return how well a scene's run is known, and a run good enough to judge changes by: itself or a finer one.

    Parameters
    ----------
    scene : Scene
    model : Model
        Its own.
    run : Run
        Its own.
    bearable : float
        Largest change of an output that is borne.

    Returns
    -------
    (Accuracy, Held)
    """
    needed = SHARE * bearable
    held = refined(scene, model, run, lambda one, finer: worst(outputs_apart(finer, one)), lambda _: needed)
    method, tolerance = held.plan.method, held.plan.tolerance
    steps = held.run.report.steps
    return Accuracy(held.own, held.apart, needed, held.refinements, method, tolerance, steps), held


def refined(
    scene: Subject, model: Model, run: Run, apart: Callable[[Run, Run], float], needed: Callable[[Run], float]
) -> Held:
    """Return a scene's run, or a finer one: until the next finer one agrees as needed, or agrees no better.

    Parameters
    ----------
    scene : Scene
    model : Model
        Its own.
    run : Run
        Its own.
    apart : callable
        (run, finer run) ↦ how far they are apart.
    needed : callable
        Run ↦ how near the finer one must be.

    Returns
    -------
    Held
    """
    plan, own = scene.simulation, np.inf
    best: Held | None = None
    for refinements in range(_REFINEMENTS + 1):
        finer = finer_plan(plan, run)
        after = _finished(scene.with_(simulation=finer), model)
        gap = np.inf if after is None else apart(run, after)
        own = gap if best is None else own
        if best is not None and not gap < best.apart:
            break
        best = Held(run, after, plan, gap, own, refinements)
        if after is None or gap <= needed(run):
            break
        plan, run = finer, after
    assert best is not None
    return best


def _finished(scene: Subject, model: Model) -> Run | None:
    """A scene's run, if it comes to its end."""
    try:
        run = unstopped(scene.run(model))
    except FlexctrlError:
        return None
    return run if run.status is Status.FINISHED else None


def worst(changes: Mapping[str, float]) -> float:
    """Return the largest of some changes; 0 if there are none."""
    return max(changes.values(), default=0.0)


def finer_plan(plan: Any, run: Run) -> Any:
    """Return a plan with at least twice as many steps as a run took, whatever held them, and a tenth of the tolerance.

    Parameters
    ----------
    plan : Simulation
        Of the run.
    run : Run

    Returns
    -------
    Simulation
    """
    half = 0.5 * float(run.t[-1] - run.t[0]) / max(run.report.steps, 1)
    tolerance = Tolerance(0.1 * plan.tolerance.relative, 0.1 * plan.tolerance.absolute)
    return replace(plan, method=_with_steps(bare(plan.method or AdaptiveAlpha()), half), tolerance=tolerance)


def _with_steps(method: Any, longest: float) -> Any:
    """A method whose steps are no longer than that; an integrator of the user's own has its tolerance alone."""
    if isinstance(method, Richardson):
        return replace(method, method=_with_steps(method.method, longest))
    if isinstance(method.pace, Fixed):
        return replace(method, step=min(0.5 * method.step, longest)) if hasattr(method, "step") else method
    if not hasattr(method, "largest_step"):
        return method
    return replace(method, largest_step=min(method.largest_step, longest))
