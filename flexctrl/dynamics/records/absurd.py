"""When energy books end a run on its way, or look closely: the same for plain steps and for compiled loops."""

from __future__ import annotations

from flexctrl.kernels.native import seldom

__all__ = [
    "ABSURD",
    "ALIKE",
    "FAR",
    "LOOKED_AT",
    "OFTEN",
    "ROUND_OFF",
    "VISIBLE",
    "absurd",
    "borne_out",
    "looking",
    "missed",
    "unlooked",
]

OFTEN = 32
"""Steps from one balance to the next; at first there is one after each."""
ABSURD = 0.5
"""Share of the energy turned over that no method makes of motion that it resolves."""
VISIBLE = 1e-3
"""Share of the machine's size that is seen to move."""
ROUND_OFF = 1e-6
"""Share of the energy at the start that may be lost in the last digits of places."""
LOOKED_AT = 4
"""Steps of which the error of one is added up: of more, it could be told from the clock."""
ALIKE = 1.1
"""Quadrature that says so many times what is lost halfway, and no more, sees what is lost."""
FAR = 4.0
"""So many times what quadrature says drag takes of rates that alternate from step to step, accelerations aside."""
_MUCH, _SLIGHT, _LITTLE = 1e-2, 1e-3, 1e-6


def looking(entered: int) -> bool:
    """Tell whether the error of a step is added up: one of four, in golden shares of the count.

    Of every fourth, what comes again every so many steps might be seen always or never.
    """
    return entered * 40503 % 65536 < 65536 // LOOKED_AT


@seldom
def absurd(entered: int, made: float, turnover: float, moved: float, start: float) -> bool:
    """Tell whether a method makes energy from nothing, a large share of all, in motion that is seen."""
    if entered < OFTEN or moved < VISIBLE:
        return False
    return made > ABSURD * turnover and made >= ROUND_OFF * abs(start)


def unlooked(entered: int, made: float, unseen: float, turnover: float) -> float:
    """Return the energy that a step may dissipate without a close look [J].

    Rates that damping should have ended within a step may swing on for many. Where a little of it in each step has
    become more, the books have made energy, as the next balance says.
    """
    if made > _SLIGHT * turnover:
        return _SLIGHT * turnover / entered
    return (_LITTLE if unseen > _MUCH * turnover else _MUCH / OFTEN) * turnover


def borne_out(lost: float, made: float, unseen: float, turnover: float) -> bool:
    """Tell whether the balance bears out what little a step has dissipated: nothing is put right then.

    ``made`` is what the books make with it [J].
    """
    return max(lost, unseen) <= _MUCH * turnover and made <= _SLIGHT * turnover


def missed(made: float, unseen: float) -> float:
    """Return what the books miss [J], of which ``made`` is what they have the method make.

    As much as has been booked of rates that damping ends within steps may never have been lost.
    """
    return max(0.0, made - unseen) if made > 0.0 else -made
