"""What loads put on at once set ringing so fast that steps see little of it: lines and shafts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.sparse as sp

from flexctrl.dynamics.methods.extrapolation import Richardson
from flexctrl.dynamics.notes.fading import fading
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

_SEEN, _LITTLE, _STEADY, _RESOLVED = 1.0, 0.05, 0.01, 0.2
"""Radians in a step; what counts, of what an output goes through and of its largest; a step that sees all."""
_LAG = 0.3
"""Radians by which two runs part in phase from where on an extrapolation of them is larger than either."""
_FADED, _MORE, _AIM = 0.1, 3.0, 0.05
"""What is noted of what an output goes through, where that is more than three times what is told; and what is not."""
_SEEDS = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)
_SAID = (
    "{name} rings by up to {swing:.2g} from {since} on, by {turned:.2g} rad in a step, which sees little of that: "
    "its peaks may be missed; bring loads up more slowly, or take steps of {finer:.1g} s"
)
_PARTED = (
    "{name} rings by up to {swing:.2g} from {since} on, and the two runs that are extrapolated part by {lag:.2g} rad "
    "of that: its peaks may be too large; bring loads up more slowly, or take steps of {finer:.1g} s"
)
_FADING = (
    "{name} rings by up to {swing:.2g} from {since} on, of which steps of {step:.2g} s damp {lost:.0%} away and have "
    "the rest lag by {lag:.2g} rad at the end: take steps of {finer:.1g} s if that counts"
)


def ringing(run: Run, journey: Journey) -> Run:
    """Return a run with notes on tensions and motor speeds that ring in ways that its steps do not resolve.

    What is out of balance at the start accelerates a line's ends, or a motor, by a: they swing about where forces
    balance by a/ω², and a motor's speed by a/ω. So do they where an input jumps, by what it adds to a. Where that is
    5 % of what the output gets to, and steps turn it by more than a radian on average, its peaks are a matter of
    chance, but for the first, which short first steps may see; where the two runs of `Richardson` part by a third of a
    radian in it, they are too large. What turns by less than a radian, steps may damp away or have lag, if nothing else
    ends it before. Where dry contacts may hold, this tells nothing.

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
    told = max(run.report.error, *run.report.output_errors.values(), 0.0)
    shocks += _jumps(run, journey, model)
    for output in asked:
        found, shock = max(((shock.swing(output), shock) for shock in shocks), key=lambda found: found[0].size)
        values = run[output.name]
        way, most = float(np.ptp(values)), float(np.abs(values).max())
        if found.size > max(_LITTLE * way, _STEADY * most):
            yield from _note(journey, found, shock, _Rows(output.name, step, way, told))


class _Rows(NamedTuple):
    """An output: its name, the mean step [s], what it goes through, and the largest share that is told of others."""

    name: str
    step: float
    way: float
    told: float


def _note(journey: Journey, found: _Swing, shock: _Shock, rows: _Rows) -> Iterator[str]:
    step, turned = rows.step, rows.step * found.frequency
    said = {"name": rows.name, "swing": found.size, "since": shock.since}
    left = journey.point.state.t - shock.state.t
    if turned > _SEEN:
        yield _SAID.format(**said, turned=turned, finer=_RESOLVED / found.frequency)
        return
    if isinstance(journey.plan.method, Richardson):
        lag = 0.75 * left * found.frequency * turned**2 / 12.0
        if lag > _LAG:
            yield _PARTED.format(**said, lag=lag, finer=step * np.sqrt(0.1 * _LAG / lag))
        return
    lasts = left if left * found.decay < 1.0 else 1.0 / found.decay
    faded, lag = fading(journey.plan.method, turned, found.frequency * lasts)
    off = min(-np.expm1(-faded) + lag, 1.0) * found.size
    if off > max(_FADED, _MORE * rows.told) * rows.way:
        finer = step * np.sqrt(_AIM / (faded + lag))
        yield _FADING.format(**said, step=step, lost=-np.expm1(-faded), lag=lag, finer=finer)


def _start(journey: Journey, model: Model) -> _Shock:
    """What is out of balance where the run begins."""
    state, u = journey.origin.state, journey.origin.u
    force = model.balance(state, state.v, np.zeros(model.n)) + model.loads(state, u)
    return _Shock.of(model, state, u, force, state.v, "the start")


def _jumps(run: Run, journey: Journey, model: Model) -> Iterator[_Shock]:
    """The largest jump of each input, or what it changes by from one row to the next as steps see no more of it."""
    leaps, seen = np.abs(np.diff(run.u, axis=0)), _as_steps(run, journey)
    for i in np.flatnonzero((leaps[seen] > 0.0).any(axis=0)).tolist() if seen.any() else []:
        row = 1 + int(np.argmax(np.where(seen, leaps[:, i], 0.0)))
        before, after = run.u[row - 1], run.u[row]
        t = float(run.t[row])
        state = run.track.state(t)[0] if run.track.stretches else journey.origin.state
        force = model.loads(state, after) - model.loads(state, before)
        yield _Shock.of(model, state, after, force, np.zeros(model.n), f"t = {t:.3g} s")


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


class _Swing(NamedTuple):
    """By how much an output rings, how fast [rad/s], and at what rate it rings out by itself [1/s]."""

    size: float
    frequency: float
    decay: float


_NONE = _Swing(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class _Shock:
    """Forces put on at once.

    Attributes
    ----------
    model : Model
    state : State
    moves, rates : numpy.ndarray, shape (n,)
        Rates that it begins with, and accelerations by them; 0 of what has no mass.
    mass, damping, stiffness : numpy.ndarray or scipy.sparse.csr_matrix
        Of each freedom, (n,), but damping, (n, n).
    since : str
        When, in words.
    """

    model: Model
    state: State
    moves: np.ndarray
    rates: np.ndarray
    mass: np.ndarray
    damping: sp.csr_matrix
    stiffness: np.ndarray
    since: str

    @classmethod
    def of(cls, model: Model, state: State, u: np.ndarray, force: np.ndarray, moves: np.ndarray, since: str) -> _Shock:
        still, rates = np.zeros((2, model.n))
        M, C, K = (sp.csr_matrix(-model.slope(state, state.v, still, seeds, u)) for seeds in _SEEDS)
        heavy = np.flatnonzero(M.diagonal() > model.dust)
        with suppress(SingularMatrixError):
            rates[heavy] = factorise(M[heavy][:, heavy])(force[heavy])
        mass = np.where(M.diagonal() > model.dust, M.diagonal(), np.inf)
        return cls(model, state, moves, rates, mass, C, np.maximum(K.diagonal(), 0.0), since)

    def swing(self, output: Tension | DriveSpeed) -> _Swing:
        """What becomes of an output; nothing of lines and shafts that do not give way."""
        return self._tension(output) if isinstance(output, Tension) else self._speed(output)

    def _tension(self, output: Tension) -> _Swing:
        """About where forces balance: by T̈/ω², and by Ṫ/ω."""
        model, frequency = self.model, frequency_of(self.model, output.line)
        if not frequency:
            return _NONE
        raw = np.zeros(model.motion.raw)
        sight = model.signals.sight(self.state, raw, raw.size) @ model.motion.jacobian(self.state)
        pull = sight[model.outputs.index(output.name)].toarray().ravel()
        size = np.hypot(pull @ self.rates / frequency**2, pull @ self.moves / frequency)
        return _Swing(float(size), frequency, self._decay(pull / self.mass))

    def _speed(self, output: DriveSpeed) -> _Swing:
        motion, drive = self.model.motion, [d.name for d in self.model.structure.drives].index(output.drive)
        own = int(motion.sources[drive])
        if motion.rigid[drive] or own >= self.model.n or not self.stiffness[own] / self.mass[own] > 0.0:
            return _NONE
        frequency = float(np.sqrt(self.stiffness[own] / self.mass[own]))
        along = np.zeros(self.model.n)
        along[own] = 1.0
        return _Swing(abs(float(self.rates[own])) / frequency, frequency, self._decay(along))

    def _decay(self, along: np.ndarray) -> float:
        """The rate at which a vibration along some freedoms rings out, masses beside the diagonal left out [1/s]."""
        heavy = np.isfinite(self.mass)
        moved = float(along[heavy] ** 2 @ self.mass[heavy])
        return max(0.5 * float(along @ (self.damping @ along)) / moved, 0.0) if moved > 0.0 else 0.0
