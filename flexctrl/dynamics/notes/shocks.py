"""What sets lines, motors and all that bends vibrating: forces out of balance at the start, and inputs that jump."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cached_property, partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh

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
    from flexctrl.dynamics.feed import Feed
    from flexctrl.dynamics.journey import Journey

__all__ = ["Fast", "Shock", "Swing", "shocks"]

_SEEDS = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)
_FEW = 200
"""Degrees of freedom of a machine whose modes are looked at."""
_ROUND_OFF, _LITTLE = 1e-12, 1e-6
_MOST, _BESIDE = 16, 1e-9
"""Breaks of a law that are looked at, and how far on either side, in parts of the run."""

Answer = Callable[[State, np.ndarray], np.ndarray]
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


class _At(NamedTuple):
    """A machine in a state under inputs, and its law."""

    model: Model
    state: State
    u: np.ndarray
    law: Answer


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
    mass : numpy.ndarray, shape (n,)
        Of each degree of freedom alone; infinite where there is none.
    inertia, damping, stiffness : scipy.sparse.csr_matrix, shape (n, n)
    law : Answer
        Force by which a continuous law answers rates.
    since : str
        When, in words.
    """

    model: Model
    state: State
    moves: np.ndarray
    rates: np.ndarray
    mass: np.ndarray
    inertia: sp.csr_matrix
    damping: sp.csr_matrix
    stiffness: sp.csr_matrix
    law: Answer
    since: str

    @classmethod
    def of(cls, at: _At, force: np.ndarray, moves: np.ndarray, since: str) -> Shock:
        (model, state, u), law = at[:3], at.law
        still, rates = np.zeros((2, model.n))
        M, C, K = (sp.csr_matrix(-model.slope(state, state.v, still, seeds, u)) for seeds in _SEEDS)
        heavy = np.flatnonzero(M.diagonal() > model.dust)
        with suppress(SingularMatrixError):
            rates[heavy] = factorise(M[heavy][:, heavy])(force[heavy])
        mass = np.where(M.diagonal() > model.dust, M.diagonal(), np.inf)
        return cls(model, state, moves, rates, mass, M, C, K, law, since)

    def swings(self, output: Fast) -> list[Swing]:
        """What becomes of an output: the most that one line or motor makes of it, and what modes make of a speed."""
        by_place, by_rate = (part[self.model.outputs.index(output.name)].toarray().ravel() for part in self._sights)

        def seen(part: _Vibration) -> Swing:
            size = np.hypot(by_place @ part.rates / part.frequency, by_rate @ part.rates)
            return Swing(float(size), part.frequency, part.decay)

        speed = isinstance(output, Velocity | AngularVelocity)
        alone = [seen(part) for part in self._vibrations if speed or part.part == _source(output)]
        return [max(alone, default=_NONE), *map(seen, self._modes if speed else ())]

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

    @cached_property
    def _modes(self) -> tuple[_Vibration, ...]:
        """Modes of the machine as it stands, with what the shock makes of each; none of a machine of many freedoms."""
        heavy = np.isfinite(self.mass)
        if not 0 < np.count_nonzero(heavy) <= _FEW:
            return ()
        M, K = self.inertia[heavy][:, heavy].toarray(), _condensed(self.stiffness.toarray(), heavy)
        with suppress(np.linalg.LinAlgError):
            squares, shapes = eigh(0.5 * (K + K.T), 0.5 * (M + M.T))
            fast = np.flatnonzero(squares > _ROUND_OFF * squares[-1])
            return tuple(self._mode(heavy, shapes[:, i], np.sqrt(squares[i])) for i in fast)
        return ()

    def _mode(self, heavy: np.ndarray, shape: np.ndarray, frequency: float) -> _Vibration:
        share = self.inertia[heavy][:, heavy] @ shape
        speed = np.hypot(share @ self.rates[heavy] / frequency, share @ self.moves[heavy])
        along = np.zeros(self.model.n)
        along[heavy] = shape
        return _Vibration("", speed * along, float(frequency), self._slowed(along))

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
        return self._slowed(along) / moved if moved > 0.0 else 0.0

    def _slowed(self, along: np.ndarray) -> float:
        """Half the power that damping and a continuous law take at some rates; 0 where they give any."""
        return max(0.5 * float(along @ (self.damping @ along - self.law(self.state, along))), 0.0)


def _condensed(K: np.ndarray, heavy: np.ndarray) -> np.ndarray:
    """Return a stiffness of what has mass, all else where it balances, shape (heavy, heavy)."""
    light = ~heavy
    if not light.any():
        return K
    follows = np.linalg.lstsq(K[np.ix_(light, light)], K[np.ix_(light, heavy)], rcond=None)[0]
    return np.asarray(K[np.ix_(heavy, heavy)] - K[np.ix_(heavy, light)] @ follows)


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
    law = partial(_answered, model, journey.plan.feed)
    yield Shock.of(_At(model, state, u, law), force, state.v, "the start")
    largest: dict[int, _Jump] = {}
    for jump in _jumps(run, journey):
        for i, leap in enumerate(np.abs(jump.after - jump.before).tolist()):
            if leap > (largest[i].size(i) if i in largest else 0.0):
                largest[i] = jump
    for jump in {id(found): found for found in largest.values()}.values():
        force = model.loads(jump.state, jump.after) - model.loads(jump.state, jump.before)
        at = _At(model, jump.state, jump.after, law)
        yield Shock.of(at, force, np.zeros(model.n), f"t = {jump.state.t:.3g} s")


def _answered(model: Model, feed: Feed, state: State, rates: np.ndarray) -> np.ndarray:
    """By how much the forces of a continuous law without states of its own change with rates; elsewhere nothing."""
    if feed.controller is None or not feed.continuous or (x := feed.controller.initial()).size:
        return np.zeros(model.n)
    little = _LITTLE / max(float(np.abs(rates).max()), _LITTLE)
    with suppress(ControllerError, ArithmeticError, ValueError):
        before, after = (feed.evaluate(s, x).u for s in (state, state.with_(v=state.v + little * rates)))
        return (model.loads(state, after) - model.loads(state, before)) / little
    return np.zeros(model.n)


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
