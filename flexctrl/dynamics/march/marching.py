"""From a model to a compiled march: its record, and points that come and go."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property, partial
from typing import Any, NamedTuple, TypeGuard

import numpy as np

from flexctrl.dynamics.alpha.point import AlphaPoint
from flexctrl.dynamics.feed import Feed, Supply
from flexctrl.dynamics.inputs import Inputs, Stepwise
from flexctrl.dynamics.march.calling import Loops
from flexctrl.dynamics.march.contacts import enter_contacts
from flexctrl.dynamics.march.law import Sampling
from flexctrl.dynamics.march.making import CAPACITY, Method
from flexctrl.dynamics.march.record import (
    CONTROLLED,
    DONE,
    FIXED,
    FRESH,
    JUMP,
    SAMPLED,
    SETTLE,
    START,
)
from flexctrl.dynamics.march.shelf import states_of, width_of
from flexctrl.dynamics.march.weaving import Weaver
from flexctrl.dynamics.records.books import Sums
from flexctrl.dynamics.records.frames import Later
from flexctrl.dynamics.scales import components, farthest
from flexctrl.dynamics.steps import Mark
from flexctrl.dynamics.swift.stiff_lines import told_by_differences
from flexctrl.errors import ControllerError
from flexctrl.kernels.kernel import Compiled
from flexctrl.kernels.native import Packed
from flexctrl.model.flat.flattening import can_be_flat
from flexctrl.model.model import Model
from flexctrl.model.plant import Plant
from flexctrl.model.state import State

__all__ = ["Marcher", "Pacing", "can_march"]


_SPARE, _HEAVY = 2, 8_000_000
"""Marches kept for other runs; numbers of a matrix with which one is not: there is to be room for what is told."""
_OTHERWISE = (
    "steps of a run do not come out when they are taken again, for what is between rows: asked again, the controller "
    "says other than before; keep nothing outside its state, or give it a sample time"
)


def can_march(model: Plant) -> TypeGuard[Model]:
    """Tell whether a model can be marched through time in compiled loops.

    Parameters
    ----------
    model : Plant

    Returns
    -------
    bool
    """
    flat = isinstance(model, Model) and isinstance(model.backend, Compiled) and can_be_flat(model)
    return flat and told_by_differences(model)


class Pacing(NamedTuple):
    """Steps of controlled error: the first and the largest, where to stop and what not to pass [s]; the tolerance."""

    size: float
    largest: float
    stop: float
    until: float
    relative: float
    absolute: float


class Marcher(Loops):
    """A model on a compiled march.

    Parameters
    ----------
    model : Model
        One that `can_march`.
    method : Method
    """

    def __init__(self, model: Model, method: Method) -> None:
        super().__init__(model, method)
        m = self.march
        self._h, self._wanted, self._jumping = (m.cell(name) for name in ("h", "wanted", "jumping"))
        self._inputs: Any = self.flattened.flat.u.data
        self.steps, self.clock = m.cell("done"), m.cell("t")
        self._heeded: tuple[Sampling, Packed] | None = None
        self._last: tuple[Sampling, Packed] | None = None
        self.width = 1 + len(model.outputs)
        self.rows = m.rows.reshape(-1, self.width)
        self.times: Any = m.rows.data[:: self.width]

    @classmethod
    def of(cls, model: Model, method: Method) -> Marcher:
        """Return a march that another run is done with, as good as new, or a new one."""
        idle = cls._idle(model)
        while idle:
            found = idle.pop()
            if found.method.coefficients == method.coefficients and found.method.least == method.least:
                return found
        return cls(model, method)

    @classmethod
    def _idle(cls, model: Model) -> list[Any]:
        """Marches of a model that no run uses; not more than a few, and taken by one run at a time."""
        return model.__dict__.setdefault(f"_idle_{cls.__name__}", [])

    def done(self) -> None:
        """Leave the march to another run."""
        self.forget()
        self._heeded = None
        if len(self._idle(self.model)) < _SPARE and len(self.march.entries) < _HEAVY:
            self._idle(self.model).append(self)

    @property
    def room(self) -> int:
        """How many steps can be taken in one call."""
        return self.march.shelf if self.march.keeping else CAPACITY

    @cached_property
    def readings(self) -> list[np.ndarray]:
        """The outputs after each step, row by row."""
        return list(self.rows[:, 1:])

    @cached_property
    def weaver(self) -> Weaver:
        """What finds rows between steps whose states have been kept."""
        return Weaver(self.model, self.march.states)

    @cached_property
    def _state_width(self) -> int:
        return width_of(self.flattened)

    def entered(self, point: AlphaPoint) -> Marcher:
        """Put a point at the start; return the march."""
        m, F = self.march, self.flattened
        F.enter(point.state)
        self.dry = point.state.dry
        enter_contacts(self.contacts, F, point.state)
        m.v[:], m.rate[:] = F.ordered(point.state.v), F.ordered(point.rate)
        m.algorithmic[:], m.trend[:] = F.ordered(point.algorithmic), F.ordered(point.trend)
        m.lean, m.came, m.phase, m.attempt, m.t = point.lean, point.came, FRESH, 0, point.state.t
        m.lagging = 0.0
        if (m.swift or m.whole) and not F.keeps_shape:
            m.swift = m.whole = 0
        self.supply(point.supply.u)
        self.open(point.state.q, np.zeros(self.model.n), False)
        return self

    def open(self, first: np.ndarray, moved: np.ndarray, losing: bool) -> None:
        """Open the books.

        Parameters
        ----------
        first, moved : numpy.ndarray, shape (n,)
            Where the degrees of freedom were at first, and how far they have been from there.
        losing : bool
            Whether power is dissipated.
        """
        m, F = self.march, self.flattened
        m.first[:], m.reach[:] = F.ordered(first), F.ordered(moved)
        way = farthest(self.model, moved)
        m.reached = float(way.max(initial=0.0))
        m.farthest[components(self.model)] = way
        m.losing, m.drawing, m.absurd, m.gained, m.lost, m.closing.open = int(losing), 0, 0, 0.0, 0.0, 0.0
        self._do(SETTLE)

    def go_on(self, sums: Sums) -> None:
        """Go on with books: what is summed up does not depend on where marches begin and end."""
        m, F = self.march, self.flattened
        m.drawing, m.absurd, m.entered = 1, int(sums.absurd), sums.entered
        m.gained, m.lost, m.unseen = sums.work, sums.lost, sums.unseen
        m.begun, m.moving, m.turnover, m.gap, m.made = sums.start, sums.moving, sums.turnover, sums.gap, sums.made
        m.ahead[:], m.path[:] = F.ordered(sums.ahead), F.ordered(sums.path)
        m.swept[:], m.bent[:] = F.ordered(sums.swept), F.ordered(sums.bent)
        m.closing.open = sums.closure
        if m.losing and self.model.motion.flows.size:  # which may be over within the step: their state does not tell
            m.power = sums.power

    def worst(self) -> int:
        """Return the degree of freedom with the largest correction in the last iteration."""
        return int(self.flattened.plan.order[self.march.worst])

    def supply(self, u: np.ndarray) -> None:
        """Set the inputs."""
        self.flattened.flat.u[:] = u

    def point(self, supply: Supply) -> AlphaPoint:
        """Return where the march stands."""
        m, F = self.march, self.flattened
        v, own = (m.left, m.own) if m.lagging else (m.v, m.algorithmic)
        state = F.state(v, m.t, self.dry)
        return AlphaPoint(state, F.own(m.rate), supply, F.own(own), F.own(m.trend), m.lean, m.came)

    def fixed(self, h: float, count: int) -> int:
        """Take up to ``count`` steps of one length; return how it ended."""
        self.march.taken = h
        return self.travel(h, count)[0]

    def travel(self, pacing: float | Pacing, count: int) -> tuple[int, int]:
        """Take up to ``count`` steps of one length or as paced; return how it ended, and how many there were."""
        m = self.march
        m.wanted, m.done, m.kept = count, 0, 0
        if isinstance(pacing, Pacing):
            m.size, m.largest, m.stop, m.until, m.relative, m.absolute = pacing
            status = self._through(CONTROLLED)
        else:
            m.h = pacing
            status = self._through(FIXED)
        return status, m.done

    def begin(self) -> None:
        """Begin rows and states of steps of one length anew; see `on`."""
        self.march.done = self.march.kept = 0
        self._task[0] = FIXED

    def on(self, h: float, wanted: int) -> int:
        """Go on with steps of one length until as many as wanted are done; return how it ended."""
        self._h[0], self._wanted[0] = h, wanted
        status = self._run()
        return status if status == DONE else self._answered(status, FIXED)

    def jumps(self, u: list[float]) -> None:
        """Let the inputs jump before the next step of one length."""
        for i, value in enumerate(u):
            self._inputs[i] = value
        self._jumping[0] = 1

    def heed(self, feed: Feed) -> tuple[Sampling, Packed]:
        """Take the feed's controller, which can be lowered, into the loops; return it, and its numbers there."""
        if self._heeded is None or self._heeded[0].feed is not feed:
            assert isinstance(self.model.backend, Compiled)
            if self._last is None or not self._last[0].serves(feed):
                sampling = Sampling(feed, self.model.backend, self.flattened.flat.u, CAPACITY)
                self._last = sampling, Packed(sampling.law)
            self._heeded = self._last
            self._heeded[0].serve(feed)
            self._heeded[1].reset()
            self.march.lend("law", self._heeded[1])
        return self._heeded

    def sampled(self, pacing: Pacing | None) -> int:
        """Go on from sample to sample of the law as it is set, by its steps or as paced; return how it ended."""
        m = self.march
        m.done, m.kept, m.wanted = 0, 0, 0
        if pacing is not None:
            m.size, m.largest, m.stop, m.until, m.relative, m.absolute = pacing
        return self._through(SAMPLED)

    def inputs(self, supply: Supply, t: float, count: int) -> Inputs:
        """Return the inputs over as many steps taken last, which set out under some supply at a time."""
        return Stepwise(np.tile(supply.u, (count + 1, 1)))

    def under(self, supply: Supply) -> Marcher:
        """Go on under inputs that are in force already; return the march."""
        return self

    def faults(self) -> list[BaseException]:
        """Return what was raised by who is asked from within the loops, once."""
        return []

    def supplied(self, supply: Supply) -> Supply:
        """Return the inputs where the march stands, having set out under others."""
        return supply

    def supplies(self, supply: Supply, count: int) -> list[Supply]:
        """Return the inputs after each of as many steps taken last."""
        return [supply] * count

    def resupply(self, before: Supply, supply: Supply, pacing: float | Pacing) -> None:
        """Let the inputs jump at the start of a leg, if they do."""
        if before.u.tolist() != supply.u.tolist():
            self.about_to(pacing.size if isinstance(pacing, Pacing) else pacing)
            self.jump(supply.u)

    def travelled(self, supply: Supply, pacing: float | Pacing, count: int) -> tuple[Later, list[Supply]]:
        """Take as many steps; return the states and the inputs after them."""
        found: list[Later] = []
        told: list[Supply] = []
        while len(told) < count:
            done = self.travel(pacing, min(self.room, count - len(told)))[1]
            if not done:
                raise next(iter(self.faults()), ControllerError(_OTHERWISE))
            found.append(self.states())
            told += self.supplies(supply, done)
            if isinstance(pacing, Pacing):
                pacing = pacing._replace(size=self.march.size)
        return Later.joined(found), told

    def keep(self, all_states: bool, due: float = math.inf, spacing: float = math.inf) -> None:
        """Keep the states after all steps, or only when they are due."""
        m = self.march
        m.keeping, m.due, m.spacing = int(all_states), due, spacing

    def watch(self, sides: np.ndarray, state: State) -> None:
        """End before steps that pass corners of laws of force, or in which contacts may switch.

        ``sides`` are those of the corners that a state is on.
        """
        m = self.march
        m.corners.arms[:] = self.model.kinks.met.sheaved(state).ravel()
        m.corners.sides[:] = sides
        m.watching, self.contacts.watched = int(sides.size > 0), int(self.contacts.count > 0)

    def follow(self, mark: Mark) -> None:
        """Take up how steps of controlled error go on beyond a corner, and how long the last step of one length was."""
        m = self.march
        m.size, m.follow, m.cap, m.led, m.taken = mark.size, mark.follow, mark.cap, mark.led, mark.taken

    def watch_no_more(self) -> None:
        """End steps wherever they do."""
        self.march.watching = self.contacts.watched = 0

    def books(self, sums: Sums) -> Sums:
        """Return the books, gone on from some sums."""
        m, F = self.march, self.flattened
        return replace(
            sums,
            work=m.gained,
            lost=m.lost,
            unseen=m.unseen,
            gap=m.gap,
            turnover=m.turnover,
            made=m.made,
            power=m.power if m.losing else sums.power,
            closure=m.closing.open,
            entered=m.entered,
            absurd=bool(m.absurd),
            moved=F.own(m.reach),
            ahead=F.own(m.ahead),
            swept=F.own(m.swept),
            bent=F.own(m.bent),
            path=F.own(m.path),
        )

    def about_to(self, h: float) -> None:
        """Tell about how long the steps are: over what time rates of first order change little, and parts are held."""
        if self.model.motion.flows.size or self.march.throws:
            self.march.h = h

    def jump(self, u: np.ndarray) -> int:
        """Let the inputs jump; return how it ended."""
        self.supply(u)
        return self._through(JUMP)

    def start(self, u: np.ndarray) -> int:
        """Find the accelerations that a run sets out with under some inputs; return how it ended."""
        self.supply(u)
        return self._through(START)

    def states(self) -> Later:
        """Return the states kept in the last call; they are made when one is looked at."""
        count, width = self.march.kept, self._state_width
        table = self.march.states[: count * width].reshape(count, width).copy()
        return Later(table, partial(states_of, self.flattened, dry=self.dry))
