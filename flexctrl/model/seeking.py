"""The search for an equilibrium: straight on, load by load, by masses that fade, by ropes that stretch more."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import partial, reduce

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import EquilibriumError
from flexctrl.model.balance import Balance
from flexctrl.model.built_up import built_up
from flexctrl.model.driven import driven_freely
from flexctrl.model.eased import Eased, eased
from flexctrl.model.overturned import overturned
from flexctrl.model.recounted import recounted
from flexctrl.model.search import SMALLEST_PART, Found, Newton, follow
from flexctrl.model.softened import stiffest, stretching
from flexctrl.model.state import State

__all__ = ["found"]

_SOFT_REACH, _NEAR = (0.3, 0.1, 0.03), 0.1
_IN_PLACE, _ASTRAY, _DUST = 1e-15, 1e-12, 1e-9
_TAUT, _STIFFER = (300.0, 30.0, 3000.0), 10.0
"""How stiff ropes and beams are at first, over all loads; what they are stiffened by from search to search."""


def found(balance: Balance, start: State, tolerance: float) -> Found:
    """Return where a start leads to; itself, if nothing is left to do there.

    Parameters
    ----------
    balance : Balance
    start : State
    tolerance : float

    Returns
    -------
    Found

    Raises
    ------
    EquilibriumError
        If no search finds one.
    """
    start = built_up(balance, start)
    force = balance.force(start)
    if not np.isfinite(force).all():
        raise EquilibriumError("no equilibrium found: the start's own forces are not finite; start from another shape")
    ease = eased(balance, start) if force.any() or balance.astray(start) else None
    if (ease.balance if ease else balance).idle(start):
        return Found(start, balance.residual(start), 0, True, True, True)
    return _behind(ease, start, tolerance) if ease else _searched(balance, start, tolerance)


def _behind(ease: Eased, start: State, tolerance: float) -> Found:
    """The search behind eased shafts, with motors that are held turned on until the torques stay as they are."""
    found, turned, before = _searched(ease.balance, start, tolerance), np.zeros(len(ease.motors)), np.inf
    iterations = found.iterations
    while (off := ease.unheld(ease.turned(found.state) - turned)) > _IN_PLACE and off <= 0.5 * before:
        turned, before = ease.turned(found.state), off
        found = _searched(ease.holding(turned), found.state, tolerance)
        iterations += found.iterations
    if off > _ASTRAY:
        raise EquilibriumError(_not_borne(ease), found.state, found.residual)
    left = ease.holding(turned).beyond_noise(found.state)
    return replace(found, state=ease.back(found.state), residual=min(found.residual, left), iterations=iterations)


def _searched(balance: Balance, start: State, tolerance: float) -> Found:
    """The search: straight on from a shape that stands by itself, else as it is led."""
    if _stands(balance, start):
        return _loaded(balance, start, tolerance)
    there = _led(balance, start, tolerance)
    return replace(there, state=recounted(balance, start, there.state))


def _led(balance: Balance, start: State, tolerance: float) -> Found:
    """Where a shape that does not stand by itself is led by masses, at last by what stretches more."""
    try:
        return _hung(balance, start, tolerance)
    except EquilibriumError as failure:
        led = []
        for taut in _TAUT:
            softer = _ever_stiffer(balance, start, taut)
            with suppress(EquilibriumError):
                led += [_stiffened([*softer, balance], start, tolerance)] if softer else []
            if led and not balance.unstable(led[-1].state):
                return led[-1]
        if led:
            return reduce(partial(_lasting, balance), led)
        raise _explained(balance, start, tolerance, failure) from None


def _ever_stiffer(balance: Balance, start: State, taut: float) -> list[Balance]:
    """Balances of machines whose ropes and beams stretch, and then ever less; none where all stretch as much already.

    A cable a hundred thousand times as stiff as it is heavy leaves its catenary by waves of slack pieces, which no
    step gets out of; where it hangs with a thousandth of that stiffness is near where it comes to.
    """
    EA = taut * float(np.abs(balance.force(start) / balance.lever[balance.free]).sum())
    limit, softer = stiffest(balance.model), list[Balance]()
    while 0.0 < EA < limit:
        softer.append(replace(balance, model=stretching(balance.model, EA)))
        EA *= _STIFFER
    return softer


def _stiffened(ways: list[Balance], start: State, tolerance: float) -> Found:
    """Where balances lead to, each from the equilibrium of the one before."""
    there, iterations = start, 0
    for balance in ways:
        step = (_loaded if _stands(balance, there) else _hung)(balance, there, tolerance)
        there, iterations = step.state, iterations + step.iterations
    return replace(step, iterations=iterations)


def _loaded(balance: Balance, start: State, tolerance: float) -> Found:
    """Where a shape that stands by itself is brought by loads."""
    straight = Newton(balance, tolerance).run(start, 60, watch=True)
    if straight.done and straight.steady:
        return straight
    followed, share = follow(balance, start, tolerance, strict=True, watch=True)
    if not followed.done and balance.astray(start):
        followed, share = _loads_first(balance, start, followed, share, tolerance)
    if not followed.done:  # it gives way, or stays where it is and is left by itself from there on
        followed, share = follow(balance, start, tolerance, strict=True)
    if not followed.done:
        raise EquilibriumError(_gave_way(balance, followed, share), followed.state, followed.residual)
    return followed


def _hung(balance: Balance, start: State, tolerance: float) -> Found:
    """Where masses lead a shape to that does not stand by itself."""
    force = balance.force(start)
    shift = _first_shift(balance, start, force) if force.size else 0.0
    found = _softly(balance, start, shift, tolerance)
    if not found.done:
        found = follow(balance, start, tolerance, strict=False)[0]
    if shift and not (found.done and _is_meant(balance, start, found.state)):
        down = Newton(balance, tolerance, _SOFT_REACH[0], downhill=True).run(start, 240, shift)
        found = _lasting(balance, found, down)
        if not (found.done and _is_meant(balance, start, found.state)) and balance.astray(start):
            found = _lasting(balance, found, _led_there(balance, start, shift, tolerance))
    if not found.done:
        raise EquilibriumError(_complaint(balance, found), found.state, found.residual)
    return found


def _first_shift(balance: Balance, start: State, force: np.ndarray) -> float:
    """How fast masses hold at first, by the loads; where nothing is pushed yet, by what goes to its place [1/s²]."""
    load, called = float(np.abs(force / balance.lever[balance.free]).max()), balance.called_forth(start)
    pushed = load > _DUST * called
    heaviest = balance.heaviest if pushed else float(balance.felt.max())
    least = max(_ASTRAY * balance.scale(start), 1e-300)  # a trolley under a load that is lifted, which nothing pushes
    return 10.0 * max(load if pushed else called, least) / (heaviest * balance.size)


def _softly(balance: Balance, start: State, shift: float, tolerance: float) -> Found:
    """Where masses that fade lead to; by shorter steps where a slack cable, say, overshoots by several lengths."""
    found = Newton(balance, tolerance, _SOFT_REACH[0]).run(start, 240, shift)
    for reach in _SOFT_REACH[1:] if shift else ():
        if found.done:
            break
        found = Newton(balance, tolerance, reach).run(start, 480, shift)
    return found


def _is_meant(balance: Balance, start: State, found: State) -> bool:
    """Whether an equilibrium lasts, or the start is near it and lasts no better: else a machine would not stay."""
    ways = balance.unstable(found)
    return not ways or (balance.moved(found.q - start.q) < _NEAR and ways <= balance.unstable(start))


def _lasting(balance: Balance, one: Found, other: Found) -> Found:
    """Return the equilibrium that is left in fewer directions, if one of two is one."""
    lasts = other.done and (not one.done or balance.unstable(other.state) < balance.unstable(one.state))
    return other if lasts else one


def _led_there(balance: Balance, start: State, shift: float, tolerance: float) -> Found:
    """Where a machine comes to whose held coordinates are brought to their places by and by, under all its loads.

    A cable drawn straight whose end is held nearer is pressed straight by steps that bring the end there at once.
    """
    hung = Newton(balance.held_as(start), tolerance, _SOFT_REACH[0]).run(start, 240, shift)
    return follow(balance, hung.state, tolerance, strict=True, watch=True)[0] if hung.done else hung


def _loads_first(balance: Balance, start: State, found: Found, share: float, tolerance: float) -> tuple[Found, float]:
    """What the loads lead to first and what is held then; what was found if these do not lead on.

    Pressed together and loaded from the side at once, a column is loaded from the side too late.
    """
    here = balance.held_as(start)
    loaded = Newton(here, tolerance).run(start, 60, watch=True)
    if not (loaded.done and loaded.steady):
        loaded = follow(here, start, tolerance, strict=True, watch=True)[0]
    return follow(balance, loaded.state, tolerance, strict=True, watch=True) if loaded.done else (found, share)


def _stands(balance: Balance, start: State) -> bool:
    """Whether a start stands by itself: it resists every displacement, and the smallest part of the loads in earnest.

    A cable with next to no bending stiffness, drawn straight, would bend by a million times its length.
    """
    K = balance.slope(start)
    return balance.holds(start, K) and SMALLEST_PART * balance.moved(balance.linear_step(start, K)) <= 1.0


def _not_borne(ease: Eased) -> str:
    return (
        f"no equilibrium found behind the shafts of {ease}: beside them doubles hold nothing of what they drive, and "
        "behind softer ones it does not stay in one place; leave them out of ShaftElasticity: rigid, they differ by "
        "nothing that can be seen"
    )


def _gave_way(balance: Balance, found: Found, share: float) -> str:
    if turned := overturned(balance.model, found.state):
        return f"no equilibrium found: the loads carry the machine as far as {share:.4g} of them, where {turned}"
    return (
        f"no equilibrium found: brought on gradually, the loads carry the machine as far as {share:.4g} of them; there "
        f"it gives way, or may move freely (relative residual of the whole {found.residual:.3g}, worst at "
        f"{balance.worst(found.state)}). Follow it past that limit with flexctrl.equilibrium_path, or start near the "
        "shape expected"
    )


def _explained(balance: Balance, start: State, tolerance: float, failure: EquilibriumError) -> EquilibriumError:
    """A failure with the motions that the loads drive freely from the start on, unless it tells of the whole's."""
    told = isinstance(failure.state, State) and _pushed_freely(balance, failure.state)
    if told or not (driven := driven_freely(balance, start, tolerance)):
        return failure
    it, its = ("it", "its load") if len(driven) == 1 else ("them", "their loads")
    hold = ", ".join(f"{motion.lead!r}: …" for motion in driven)
    return EquilibriumError(
        f"no equilibrium found: nothing resists the motion of {', nor that of '.join(map(str, driven))}: hold {it} "
        f"(hold={{{hold}}}) or balance {its}",
        failure.state,
        failure.residual,
    )


def _complaint(balance: Balance, found: Found) -> str:
    if turned := overturned(balance.model, found.state):
        return f"no equilibrium found: {turned}"
    loose, worst = _pushed_freely(balance, found.state), balance.worst(found.state)
    free = "If the machine is free to move there, hold that coordinate"
    if loose:
        free = f"It is free in {' and '.join(loose)}, and pushed there: hold a coordinate"
    return (
        f"no equilibrium found: relative residual {found.residual:.3g}, worst at {worst}. {free} or balance its load; "
        "else try a start nearer to the shape expected, or apply the load in parts"
    )


def _pushed_freely(balance: Balance, state: State) -> list[str]:
    """The motions of the whole machine that nothing resists but a load drives."""
    model, scale, unit = balance.model, balance.scale(state), balance.unit[balance.free]
    force = unit * balance.force(state)
    K = sp.diags(unit) @ balance.among_free(balance.slope(state)) @ sp.diags(unit)
    T = model.motion.jacobian(state)[:, balance.free]
    pushed = []
    from flexctrl.model.certify import whole_body  # brings all that modes need

    for name, motion in whole_body(T, model.motion, state):
        way = motion / unit
        size = float(np.abs(way).max())
        resisted = bool((np.abs(K @ way) > 1e-6 * (abs(K) @ np.abs(way))).any())
        if not resisted and abs(float(force @ way)) > 1e-6 * scale * size * balance.size:
            pushed.append(name)
    return pushed
