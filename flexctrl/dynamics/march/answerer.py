"""Marches under a continuous law: what the loops are told of it, and what they tell."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from flexctrl.design.answers import Answering
from flexctrl.dynamics.alpha.point import AlphaPoint
from flexctrl.dynamics.feed import Feed, Supply
from flexctrl.dynamics.law_state import MANY
from flexctrl.dynamics.march.answer import Answer
from flexctrl.dynamics.march.answering import recite
from flexctrl.dynamics.march.calling import Remembered
from flexctrl.dynamics.march.making import CAPACITY, Method
from flexctrl.dynamics.march.marching import Marcher, Pacing, can_march
from flexctrl.dynamics.march.spoken import Spoken
from flexctrl.dynamics.march.stepper import MarchingStepper
from flexctrl.dynamics.swift.settling import weightless
from flexctrl.frozen import frozen
from flexctrl.kernels.kernel import Compiled
from flexctrl.kernels.native import Packed, Runs
from flexctrl.model.model import Model

__all__ = ["Answerer", "AnsweringStepper", "Follow", "can_answer"]

_ROWS = 512


def can_answer(feed: Feed) -> bool:
    """Tell whether a continuous controller can be asked by compiled loops.

    They have no rule for laws of force that switch within a step whose inputs change, nor for freedoms without mass.

    Parameters
    ----------
    feed : Feed

    Returns
    -------
    bool
    """
    model = feed.model
    if model.switches.names or model.motion.flows.size or weightless(model).size:
        return False
    return not feed.spoken or len(feed.beginning) < MANY


class Answerer(Marcher):
    """A model on a march under a continuous law."""

    answering = 1

    def __init__(self, model: Model, method: Method) -> None:
        super().__init__(model, method)
        self._known: tuple[Feed, Answer, Packed] | None = None

    def listening(self, feed: Feed) -> Answerer:
        """Take up a feed's controller; return the march."""
        assert isinstance(self.model.backend, Compiled)
        if self._known is None or not _serves(self._known[0], feed):
            self.source = feed.answering or Spoken(feed)
            law = _answer(feed, self.source, self.model.backend, self.flattened.flat)
            self._known = feed, law, Packed(law)
        self.law, self._numbers = self._known[1:]
        self._numbers.reset()
        self.law.base[:], self.law.trend[:] = feed.base, 0.0
        if isinstance(self.source, Spoken):  # it says what is under its commands, too
            self.law.base[self.law.writes] = 0.0
        self.law.inverse[:] = np.eye(self.law.commands).ravel()
        self.march.lend("answer", self._numbers)
        self.feed = feed
        return self

    @property
    def _state(self) -> np.ndarray:
        """The law's state and its rate at the start of the step."""
        law = self.law
        return law.work[law.outputs + law.states : law.outputs + 3 * law.states].reshape(2, -1)

    def entered(self, point: AlphaPoint) -> Answerer:
        """Put a point at the start; return the march."""
        super().entered(point)
        return self.under(point.supply)

    def under(self, supply: Supply) -> Answerer:
        """Go on with inputs, and with the law's state; return the march."""
        self._numbers.tries = 0
        self.law.last[:] = supply.u
        if self.law.states:
            self._state[:] = supply.x, supply.rate
            known = supply.trend.size > 0
            self._numbers.bent = int(known)
            self.law.bend[:] = supply.trend if known else 0.0
            self.law.reached[:] = supply.most if known else np.abs(supply.x)
        return self

    def faults(self) -> list[BaseException]:
        """Return Ctrl-C where the law was asked, once."""
        if not isinstance(self.source, Spoken):
            return []
        found = self.source.faults[:]
        self.source.faults.clear()
        return found

    def supplied(self, supply: Supply) -> Supply:
        """Return the inputs and the law's state where the march stands."""
        x, rate = self._state
        found = Supply(self.law.last.copy(), x.copy(), rate.copy())
        if not (self.law.states and self._numbers.bent):
            return found
        return replace(found, trend=self.law.bend.copy(), most=self.law.reached.copy())

    def supplies(self, supply: Supply, count: int) -> list[Supply]:
        """Return inputs and the law's state after each of as many steps taken last."""
        m, s = self.law.inputs, self.law.states
        return [Supply(row[:m], row[m : m + s], row[m + s :]) for row in self._told(count)]

    def inputs(self, supply: Supply, t: float, count: int) -> Follow:
        """Return the inputs over as many steps taken last, which set out under some supply at a time."""
        start = np.concatenate([supply.u, supply.x, supply.rate])
        times = np.concatenate([[t], self.march.rows[: count * self.width : self.width]])
        return Follow(self, times, np.vstack([start, self._told(count)]))

    def resupply(self, before: Supply, supply: Supply, pacing: float | Pacing) -> None:
        """Let the inputs jump at the start of a leg, if they do."""
        super().resupply(self.supplied(before), supply, pacing)
        self.under(supply)

    def travel(self, pacing: float | Pacing, count: int) -> tuple[int, int]:
        """Take steps, not beyond what depends on time in one way."""
        law, t = self.law, self.march.t
        for k, clock in enumerate(self.source.clocks):
            law.origins[k], row = clock.piece(t)
            law.powers[k * law.width : (k + 1) * law.width] = [0.0] * (law.width - len(row)) + list(row[::-1])
        return super().travel(pacing, count)

    def _told(self, count: int) -> np.ndarray:
        """Return inputs, state and rate of the law after each of so many steps."""
        width = self.law.inputs + 2 * self.law.states
        return self.law.told[: count * width].reshape(count, width).copy()

    def remembered(self) -> Remembered:
        """Return what another march needs to go on with the same bits."""
        found = super().remembered()
        return replace(found, numbers=(*found.numbers, *self.law.trend.tolist(), *self.law.inverse.tolist()))

    def recall(self, memory: Remembered) -> None:
        """Go on as the march whose memory this is."""
        m, n = self.law.inputs, self.law.inputs + self.law.inverse.size
        numbers = np.array(memory.numbers[-n:])
        super().recall(replace(memory, numbers=memory.numbers[:-n]))
        self.law.trend[:], self.law.inverse[:] = numbers[:m], numbers[m:]

    def said(self, times: np.ndarray, outputs: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return the inputs at instants, of what is measured there and the law's state.

        Parameters
        ----------
        times : numpy.ndarray, shape (n,)
        outputs : numpy.ndarray, shape (n, outputs)
        x : numpy.ndarray, shape (n, states)

        Returns
        -------
        numpy.ndarray, shape (n, inputs)
        """
        law = self.law
        clocks = [clock.along(times) for clock in self.source.clocks]
        table = np.column_stack([outputs, x, np.zeros((len(times), 2 * law.states)), *clocks])
        work, found = law.work.copy(), np.tile(law.base, (len(times), 1))
        run = self._numbers.bound(recite)
        for start in range(0, len(times), _ROWS):
            part = table[start : start + _ROWS]
            law.asked[: part.size], self._numbers.wanted = part.ravel(), len(part)
            run()
            said = law.answers[: len(part) * law.commands].reshape(len(part), -1)
            for k, i in enumerate(law.writes.tolist()):
                found[start : start + _ROWS, i] += said[:, k]
        law.work[:] = work
        if not np.isfinite(found).all():
            self._blame(times, outputs, x, found)
        return found

    def _blame(self, times: np.ndarray, outputs: np.ndarray, x: np.ndarray, found: np.ndarray) -> None:
        """Raise what the controller does where it says no numbers."""
        for k in np.flatnonzero(~np.isfinite(found).all(axis=1)).tolist():
            found[k] = self.feed.answer(float(times[k]), outputs[k, self.feed.reads], x[k])[0]


def _serves(known: Feed, feed: Feed) -> bool:
    """Tell whether what was made for one feed does for another: the same law on the same signals."""
    if feed.spoken:
        return known is feed  # of which it has the inputs under its commands, and the jumps it has met
    same = known.answering is feed.answering and known.model is feed.model
    return same and known.reads.tolist() == feed.reads.tolist() and known.writes == feed.writes


def _answer(feed: Feed, law: Answering | Spoken, backend: Compiled, flat: Any) -> Answer:
    n, m, s, c, k = len(feed.model.outputs), len(feed.model.inputs), law.states, len(law.clocks), law.commands
    wide, width = n + 3 * s + c, max((clock.width for clock in law.clocks), default=0)
    work, answer, slopes = np.zeros(wide), np.zeros(k + s), law.slopes.copy()
    step, slope = law.runs(work, answer, slopes) if isinstance(law, Spoken) else _kernels(feed, law, backend)
    last, trend, said = np.zeros((3, m))
    gap, before, change, felt, row = np.zeros((5, k))
    return Answer(
        outputs=n,
        inputs=m,
        states=s,
        clocks=c,
        commands=k,
        width=width,
        step=step,
        slope=slope,
        work=work,
        answer=answer,
        slopes=slopes,
        factors=np.zeros(s * s),
        order=np.zeros(s, dtype=int),
        off=np.zeros(s),
        writes=np.array(feed.writes, dtype=int),
        base=np.zeros(m),
        u=flat.u,
        last=last,
        trend=trend,
        said=said,
        inverse=np.zeros(k * k),
        gap=gap,
        before=before,
        change=change,
        felt=felt,
        row=row,
        way=np.zeros(flat.padded),
        powers=np.zeros(c * width),
        origins=np.zeros(c),
        told=np.zeros((m + 2 * s) * CAPACITY),
        asked=np.zeros(wide * _ROWS),
        answers=np.zeros(k * _ROWS),
        sides=np.zeros(2 * s),
        kept=np.zeros(s),
        bend=np.zeros(s),
        reached=np.zeros(s),
        spoken=int(isinstance(law, Spoken)),
        changing=law.places.size,
        reading=feed.reads.size,
    )


def _kernels(feed: Feed, law: Answering, backend: Compiled) -> tuple[Runs, Runs]:
    n, s = len(feed.model.outputs), law.states
    gather = np.concatenate([feed.reads, n + np.arange(s), n + 3 * s + np.arange(len(law.clocks))])[None]
    step = (backend.bind(law.kernel, gather, law.values[None], np.arange(law.kernel.n_out)[None]),)
    return step, () if law.slope is None else (backend.bind(law.slope, gather, law.values[None], law.places[None]),)


@frozen(eq=False)
class Follow:
    """The inputs on the way of some steps.

    Attributes
    ----------
    marcher : Answerer
    times : numpy.ndarray, shape (steps + 1,)
    supplies : numpy.ndarray, shape (steps + 1, inputs + 2 · states)
        At these times: inputs, state and rate of the law.
    """

    marcher: Answerer
    times: np.ndarray
    supplies: np.ndarray

    def at(self, steps: np.ndarray, ends: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Return the inputs of rows (time and outputs) within steps, or at the ends of these."""
        law = self.marcher.law
        found = self.supplies[steps + 1, : law.inputs]
        inner = ~ends
        if inner.any():
            t = rows[inner, 0]
            found[inner] = self.marcher.said(t, rows[inner, 1:], self._states(steps[inner], t))
        return found

    def _states(self, steps: np.ndarray, t: np.ndarray) -> np.ndarray:
        """The law's state within steps; as `Feed.between` does."""
        law, h = self.marcher.law, np.diff(self.times)[steps, None]
        s = (t - self.times[steps])[:, None] / h
        x, rate = (self.supplies[:, law.inputs + k * law.states :][:, : law.states] for k in (0, 1))
        first, last, change = h * rate[steps], h * rate[steps + 1], x[steps + 1] - x[steps]
        return x[steps] + s * (first + s * (3.0 * change - 2.0 * first - last + s * (first + last - 2.0 * change)))


@dataclass
class AnsweringStepper(MarchingStepper):
    """A stepper whose steps are marched under a continuous law."""

    @cached_property
    def marcher(self) -> Answerer:
        """The model on a march."""
        p = self.plain
        assert can_march(p.model)
        found = Answerer.of(p.model, Method(p.coefficients, p.tolerance, p.weight, p.turning))
        assert isinstance(found, Answerer)
        return found.listening(p.feed)

    def _supplied(self, point: AlphaPoint) -> Supply:
        return self.marcher.supplied(point.supply)

    def enter(self, point: AlphaPoint) -> None:
        """Put the march at a point, unless it is there."""
        super().enter(point)
        self.marcher.under(point.supply)
