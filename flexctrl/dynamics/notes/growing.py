"""What grows faster than steps see: an implicit step maps what grows fast into the unit circle, as what decays."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.linalg as la

from flexctrl.dynamics.feed import Feed, Supply
from flexctrl.dynamics.linear_motion.exact import Exact
from flexctrl.dynamics.methods.explicit import ExplicitRungeKutta
from flexctrl.dynamics.methods.extrapolation import Richardson
from flexctrl.dynamics.notes.limits import limited
from flexctrl.dynamics.notes.moments import FEW, PARTLY, PARTS, moments, step_about
from flexctrl.model.model import Model
from flexctrl.model.plant import Plant
from flexctrl.model.stability import without_energy
from flexctrl.model.state import State

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["Growth", "growth", "loop_poles"]

_MOST = 400
_DOUBTED, _MISSED = 0.5, 1.5
_GROWN = 4.0
_INFINITE = 1e6
_SAME = 1e-3
_LOOP = "the continuous loop"
_SMALL = 1e-7
_OFTEN = 64
"""Moments at which it is seen how far readings go."""


class Growth(NamedTuple):
    """A pole by which a loop grows, or a machine that loads without a potential drive.

    Attributes
    ----------
    grown : str
        What grows.
    pole : complex
        [1/s]
    step : float
        The mean step [s].
    span : float
        How long it had to grow [s].
    missed : bool
        Whether the loop was and is one that steps by far do not see grow, at the start and at the end, and nothing
        holds it: a law that answers little to much does.
    when : str
        Since when and until when, in words; empty if all along.
    """

    grown: str
    pole: complex
    step: float
    span: float
    missed: bool
    when: str = ""

    def __str__(self) -> str:
        pole = f"{self.pole.real:.3g}" + (f" ± {abs(self.pole.imag):.3g}i" if self.pole.imag else "")
        unstable = f"{self.grown} is unstable{self.when}, with a pole at {pole} 1/s"
        if abs(self.pole) * self.step > _DOUBTED:
            cause = "gains" if self.grown == _LOOP else "loads"
            finer = f"look at the {cause}, or take steps below {0.1 / abs(self.pole):.1g} s"
            return f"{unstable} that steps of {self.step:.2g} s do not see grow; {finer}"
        return f"{unstable}: over the run what steps err by grows with it, by up to e^{self.pole.real * self.span:.0f}"


def growth(journey: Journey, start: tuple[State, Supply]) -> Growth | None:
    """Return the pole by which a machine grows in truth, and may not in implicit steps; None if there is none.

    That of a continuous loop, or under loads that have no potential: what has one and leaves by itself does so without
    turning, as steps see it. Linear about the start and about the end: at one of these, if steps do not see it grow, at
    both otherwise. What grows by less than e⁴ over the run is let pass. Under a continuous law small machines are
    looked at between them, too.

    Parameters
    ----------
    journey : Journey
        At its end.
    start : tuple of State and Supply
        Where it set out.

    Returns
    -------
    Growth or None
    """
    feed, method, end = journey.plan.feed, journey.plan.method, journey.point
    method = method.method if isinstance(method, Richardson) else method
    span = end.state.t - start[0].t
    driven = () if feed.reacting else _driven(feed, start[1].u, end.supply.u)
    if not (feed.reacting or driven) or isinstance(method, ExplicitRungeKutta | Exact):
        return None
    if not journey.mark.steps or span <= 0.0:
        return None
    grown, step = f"the machine under {', '.join(driven)}" if driven else _LOOP, end.state.t / journey.mark.steps
    found = [_growing(loop_poles(feed, at, to, step), span) for at, to in (start, (end.state, end.supply))]
    least, worst = sorted(found, key=lambda pole: pole.real)
    if least or abs(worst) * step > _DOUBTED:
        missed = abs(least) * step > _MISSED and not (feed.reacting and _limited(journey))
        return Growth(grown, worst, step, span, missed)
    return _between(journey, grown) if feed.reacting and 2 * feed.model.n <= FEW else None


def _between(journey: Journey, grown: str) -> Growth | None:
    """Return the pole that grows most in the midst of a run, as gains may be high there alone, if steps do not see it.

    What several parts of the run add is summed up.
    """
    feed, track, end, found = journey.plan.feed, journey.track, journey.point.state.t, []
    for moment in moments(track, end, PARTS):
        step = step_about(track, moment)
        poles = loop_poles(feed, moment.state, moment.supply, step)
        pole = complex(max(poles, key=lambda pole: pole.real, default=0.0))
        if pole.real > 0.0 and abs(pole) * step > _DOUBTED:
            found.append((moment, pole, step))
    if sum(pole.real * moment.part for moment, pole, _ in found) <= PARTLY:
        return None
    (first, *_), (last, *_) = found[0], found[-1]
    _, worst, step = max(found, key=lambda each: each[1].real)
    when = f" from about t = {first.state.t:.3g} s to {last.state.t:.3g} s"
    return Growth(grown, worst, step, len(found) * first.part, False, when)


def _limited(journey: Journey) -> bool:
    """Tell whether a law holds growth by answering less to much; its readings go as far as at some moments."""
    feed, end = journey.plan.feed, journey.point
    y = feed.measured(end.state)
    states = [moment.state for moment in moments(journey.track, end.state.t, _OFTEN)]
    way = np.ptp([y, *(feed.measured(state) for state in states)], axis=0)
    return limited(lambda read: feed.renewed(end.state.t, read, end.supply).u, y, way)


def _driven(feed: Feed, *inputs: np.ndarray) -> tuple[str, ...]:
    """The loads without a potential, at the start or at the end."""
    model = feed.model
    if not isinstance(model, Model):
        return ()
    return tuple(dict.fromkeys(name for u in inputs for name in without_energy(model, u)))


def _growing(poles: np.ndarray, span: float) -> complex:
    """Return the pole that grows most over the run, 0 if none does."""
    return complex(max(poles[poles.real * span > _GROWN], key=lambda pole: pole.real, default=0.0))


def loop_poles(feed: Feed, state: State, supply: Supply, step: float) -> np.ndarray:
    """Return the finite poles of a model and of a continuous law, linear about a state in motion [1/s].

    Parameters
    ----------
    feed : Feed
        With a continuous law that reads the motion; else of the model alone, its inputs held.
    state : State
    supply : Supply
        The inputs there.
    step : float
        Poles far above 1/step are left out [s].

    Returns
    -------
    numpy.ndarray of complex
        Empty for machines too large for it, and while contacts stick.
    """
    model = feed.model
    if 2 * model.n + supply.x.size > _MOST or model.switches.sticks(state):
        return np.zeros(0, complex)
    J, E = _looped(feed, state, supply, step) if feed.reacting else _scaled(*_alone(feed.model, state, supply.u, step))
    poles = _finite(J, E)
    if (poles.real > _SAME).any():  # what has no mass has poles that round-off makes finite: others each time
        columns = 2.0 ** np.random.default_rng(0).integers(-4, 5, len(J))
        again = _finite(J * columns, E * columns)
        poles = poles[[p.real <= _SAME or bool((abs(p - again) <= _SAME * abs(p)).any()) for p in poles]]
    return np.asarray(poles / step)


def _finite(J: np.ndarray, E: np.ndarray) -> np.ndarray:
    over, under = la.eig(J, E, right=False, homogeneous_eigvals=True)
    finite = (abs(over) < _INFINITE * abs(under)) & np.isfinite(over) & np.isfinite(under)
    return np.asarray(over[finite] / under[finite])


def _alone(model: Plant, state: State, u: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """J z = λ h E z of places and h times rates."""
    n, still = model.n, np.zeros(model.n)
    kinds = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    place, rate, mass = (model.slope(state, state.v, still, seeds, u).toarray() for seeds in kinds)
    J = np.block([[np.zeros((n, n)), np.eye(n) / step], [place, rate / step]])
    return J, la.block_diag(np.eye(n), -mass / step) / step


def _looped(feed: Feed, state: State, supply: Supply, step: float) -> tuple[np.ndarray, np.ndarray]:
    """The same with the law's states after them."""
    model, n, x = feed.model, feed.model.n, supply.x.size
    J, E = _alone(model, state, supply.u, step)
    on_place, on_rate = model.signals.slopes(state, model.rates(state), model.motion.raw)
    T = model.motion.jacobian(state)[: model.motion.raw]
    reads = np.hstack([(on_place[feed.reads] @ T).toarray(), (on_rate[feed.reads] @ T).toarray() / step])
    push = (T.T @ model.reach(state, supply.u)).toarray()
    on_y, on_x = _answers(feed, state, supply)
    says, follows = (on_y[: len(supply.u)], on_y[len(supply.u) :])
    J = np.block([[J, np.zeros((2 * n, x))], [follows @ reads, on_x[len(supply.u) :]]])
    J[n : 2 * n] += push @ np.hstack([says @ reads, on_x[: len(supply.u)]])
    return _scaled(J, la.block_diag(E, np.eye(x) / step))


def _scaled(J: np.ndarray, E: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of one size."""
    size = np.maximum(abs(J).max(axis=1), abs(E).max(axis=1))
    size[size == 0.0] = 1.0
    return J / size[:, None], E / size[:, None]


def _answers(feed: Feed, state: State, supply: Supply) -> tuple[np.ndarray, np.ndarray]:
    """How the inputs and the rates of a law's states change with what it reads and with its states."""
    y, x = feed.measured(state), supply.x

    def said(d: np.ndarray) -> np.ndarray:
        found = feed.renewed(state.t, y + d[: y.size], Supply(supply.u, x + d[y.size :], supply.rate))
        return np.concatenate([found.u, found.rate])

    at = np.concatenate([y, x])
    steps = np.diag(_SMALL * np.maximum(1.0, abs(at)))
    slope = np.array([(said(d) - said(-d)) / (2.0 * d.max()) for d in steps]).T
    return slope[:, : y.size], slope[:, y.size :]
