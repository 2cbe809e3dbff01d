"""What the start sets ringing so fast that steps see little of it: lines and shafts under loads put on at once."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.run import Run
from flexctrl.dynamics.swift.stiff_lines import frequency_of
from flexctrl.errors import SingularMatrixError
from flexctrl.model.model import Model
from flexctrl.model.solve import factorise
from flexctrl.model.state import State
from flexctrl.structure.outputs import DriveSpeed, Tension

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["ringing"]

_SEEN, _LITTLE, _RESOLVED = 1.0, 0.05, 0.2
_SEEDS = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
_SAID = (
    "{name} rings by up to {swing:.2g} from the start on, by {turned:.2g} rad in a step, which sees little of that: "
    "its peaks may be missed; bring loads up more slowly, or take steps of {finer:.1g} s"
)


def ringing(run: Run, journey: Journey) -> Run:
    """Return a run with notes on tensions and motor speeds whose ringing from the start on its steps do not resolve.

    What is out of balance at the start accelerates a line's ends, or a motor, by a: they swing about where forces
    balance by a/ω², and a motor's speed by a/ω. Where that is 5 % of what the output gets to, and steps turn it by more
    than a radian on average, its peaks are a matter of chance, but for the first, which short first steps may see.
    Where dry contacts may hold, the start tells nothing of that.

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
    step, start = journey.point.state.t / max(journey.mark.steps, 1), _Start.of(journey)
    for output in asked:
        swing, frequency = start.tension(output) if isinstance(output, Tension) else start.speed(output)
        turned, most = step * frequency, float(np.abs(run[output.name]).max())
        if turned > _SEEN and swing > _LITTLE * most:
            yield _SAID.format(name=output.name, swing=swing, turned=turned, finer=_RESOLVED / frequency)


@dataclass(frozen=True)
class _Start:
    """A machine where it begins: accelerations and squares of own frequencies, (n,) each, 0 of what has no mass."""

    model: Model
    state: State
    rates: np.ndarray
    square: np.ndarray

    @classmethod
    def of(cls, journey: Journey) -> _Start:
        model, state, u = journey.plan.model, journey.origin.state, journey.origin.u
        assert isinstance(model, Model)
        still, rates, square = np.zeros((3, model.n))
        mass, stiffness = (-model.slope(state, state.v, still, seeds, u).tocsr() for seeds in _SEEDS)
        heavy = np.flatnonzero(mass.diagonal() > model.dust)
        force = model.balance(state, state.v, still) + model.loads(state, u)
        square[heavy] = np.maximum(stiffness.diagonal()[heavy] / mass.diagonal()[heavy], 0.0)
        with suppress(SingularMatrixError):
            rates[heavy] = factorise(mass[heavy][:, heavy])(force[heavy])
        return cls(model, state, rates, square)

    def tension(self, output: Tension) -> tuple[float, float]:
        """By how much a tension rings [N], and how fast [rad/s]; 0 where its line does not give way."""
        model, frequency = self.model, frequency_of(self.model, output.line)
        raw = np.zeros(model.motion.raw)
        pulls = model.signals.sight(self.state, raw, raw.size) @ (model.motion.jacobian(self.state) @ self.rates)
        pull = abs(float(pulls[model.outputs.index(output.name)]))
        return (pull / frequency**2, frequency) if frequency else (0.0, 0.0)

    def speed(self, output: DriveSpeed) -> tuple[float, float]:
        """By how much a motor's speed rings [rad/s], and how fast [rad/s]; 0 of one behind a rigid shaft."""
        motion, drive = self.model.motion, [d.name for d in self.model.structure.drives].index(output.drive)
        own = int(motion.sources[drive])
        if motion.rigid[drive] or own >= self.model.n or not self.square[own]:
            return 0.0, 0.0
        frequency = float(np.sqrt(self.square[own]))
        return abs(float(self.rates[own])) / frequency, frequency
