"""Where a whole run began, and what others laid beside its parts have told so far."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.frozen import frozen
from flexctrl.model.state import State

if TYPE_CHECKING:
    from flexctrl.dynamics.checkpoint import Checkpoint

__all__ = ["Origin"]

_NEAR = 1e-9


@frozen(eq=False)
class Origin:
    """Where a run began, and where those stand that were laid beside it: what these tell goes on with it.

    Attributes
    ----------
    state : State
    u : numpy.ndarray, shape (inputs,)
        Inputs as they were told first; empty if nobody was asked.
    others : tuple of Checkpoint
        Of each run beside, where it stood last.
    error : float
        How far the run has been off by these, as `Report` has it; 0 if there are none.
    right : float
        Until when it is known to have been right by these [s].
    seen : float
        Until when others have been laid beside it, or would not have told more [s].
    unseen : tuple of float
        From when until when not all of it has been: parts that were cut; both 0 if there are none [s].
    """

    state: State
    u: np.ndarray
    others: tuple[Checkpoint, ...] = ()
    error: float = 0.0
    right: float = math.inf
    seen: float = 0.0
    unseen: tuple[float, float] = (0.0, 0.0)

    def gone_on(self, t: float) -> Origin:
        """Return it for a part that goes on from a time: what nobody has seen before that is left behind.

        Parameters
        ----------
        t : float
            [s]

        Returns
        -------
        Origin
        """
        if t <= self.seen * (1.0 + _NEAR):
            return self
        return replace(self, unseen=(self.unseen[0] if self.unseen[1] else self.seen, t))

    def seen_until(self, t: float) -> Origin:
        """Return it for a run beside which others have come to a time.

        Parameters
        ----------
        t : float
            [s]

        Returns
        -------
        Origin
        """
        return replace(self, seen=max(self.seen, t))
