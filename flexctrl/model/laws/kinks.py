"""Where laws of force have a corner: a rope goes slack or taut, a gap closes or opens, a rail ends.

Steps end there, or the corner would cost accuracy however small the step: the values' signs tell the sides.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import scipy.sparse as sp

from flexctrl.effects.backlash import gaps_of
from flexctrl.frozen import frozen
from flexctrl.mechanics.pieces import SLIGHT
from flexctrl.model.laws.loose_kinds import loose_names
from flexctrl.model.laws.sheaves import closest
from flexctrl.model.state import State
from flexctrl.structure.drives import Winch
from flexctrl.structure.lines import Rope, Spring
from flexctrl.structure.nodes import Node
from flexctrl.structure.trolleys import Trolley

if TYPE_CHECKING:
    from flexctrl.model.model import Model

__all__ = ["MANY", "Kinks"]

MANY = 32
"""Ropes up to which steps end where one of them goes slack or taut."""

_ROUND_OFF = 1e-12
_DIGITS = 16.0 * float(np.finfo(float).eps)
_BESIDE = 0.05
_TINY = 1e-300
_Size = TypeVar("_Size", float, np.ndarray)


@frozen
class Turn:
    """A corner of a drive: where a sum of its driven coordinate and its source angle has a value.

    Attributes
    ----------
    drive : int
    on_driven, on_source : float
        Weights.
    at, dust : float
        The value, and what is zero but for round-off.
    end : str
        What to say if a run cannot go on beyond; empty if it can.
    jumps : bool
        Whether its force jumps there, as a damper's does.
    """

    drive: int
    on_driven: float
    on_source: float
    at: float
    dust: float
    end: str = ""
    jumps: bool = False


@frozen
class Line:
    """A line between two nodes with a corner at a length; what to say if a run cannot go on beyond it.

    Where it is the rope of a winch, that length grows with the motor's angle. ``jumps``: whether its force jumps there.
    """

    name: str
    start: Node
    end: Node
    length: float
    stop: str = ""
    jumps: bool = False
    drive: int = 0
    share: float = 0.0


@frozen
class RailEnd:
    """An end of a trolley's rail: where sign·s + offset, positive on the rail, is zero."""

    trolley: Trolley
    sign: float
    offset: float
    end: str


@frozen(eq=False)
class Kinks:
    """The corners of a model's laws of force: lengths of lines, those of winches last, turns of drives, ends of rails.

    Attributes
    ----------
    model : Model
    ropes : bool
        Whether ropes are among the lines.
    """

    model: Model
    ropes: bool = True

    @cached_property
    def met(self) -> Kinks:
        """Those that steps end at: all, but for ropes that many others are in a row with.

        Waves that run along a row of n pieces pass n corners on their way: located one by one, steps would be n² times
        as many, for what a piece has in it. Errors that passing them makes are the control of steps to see.
        """
        parts = self.model.structure.elements
        many = sum(isinstance(p, Rope) and self.model.bends(p) for p in parts) > MANY
        return replace(self, ropes=False) if many else self

    @cached_property
    def _lines(self) -> tuple[Line, ...]:
        """Ropes, springs with play, ropes of winches in small motion, and the ways from sheaves to what hangs there."""
        parts, gaps = self.model.structure.elements, gaps_of(self.model.effects)
        bent = [p for p in parts if isinstance(p, Rope) and self.model.bends(p)] if self.ropes else []
        ropes = [Line(p.name, p.start, p.end, p.length, jumps=p.damping > 0.0) for p in bent]
        loose = [p for p in parts if isinstance(p, Spring) and p.name in self._loose]
        sides = [(p, p.length + s * gaps[p.name]) for p in loose for s in (0.5, -0.5)]
        gapped = [Line(p.name, p.start, p.end, length, jumps=p.damping > 0.0) for p, length in sides]
        winches = [(i, d) for i, d in enumerate(self.model.structure.drives) if isinstance(d, Winch)]
        hoists = [self._hoist(i, d) for i, d in winches if self.model.bends(d) and not self.model.large]
        return (*ropes, *gapped, *hoists, *(Line(d.name, d.against, d.node, d.shortest, _down(d)) for _, d in winches))

    def _hoist(self, i: int, d: Winch) -> Line:
        """The rope of a winch in small motion: EA (d − ℓ)/ℓ, to first order in both, is zero at the corner."""
        rest = self.model.rest
        angle = float(rest.q[self.model.motion.sources[i]])
        out = d.length + angle / d.effective_ratio
        apart = rest.x[self._number(d.node)] - rest.x[self._number(d.against)]
        share = float(np.linalg.norm(apart)) / out / d.effective_ratio
        return Line(d.name, d.against, d.node, out - share * angle, "", d.damping > 0.0, i, share)

    @cached_property
    def _turns(self) -> tuple[Turn, ...]:
        """Corners of drives with play and of winches."""
        gaps, found = gaps_of(self.model.effects), []
        for i, d in enumerate(self.model.structure.drives):
            if d.name in self._loose:
                flanks = [side * gaps[d.name] for side in (0.5, -0.5)]
                found += [Turn(i, d.effective_ratio, -1.0, at, _ROUND_OFF, jumps=d.damping > 0.0) for at in flanks]
            elif isinstance(d, Winch) and self.model.bends(d):
                found += self._winch(i, d)
        return tuple(found)

    def _winch(self, i: int, d: Winch) -> list[Turn]:
        """Where a rope that stretches goes slack, and where there is hardly any left."""
        least, dust = d.shortest - d.length, _ROUND_OFF * d.length
        out, limp = (1.0 - SLIGHT) / d.effective_ratio, -SLIGHT * d.length  # just short of taut counts as taut
        slack = Turn(i, 1.0, -out, limp, self._digits(d.length), jumps=d.damping > 0.0)
        end = Turn(i, 0.0, 1.0 / d.effective_ratio, least, dust, _down(d))
        return [slack, end] if self.model.large else [end]

    @cached_property
    def _rails(self) -> tuple[RailEnd, ...]:
        """Both ends of every rail."""
        found = []
        for p in (p for p in self.model.structure.elements if isinstance(p, Trolley)):
            length = next(t.places[-1] for t in self.model.structure.tracks if t.node == self._number(p.node))
            found.append(RailEnd(p, 1.0, 0.0, f"{p.name} is at the start of its rail"))
            found.append(RailEnd(p, -1.0, length, f"{p.name} is at the end of its rail, {length:.6g} m from its start"))
        return tuple(found)

    def _number(self, node: Node) -> int:
        return self.model.structure.number(node)

    @cached_property
    def _loose(self) -> frozenset[str]:
        return loose_names(self.model.structure, self.model.effects)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The parts, in the order of `values`; one with play has two flanks."""
        drives = self.model.structure.drives
        turns = (drives[turn.drive].name for turn in self._turns)
        return (*(line.name for line in self._lines), *turns, *(end.trolley.name for end in self._rails))

    @cached_property
    def ends(self) -> tuple[str, ...]:
        """What to say where a run cannot go on beyond a corner; empty where it can."""
        return (
            *(line.stop for line in self._lines),
            *(turn.end for turn in self._turns),
            *(rail.end for rail in self._rails),
        )

    @cached_property
    def lines(self) -> tuple[np.ndarray, np.ndarray]:
        """Nodes at the ends of the lines, shape (lines, 2); the lengths at which they have corners [m]."""
        number = self.model.structure.number
        ends = [(number(line.start), number(line.end)) for line in self._lines]
        return np.array(ends, dtype=int).reshape(-1, 2), np.array([line.length for line in self._lines])

    @cached_property
    def wound(self) -> tuple[np.ndarray, np.ndarray]:
        """Of each line: the drive that pays it out, and by how much a radian of its motor moves the corner [m/rad]."""
        lines = self._lines
        return np.array([line.drive for line in lines], dtype=int), np.array([line.share for line in lines])

    @cached_property
    def ways(self) -> np.ndarray:
        """Directions at rest of the lines that small motion stretches by what is along them, (lines, 3); large: none.

        Their tension is as linear. The way to the sheave of a winch, which ends runs, is looked at as it is.
        """
        if self.model.large:
            return np.zeros((0, 3))
        first, last = self.lines[0][: len(self._lines) - self.sheaves].T
        arms = self.model.rest.x[last] - self.model.rest.x[first]
        return arms / np.maximum(np.linalg.norm(arms, axis=1), _TINY)[:, None]

    @cached_property
    def sheaves(self) -> int:
        """How many of the lines, the last ones, lead to the sheave of a winch."""
        return sum(1 for line in self._lines if line.stop)

    @cached_property
    def shafts(self) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of the drives; weights of driven coordinate and source angle and where their sum has a corner (3)."""
        rows = [(turn.on_driven, turn.on_source, turn.at) for turn in self._turns]
        return np.array([turn.drive for turn in self._turns], dtype=int), np.array(rows).reshape(-1, 3)

    @cached_property
    def rails(self) -> tuple[np.ndarray, np.ndarray]:
        """Nodes whose x is how far a trolley has travelled; sign and offset of an end of its rail (2)."""
        rows = [(rail.sign, rail.offset) for rail in self._rails]
        nodes = [self._number(rail.trolley.travel) for rail in self._rails]
        return np.array(nodes, dtype=int), np.array(rows).reshape(-1, 2)

    @cached_property
    def dust(self) -> np.ndarray:
        """Values below these are zero but for round-off: a stiff rope that is taut by more bears a load.

        One that is slack by more bears none: its law takes it for taut until it is short of that by `SLIGHT`.
        """
        longest = [_ROUND_OFF * track.places[-1] for track in self.model.structure.tracks for _ in range(2)]
        return np.concatenate([self._digits(self.lines[1]), [turn.dust for turn in self._turns], longest])

    @cached_property
    def jumps(self) -> np.ndarray:
        """Numbers of the corners where forces jump: a damper comes into play, or goes out of it, at speed."""
        found = [*(line.jumps for line in self._lines), *(turn.jumps for turn in self._turns)]
        return np.flatnonzero(found)

    def sides(self, state: State) -> np.ndarray:
        """Return on which side of those corners a state is: ±1, or 0 for on one but for round-off."""
        if not self.jumps.size:
            return np.zeros(0)
        values = self.values(state, state)[self.jumps]
        return np.where(np.abs(values) > self.dust[self.jumps], np.sign(values), 0.0)

    def _digits(self, length: _Size) -> _Size:
        """What is zero but for round-off of the stretch of lines."""
        return SLIGHT * length + _DIGITS * (length + self._reach)

    @cached_property
    def _reach(self) -> float:
        """How far from the origin places are [m]."""
        return float(np.abs(self.model.rest.x).max(initial=0.0))

    def values(self, state: State, before: State) -> np.ndarray:
        """Return what changes its sign at the corners: stretch of ropes, strains from flanks, rope or rail left.

        Parameters
        ----------
        state, before : State
            What has come through a sheave since ``before`` has less than no rope left.

        Returns
        -------
        numpy.ndarray, shape (corners,)
            [m], or [rad] of a motor.
        """
        motion, (ends, lengths), (drives, rows) = self.model.motion, self.lines, self.shafts
        arms, angles = state.x[ends[:, 1]] - state.x[ends[:, 0]], np.append(state.q, 0.0)[motion.sources]
        strains = self._through(self._distances(arms), arms, state, before) - lengths
        if self.wound[1].any():
            strains -= self.wound[1] * angles[self.wound[0]]
        own = angles[drives]
        turned = rows[:, 0] * state.driven[drives] + rows[:, 1] * own - rows[:, 2]
        travelling, ends = self.rails
        return np.concatenate([strains, turned, ends[:, 0] * state.x[travelling, 0] + ends[:, 1]])

    def _distances(self, arms: np.ndarray) -> np.ndarray:
        """How far the ends of lines are apart: in small motion, along their directions at rest."""
        found, ways = np.sqrt(np.einsum("ij,ij->i", arms, arms)), self.ways
        found[: len(ways)] = np.einsum("ij,ij->i", arms[: len(ways)], ways)
        return np.asarray(found)

    def sheaved(self, state: State) -> np.ndarray:
        """Return the arms from sheaves to what hangs on them, shape (sheaves, 3)."""
        ends = self.lines[0][len(self._lines) - self.sheaves :]
        return state.x[ends[:, 1]] - state.x[ends[:, 0]]

    def _through(self, distances: np.ndarray, arms: np.ndarray, state: State, before: State) -> np.ndarray:
        """Turn the sign of distances to sheaves where the way from before leads right through them.

        A rope that stretches and is slack lets what hangs on it pass beside the sheave, however near.
        """
        first = len(arms) - self.sheaves
        now, was = arms[first:], self.sheaved(before)
        away = np.flatnonzero(np.einsum("ij,ij->i", now, was) < 0.0)
        if not away.size:
            return distances
        leaving, arriving = ((state.t - before.t) * self._parting(s) for s in (before, state))
        signs = np.ones(len(now))
        for i in away.tolist():
            rigid = 0.0 if self._stretching[i] else min(np.linalg.norm(was[i]), distances[first + i])
            near = closest(was[i], leaving[i], now[i], arriving[i])
            signs[i] = -1.0 if near < _BESIDE * rigid + self.lines[1][first + i] else 1.0
        return np.append(distances[:first], signs * distances[first:])

    def _parting(self, state: State) -> np.ndarray:
        """Return the rates of the arms from sheaves to what hangs on them, shape (sheaves, 3) [m/s]."""
        count = len(self.model.structure.nodes)
        speeds = self.model.rates(state)[: 6 * count].reshape(count, 6)[:, :3]
        ends = self.lines[0][len(self._lines) - self.sheaves :]
        return np.asarray(speeds[ends[:, 1]] - speeds[ends[:, 0]])

    @cached_property
    def _stretching(self) -> tuple[bool, ...]:
        """Whether the rope of each winch stretches."""
        return tuple(self.model.bends(d) for d in self.model.structure.drives if isinstance(d, Winch))

    def standing(self, state: State, free: np.ndarray) -> tuple[str, ...]:
        """Say in words which parts stand exactly on a corner that a motion of the free coordinates would leave.

        Parameters
        ----------
        state : State
        free : numpy.ndarray
            Numbers of the coordinates that can move.

        Returns
        -------
        tuple of str
            Each part with what to do about it. Empty where all laws of force have a derivative.
        """
        on = np.flatnonzero(np.abs(self.values(state, state)) <= np.maximum(self.dust, self._near))
        moved = np.concatenate([self._leaving(state, free), np.ones(len(self._turns), dtype=bool), self._rolling(free)])
        return tuple(dict.fromkeys(self._words(i) for i in on.tolist() if moved[i]))

    @property
    def _near(self) -> np.ndarray:
        """Values below these are zero for all that an equilibrium tells."""
        return np.concatenate([_ROUND_OFF * self.lines[1], np.zeros(len(self._turns) + len(self._rails))])

    def _rolling(self, free: np.ndarray) -> np.ndarray:
        """Whether each trolley can travel with some coordinates."""
        return np.isin(self.model.motion.place[self.rails[0], 0], free)

    def _leaving(self, state: State, free: np.ndarray) -> np.ndarray:
        """Whether the length of each line changes with any of some coordinates."""
        ends = self.lines[0]
        if not len(ends):
            return np.zeros(0, dtype=bool)
        arms = state.x[ends[:, 1]] - state.x[ends[:, 0]]
        arms /= np.linalg.norm(arms, axis=1)[:, None]
        T = self.model.motion.jacobian(state)[:, free]
        places = (6 * ends[:, :, None] + np.arange(3)).reshape(len(ends), 6)
        rows = np.repeat(np.arange(len(ends)), 6)
        pulls = sp.csr_matrix((np.hstack([-arms, arms]).ravel(), (rows, places.ravel())), (len(ends), T.shape[0]))
        return np.asarray(abs(pulls @ T).max(axis=1).todense()).ravel() > _ROUND_OFF**0.5

    def _words(self, corner: int) -> str:
        """What to say of a part on its corner."""
        name = self.names[corner]
        if corner >= len(self.names) - len(self._rails):
            return self.ends[corner] + "; hold it there, or move it off the end"
        if self.ends[corner]:
            return self.ends[corner] + "; pay some out"
        if name in self._loose:
            return f"{name} stands exactly on a flank of its gap; load it, or move it off the flank"
        return (
            f"{name} is exactly at its natural length; prestress it, or hold it slack or taut (if it is taut, but so "
            "stiff that the last digits of places do not show by how much it is stretched: make it softer, or rigid)"
        )


def _down(d: Winch) -> str:
    """What to say where the rope of a winch ends."""
    return f"the rope of {d.name} is down to its shortest, {d.shortest:.6g} m"
