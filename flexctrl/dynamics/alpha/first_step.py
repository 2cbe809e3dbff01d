"""The first step of a run that chooses its steps, from how a machine sets out.

As with Hairer, Nørsett & Wanner (1993, § II.4) it is the time in which something happens, times the root of the error
allowed. Accelerations in yardsticks and the slowest vibration tell that time, so it does not depend on units.
"""

from __future__ import annotations

import numpy as np

from flexctrl.dynamics.feed import Feed, Supply
from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.scales import yardsticks
from flexctrl.dynamics.steps import Controlled
from flexctrl.model.state import State

__all__ = ["first_step", "unseen"]

_NEVER, _NEAR, _BRIEF, _HIDDEN = 1e4, 0.1, 1e-3, 6.0


def first_step(feed: Feed, state: State, supply: Supply, pace: Controlled, tolerance: Tolerance, span: float) -> float:
    """Return the length of the first step [s].

    Where nothing happens in a time that is longer than a span by orders, as to a free rotor, it goes a tenth of a
    radian or of the machine's size; where nothing moves, a thousandth of the span.

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
        To the end of the run, or to where inputs jump [s].
    """
    rate = _quickness(feed, state, supply) / tolerance.absolute ** (1.0 / pace.steepness)
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


def _quickness(feed: Feed, state: State, supply: Supply) -> float:
    """How quickly accelerations, and the slowest vibration, bring a machine about [1/s].

    Both are those of the freedoms one by one: what couples them is not asked for.
    """
    model, still, yard = feed.model, np.zeros(feed.model.n), yardsticks(feed.model)
    mass = -model.slope(state, state.v, still, (0.0, 0.0, 1.0), supply.u).diagonal()
    moved = (mass > model.dust) & np.isfinite(yard)
    moved[model.motion.flows] = False
    force = model.balance(state, state.v, still) + model.loads(state, supply.u)
    slope = model.slope(state, state.v, still, (1.0, 0.0, 0.0), supply.u).diagonal()
    if feed.continuous:
        slope = slope + feed.slope(state, supply, 0.0, (1.0, 0.0, 0.0)).diagonal()
    pushed, stiff = (np.abs(a[moved] / mass[moved]) for a in (force, slope))
    slowest = min(stiff[stiff > 0.0].tolist(), default=0.0)
    return float(max((pushed / yard[moved]).max(initial=0.0), slowest) ** 0.5)
