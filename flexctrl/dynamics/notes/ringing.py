"""What the start sets ringing so fast that steps see little of it: lines and shafts under loads put on at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse.linalg import spsolve

from flexctrl.dynamics.run import Run
from flexctrl.dynamics.swift.stiff_lines import frequency_of
from flexctrl.model.model import Model
from flexctrl.model.state import State
from flexctrl.structure.outputs import DriveSpeed, Tension

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["ringing"]

_SEEN, _LITTLE, _RESOLVED = 1.0, 0.05, 0.2
_SAID = (
    "{name} rings by up to {swing:.2g} from the start on, by {turned:.2g} rad in a step, which sees little of that: "
    "its peaks may be missed; bring loads up more slowly, or take steps of {finer:.1g} s"
)


def ringing(run: Run, journey: Journey) -> Run:
    """Return a run with notes on tensions and motor speeds whose ringing from the start on its steps do not resolve.

    What is out of balance at the start accelerates a line's ends, or a motor, by a: they swing about where forces
    balance by a/ω². Where that is 5 % of what the output gets to, and steps turn it by more than a radian on average,
    its peaks are a matter of chance, but for the first, which short first steps may see. Where dry contacts may hold,
    the start tells nothing of that.

    Parameters
    ----------
    run : Run
    journey : Journey
        How it went.

    Returns
    -------
    Run
    """
    model = journey.plan.model
    if not (isinstance(model, Model) and len(run.y)) or model.switches.names:
        return run
    asked = [o for o in model.structure.outputs if isinstance(o, Tension | DriveSpeed)]
    asked = [o for o in asked if o.name not in run.report.output_errors]
    notes = tuple(_notes(run, journey, model, asked)) if asked else ()
    return replace(run, report=replace(run.report, notes=(*run.report.notes, *notes))) if notes else run


def _notes(run: Run, journey: Journey, model: Model, asked: list[Tension | DriveSpeed]) -> Iterator[str]:
    step = journey.point.state.t / max(journey.mark.steps, 1)
    start, u = journey.origin.state, journey.origin.u
    rates = _accelerations(model, start, u)
    for output in asked:
        swing, frequency = _swing(model, start, u, rates, output)
        turned, most = step * frequency, float(np.abs(run[output.name]).max())
        if turned > _SEEN and np.isfinite(swing) and swing > _LITTLE * most:
            yield _SAID.format(name=output.name, swing=swing, turned=turned, finer=_RESOLVED / frequency)


def _accelerations(model: Model, start: State, u: np.ndarray) -> np.ndarray:
    """Accelerations at the start, shape (n,); 0 of what has no mass."""
    still, found = np.zeros(model.n), np.zeros(model.n)
    mass = -model.slope(start, start.v, still, (0.0, 0.0, 1.0), u).tocsc()
    heavy = np.flatnonzero(mass.diagonal() > model.dust)
    force = model.balance(start, start.v, still) + model.loads(start, u)
    if heavy.size:
        found[heavy] = spsolve(mass[heavy][:, heavy], force[heavy])
    return found


def _swing(
    model: Model, start: State, u: np.ndarray, rates: np.ndarray, output: Tension | DriveSpeed
) -> tuple[float, float]:
    """By how much an output rings, in its own unit, and how fast [rad/s]; 0 where it does not."""
    still = np.zeros(model.n)
    if isinstance(output, Tension):
        frequency = frequency_of(model, output.line)
        row = model.signals.sight(start, np.zeros(model.motion.raw), model.motion.raw)[model.outputs.index(output.name)]
        pull = float(np.abs(row @ (model.motion.jacobian(start) @ rates)).max(initial=0.0))
        return (pull / frequency**2, frequency) if frequency else (0.0, 0.0)
    drive = [d.name for d in model.structure.drives].index(output.drive)
    own = int(model.motion.sources[drive])
    if model.motion.rigid[drive] or own >= model.n:
        return 0.0, 0.0
    mass, stiffness = (
        -float(model.slope(start, start.v, still, seeds, u).diagonal()[own])
        for seeds in ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    )
    frequency = (stiffness / mass) ** 0.5 if mass > 0.0 and stiffness > 0.0 else 0.0
    return (abs(float(rates[own])) / frequency, frequency) if frequency else (0.0, 0.0)
