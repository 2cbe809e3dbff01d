"""Whether a machine has left a state by itself on its way: buckled, snapped through or fallen over."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from flexctrl.model.model import Model
from flexctrl.model.paths.pivots import pivots
from flexctrl.model.stability import without_energy
from flexctrl.model.state import State

if TYPE_CHECKING:
    from flexctrl.dynamics.feed import Feed
    from flexctrl.dynamics.journey import Journey
    from flexctrl.dynamics.run import Run

__all__ = ["leaves"]

_LOOKED_AT, _GROWN = 12, 3.0
"""States, and powers of e over the run."""
_STIFFNESS, _MASS = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def leaves(run: Run, journey: Journey, feed: Feed | None) -> bool:
    """Tell whether small differences may have grown by e³, however little has moved.

    So they may where K + 9 M/T² is not positive, T the duration of the run: something leaves at a rate of 3/T.
    Looked at are the start, the end and some states between, evenly in time, as what leaves lingers before it does; so
    may all that moves under loads without a potential. Under a sampled law it is the poles of the loop that count.

    Parameters
    ----------
    run : Run
    journey : Journey
        How it went.
    feed : Feed or None
        With a law that may be asked anew; None if there is none.

    Returns
    -------
    bool
    """
    if feed is not None and feed.sample_time and feed.reads.size:
        from flexctrl.dynamics.notes.sampled_growth import grows  # brings all that modes need

        return grows(journey, feed)
    model, end = journey.plan.model, journey.point
    if not isinstance(model, Model) or not end.state.t > 0.0:
        return False
    if without_energy(model, end.supply.u) or without_energy(model, journey.origin.u):
        return True
    u, still = end.supply.u, np.zeros(model.n)
    M = -model.slope(end.state, still, still, _MASS, u) * (_GROWN / end.state.t) ** 2
    return any(_leaves(model, state, u, M) for state in (journey.origin.state, *_between(run), end.state))


def _between(run: Run) -> Iterator[State]:
    """Some states of a run."""
    for i in np.unique(np.linspace(0, len(run.frames) - 1, _LOOKED_AT).round().astype(int)) if run.frames else ():
        yield run.frames[int(i)]


def _leaves(model: Model, state: State, u: np.ndarray, M: sp.spmatrix) -> bool:
    """Tell whether something leaves a state, as if it stood still there, M divided by the square of the time it has."""
    still = np.zeros(model.n)
    K = -model.slope(state, still, still, _STIFFNESS, u)
    return bool((pivots(sp.csr_matrix(K + M), None, 1.0) < 0.0).any())
