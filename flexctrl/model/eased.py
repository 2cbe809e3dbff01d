"""Equilibria behind shafts so stiff that doubles hold nothing of what they drive: such shafts are eased.

A shaft adds k R² to the stiffness of what it drives. At 1e18 N m/rad the last digit of a double is 128 N m/rad, and of
what bends beside it K and the forces hold nothing. Where it bears a torque T, the machine is in the same place behind a
shaft k' whose motor is turned on by T/k' − T/k: what is driven cannot tell one from the other. With k' R² at 2²³ times
the least stiffness that it drives, digits are left to both, and the torque is told by a twist that is seen. What has
next to no stiffness, as a lift on an upright rail, counts as held by a share of the forces at work: these move it by
about 2⁻¹⁷ of the machine's size then.

A motor that is free finds that place by itself. One that is held is turned on by hand until the torque stays as it is:
each round leaves the share of 2⁻²³ of what was wrong, or more where stiffness grows on the way.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from flexctrl.frozen import frozen
from flexctrl.model.balance import Balance
from flexctrl.model.model import Model
from flexctrl.model.rounding import DIGITS
from flexctrl.model.softened import shafts_of, softened
from flexctrl.model.state import State

__all__ = ["Eased", "eased", "shares_left", "told"]

_DROWNED, _FIRM, _SWUNG = 2.0**-28, 2.0**23, 2.0**-6
_ALIKE, _BESIDE = 1e-12, 2.0**-10
_SOFT, _DUST, _LAST_DIGITS = 2.0**-100, 2.0**-90, 2.0**-44


@frozen(eq=False)
class Eased:
    """A balance behind shafts that are eased.

    Attributes
    ----------
    balance : Balance
        Of the machine with these shafts.
    bare : Model
        The machine with next to none in their place.
    motors : numpy.ndarray of int, shape (shafts,)
        Their coordinates.
    slack : numpy.ndarray, shape (shafts,)
        By what a motor is turned on for each newton metre that its shaft bears, 1/k' − 1/k [rad/(N m)].
    """

    balance: Balance
    bare: Model
    motors: np.ndarray
    slack: np.ndarray

    def turned(self, state: State) -> np.ndarray:
        """Return by how much motors are turned on in a state, for the torques that their shafts bear in it [rad]."""
        still = self.balance.still
        there, without = (m.balance(state, still, still)[self.motors] for m in (self.balance.model, self.bare))
        return np.asarray((without - there) * self.slack)

    def holding(self, turned: np.ndarray) -> Balance:
        """Return the balance with motors that are held turned on."""
        held = dict(self.balance.held)
        held |= {i: held[i] + more for i, more in zip(self.motors.tolist(), turned.tolist(), strict=True) if i in held}
        return replace(self.balance, held=held)

    def unheld(self, turned: np.ndarray) -> float:
        """Return how far what is driven is astray where motors that are held are turned on wrongly by so much."""
        held = np.isin(self.motors, self.balance.fixed)
        return float(np.abs(turned / self.balance.unit[self.motors])[held].max(initial=0.0))

    def back(self, state: State) -> State:
        """Return the state in which the shafts themselves bear the torques of these: θ_d = R s + T/k."""
        return _turned(state, self.motors, -self.turned(state))

    def onto(self, state: State) -> State:
        """Return the state in which these shafts bear what best balances all else."""
        balance = self.balance
        lever = balance.lever[balance.free]
        columns = balance.slope(state).tocsc()[:, self.motors][balance.free].toarray() / lever[:, None]
        return _turned(state, self.motors, np.linalg.lstsq(columns, balance.force(state) / lever, rcond=None)[0])

    def balanced(self, state: State, tolerance: float) -> bool:
        """Tell whether a state is an equilibrium but for the last digits of motors' angles."""
        there = self.onto(state)
        away, most = np.abs(self.back(there).q - state.q), np.maximum(self.balance.unit, np.abs(state.q))
        return bool((away <= _LAST_DIGITS * most)[self.motors].all()) and self.balance.settled(there, tolerance)

    def __str__(self) -> str:
        """Return the names of the drives."""
        names = shafts_of(self.balance.model)
        return " and ".join(names[i] for i in self.motors.tolist())


def told(balance: Balance, state: State) -> tuple[Balance, State]:
    """Return a balance and an equilibrium in which forces and stiffness can be told: the same ones, as a rule.

    Parameters
    ----------
    balance : Balance
    state : State

    Returns
    -------
    Balance, State
        Behind eased shafts where others leave nothing to be told.
    """
    ease = eased(balance, state)
    return (ease.balance, ease.onto(state)) if ease else (balance, state)


def eased(balance: Balance, state: State) -> Eased | None:
    """Return a balance behind shafts eased as far as doubles need, or None if they need nothing.

    Parameters
    ----------
    balance : Balance
    state : State
        About which stiffness is asked for.

    Returns
    -------
    Eased or None
    """
    shares = shares_left(balance, state)
    return _with(balance, shares) if shares else None


def shares_left(balance: Balance, state: State) -> dict[int, float]:
    """Return which share of their stiffness doubles hold of the shafts that drown what they drive.

    Parameters
    ----------
    balance : Balance
    state : State
        About which stiffness is asked for.

    Returns
    -------
    dict of int to float
        By the coordinates of motors; of those alone whose shafts are that stiff.
    """
    shafts = shafts_of(balance.model)
    if not shafts or balance.model.about:
        return {}
    borne = _borne(balance, state, np.array(list(shafts)))
    if not borne.any():
        return {}
    bare = softened(balance.model, dict.fromkeys(shafts.values(), _SOFT))
    own = _own(replace(balance, model=bare), state, borne)
    with np.errstate(divide="ignore"):
        least = np.where(borne > 0.0, own / borne, np.inf).min(axis=1)
    shares = np.where(least < _DROWNED, _FIRM * least, 1.0)
    shares = _side_by_side(shares, borne, np.isin(list(shafts), balance.fixed))
    return {i: share for i, share in zip(shafts, shares.tolist(), strict=True) if share < 1.0}


def _side_by_side(shares: np.ndarray, borne: np.ndarray, held: np.ndarray) -> np.ndarray:
    """The shares kept by shafts of which those of held motors on one joint, if stiff, bear as they do unless eased."""
    size, shares = np.linalg.norm(borne, axis=1), shares.copy()
    alike = borne @ borne.T >= (1.0 - _ALIKE) * np.outer(size, size)
    alike &= np.outer(held, held) & (size > 0.0)
    for row in alike[shares < 1.0]:
        if row.any():
            least = shares[row].min()
            shares[row & (size > _BESIDE * least * size[row].max())] = least
    return shares


def _borne(balance: Balance, state: State, motors: np.ndarray) -> np.ndarray:
    """What each shaft adds to the stiffness of each free coordinate of which all of them leave next to nothing."""
    K = balance.slope(state)
    own = K.diagonal()
    stiff = np.where(own[motors] > 0.0, own[motors], np.inf)
    borne = _beyond_dust(K[motors].toarray() ** 2 / stiff[:, None], balance.unit)
    drowned = own - borne.sum(axis=0) < _DROWNED * own
    drowned[motors] = False
    return np.asarray(np.where(drowned, borne, 0.0)[:, balance.free])


def _beyond_dust(borne: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """The same without what shafts add by levers of last digits: what a leg spins by about itself, none turns."""
    felt = borne * unit**2
    return np.where(felt > _DUST * felt.max(axis=1, keepdims=True), borne, 0.0)


def _own(bare: Balance, state: State, borne: np.ndarray) -> np.ndarray:
    """How stiff free coordinates are without shafts; if not at all, what that is made of, or as the softest shaft.

    They count as no softer than a share of what would swing their masses as the forces at work swing the machine.
    """
    K, shafts = bare.slope(state), borne.sum(axis=0)
    own, terms = np.abs(bare.among_free(K).diagonal()), bare.terms(state, K).diagonal()
    seen = (own > DIGITS * terms) & (own > _DUST * shafts)
    hidden = (terms > _DUST * shafts) & ~(seen & (shafts > 0.0)).any()
    softest = np.where(borne > 0.0, borne, np.inf).min(axis=0)
    swung = _SWUNG * bare.pull(state) * bare.inertia[bare.free]
    found = np.where(seen, own, np.minimum(softest, np.where(hidden, terms, np.inf)))
    return np.asarray(np.maximum(found, swung))


def _with(balance: Balance, shares: Mapping[int, float]) -> Eased:
    """The balance with shares of the stiffness of shafts, by the coordinates of their motors."""
    model, names = balance.model, shafts_of(balance.model)
    stiffness = {drive.name: drive.stiffness for drive in model.structure.drives}
    eased, bare = (
        softened(model, {names[i]: by for i, by in s.items()}) for s in (shares, dict.fromkeys(shares, _SOFT))
    )
    slack = [(1.0 / share - 1.0) / stiffness[names[i]] for i, share in shares.items()]
    return Eased(replace(balance, model=eased), bare, np.array(list(shares)), np.array(slack))


def _turned(state: State, motors: np.ndarray, by: np.ndarray) -> State:
    q = state.q.copy()
    q[motors] += by
    return replace(state, q=q)
