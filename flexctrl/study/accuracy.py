"""How accurately the full run of a ledger is known, and how finely runs are integrated to be compared."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flexctrl.dynamics.alpha import AdaptiveAlpha
from flexctrl.dynamics.extrapolation import Richardson
from flexctrl.dynamics.run import Run, Status, Tolerance
from flexctrl.dynamics.steps import Fixed, Integrator
from flexctrl.errors import FlexctrlError
from flexctrl.model.model import Model
from flexctrl.study.answers import outputs_apart
from flexctrl.study.subject import Subject

__all__ = ["Accuracy", "accurate"]

_REFINEMENTS = 5
_SHARE = 1.0 / 3.0
"""Of the largest change that is borne: what the full run may be off by to judge changes."""


@dataclass(frozen=True, eq=False)
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
        known = f"known to {100.0 * self.known:.2g} %"
        if not self.refinements:
            return f"outputs: {known}"
        return f"outputs: of runs with {self.steps} steps, {known}; the scene's own is {100.0 * self.own:.2g} % off"


def accurate(scene: Subject, model: Model, run: Run, bearable: float) -> tuple[Accuracy, Run]:
    """Return how well a scene's run is known, and a run good enough to judge changes by: itself or a finer one.

    Each is held against one with at least twice as many steps, until they agree within a third of what is borne or
    finer runs agree no better.

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
    (Accuracy, Run)
    """
    plan = scene.simulation
    own = np.inf
    best: tuple[Accuracy, Run] | None = None
    for refinements in range(_REFINEMENTS + 1):
        finer = _finer(plan, run)
        gap, after = _apart(scene.with_(simulation=finer), model, run)
        own = gap if best is None else own
        if best is None or gap < best[0].known:
            steps = run.report.steps
            best = Accuracy(own, gap, _SHARE * bearable, refinements, plan.method, plan.tolerance, steps), run
        if best[1] is not run or gap <= best[0].needed or after is None:
            break
        plan, run = finer, after
    assert best is not None
    return best


def _apart(finer: Subject, model: Model, run: Run) -> tuple[float, Run | None]:
    """How far a run is from a finer one, and that one if it came to its end."""
    try:
        after = finer.run(model)
    except FlexctrlError:
        return np.inf, None
    if after.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    if after.status is not Status.FINISHED:
        return np.inf, None
    return max(outputs_apart(after, run).values(), default=0.0), after


def _finer(plan: Any, run: Run) -> Any:
    """A plan with at least twice as many steps as a run took, whatever held them, and a tenth of the tolerance."""
    half = 0.5 * float(run.t[-1] - run.t[0]) / max(run.report.steps, 1)
    tolerance = Tolerance(0.1 * plan.tolerance.relative, 0.1 * plan.tolerance.absolute)
    return replace(plan, method=_with_steps(plan.method or AdaptiveAlpha(), half), tolerance=tolerance)


def _with_steps(method: Any, longest: float) -> Any:
    """A method whose steps are no longer than that; an integrator of the user's own has its tolerance alone."""
    if isinstance(method, Richardson):
        return replace(method, method=_with_steps(method.method, longest))
    if isinstance(method.pace, Fixed):
        return replace(method, step=min(0.5 * method.step, longest)) if hasattr(method, "step") else method
    if not hasattr(method, "largest_step"):
        return method
    return replace(method, largest_step=min(method.largest_step, longest))
