"""What sets lines and motors vibrating: forces out of balance at the start, and inputs that jump."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.sparse as sp

from flexctrl.dynamics.run import Run
from flexctrl.dynamics.swift.lengths import lengthening
from flexctrl.errors import ControllerError, SingularMatrixError
from flexctrl.frozen import frozen
from flexctrl.model.model import Model
from flexctrl.model.solve import factorise
from flexctrl.model.state import State
from flexctrl.structure.drives import Winch
from flexctrl.structure.outputs import AngularVelocity, DriveSpeed, Tension, Velocity

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["Fast", "Shock", "Swing", "shocks"]

_SEEDS = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)
_MOST, _BESIDE = 16, 1e-9
"""Breaks of a law that are looked at, and how far on either side, in parts of the run."""

Fast = Tension | DriveSpeed | Velocity | AngularVelocity


class Swing(NamedTuple):
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


_NONE = Swing(0.0, 0.0, 0.0)


@frozen(eq=False)
class Shock:
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
    def of(cls, model: Model, state: State, u: np.ndarray, force: np.ndarray, moves: np.ndarray, since: str) -> Shock:
        still, rates = np.zeros((2, model.n))
        M, C, K = (sp.csr_matrix(-model.slope(state, state.v, still, seeds, u)) for seeds in _SEEDS)
        heavy = np.flatnonzero(M.diagonal() > model.dust)
        with suppress(SingularMatrixError):
            rates[heavy] = factorise(M[heavy][:, heavy])(force[heavy])
        return cls(model, state, moves, rates, np.where(M.diagonal() > model.dust, M.diagonal(), np.inf), C, K, since)

    def swing(self, output: Fast) -> Swing:
        """What becomes of an output: the most that one line or motor makes of it."""
        by_place, by_rate = (part[self.model.outputs.index(output.name)].toarray().ravel() for part in self._sights)
        found = [_NONE]
        for part in self._vibrations:
            if isinstance(output, Velocity | AngularVelocity) or part.part == _source(output):
                size = np.hypot(by_place @ part.rates / part.frequency, by_rate @ part.rates)
                found.append(Swing(float(size), part.frequency, part.decay))
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


def _source(output: Fast) -> str:
    """The line or the drive that an output is of."""
    return output.line if isinstance(output, Tension) else output.drive if isinstance(output, DriveSpeed) else ""


def shocks(run: Run, journey: Journey, model: Model) -> Iterator[Shock]:
    """Return what sets a machine vibrating: what is out of balance where it begins, and the largest jump of each input.

    Parameters
    ----------
    run : Run
    journey : Journey
        How it went.
    model : Model

    Returns
    -------
    iterator of Shock
    """
    state, u = journey.origin.state, journey.origin.u
    force = model.balance(state, state.v, np.zeros(model.n)) + model.loads(state, u)
    yield Shock.of(model, state, u, force, state.v, "the start")
    largest: dict[int, _Jump] = {}
    for jump in _jumps(run, journey):
        for i, leap in enumerate(np.abs(jump.after - jump.before).tolist()):
            if leap > (largest[i].size(i) if i in largest else 0.0):
                largest[i] = jump
    for jump in {id(found): found for found in largest.values()}.values():
        force = model.loads(jump.state, jump.after) - model.loads(jump.state, jump.before)
        yield Shock.of(model, jump.state, jump.after, force, np.zeros(model.n), f"t = {jump.state.t:.3g} s")


class _Jump(NamedTuple):
    """Inputs before and after, in a state."""

    state: State
    before: np.ndarray
    after: np.ndarray

    def size(self, i: int) -> float:
        return float(abs(self.after[i] - self.before[i]))


def _jumps(run: Run, journey: Journey) -> Iterator[_Jump]:
    """Where inputs jump: at breaks of a continuous law, as far as they are known, and at samples where rows tell."""
    feed, track, t, every = journey.plan.feed, run.track, run.t, journey.rows.every
    if feed.controller is None or not track.stretches:
        return
    if feed.continuous:
        beside = _BESIDE * journey.point.state.t
        inner = [b for b in (*feed.breaks, *feed.met) if track.starts[0] + beside < b < journey.point.state.t - beside]
        with suppress(ControllerError, ArithmeticError, ValueError):  # beside where it was, a law may say nothing
            for b in sorted(set(inner))[:_MOST]:
                state, before = track.state(b - beside)
                yield _Jump(state.with_(t=b), before, track.state(b + beside)[1])
    elif len(t) > 1 and (every is None or feed.sample_time > 0.5 * every):
        leaps = np.abs(np.diff(run.u, axis=0))
        for row in np.unique(1 + np.argmax(leaps, axis=0)).tolist() if leaps.any() else []:
            yield _Jump(track.state(float(t[row]))[0], run.u[row - 1], run.u[row])
