"""Richardson extrapolation on the rotation group: a method run twice side by side, with steps h and h/2.

The difference δ of the two shapes is taken in the degrees of freedom, rotations by the logarithm of the relative
rotation; the extrapolated shape is the finer one moved on by δ/(2^p − 1). Both runs go on from their own states, so
the pair is as stable as the method itself. Steps are chosen as the coarser run alone would choose them.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, cast

import numpy as np
import scipy.sparse as sp

from flexctrl.dynamics.feed import Feed, Supply
from flexctrl.dynamics.march.stepper import plain_of
from flexctrl.dynamics.methods.local import Local
from flexctrl.dynamics.records.dense import Hermite
from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.steps import Counts, Integrator, Joining, Judging, Pace, Point, Stepper
from flexctrl.dynamics.swift.lengths import lengths_of, long_as, stiff_in
from flexctrl.dynamics.swift.settling import weightless
from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.mechanics.rotation import logarithm
from flexctrl.model.linkages.chart import LeaningRope
from flexctrl.model.linkages.charting import chart_of
from flexctrl.model.model import Model
from flexctrl.model.motion import DENSE_UP_TO
from flexctrl.model.plant import Plant
from flexctrl.model.solve import factorise
from flexctrl.model.state import State

__all__ = ["Richardson"]

_TIGHT = 1e-12
"""What Newton's method leaves open must not show in the difference of two runs: undamped, it adds up."""


@frozen
class Richardson:
    """A method of lower order run with steps h and h/2, and extrapolated.

    Two more orders for a method that is symmetric in time (`ConservingMidpoint`, ``GeneralizedAlpha(h, rho=1.0)``),
    one more for others, at three steps for one, taken one by one in Python (some 0.4 ms beside what they cost: below a
    hundred elements smaller steps of the method are faster). As damped and as stable as the method itself. Errors of
    both runs grow with time, so this is for runs in which the coarser one still follows the motion. Beyond a corner of
    a law of force both go on from where the finer one is. Steps of `AdaptiveAlpha` are those that it takes by itself: a
    tolerance is kept by the coarser run, and what is extrapolated is as much better as with fixed steps.

    Parameters
    ----------
    method : Integrator
        Of order 2: `GeneralizedAlpha`, `AdaptiveAlpha`, `ConservingMidpoint`; its step is the longer of the two.

    Raises
    ------
    StructureError
        For a method of another order.
    """

    method: Integrator

    def __post_init__(self) -> None:
        if not isinstance(self.method, Integrator) or self.method.order != 2:
            raise StructureError(f"Richardson: {self.method!r}; give a method of order 2, as GeneralizedAlpha(1e-3)")

    @property
    def order(self) -> int:
        return 4 if self.method.symmetric else 3

    @property
    def symmetric(self) -> bool:
        return False

    @property
    def damping(self) -> str:
        return self.method.damping

    @property
    def pace(self) -> Pace:
        return self.method.pace

    def stepper(self, model: Plant, feed: Feed, tolerance: Tolerance) -> _Stepper:
        tight = replace(tolerance, absolute=min(tolerance.absolute, _TIGHT))
        coarse, fine = (self.method.stepper(model, feed, tight) for _ in range(2))
        return _Stepper(model, feed, coarse, fine, 1.0 / 3.0)


@frozen
class _Point(Point):
    """A point with those of both runs."""

    coarse: Point
    fine: Point

    @property
    def firm(self) -> _Point:
        """The finer run: an extrapolation of what steps do not resolve, gone on from again and again, grows."""
        return replace(self, state=self.fine.state, rate=self.fine.rate, supply=self.fine.supply)


@dataclass
class _Stepper:
    """Two steppers side by side."""

    model: Plant
    feed: Feed
    coarse: Stepper[Any]
    fine: Stepper[Any]
    weight: float
    counts: Counts = field(default_factory=Counts)

    def __post_init__(self) -> None:
        self.between = Difference(self.model)
        self.local = _Apart(self.model)
        self.seen = _Seen(self.model)
        self.parted = np.zeros(self.model.n)

    def curve(self, before: Point, after: Point) -> _Course:
        """Return the motion over a step."""
        return _Course(self.local, before.state, after.state)

    @property
    def memory(self) -> tuple[Any, Any]:
        return self.coarse.memory, self.fine.memory

    @memory.setter
    def memory(self, memory: tuple[Any, Any]) -> None:
        self.recall(memory)

    def recall(self, memory: tuple[Any, Any]) -> None:
        """Go on as the steppers whose memories these are."""
        self.coarse.recall(memory[0])
        self.fine.recall(memory[1])

    def start(self, state: State, supply: Supply, step: float) -> _Point:
        """Return the point of a state, both runs together."""
        coarse, fine = self.coarse.start(state, supply, step), self.fine.start(state, supply, 0.5 * step)
        return _Point(fine.state, fine.rate, fine.supply, coarse, fine)

    def renew(self, point: _Point, supply: Supply, step: float) -> _Point:
        """Return the point under other inputs; the runs stay apart."""
        coarse, fine = (self._switched(run, point.state) for run in (point.coarse, point.fine))
        coarse = self.coarse.renew(coarse, self._own(coarse, supply), step)
        fine = self.fine.renew(fine, self._own(fine, supply), 0.5 * step)
        rate = fine.rate + self.weight * (fine.rate - coarse.rate)
        point = replace(point, rate=rate, supply=supply, coarse=coarse, fine=fine)
        if not (weightless(self.model).size or self.model.motion.flows.size):
            return point  # no place and no rate has jumped
        state = self.moved_on(coarse.state, fine.state)
        return replace(point, state=state, supply=self._supply(supply, state, coarse, fine))

    def fed(self, point: _Point, supply: Supply) -> _Point:
        """Return the point with other states or rates of its law: what either run goes on from, at corners, too."""
        coarse, fine = (replace(run, supply=self._own(run, supply)) for run in (point.coarse, point.fine))
        return replace(point, supply=supply, coarse=coarse, fine=fine)

    def join(self, point: _Point, supply: Supply, step: float) -> _Point:
        """Return the point with both runs in its state: apart, they would meet a corner of a law of force apart."""
        coarse = _joined(self.coarse, replace(point.coarse, state=point.state), supply, step)
        fine = _joined(self.fine, replace(point.fine, state=point.state), supply, 0.5 * step)
        return replace(point, rate=fine.rate, supply=supply, coarse=coarse, fine=fine)

    def lengthen(self, point: _Point, step: float) -> _Point:
        """Return the point before a step many times longer than the last."""
        coarse, fine = _longer(self.coarse, point.coarse, step), _longer(self.fine, point.fine, 0.5 * step)
        rate = fine.rate + self.weight * (fine.rate - coarse.rate)
        return replace(point, rate=rate, coarse=coarse, fine=fine)

    def _own(self, run: Point, supply: Supply) -> Supply:
        """What a run is supplied with: the states of a continuous law are integrated, by each run its own."""
        return replace(supply, x=run.supply.x) if self.feed.continuous else supply

    def _switched(self, run: Any, state: State) -> Any:
        """A run whose dry contacts stick or slide as those of a state do."""
        return replace(run, state=self.model.switches.like(run.state, state))

    def step(self, point: _Point, h: float) -> _Point:
        """Return the point a step later."""
        before = self._spent()
        coarse = self.coarse.step(point.coarse, h)
        fine = self.fine.step(self.fine.step(point.fine, 0.5 * h), 0.5 * h)
        spent = self._spent()
        self.counts.newton += spent[0] - before[0]
        self.counts.factorisations += spent[1] - before[1]
        self.counts.worst = self.fine.counts.worst
        state = self._as_long(self.moved_on(coarse.state, fine.state), coarse.state, fine.state, h)
        rate = fine.rate + self.weight * (fine.rate - coarse.rate)
        return _Point(state, rate, self._supply(point.supply, state, coarse, fine), coarse, fine)

    def _spent(self) -> tuple[int, int]:
        a, b = self.coarse.counts, self.fine.counts
        return a.newton + b.newton, a.factorisations + b.factorisations

    def moved_on(self, coarse: State, fine: State) -> State:
        """Return the extrapolated state."""
        gap = self.between(coarse, fine)
        v = fine.v + self.weight * (fine.v - self.seen(coarse, fine))
        return self.model.advance(fine, self.weight * gap, v, fine.t)

    def _as_long(self, state: State, coarse: State, fine: State, h: float) -> State:
        """An extrapolated state with the lengths of lines extrapolated: places leave a rope's circle by δ²."""
        model = self.model
        stiff = stiff_in(model, h)
        if not (stiff.size and isinstance(model, Model)):
            return state
        longer, own = (lengths_of(model, run) for run in (coarse, fine))
        for _ in range(_MEASURED):
            state = long_as(model, state, own + self.weight * (own - longer), stiff)
        return state

    def _supply(self, held: Supply, state: State, coarse: Point, fine: Point) -> Supply:
        if not self.feed.continuous:
            return held
        within = self.feed.within(state, fine.supply.x + self.weight * (fine.supply.x - coarse.supply.x))
        return replace(within, u=fine.supply.u, slid=True) if fine.supply.slid else within

    def error(self, before: _Point, after: _Point, h: float, moved: np.ndarray, tolerance: Tolerance) -> float:
        """Return the error that the step added to the coarser run, over what is allowed.

        By how the two runs part over a step nothing is to be told: what they differ by already goes on by itself,
        and no shorter step makes it less.
        """
        return self.coarse.error(before.coarse, after.coarse, h, moved, tolerance)

    def missed(self, before: _Point, after: _Point) -> np.ndarray:
        """Return the local error of the coarser run; look how far the two are apart."""
        self.parted = np.maximum(self.parted, np.abs(self.between(after.coarse.state, after.fine.state)))
        return cast("Judging[Any]", plain_of(self.coarse)).missed(before.coarse, after.coarse)

    def remains(self, share: np.ndarray) -> np.ndarray:
        """Return what a run is off by: of second order in the lag of the coarser one."""
        return np.asarray(0.5 * share * share)


def _joined(stepper: Stepper[Any], run: Any, supply: Supply, step: float) -> Any:
    """Start a run anew, as the method by itself does beyond a corner."""
    plain = plain_of(stepper)
    return plain.join(run, supply, step) if isinstance(plain, Joining) else plain.start(run.state, supply, step)


def _longer(stepper: Stepper[Any], run: Any, step: float) -> Any:
    plain = plain_of(stepper)
    return plain.lengthen(run, step) if isinstance(plain, Joining) else run


@frozen(eq=False)
class Difference:
    """How two neighbouring shapes differ, in the degrees of freedom; right to first order in the difference.

    Attributes
    ----------
    model : Plant
    """

    model: Plant

    def __call__(self, one: State, other: State) -> np.ndarray:
        """Return the step from one state to the other, shape (n,)."""
        if not (isinstance(self.model, Model) and self.model.large):
            return other.q - one.q
        motion = self.model.motion
        turned = logarithm(other.R @ np.swapaxes(one.R, 1, 2))
        own = np.append(other.q - one.q, 0.0)
        driven = np.where(motion.rigid, motion.ratios * (other.driven - one.driven), own[motion.sources])
        raw = np.concatenate([np.hstack([other.x - one.x, turned]).ravel(), driven, own[motion.inner]])
        if motion.plain:
            return motion.collect(other, raw) / motion.collect(other, np.ones(motion.raw))
        T = motion.dense_jacobian(other) if self.model.n <= DENSE_UP_TO else motion.jacobian(other)
        return factorise(sp.csr_matrix(T.T @ T))(T.T @ raw)


_MEASURED = 2
"""Each time the coordinates of the end are measured, what they are off by is less by the angle turned."""


@frozen(eq=False)
class _Seen:
    """Rates of one shape in the axes of a neighbouring one, where these depend on the steps that led there.

    The axes of a rigid rope twist about it as it sways: those of the two runs part by O(h²), and rates across it too.
    """

    model: Plant

    def __call__(self, one: State, other: State) -> np.ndarray:
        v = one.v
        for line in self._lines:
            main = other.R[line.node] @ line.axes[:, line.main]
            twist = float(main @ logarithm((other.R[line.node] @ one.R[line.node].T)[None])[0])
            v = line.twisted(v, -twist)
        return v

    @cached_property
    def _lines(self) -> tuple[LeaningRope, ...]:
        return chart_of(self.model, self.model.rest).lines if isinstance(self.model, Model) and self.model.large else ()


class _Apart(Local):
    """Coordinates from one extrapolated shape to the next, which no single step leads to: the sums of steps, put right.

    Where a machine turns, steps of both runs and the extrapolation do not commute: sums are off by O(h³).
    """

    def between(self, start: State, end: State) -> np.ndarray:
        xi = super().between(start, end)
        if self._chart is not None:
            for _ in range(_MEASURED):
                xi[: self.model.n] += self._gap(self.place(start, xi, end.v, end.t), end)
        return xi

    @cached_property
    def _gap(self) -> Difference:
        return Difference(self.model)


class _Course(Hermite):
    """`Hermite`, with what rates have beside those of the coordinates as it is there, not as it grows in the mean.

    What that is off by, O(h³), has one sign all along a step: in the energy books it would add up.
    """

    def at(self, t: float) -> State:
        place, rate, turning = self.course(t)
        state = self.local.place(self.start, place, rate[: len(turning)] + turning, t)
        return state.with_(v=state.v + (rate - self.local.rates(self.start, place, state)[0])[: len(state.v)])
