"""What loads put on at once set ringing so fast that steps see little of it: lines and shafts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.methods.extrapolation import Richardson
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
_LAG = 0.3
"""Radians by which two runs part in phase from where on an extrapolation of them is larger than either."""
_SEEDS = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
_SAID = (
    "{name} rings by up to {swing:.2g} from {since} on, by {turned:.2g} rad in a step, which sees little of that: "
    "its peaks may be missed; bring loads up more slowly, or take steps of {finer:.1g} s"
)
_PARTED = (
    "{name} rings by up to {swing:.2g} from {since} on, and the two runs that are extrapolated part by {lag:.2g} rad "
    "of that: its peaks may be too large; bring loads up more slowly, or take steps of {finer:.1g} s"
)


def ringing(run: Run, journey: Journey) -> Run:
    """Return a run with notes on tensions and motor speeds that ring in ways that its steps do not resolve.

    What is out of balance at the start accelerates a line's ends, or a motor, by a: they swing about where forces
    balance by a/ω², and a motor's speed by a/ω. So do they where an input jumps, by what it adds to a. Where that is
    5 % of what the output gets to, and steps turn it by more than a radian on average, its peaks are a matter of
    chance, but for the first, which short first steps may see; where the two runs of `Richardson` part by a third of a
    radian in it, they are too large. Where dry contacts may hold, this tells nothing.

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
    step, shocks = journey.point.state.t / max(journey.mark.steps, 1), [_start(journey, model)]
    shocks += _jumps(run, journey, model)
    for output in asked:
        (swing, frequency), shock = max(((shock.swing(output), shock) for shock in shocks), key=lambda found: found[0])
        turned, most = step * frequency, float(np.abs(run[output.name]).max())
        if swing <= _LITTLE * most:
            continue
        lag = _parted(journey, shock, step, frequency)
        said = {"name": output.name, "swing": swing, "since": shock.since}
        if turned > _SEEN:
            yield _SAID.format(**said, turned=turned, finer=_RESOLVED / frequency)
        elif lag > _LAG:
            yield _PARTED.format(**said, lag=lag, finer=step * np.sqrt(0.1 * _LAG / lag))


def _parted(journey: Journey, shock: _Shock, step: float, frequency: float) -> float:
    """By how much the runs of an extrapolation part in phase [rad]: a run lags by (h ω)²/12 of its way."""
    if not isinstance(journey.plan.method, Richardson):
        return 0.0
    return 0.75 * (journey.point.state.t - shock.state.t) * frequency * (step * frequency) ** 2 / 12.0


def _start(journey: Journey, model: Model) -> _Shock:
    """What is out of balance where the run begins."""
    state, u = journey.origin.state, journey.origin.u
    force = model.balance(state, state.v, np.zeros(model.n)) + model.loads(state, u)
    return _Shock.of(model, state, u, force, "the start")


def _jumps(run: Run, journey: Journey, model: Model) -> Iterator[_Shock]:
    """The largest jump of each input, or what it changes by from one row to the next as steps see no more of it."""
    leaps, seen = np.abs(np.diff(run.u, axis=0)), _as_steps(run, journey)
    for i in np.flatnonzero((leaps[seen] > 0.0).any(axis=0)).tolist() if seen.any() else []:
        row = 1 + int(np.argmax(np.where(seen, leaps[:, i], 0.0)))
        before, after = run.u[row - 1], run.u[row]
        t = float(run.t[row])
        state = run.track.state(t)[0] if run.track.stretches else journey.origin.state
        force = model.loads(state, after) - model.loads(state, before)
        yield _Shock.of(model, state, after, force, f"t = {t:.3g} s")


def _as_steps(run: Run, journey: Journey) -> np.ndarray:
    """Between which rows inputs change as steps see it: one after the other, or those with a jump between them."""
    feed, t = journey.plan.feed, run.t
    if feed.controller is None or len(t) < 2:
        return np.zeros(max(len(t) - 1, 0), dtype=bool)
    if journey.rows.every is None or feed.sample_time > 0.5 * journey.rows.every:
        return np.ones(len(t) - 1, dtype=bool)
    found = np.zeros(len(t) - 1, dtype=bool)
    breaks = np.array([b for b in (*feed.breaks, *feed.met) if t[0] < b <= t[-1]])
    found[np.searchsorted(t, breaks * (1.0 - 1e-9), side="left") - 1] = True
    return found


@dataclass(frozen=True)
class _Shock:
    """Forces put on at once: accelerations by them and squares of own frequencies, (n,) each, 0 of what has no mass."""

    model: Model
    state: State
    rates: np.ndarray
    square: np.ndarray
    since: str

    @classmethod
    def of(cls, model: Model, state: State, u: np.ndarray, force: np.ndarray, since: str) -> _Shock:
        still, rates, square = np.zeros((3, model.n))
        mass, stiffness = (-model.slope(state, state.v, still, seeds, u).tocsr() for seeds in _SEEDS)
        heavy = np.flatnonzero(mass.diagonal() > model.dust)
        square[heavy] = np.maximum(stiffness.diagonal()[heavy] / mass.diagonal()[heavy], 0.0)
        with suppress(SingularMatrixError):
            rates[heavy] = factorise(mass[heavy][:, heavy])(force[heavy])
        return cls(model, state, rates, square, since)

    def swing(self, output: Tension | DriveSpeed) -> tuple[float, float]:
        """By how much an output rings, and how fast [rad/s]."""
        return self.tension(output) if isinstance(output, Tension) else self.speed(output)

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
