"""What loads put on at once set ringing so fast that steps see little of it: lines and shafts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.sparse as sp

from flexctrl.dynamics.methods.extrapolation import Richardson
from flexctrl.dynamics.notes.fading import fading
from flexctrl.dynamics.run import Run
from flexctrl.dynamics.swift.stiff_lines import lengthening
from flexctrl.errors import SingularMatrixError
from flexctrl.model.model import Model
from flexctrl.model.solve import factorise
from flexctrl.model.state import State
from flexctrl.structure.drives import Winch
from flexctrl.structure.outputs import AngularVelocity, DriveSpeed, Tension, Velocity

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


_Fast = Tension | DriveSpeed | Velocity | AngularVelocity


def ringing(run: Run, journey: Journey) -> Run:
    """Return a run with notes on tensions and rates that ring in ways that its steps do not resolve.

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
    asked = [o for o in model.structure.outputs if isinstance(o, _Fast)]
    asked = [o for o in asked if o.name not in run.report.output_errors]
    notes = tuple(_notes(run, journey, model, asked)) if asked else ()
    return replace(run, report=replace(run.report, notes=(*run.report.notes, *notes))) if notes else run


def _notes(run: Run, journey: Journey, model: Model, asked: list[_Fast]) -> Iterator[str]:
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


class _Vibration(NamedTuple):
    """A line or a motor that swings as if all else let go.

    Attributes
    ----------
    part : str
        Its name.
    rates : numpy.ndarray, shape (n,)
        Amplitudes of the rates of degrees of freedom.
    frequency, decay : float
        [rad/s, 1/s]
    """

    part: str
    rates: np.ndarray
    frequency: float
    decay: float


_NONE = _Swing(0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class _Shock:
    """Forces put on at once.

    Attributes
    ----------
    model : Model
    state : State
    moves, rates : numpy.ndarray, shape (n,)
        Rates that it begins with, and accelerations by them; 0 of what has no mass.
    mass, damping, stiffness : numpy.ndarray, shape (n,), or scipy.sparse.csr_matrix, shape (n, n)
    since : str
        When, in words.
    """

    model: Model
    state: State
    moves: np.ndarray
    rates: np.ndarray
    mass: np.ndarray
    damping: sp.csr_matrix
    stiffness: sp.csr_matrix
    since: str

    @classmethod
    def of(cls, model: Model, state: State, u: np.ndarray, force: np.ndarray, moves: np.ndarray, since: str) -> _Shock:
        still, rates = np.zeros((2, model.n))
        M, C, K = (sp.csr_matrix(-model.slope(state, state.v, still, seeds, u)) for seeds in _SEEDS)
        heavy = np.flatnonzero(M.diagonal() > model.dust)
        with suppress(SingularMatrixError):
            rates[heavy] = factorise(M[heavy][:, heavy])(force[heavy])
        return cls(model, state, moves, rates, np.where(M.diagonal() > model.dust, M.diagonal(), np.inf), C, K, since)

    def swing(self, output: _Fast) -> _Swing:
        """What becomes of an output: the most that one line or motor makes of it."""
        by_place, by_rate = (part[self.model.outputs.index(output.name)].toarray().ravel() for part in self._sights)
        found = [_NONE]
        for part in self._vibrations:
            if isinstance(output, Velocity | AngularVelocity) or part.part == _source(output):
                size = np.hypot(by_place @ part.rates / part.frequency, by_rate @ part.rates)
                found.append(_Swing(float(size), part.frequency, part.decay))
        return max(found)

    @cached_property
    def _sights(self) -> tuple[sp.csr_matrix, sp.csr_matrix]:
        """How outputs change with places and with rates, (outputs, n) each; tensions are told without damping."""
        model, state = self.model, self.state
        raw = model.motion.raw
        on_rate = model.signals.slopes(state, model.rates(state), raw)[1]
        T, pulls = model.motion.jacobian(state)[:raw], model.signals.sight(state, np.zeros(raw), raw)
        tense = sp.diags([float(isinstance(o, Tension)) for o in model.structure.outputs])
        calm = sp.diags([float(not isinstance(o, Tension)) for o in model.structure.outputs])
        return sp.csr_matrix(tense @ pulls @ T), sp.csr_matrix(calm @ on_rate @ T)

    @cached_property
    def _vibrations(self) -> tuple[_Vibration, ...]:
        return (*self._lines(), *self._motors())

    def _lines(self) -> Iterator[_Vibration]:
        """About where forces balance: they part by s̈/ω² and by ṡ/ω."""
        for name, arm, frequency in lengthening(self.model, self.state):
            along = arm / self.mass
            parted = float(arm @ along)
            if frequency and parted and along @ (self.stiffness @ along) > 0.0:  # it is taut
                speed = np.hypot(arm @ self.rates / frequency, arm @ self.moves)
                yield _Vibration(name, speed / parted * along, frequency, self._decay(along))

    def _motors(self) -> Iterator[_Vibration]:
        motion, square = self.model.motion, np.maximum(self.stiffness.diagonal(), 0.0) / self.mass
        for drive, rigid, own in zip(self.model.structure.drives, motion.rigid, motion.sources, strict=True):
            if rigid or isinstance(drive, Winch) or own >= self.model.n or not square[own]:
                continue
            along = np.zeros(self.model.n)
            along[own] = 1.0
            frequency = float(np.sqrt(square[own]))
            yield _Vibration(drive.name, abs(float(self.rates[own])) / frequency * along, frequency, self._decay(along))

    def _decay(self, along: np.ndarray) -> float:
        """The rate at which a vibration along some freedoms rings out, masses beside the diagonal left out [1/s]."""
        heavy = np.isfinite(self.mass)
        moved = float(along[heavy] ** 2 @ self.mass[heavy])
        return max(0.5 * float(along @ (self.damping @ along)) / moved, 0.0) if moved > 0.0 else 0.0


def _source(output: _Fast) -> str:
    """The line or the drive that an output is of."""
    return output.line if isinstance(output, Tension) else output.drive if isinstance(output, DriveSpeed) else ""
