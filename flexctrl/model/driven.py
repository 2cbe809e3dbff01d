"""Motions that nothing resists and that loads drive: why a machine has no place to rest, and what to hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import SingularMatrixError
from flexctrl.frozen import frozen
from flexctrl.model.balance import Balance
from flexctrl.model.search import Newton
from flexctrl.model.solve import factorise
from flexctrl.model.state import State
from flexctrl.model.units import force_unit

__all__ = ["Driven", "driven_freely"]

_MOST, _ROUNDS = 6, 6
_SOFT, _UNRESISTED, _ROUNDING = 1e-4, 0.03, 1e-13
"""What free motions are told from others by, over the ω² of the machine's swinging; how free they are, over that; and
the least of it over the ω² of the stiffest."""
_DUST, _ALONG = 8.0, 0.1
_WAY, _ALIKE = 0.5, 0.1
"""As far is gone along a motion [rad or sizes of the machine]; by as little what drives it differs there."""


@frozen
class Driven:
    """A motion that nothing resists and that the loads drive.

    Attributes
    ----------
    lead : str
        The coordinate to hold: a motor that takes part, else what turns or moves most.
    beside : str
        What moves most beside; empty for nothing.
    push : float
        What drives the lead where all of them are held [N or N m].
    """

    lead: str
    beside: str
    push: float

    def __str__(self) -> str:
        beside = f" (with {self.beside})" if self.beside else ""
        return f"{self.lead}{beside}, which the loads drive by {self.push:.4g}{force_unit(self.lead)}"


def driven_freely(balance: Balance, start: State, tolerance: float) -> tuple[Driven, ...]:
    """Return the motions about a start that nothing resists and that loads drive on and on.

    With their leading coordinates held there is an equilibrium, and farther on as well, under the same forces: what
    only begins without stiffness, as a pendulum drawn level, is none of them.

    Parameters
    ----------
    balance : Balance
    start : State
    tolerance : float
        Of the equilibria.

    Returns
    -------
    tuple of Driven
        Empty where there are none, or where more than a few are driven.
    """
    about = start
    for _ in range(2):  # the second time with the stresses that what is loaded has
        motions = _free_motions(balance, about)
        leads = [_moving(balance, motion)[0] for motion in motions]
        here = _resting(balance, leads, about, tolerance) if leads else None
        if here is None:
            return ()
        way = np.sum([motion * (_WAY / balance.moved(motion)) for motion in motions], axis=0)
        there = _resting(balance, leads, balance.model.advance(here, way, balance.still, 0.0), tolerance)
        push = balance.whole_force(here)[leads]
        if there and (np.abs(balance.whole_force(there)[leads] - push) <= _ALIKE * np.abs(push)).all():
            return tuple(_told(balance, *pair) for pair in zip(motions, push, strict=True))
        about = here
    return ()


def _told(balance: Balance, motion: np.ndarray, push: float) -> Driven:
    lead, *others = (balance.model.coordinates[i] for i in _moving(balance, motion))
    return Driven(lead, others[0] if others else "", float(push))


def _free_motions(balance: Balance, state: State) -> list[np.ndarray]:
    """The free motions that are driven, each with those before it held by what leads them; none for too many."""
    held, motions = balance, list[np.ndarray]()
    while (motion := _free_motion(held, state)) is not None:
        motions.append(motion)
        if len(motions) > _MOST:
            return []
        held = _holding(balance, [_moving(balance, motion)[0] for motion in motions], state)
    return motions


def _free_motion(balance: Balance, state: State) -> np.ndarray | None:
    """The motion of all coordinates, without stiffness, on which the forces do most work for its kinetic energy.

    Solving with K + σM again and again leaves nothing but that of what the forces call forth.
    """
    force, inertia = balance.force(state), balance.inertia[balance.free]
    if not force.any():
        return None
    K = balance.among_free(balance.slope(state))
    stiffest = float((np.abs(K.diagonal()) / inertia).max())
    shift = max(_SOFT * balance.pull(state), _ROUNDING * stiffest)
    try:
        solve = factorise((K + sp.diags(shift * inertia)).tocsr())
    except SingularMatrixError:
        return None
    motion = force / inertia
    for _ in range(_ROUNDS):
        motion = solve(inertia * motion)
        motion = motion / max(float(np.abs(motion).max()), 1e-300)
    resisting = K @ motion
    if not np.sum(resisting**2 / inertia) <= (_UNRESISTED * shift) ** 2 * np.sum(inertia * motion**2):
        return None
    if not force @ motion > _DUST * (balance.round_off(state) @ np.abs(motion)):
        return None
    step = np.zeros(balance.model.n)
    step[balance.free] = motion
    return balance.whole(state, step)


def _moving(balance: Balance, motion: np.ndarray) -> list[int]:
    """The coordinates that take part in a motion, what moves most first, angles before ways, a motor before both."""
    share = np.abs(motion / balance.unit) * np.where(balance.moving, 0.5, 1.0)
    among = [int(i) for i in np.argsort(-share, kind="stable") if share[i] > _ALONG * share.max()]
    motors = [i for i in among if balance.model.coordinates[i].endswith("_source")]
    return [*motors[:1], *(i for i in among if i not in motors[:1])]


def _holding(balance: Balance, numbers: list[int], state: State) -> Balance:
    """The same balance with more coordinates held: where they are."""
    more = replace(balance, held=dict.fromkeys([*balance.held, *numbers], 0.0)).held_as(state)
    return replace(more, held={**more.held, **balance.held})


def _resting(balance: Balance, leads: list[int], state: State, tolerance: float) -> State | None:
    """The equilibrium with these coordinates held where they are; None if none is found at once."""
    held = _holding(balance, leads, state)
    for _ in range(2):  # what is left is small beside the forces at the start, which stretch much
        found = Newton(held, tolerance).run(state, 120, 10.0 * balance.pull(state))
        if not found.done:
            return None
        state = found.state
    return state
