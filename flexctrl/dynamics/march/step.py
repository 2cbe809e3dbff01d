"""Generalised alpha in compiled loops: one step.

The method, its Newton iterations and its tests are those of `alpha.steps`, but for the tangent, which is kept longer
(see `march.axes`), and for Newton's tolerance, which is a share of the method's own error.
"""

from __future__ import annotations

import math

from flexctrl.dynamics.alpha.newton import ASTRAY, ITERATIONS, POOR, small_enough, wanted
from flexctrl.dynamics.march.axes import mark, turned_too_far
from flexctrl.dynamics.march.contacts import feel, firmness
from flexctrl.dynamics.march.corners import tell_sides
from flexctrl.dynamics.march.guessing import cone, predict
from flexctrl.dynamics.march.halving import find_correction, halve
from flexctrl.dynamics.march.holding import held
from flexctrl.dynamics.march.probing import probe
from flexctrl.dynamics.march.record import (
    CORRECT,
    DONE,
    EVALUATE,
    FAILED,
    FRESH,
    SINGULAR,
    WANTS_TANGENT,
    March,
)
from flexctrl.dynamics.swift.stiff_lines import SHORT, STIFF, SURE, TURNING
from flexctrl.kernels.eights import eight, larger, largest, put, total
from flexctrl.kernels.native import seldom
from flexctrl.model.flat.flat import (
    accelerate,
    drive,
    load,
    place,
    press_entire,
    press_tiles,
    push,
    tangent,
)
from flexctrl.model.flat.fronts import factor, whose

__all__ = ["newton", "press_all", "refactored", "sloped", "step", "to_rate", "to_v"]

_TURNED = 0.1
_TRUSTED = 8
_SECOND = 0.5
"""Of the first correction: tension answers what bends, and the third is small all the same. Round-off never shrinks."""
_FINEST = 1e-12
"""Increments of probes in a step that has failed, at the least."""
_PATIENCE = 500
"""Steps until the mass is tried again for the tangent."""
_HABIT = 0.002
_MOST = 2.0
"""Coning by a correction is left out where it cannot come to more than a tenth of Newton's tolerance: 10 · 2 η."""


def step(m: March) -> int:
    """Solve a step, once more with tangents made anew if need be; after `refactored` it goes on where it was."""
    while True:
        if m.phase == FRESH:
            predict(m)
        status = newton(m)
        if status == WANTS_TANGENT:
            return status
        m.phase = FRESH
        if status != DONE and m.swift == 1:
            m.swift = -_PATIENCE
            load(m.flat)
        if status == DONE or m.attempt == 1:
            m.attempt = 0
            m.worst = m.worst if status == SINGULAR else foremost(m)
            return status
        m.attempt = 1


def newton(m: March) -> int:
    """Iterate until the step is solved."""
    while m.iteration < ITERATIONS:
        if m.swift == 1:
            lag(m)
        elif m.phase != CORRECT:
            if m.phase == EVALUATE:
                press_all(m)
            m.phase = CORRECT
            if m.attempt == 1 or wary(m) or poor(m) or (m.iteration == 0 and stale(m)):
                status = sloped_here(m)
                if status != DONE:
                    return status
        m.phase = EVALUATE
        size = correct(m)
        if not math.isfinite(size) or m.strayed > ASTRAY:
            m.last = size if math.isfinite(size) else math.inf
            return FAILED
        m.contraction = size / m.last if math.isfinite(m.last) else 0.0
        m.last = size
        if m.swift == 1 and m.contraction > POOR:
            return FAILED
        if m.contraction > 2.0 and m.iteration > 3 and not wary(m):
            return FAILED
        if wary(m):
            if sure(m, size):
                return DONE
        elif converged(m, size):
            reckon(m)
            return DONE
        m.iteration += 1
    return FAILED


def poor(m: March) -> bool:
    """Tell whether corrections shrink too slowly; the second may be what the first has called forth elsewhere."""
    return m.contraction > (POOR if m.iteration > 2 else _SECOND)


def press_all(m: March) -> None:
    """Sum up the forces of the motion under way."""
    f = m.flat
    if m.whole == 1:
        press_entire(f)
        return
    if f.tiles.count > 0 and m.contacts.count == 0:
        press_tiles(f)
        return
    place(f)
    drive(f)
    if m.contacts.count > 0 and m.contacts.stuck > 0:
        feel(m.contacts, f)
    push(f)


def sloped_here(m: March) -> int:
    """Make the tangent anew where the iteration stands, or ask for it."""
    m.last = m.last if wary(m) else math.inf
    if m.whole == 1:
        place(m.flat)
        drive(m.flat)
    if m.asking == 1:
        return WANTS_TANGENT
    sloped(m, 1.0, to_v(m), to_rate(m))
    return refactored(m)


def lag(m: March) -> None:
    """Find the Newton step with the mass for the tangent: how far accelerations are from those of the end."""
    f = m.flat
    accelerate(f)
    pull = 1.0 / to_rate(m)
    for i in range(0, f.padded, 8):
        put(f.force[i:], pull * (eight(f.rate[i:]) - eight(f.answer[i:])))


@seldom
def sloped(m: March, on_place: float, on_rate: float, on_acceleration: float) -> None:
    """Fill in the slope of the forces for motions that add these times an increment."""
    if m.probes.groups > 0:
        least = _FINEST if m.attempt == 1 else 1.0
        probe(m.probes, m.flat, m.corners, m.whole, on_place, on_rate, on_acceleration, least, m.entries)
    else:
        if m.fronts.beyond > 0:  # levers turn under the forces they carry
            push(m.flat)
        tangent(m.flat, on_place, on_rate, on_acceleration, m.entries)


def foremost(m: March) -> int:
    """Return the degree of freedom with the largest correction in the last iteration, or one that is not finite."""
    f = m.flat
    for i in range(f.n):
        if not abs(f.force[i]) * m.weight[i] < m.last:
            return i
    return 0


def to_v(m: March) -> float:
    """Return what an increment of the step adds to the rates at its end."""
    return m.gamma / (m.h * m.beta)


def to_rate(m: March) -> float:
    """Return what an increment of the step adds to the accelerations at its end."""
    return (1.0 - m.alpha_m) / (m.h * m.h * m.beta * (1.0 - m.alpha_f))


def wary(m: March) -> bool:
    """Tell whether lines are too stiff for tangents that were not made where the iteration stands.

    What a stiff line gives way by is nothing to be seen, but its force, seen from where it pointed before, has a share
    across it that moves the machine.
    """
    return m.h * m.firmest > STIFF and m.swift != 1


def sure(m: March, size: float) -> bool:
    """Tell whether a correction of this size was the last that stiff lines need; the last is never a short one.

    What goes back and forth between a slack rope and a taut one goes a little less far from then on.
    """
    if small_enough(size, m.contraction, min(m.tolerance, SURE), m.exact == 1):
        last = m.short == 0.0
        m.short = 0.0
        return last
    if m.contraction > TURNING and m.iteration > 1:
        m.short = SHORT
    return False


def reckon(m: March) -> None:
    """Enter the iterations of a step in the account of the tangent."""
    m.served += 1
    m.spent += m.iteration + 1.0
    m.lately = m.iteration + 1.0


def stale(m: March) -> bool:
    """Tell whether the tangent is of another step length or of another shape, or no longer worth keeping.

    It is worth that until steps take more than they did on average since it was made, what it cost included: so
    the average is the least possible.
    """
    if not abs(m.h - m.made_for) <= 1e-6 * m.h or m.lately * m.served > m.spent:
        return True
    return turned_too_far(m.axes, m.tangent, m.flat, _TURNED)


@seldom
def refactored(m: March) -> int:
    """Factorise the tangent that has been filled in for the present end of the step."""
    where = factor(m.fronts, m.entries, m.tangent.diagonal, m.tangent.down, m.tangent.up)
    m.made_for = -1.0
    if where >= 0:
        m.worst = whose(m.fronts, where)
        return SINGULAR
    m.factorisations += 1
    m.made_for = m.h
    m.habit = 0.0
    m.served = 0
    m.spent = m.price
    m.lately = 0.0
    if m.brief > 0:
        halve(m)
    mark(m.axes, m.tangent, m.flat)
    tell_sides(m.corners, m.flat)
    return DONE


def converged(m: March, size: float) -> bool:
    """Tell whether a correction of this size was the last that is needed.

    A first correction is believed to be followed by ones as much smaller as those of the steps before; now and
    then that is looked at again.
    """
    if m.contraction > 0.0:
        m.habit = max(m.contraction, max(m.habit, _HABIT))
        m.trusted = 0
    if small_enough(size, m.contraction, m.tolerance, m.exact == 1):
        return True
    tolerance = wanted(m.tolerance, m.exact == 1)
    if m.contraction > 0.0:
        return m.contraction < 1.0 and size * m.contraction <= 0.5 * tolerance
    if m.habit > 0.0 and m.trusted < _TRUSTED and size * m.habit <= 0.25 * tolerance:
        m.trusted += 1
        return True
    return False


def correct(m: March) -> float:
    """Take a Newton step, found in the place of the forces; return its size, NaN where it is not finite."""
    f = m.flat
    if m.swift != 1:
        f.force[f.n] = 0.0
        find_correction(m)
        if (
            m.contacts.count > 0
            and m.contacts.stuck > 0
            and not held(m, m.tangent, 1.0 / firmness(m.contacts, to_v(m), to_rate(m)))
        ):
            return math.nan
    speed = to_v(m)
    pull = to_rate(m)
    most = 0.0 * eight(m.weight)
    sums = most
    turn = most
    for i in range(0, f.padded, 8):
        change = (1.0 - m.short) * eight(f.force[i:])
        put(f.step[i:], eight(f.step[i:]) - change)
        put(f.v[i:], eight(f.v[i:]) - speed * change)
        put(f.rate[i:], eight(f.rate[i:]) - pull * change)
        sizes = abs(change) * eight(m.weight[i:])
        most = larger(most, sizes)
        sums = sums + sizes
        turn = larger(turn, abs(change) * eight(m.turns[i:]))
    m.newton += 1
    turned = largest(turn)
    m.strayed += turned
    if _MOST * m.h * m.h * m.fastest * speed * turned > m.tolerance:
        cone(m, f.force, (1.0 - m.short) * speed, 0, m.coning)
    return largest(most) if math.isfinite(total(sums)) else math.nan
