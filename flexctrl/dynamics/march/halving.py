"""A tangent in half the room: compiled loops.

Machines that fit no near cache wait for their factors. In single precision these come in half the time, and are as good
a tangent where what that takes from a correction is less than what a tangent that has been kept takes anyway. That is
measured on the first correction with each: a part a million times stiffer than it is heavy may need all digits.
"""

from __future__ import annotations

import math

from flexctrl.dynamics.march.axes import solved, solved_with
from flexctrl.dynamics.march.record import March
from flexctrl.kernels.eights import eight, larger, largest, put, total
from flexctrl.kernels.native import Reals, Singles, seldom
from flexctrl.model.flat.solving import copy_on

__all__ = ["find_correction", "halve"]

_ENOUGH = 1e-4
"""What rounding may take from a correction."""


def halve(m: March) -> None:
    """Take over a tangent that has just been made, in single precision as well; what that is worth is not known yet."""
    shorten(m.fronts.below, m.tangent.down, m.tangent.brief_down)
    shorten(m.fronts.right, m.tangent.up, m.tangent.brief_up)
    m.halved = 0 if m.attempt == 1 else -1


def shorten(count: int, x: Reals, y: Singles) -> None:
    """Copy numbers, eight at a time."""
    for i in range(0, count, 8):
        put(y[i:], eight(x[i:]))


def find_correction(m: March) -> None:
    """Solve with the tangent, in the place of the forces."""
    if m.brief > 0 and m.halved < 0:
        weigh_up(m)
    elif m.brief > 0 and m.halved == 1:
        solved_briefly(m)
    else:
        solved(m.axes, m.tangent, m.fronts, m.flat.force)


def solved_briefly(m: March) -> None:
    """Solve in single precision."""
    solved_with(m.axes, m.tangent, m.fronts, m.tangent.brief_down, m.tangent.brief_up, m.flat.force)


@seldom
def weigh_up(m: March) -> None:
    """Solve with a new tangent, and find out whether half its digits would do."""
    f = m.flat
    exact = m.stray[0:]
    copy_on(f.padded, f.force, exact)
    solved(m.axes, m.tangent, m.fronts, exact)
    solved_briefly(m)
    most = 0.0 * eight(m.weight)
    off = most
    sums = most
    for i in range(0, f.padded, 8):
        weight = eight(m.weight[i:])
        apart = abs(eight(f.force[i:]) - eight(exact[i:])) * weight
        most = larger(most, abs(eight(exact[i:])) * weight)
        off = larger(off, apart)
        sums = sums + apart
    m.halved = 1 if math.isfinite(total(sums)) and largest(off) < _ENOUGH * largest(most) else 0
    if m.halved == 0:
        copy_on(f.padded, exact, f.force)
