"""Generalised alpha in compiled loops: the error of a step, and how exactly Newton's method solves the next."""

from __future__ import annotations

import math

from flexctrl.dynamics.march.guessing import blended
from flexctrl.dynamics.march.record import CONTROLLED, SAMPLED, March
from flexctrl.dynamics.records.absurd import LOOKED_AT
from flexctrl.kernels.eights import eight, larger, largest, put, rounded

__all__ = ["chosen", "compared", "follow", "growth", "judge", "lean", "miss", "tighten"]

_QUIET = 1e-7
_LAST = 1e-14


def growth(error: float) -> float:
    """Return by what a step may be longer for an error of 1: it grows with the cube."""
    return math.pow(max(error, 1e-9), -1.0 / 3.0)


def judge(m: March) -> None:
    """Work out what errors go by: how much the method's own acceleration changes."""
    f = m.flat
    local = 0.0 * eight(m.weight)
    for i in range(0, f.padded, 8):
        own = eight(m.algorithmic[i:])
        lead = blended(m, eight(f.rate[i:]), eight(m.rate[i:]), own)
        put(m.stray[i:], abs(lead - own) * eight(m.weight[i:]))
        local = larger(local, eight(m.stray[i:]))
    m.error = largest(local)


def compared(m: March) -> float:
    """Return the error over what is allowed: in every part of the machine by how far that has been.

    Rounded as `Stepper.error` does: whether the march takes a step makes no difference to the next one.
    """
    scale = abs(m.beta - 1.0 / 6.0) * m.h * m.h
    if m.parts == 1:
        return scale * (m.error / (m.absolute + rounded(m.relative, m.reached)))
    worst = 0.0
    for i in range(m.flat.n):
        worst = max(worst, m.stray[i] / (m.absolute + rounded(m.relative, m.farthest[m.part[i]])))
    return scale * worst


def chosen(m: March) -> bool:
    """Tell whether steps are those of controlled error."""
    return m.task == CONTROLLED or (m.task == SAMPLED and m.law.pace == 0.0)


def miss(m: March) -> None:
    """Add up the local error of a step about to be accepted; as `Books.miss` does."""
    f = m.flat
    scale = (m.beta - 1.0 / 6.0) * m.h * m.h
    way = LOOKED_AT * m.h
    for i in range(0, f.padded, 8):
        own = eight(m.algorithmic[i:])
        lead = blended(m, eight(f.rate[i:]), eight(m.rate[i:]), own)
        v = eight(f.v[i:])
        a = eight(f.rate[i:])
        put(m.ahead[i:], eight(m.ahead[i:]) + scale * (lead - own) * v)
        put(m.swept[i:], eight(m.swept[i:]) + m.h * v * v)
        put(m.bent[i:], eight(m.bent[i:]) + m.h * a * a)
        put(m.path[i:], eight(m.path[i:]) + way * abs(v))


def follow(m: March) -> None:
    """Take up how far each part of the machine has been."""
    for i in range(m.flat.n):
        way = m.reach[i] * m.weight[i]
        m.farthest[m.part[i]] = max(m.farthest[m.part[i]], min(way, 1.0))


def lean(m: March, shared: float, square: float) -> None:
    """Choose the share of the last change of accelerations that the next one is expected to be."""
    m.lean = min(1.0, max(-1.0, shared / square)) if square > 0.0 else 1.0


def tighten(m: March, rough: float, steady: float, pull: float) -> None:
    """Choose Newton's tolerance for the next step.

    What he leaves kicks the rates by two over the step, while the method's own error does so by how fast it
    changes: the smoother the motion, the more exactly steps are to be solved. Changes of acceleration that turn
    back in the next step are no error to go by: they may be what he left. And what he leaves is an acceleration,
    which adds up: it is to be small beside those there are.
    """
    floor = min(m.least, max(_QUIET * m.beta * m.h * m.h * pull, _LAST))
    error = abs(m.beta - 1.0 / 6.0) * m.h * m.h * steady
    m.tolerance = min(max(floor, m.share * error * min(1.0, rough)), m.loosest)
