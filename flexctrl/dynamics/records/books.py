"""The energy books of a run: work in, dissipated, and what is stored."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from flexctrl.dynamics.feed import Feed
from flexctrl.dynamics.linear_motion.plant import LinearPlant
from flexctrl.dynamics.methods.local import Local
from flexctrl.dynamics.methods.midpoint import ConservingMidpoint
from flexctrl.dynamics.records.absurd import (
    ABSURD,
    ALIKE,
    FAR,
    LOOKED_AT,
    OFTEN,
    ROUND_OFF,
    VISIBLE,
    absurd,
    borne_out,
    looking,
    missed,
    unlooked,
)
from flexctrl.dynamics.records.dense import Booked, Curve, Hermite
from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.scales import yardsticks
from flexctrl.dynamics.steps import Integrator, Point
from flexctrl.dynamics.swift.fleeting import felt_power, settled_power
from flexctrl.dynamics.swift.settling import dragged, quasistatic
from flexctrl.dynamics.swift.stiff_lines import noise, stiffest
from flexctrl.model.state import State

__all__ = ["Books", "Sums"]

_UNRESOLVED, _DOUBTFUL = 0.2, 0.05
_MOSTLY = 0.9
_FELT = 3e-3
_SLIGHT, _RESTING = 10.0, 1e-2
_LOBATTO = ((0.5 * (1.0 - (3.0 / 7.0) ** 0.5), 49.0 / 180.0), (0.5, 64.0 / 180.0))
_ENDS = 1.0 / 20.0
_OVERSHOT = 2.0


@dataclass
class Sums:
    """What the books hold.

    Attributes
    ----------
    start, moving : float
        Energy at the start, and what of it was kinetic [J].
    work, lost : float
        Work of the inputs and energy dissipated so far [J].
    kinetic, stored : float
        When the balance was drawn last [J].
    gap, turnover : float
        Largest |energy − start − work + lost|, less what may be booked as lost and is not, and largest energy
        turned over [J].
    made : float
        Energy − start − work + lost when the balance was drawn last [J].
    power : float
        Dissipated now [W].
    unseen : float
        Energy dissipated by rates that are over within a step [J].
    closure : float
        Largest violation of conditions that close rigid loops.
    entered : int
        Steps since the start.
    absurd : bool
        Whether the method makes so much energy that the run ends.
    moved : numpy.ndarray, shape (n,)
        How far each degree of freedom has been from its start.
    ahead, swept, bent, path : numpy.ndarray, shape (n,)
        Of one step of a few, local errors e, rates v and accelerations a: Σ e v, Σ h v², Σ h a², and Σ h |v| of all.
    """

    start: float = 0.0
    moving: float = 0.0
    work: float = 0.0
    lost: float = 0.0
    kinetic: float = 0.0
    stored: float = 0.0
    gap: float = 0.0
    turnover: float = 0.0
    made: float = 0.0
    power: float = 0.0
    unseen: float = 0.0
    closure: float = 0.0
    entered: int = 0
    absurd: bool = False
    moved: np.ndarray = field(default_factory=lambda: np.zeros(0))
    ahead: np.ndarray = field(default_factory=lambda: np.zeros(0))
    swept: np.ndarray = field(default_factory=lambda: np.zeros(0))
    bent: np.ndarray = field(default_factory=lambda: np.zeros(0))
    path: np.ndarray = field(default_factory=lambda: np.zeros(0))


class Books:
    """What a run has turned over, drawn up every few steps."""

    def __init__(self, feed: Feed, state: State, method: Integrator, tolerance: Tolerance) -> None:
        self.feed, self.model, self.order = feed, feed.model, method.order
        self.first = state.q
        self.lawful = self.model.large
        self.reach = yardsticks(self.model)
        self.slight = _SLIGHT * tolerance.negligible * self.reach
        probe = np.linspace(1.0, 2.0, self.model.n)
        changing = bool(self.model.switches.names or self.model.kinks.names)  # what is loose now may damp later
        self.dissipates = changing or self.model.energy(state.with_(v=probe))[2] != 0.0
        self.midway = isinstance(method, ConservingMidpoint)  # what its damping takes is that, to round-off
        self.loses = self.dissipates or not method.symmetric  # steps that lead back in time take nothing for good
        kinetic, stored, power = self.model.energy(state)
        self.sums = Sums(kinetic + stored, kinetic, kinetic=kinetic, stored=stored, power=power)
        for name in ("moved", "ahead", "swept", "bent", "path"):
            setattr(self.sums, name, np.zeros(self.model.n))

    def enter(self, before: Point, after: Point, curve: Curve) -> None:
        """Enter a step."""
        sums = self.sums
        if before.supply.u.any() or after.supply.u.any() or self.dissipates:
            if self.order > 2:
                self._integrate(before, after, curve)
            else:
                self._trapezoid(before, after)
        sums.moved = np.maximum(sums.moved, np.abs(after.state.q - self.first))
        sums.entered += 1
        if sums.entered < OFTEN or sums.entered % OFTEN == 0:
            self.close(after)
            gone = float((sums.moved / self.reach).max(initial=0.0))
            if self.lawful and absurd(sums.entered, sums.made - sums.unseen, sums.turnover, gone, sums.start):
                sums.absurd = True

    @property
    def looking(self) -> bool:
        """Whether the error of the step about to be entered is added up."""
        return looking(self.sums.entered)

    def miss(self, error: np.ndarray, after: Point, h: float) -> None:
        """Add up the local error of a step that ends at a point."""
        sums, v, a = self.sums, after.state.v, after.rate
        sums.ahead = sums.ahead + error * v
        sums.swept = sums.swept + h * v * v
        sums.bent = sums.bent + h * a * a
        sums.path = sums.path + LOOKED_AT * h * np.abs(v)

    def jump(self, before: Point, after: Point, step: float) -> None:
        """Note that rates have jumped with the inputs before a step, and with them what is dissipated.

        Places of what has no mass have jumped too: what the inputs did on the way and springs do not store is lost.
        """
        if self.model.motion.flows.size or dragged(self.model).size:
            self.turn(after, step)
        if isinstance(self.model, LinearPlant) or quasistatic(self.model).size:
            (k0, v0, _), (k1, v1, _) = (self.model.energy(point.state) for point in (before, after))
            moved = after.state.q - before.state.q
            work = float(self.model.loads(after.state, after.supply.u) @ moved)
            self.sums.work += work
            self.sums.lost += work - (k1 + v1 - k0 - v0)
            self.sums.moved = np.maximum(self.sums.moved, np.abs(after.state.q - self.first))

    def turn(self, point: Point, step: float) -> None:
        """Note that what is dissipated jumps before a step."""
        if self.dissipates:
            self.sums.power = felt_power(self.model, point.state, point.rate, point.supply.u, step)

    def _trapezoid(self, before: Point, after: Point) -> None:
        loads = self.model.loads
        step = after.state.q - before.state.q
        forces = loads(before.state, before.supply.u) + loads(after.state, after.supply.u)
        self.sums.work += 0.5 * float(forces @ step)
        if self.dissipates and self.midway:
            self.sums.lost += self._halfway(before.state, after.state)
        elif self.dissipates:
            power = self.model.energy(after.state)[2]
            lost = 0.5 * (self.sums.power + power) * (after.state.t - before.state.t)
            self.sums.lost += self._dissipated(lost, before.state, after)
            self.sums.power = power

    def _halfway(self, before: State, after: State) -> float:
        """What is dissipated at the mean rates, where half of the step has led.

        Seen from the end of a step what turns goes aside, and has its stiff parts give way.
        """
        h, step = after.t - before.t, after.q - before.q
        return h * self.model.energy(self.model.advance(before, 0.5 * step, step / h, before.t + 0.5 * h))[2]

    def _integrate(self, before: Point, after: Point, curve: Curve) -> None:
        """Integrate the powers over a step by Lobatto's rule with five points, where the method knows no better."""
        if isinstance(curve, Booked):
            work, lost = curve.turned_over()
            self.sums.work += work
            self.sums.lost += lost
            return
        t, h = before.state.t, after.state.t - before.state.t
        first, last = self._powers(before.state, before.supply.u), self._powers(after.state, after.supply.u)

        def within(share: float, state: State) -> np.ndarray:
            return self._powers(state, self.feed.between(before.supply, after.supply, (share, h), state).u)

        def mean(curve: Curve) -> np.ndarray:
            inner = (*_LOBATTO, (1.0 - _LOBATTO[0][0], _LOBATTO[0][1]))
            return sum((w * within(share, curve.at(t + share * h)) for share, w in inner), _ENDS * (first + last))

        total = mean(curve)
        ends = 0.5 * (first[1] + last[1])
        if min(first[1], last[1]) > 0.0 and total[1] > _OVERSHOT * ends:  # it swings where damping is too stiff for it
            calm = Hermite(Local(self.model), before.state, after.state)
            total = within(0.5, calm.secant()) if total[1] > _OVERSHOT * mean(calm)[1] else total
        self.sums.work += h * float(total[0])
        self.sums.lost += self._dissipated(h * float(total[1]), before.state, after)
        self.sums.power = float(last[1])

    def _dissipated(self, lost: float, before: State, end: Point) -> float:
        """What a step has dissipated, of which quadrature says so much.

        That goes by rates at the ends. Where drag takes within the step what they have beside the mean rates (or much
        more beside what accelerations add to these, as of noise), it is the most; what is lost at the mean rates is the
        least, and between the two the balance tells.
        """
        s, after = self.sums, end.state
        if lost <= unlooked(s.entered + 1, s.made, s.unseen, s.turnover):
            return lost
        kinetic, stored, _ = self.model.energy(after)
        gap = kinetic + stored - s.start - s.work + s.lost
        if borne_out(lost, gap + lost, s.unseen, s.turnover):
            return lost
        h = after.t - before.t
        beside = after.v - (after.q - before.q) / h
        if not (self._ended(h, after, beside, 0.0) or self._ended(h, after, beside - 0.5 * h * end.rate, lost)):
            return lost
        least = self._halfway(before, after)
        if lost <= ALIKE * least:
            return lost
        told = min(lost, max(least, s.made - gap))
        s.unseen += min(told, lost - told)
        return told

    def _ended(self, h: float, state: State, beside: np.ndarray, least: float) -> bool:
        """Whether drag ends some rates within a step, and takes so much; what drives one way, as wind does, is none."""
        (swing, _, there), (_, _, back) = (self._energy(state, v) for v in (beside, -beside))
        return h * min(there, back) > max(swing, FAR * least)

    def _energy(self, state: State, v: np.ndarray) -> tuple[float, float, float]:
        return self.model.energy(state.with_(v=v))

    def _powers(self, state: State, u: np.ndarray) -> np.ndarray:
        lost = settled_power(self.model, state, u) if self.dissipates else 0.0
        return np.array([self.model.loads(state, u) @ state.v, lost])

    def close(self, point: Point) -> None:
        """Draw the balance."""
        s = self.sums
        s.kinetic, s.stored, _ = self.model.energy(point.state)
        gap = s.kinetic + s.stored - s.start - s.work + s.lost
        s.turnover = max(s.turnover, abs(s.work), s.lost, abs(s.stored + s.kinetic - s.start))
        s.turnover = max(s.turnover, s.kinetic, abs(s.kinetic - s.moving), abs(s.stored - (s.start - s.moving)))
        s.gap, s.made = max(s.gap, missed(gap, s.unseen)), gap
        s.closure = max(s.closure, self.model.motion.closure_error(point.state))

    @property
    def overflown(self) -> bool:
        """Whether energies are larger than all numbers."""
        s = self.sums
        return not math.isfinite(s.work + s.lost + s.made)

    @property
    def nonsense(self) -> str:
        """What is wrong with a run whose method makes energy from nothing, a large share of all; empty if none is."""
        s = self.sums
        if not s.absurd:
            return ""
        return f"the method has made {s.made:.3g} J of {s.turnover:.3g} J turned over: the motion is not resolved"

    @property
    def unresolved(self) -> str:
        """What the books say against a motion that has reached its end; empty if they can stand behind it.

        They have missed a large share of what was turned over, and the method's own damping is not why: that takes
        energy and gives none back, so that the largest gap is the last. A method without damping has no such excuse,
        unless the machine dissipates and the books may have mistaken how much.
        """
        s = self.sums
        damped = self.loses and s.made < 0.0 and -s.made >= _MOSTLY * s.gap
        if not self._doubtful(_UNRESOLVED) or damped:
            return ""
        return f"the energy books missed {s.gap:.3g} J of {s.turnover:.3g} J turned over: the motion is not resolved"

    @property
    def doubts(self) -> tuple[str, ...]:
        """What the books say against a motion that goes on: they miss a visible share of what was turned over."""
        s = self.sums
        said = (*self._stiff, *self._swift)
        if not self._doubtful(_DOUBTFUL):
            return (*said, *self._small)
        return (
            *said,
            f"the energy books miss {s.gap:.3g} J of {s.turnover:.3g} J turned over: the motion is "
            f"{'not' if self.residual > _UNRESOLVED else 'poorly'} resolved; take smaller steps or a smaller Tolerance",
        )

    @property
    def _stiff(self) -> tuple[str, ...]:
        """What is to be said of lines so stiff that the last digits of places are felt in a motion that is seen."""
        if not self.lawful:
            return ()
        unsure, gone = noise(self.model), float((self.sums.moved / self.reach).max(initial=0.0))
        way = self.model.structure.size * min(gone, 1.0)
        if unsure * way <= _FELT * self.sums.turnover or not self._seen:
            return ()
        name, stiffness = stiffest(self.model)
        return (
            f"{name} is so stiff ({stiffness:.3g} N/m) that the last digits of places make forces of {unsure:.2g} N in "
            f"it, beside about {self.sums.turnover / way:.2g} N that move the machine: its tension is no better than "
            "that, nor whether it is slack; make it softer, or rigid",
        )

    @property
    def _swift(self) -> tuple[str, ...]:
        """What is to be said of damping that takes a visible share of all energy within steps."""
        s = self.sums
        if not self.lawful or s.unseen <= _DOUBTFUL * s.turnover or (s.moved < self.slight).all():
            return ()
        return (
            f"damping took about {s.unseen:.3g} J of {s.turnover:.3g} J turned over faster than steps see: rates that "
            "it ends so fast are not resolved; take smaller steps or a smaller Tolerance if they count",
        )

    @property
    def _small(self) -> tuple[str, ...]:
        """What is to be said of motion too small to be seen, yet beyond the tolerance, of which the books miss much."""
        s = self.sums
        beyond = (s.moved >= self.slight).any() and s.gap >= ROUND_OFF * abs(s.start)
        if self._seen or not (self.lawful and beyond and self.residual > _DOUBTFUL):
            return ()
        if s.made > ABSURD * s.turnover:
            return (
                f"the method has made {s.made:.3g} J of {s.turnover:.3g} J turned over: it would be nearer to rest "
                "than it seems; take smaller steps, a smaller Tolerance, or an implicit method",
            )
        return (
            f"the energy books miss {s.gap:.3g} J of {s.turnover:.3g} J turned over: what moves is less than a "
            "thousandth of the machine's size, and is not resolved; take smaller steps or a smaller Tolerance if it "
            "counts",
        )

    @property
    def _seen(self) -> bool:
        """Whether the motion is large enough to be seen."""
        return bool((self.sums.moved >= VISIBLE * self.reach).any())

    def _doubtful(self, share: float) -> bool:
        """Whether the books miss more than a share, in a motion large enough to be seen."""
        s = self.sums
        visible = self._seen and s.gap >= ROUND_OFF * abs(s.start)
        return bool(self.lawful and self.residual > share and visible)

    @property
    def residual(self) -> float:
        """The largest gap over the largest energy turned over; 0 where nothing moves by a tenth of the tolerance."""
        resting = (self.sums.moved < _RESTING * self.slight).all()
        return self.sums.gap / self.sums.turnover if self.sums.turnover > 0.0 and not resting else 0.0
