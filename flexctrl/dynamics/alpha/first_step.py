"""The first step of a run that chooses its steps, from how a machine sets out.

As with Hairer, Nørsett & Wanner (1993, § II.4) it is the time in which something happens, times the root of the error
allowed. Accelerations in yardsticks and the slowest vibration tell that time, so it does not depend on units.
"""

from __future__ import annotations

import math

import numpy as np

from flexctrl.dynamics.feed import Feed, Supply
from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.scales import yardsticks
from flexctrl.dynamics.steps import Controlled
from flexctrl.model.state import State

__all__ = ["first_step", "unseen"]

_NEVER, _NEAR, _BRIEF, _HIDDEN = 1e4, 0.1, 1e-3, 6.0
_SOON, _DIGITS = 1e-6, 2.0**20
"""How far ahead inputs are looked at, as a share of a span, and to how many digits that tells how fast they change."""


def first_step(feed: Feed, state: State, supply: Supply, pace: Controlled, tolerance: Tolerance, span: float) -> float:
    """Return the length of the first step [s].

    Where nothing happens in a time that is longer than a span by orders, as to a free rotor, it goes a tenth of a
    radian or of the machine's size, if inputs do not grow faster; where nothing moves, a thousandth of the span.

    Parameters
    ----------
    feed : Feed
    state : State
        Where the run begins.
    supply : Supply
        Its inputs there.
    pace : Controlled
    tolerance : Tolerance
    span : float
        To where inputs jump, or to the end of the run if they never do [s].
    """
    error = tolerance.absolute ** (1.0 / pace.steepness)
    rate = _quickness(feed, state, supply) / error
    if rate * span * _NEVER <= 1.0:
        rate = _awakening(feed, state, supply, _SOON * span) / error
    if rate * span * _NEVER > 1.0:
        return min(1.0 / rate, pace.largest)
    speed = float(np.abs(state.v / yardsticks(feed.model)).max(initial=0.0))
    return min(_NEAR / speed if speed * span > _BRIEF else _BRIEF * span, pace.largest)


def unseen(feed: Feed, state: State, supply: Supply, tolerance: Tolerance) -> float:
    """Return a time in which accelerations move a machine by no more than its error estimate lets pass [s].

    Steps may be longer than what is over in that time: about 6 roots of the error allowed, times the time in which
    accelerations bring the machine about; 0 if there are none.

    Parameters
    ----------
    feed : Feed
    state : State
        Where the run begins.
    supply : Supply
        Its inputs there.
    tolerance : Tolerance

    Returns
    -------
    float
    """
    rate = _quickness(feed, state, supply)
    return _HIDDEN * tolerance.absolute**0.5 / rate if rate > 0.0 else 0.0


def _awakening(feed: Feed, state: State, supply: Supply, soon: float) -> float:
    """How quickly inputs that change with time bring a machine about [1/s]; to so many digits, whenever it is asked."""
    if not feed.continuous:
        return 0.0
    model = feed.model
    later = feed.at(state.with_(t=soon), supply, soon)
    change = (model.loads(state, later.u) - model.loads(state, supply.u)) / soon
    share, power = math.frexp(float(_pushed(feed, state, supply, change).max(initial=0.0)) ** (1.0 / 3.0))
    return math.ldexp(round(share * _DIGITS) / _DIGITS, power)


def _pushed(feed: Feed, state: State, supply: Supply, force: np.ndarray) -> np.ndarray:
    """The accelerations that a force makes of freedoms with mass, one by one, in yardsticks."""
    moved, mass = _moved(feed, state, supply)
    return np.asarray(np.abs(force[moved] / mass[moved]) / yardsticks(feed.model)[moved])


def _moved(feed: Feed, state: State, supply: Supply) -> tuple[np.ndarray, np.ndarray]:
    """Which freedoms have mass and yardsticks, and the masses of all."""
    model, still = feed.model, np.zeros(feed.model.n)
    mass = -model.slope(state, state.v, still, (0.0, 0.0, 1.0), supply.u).diagonal()
    moved = (mass > model.dust) & np.isfinite(yardsticks(model))
    moved[model.motion.flows] = False
    return moved, mass


def _quickness(feed: Feed, state: State, supply: Supply) -> float:
    """How quickly accelerations, and the slowest vibration, bring a machine about [1/s].

    Both are those of the freedoms one by one: what couples them is not asked for.
    """
    model, still = feed.model, np.zeros(feed.model.n)
    moved, mass = _moved(feed, state, supply)
    force = model.balance(state, state.v, still) + model.loads(state, supply.u)
    slope = model.slope(state, state.v, still, (1.0, 0.0, 0.0), supply.u).diagonal()
    if feed.continuous:
        slope = slope + feed.slope(state, supply, 0.0, (1.0, 0.0, 0.0)).diagonal()
    stiff = np.abs(slope[moved] / mass[moved])
    slowest = min(stiff[stiff > 0.0].tolist(), default=0.0)
    return float(max(_pushed(feed, state, supply, force).max(initial=0.0), slowest) ** 0.5)
