"""What sets lines, motors and all that bends vibrating: forces out of balance at the start, and inputs that jump."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh

from flexctrl.dynamics.notes.contacts import Contacts
from flexctrl.dynamics.notes.heavy import without_light
from flexctrl.dynamics.notes.jumps import PART, PARTS, Train, input_jumps
from flexctrl.dynamics.notes.outputs import Fast
from flexctrl.dynamics.run import Run
from flexctrl.dynamics.scales import yardsticks
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

__all__ = ["Shock", "Swing", "shocks"]

_SEEDS = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)
_FEW = 200
"""Degrees of freedom of a machine whose modes are looked at."""
_ROUND_OFF, _LITTLE, _SLACK, _AHEAD = 1e-12, 1e-6, 0.1, 1e-6
_LOOKED_AT = 0.1, 0.3, 0.6, 0.9
_DIRECT = 10.0
"""How much larger than by itself a line rings with a mode that is looked at."""


class Swing(NamedTuple):
    """A line, a motor or a mode that swings by itself, and by how much an output rings with it.

    Attributes
    ----------
    size : float
    frequency : float
        [rad/s]
    rates : numpy.ndarray, shape (n,)
        Amplitudes of the rates of degrees of freedom.
    gain : float
        How far shocks that follow each other make it swing, over what the largest does.
    handed_on : bool
        Whether it is a line that other parts pull: runs beside know of it, unless no step sees it.
    """

    size: float
    frequency: float
    rates: np.ndarray
    gain: float = 1.0
    handed_on: bool = False


class _Vibration(NamedTuple):
    """A line, a motor or a mode that swings as if all else let go.

    Attributes
    ----------
    part : str
        The name of a line or a motor.
    rates : numpy.ndarray, shape (n,)
        Amplitudes of the rates of degrees of freedom.
    frequency : float
        [rad/s]
    gain : float
        How far shocks that follow each other make it swing, over what the largest does.
    """

    part: str
    rates: np.ndarray
    frequency: float
    gain: float = 1.0


@frozen(eq=False)
class Shock:
    """Forces put on at once.

    Attributes
    ----------
    feed : Feed
    contacts : Contacts
    moves, rates : numpy.ndarray, shape (n,)
        Rates that it begins with, and accelerations by them; 0 of what has no mass.
    mass : numpy.ndarray, shape (n,)
        Of each degree of freedom alone; infinite where there is none.
    inertia, damping, stiffness : scipy.sparse.csr_matrix, shape (n, n)
    since : str
        When, in words.
    train : Train
        Others like it, as samples bring them.
    """

    feed: Feed
    contacts: Contacts
    moves: np.ndarray
    rates: np.ndarray
    mass: np.ndarray
    inertia: sp.csr_matrix
    damping: sp.csr_matrix
    stiffness: sp.csr_matrix
    since: str
    train: Train

    @classmethod
    def of(cls, run: Run, journey: Journey, at: State, inputs: Sequence[np.ndarray], since: str, train: Train) -> Shock:
        """Return what inputs do to a machine, or what they do once they are others."""
        model, feed, u, jumps = cast(Model, journey.plan.model), journey.plan.feed, inputs[-1], len(inputs) > 1
        state = model.switches.under(at, u) if jumps else model.switches.begin(at, u)
        contacts = Contacts.of(model, state, _later(run, state.t))
        still, rates = np.zeros((2, model.n))
        M, C, K = (sp.csr_matrix(-model.slope(contacts.loose, state.v, still, seeds, u)) for seeds in _SEEDS)
        heavy = np.flatnonzero(M.diagonal() > model.dust)
        with suppress(SingularMatrixError):
            if model.switches.names:
                held = replace(contacts, state=at)
                rates = contacts.accelerations(u) - (held.accelerations(inputs[0]) if jumps else 0.0)
            else:
                before = -model.loads(state, inputs[0]) if jumps else model.balance(state, state.v, still)
                rates[heavy] = factorise(M[heavy][:, heavy])((before + model.loads(state, u))[heavy])
        mass = np.where(M.diagonal() > model.dust, M.diagonal(), np.inf)
        return cls(feed, contacts, still if jumps else state.v, rates, mass, M, C, K, since, train)

    @property
    def model(self) -> Model:
        return self.contacts.model

    @property
    def state(self) -> State:
        return self.contacts.state

    def swings(self, output: Fast) -> list[Swing]:
        """What becomes of an output: the most that one line or motor makes of it, and what modes make of it.

        These are looked at for speeds, and for lines that are not hit themselves.
        """
        by_place, by_rate = (part[self.model.outputs.index(output.name)].toarray().ravel() for part in self._sights)

        def seen(part: _Vibration) -> Swing:
            size = np.hypot(by_place @ part.rates / part.frequency, by_rate @ part.rates)
            return Swing(part.gain * float(size), part.frequency, part.rates, part.gain)

        speed = isinstance(output, Velocity | AngularVelocity)
        if speed and self._modes:  # a line by itself moves one end alone, which others may hold to its neighbours
            return [seen(part) for part in self._modes]
        alone = [seen(part) for part in self._vibrations if speed or part.part == _source(output)]
        most = sorted(alone, key=lambda swing: swing.size)[-1:]
        if isinstance(output, Tension):
            if self.moves.any():  # what goes round a corner pulls its line, and rings with nothing
                return most
            handed = [seen(part)._replace(handed_on=True) for part in self._modes]
            return [*most, *(swing for swing in handed if swing.size > _DIRECT * sum(each.size for each in most))]
        return most

    def unseen(self, least: float) -> np.ndarray:
        """Return by how much outputs swing with modes of more than a frequency [rad/s], all of them together."""
        model, state, raw = self.model, self.state, self.model.motion.raw
        on_place, on_rate = model.signals.slopes(state, model.rates(state), raw)
        T, found = model.motion.jacobian(state)[:raw], np.zeros(len(model.outputs))
        for mode in self._modes:
            if mode.frequency > least:
                moved = T @ mode.rates
                found += mode.gain * np.hypot(on_place @ moved / mode.frequency, on_rate @ moved)
        return found

    def decay(self, swing: Swing | _Vibration) -> float:
        """Return the rate at which damping, friction, a law in time have it ring out [1/s]; 0 where they drive it."""
        rates = swing.rates
        moved = float(rates @ (self.inertia @ rates))
        lost = 0.5 * float(rates @ (self.damping @ rates - self._answer(rates))) + self.contacts.rubbed(rates)
        return max(lost / moved, 0.0) if moved > 0.0 else 0.0

    def stands(self, swing: Swing, state: State, u: np.ndarray) -> bool:
        """Tell whether there is something to swing against in another state: a line that is not slack there."""
        stiffness = -self.model.slope(state, state.v, np.zeros(self.model.n), _SEEDS[-1], u)
        rates = swing.rates
        return bool(rates @ (stiffness @ rates) > _SLACK * (rates @ (self.stiffness @ rates)))

    def _answer(self, rates: np.ndarray) -> np.ndarray:
        """By how much the forces of a continuous law without states of its own change with rates; elsewhere nothing."""
        model, feed, state, still = self.model, self.feed, self.state, np.zeros(self.model.n)
        if feed.controller is None or not feed.continuous or (x := feed.controller.initial()).size:
            return still
        little = _LITTLE / max(float(np.abs(rates).max()), _LITTLE)
        with suppress(ControllerError, ArithmeticError, ValueError):
            before, after = (feed.evaluate(s, x).u for s in (state, state.with_(v=state.v + little * rates)))
            return (model.loads(state, after) - model.loads(state, before)) / little
        return still

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
        return self._followed([*self._lines(), *self._motors()])

    @cached_property
    def _modes(self) -> tuple[_Vibration, ...]:
        """Modes of the machine as it stands, with what the shock makes of each; none of a machine of many freedoms."""
        heavy, n = np.isfinite(self.mass), self.model.n
        if not (0 < np.count_nonzero(heavy) <= _FEW and (self.rates.any() or self.moves.any())):
            return ()
        M, K, none = self.inertia.toarray(), self.stiffness.toarray(), np.zeros((0, n))
        with suppress(np.linalg.LinAlgError, ValueError):
            own = without_light(M, np.zeros((n, n)), K, none.T, (none, none), heavy, 1.0)
            free = self.contacts.free(heavy)
            squares, shapes = eigh(*(0.5 * free.T @ (A + A.T) @ free for A in (own.K, own.M)))
            shapes = free @ shapes
            fast = np.flatnonzero(squares > _ROUND_OFF * squares[-1])
            return self._followed([self._mode(heavy, shapes[:, i], np.sqrt(squares[i])) for i in fast])
        return ()

    def _followed(self, parts: list[_Vibration]) -> tuple[_Vibration, ...]:
        """What swings, with what shocks that follow this one add to it."""
        if not (self.train.sizes and parts):
            return tuple(parts)
        decays = np.array([self.decay(part) for part in parts])
        gains = self.train.gains(np.array([part.frequency for part in parts]), decays)
        return tuple(part._replace(gain=gain) for part, gain in zip(parts, gains.tolist(), strict=True))

    def _mode(self, heavy: np.ndarray, shape: np.ndarray, frequency: float) -> _Vibration:
        share = self.inertia[heavy][:, heavy] @ shape
        speed = np.hypot(share @ self.rates[heavy] / frequency, share @ self.moves[heavy])
        along = np.zeros(self.model.n)
        along[heavy] = shape
        return _Vibration("", speed * along, float(frequency))

    def _lines(self) -> Iterator[_Vibration]:
        """About where forces balance: they part by s̈/ω² and by ṡ/ω."""
        soon = _AHEAD / max(float((np.abs(self.moves) / yardsticks(self.model)).max(initial=0.0)), 1.0)
        names, arms, frequencies = lengthening(self.model, self.state)
        _, ahead, _ = lengthening(
            self.model, self.model.advance(self.state, soon * self.moves, self.moves, self.state.t)
        )
        for i in self._of_interest(names, arms).tolist():
            name, frequency = names[i], float(frequencies[i])
            arm, later = (rows[[i]].toarray().ravel() for rows in (arms, ahead))
            free = arm / self.mass
            along = self.contacts.still(free)
            parted = float(arm @ along)
            least = _SLACK * frequency**2 * (along @ (self.inertia @ along))
            if frequency and parted > 0.0 and along @ (self.stiffness @ along) > least:  # it is taut
                frequency *= np.sqrt(parted / (arm @ free))
                parting = arm @ self.rates + (later - arm) @ self.moves / soon  # what passes by a line parts, too
                speed = np.hypot(parting / frequency, arm @ self.moves)
                yield _Vibration(name, speed / parted * along, frequency)

    def _of_interest(self, names: list[str], arms: sp.csr_matrix) -> np.ndarray:
        """Numbers of the lines that outputs tell of, as far as what moves with each is what they see."""
        told = [output.line for output in self.model.structure.outputs if isinstance(output, Tension)]
        by_place, by_rate = self._sights
        seen = np.diff((by_place + by_rate).tocsc().indptr) > 0
        touches = np.asarray(abs(arms) @ seen > 0.0) | bool(self.model.switches.names)  # what sticks hands it on
        return np.flatnonzero(touches | np.isin(names, told))

    def _motors(self) -> Iterator[_Vibration]:
        motion, square = self.model.motion, np.maximum(self.stiffness.diagonal(), 0.0) / self.mass
        for drive, rigid, own in zip(self.model.structure.drives, motion.rigid, motion.sources, strict=True):
            if rigid or isinstance(drive, Winch) or own >= self.model.n or not square[own]:
                continue
            along = np.zeros(self.model.n)
            along[own] = 1.0
            along, frequency = self.contacts.still(along), float(np.sqrt(square[own]))
            yield _Vibration(drive.name, abs(float(self.rates[own])) / frequency * along, frequency)


def _source(output: Fast) -> str:
    """The line or the drive that an output is of."""
    return output.line if isinstance(output, Tension) else output.drive if isinstance(output, DriveSpeed) else ""


def shocks(run: Run, journey: Journey) -> Iterator[Shock]:
    """Return what sets a machine vibrating: what is out of balance where it begins, and each input's largest jumps.

    At samples these are the largest of some parts of the run: what moves a cart hits no rope that hangs straight.

    Parameters
    ----------
    run : Run
    journey : Journey
        How it went.

    Returns
    -------
    iterator of Shock
    """
    yield Shock.of(run, journey, journey.origin.state, [journey.origin.u], "the start", Train())
    found = list(input_jumps(run, journey))
    for i in range(len(journey.plan.model.inputs)):  # one that is the largest of several inputs has a train for each
        jumps = sorted((jump for jump in found if jump.size(i)), key=lambda jump: -jump.size(i))[:PARTS]
        for k, jump in enumerate(jumps):
            if not k or (jump.apart and jump.size(i) >= PART * jumps[0].size(i)):
                since = f"t = {jump.state.t:.3g} s"
                yield Shock.of(run, journey, jump.state, [jump.before, jump.after], since, jump.train(i))


def _later(run: Run, since: float) -> Iterator[State]:
    """Return states of a run later than a time, as far as there is a track."""
    track, left = run.track, run.final.t - since
    if track.stretches and track.starts[0] <= since and left > 0.0:
        yield from (track.state(since + share * left)[0] for share in _LOOKED_AT)
