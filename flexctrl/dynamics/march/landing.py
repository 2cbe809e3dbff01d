"""Steps that end just before a corner of a law of force, in compiled loops; as `dynamics.events.landing` has them.

What is out of the common (corners where a run ends, or met at once) is left to plain steps.
"""

from __future__ import annotations

import math

from flexctrl.dynamics.events.nearing import (
    ASTRAY,
    LANDINGS,
    LEAD,
    LEAD_MOST,
    MOST,
    SMALLEST,
    TRIES,
    Bracket,
    inside,
    narrow,
    near_enough,
    shorter,
    to_zero,
)
from flexctrl.dynamics.march.books import reach
from flexctrl.dynamics.march.corners import crossed, value, within
from flexctrl.dynamics.march.record import DONE, FRESH, March
from flexctrl.dynamics.march.siding import decided
from flexctrl.dynamics.march.step import step
from flexctrl.kernels.eights import eight, put
from flexctrl.kernels.native import seldom
from flexctrl.model.flat.solving import copy_on

__all__ = ["shortened"]


_BRIEF = 1e-6
_SLOPE = 1e-2
_ROUND_OFF = 8.0 * 2.0**-52


@seldom
def shortened(m: March) -> bool:
    """Take steps that end just before the first corner passed; on a shorter step that may be another one."""
    whole = m.h
    for _ in range(LANDINGS):
        h = m.h
        met = first_met(m)
        if met < 0.0 or not short_of(m, met, h):
            return False
        if crossed(m.corners, m.flat) < 0:
            return m.h + m.corners.when >= _BRIEF * whole
    return False


@seldom
def first_met(m: March) -> float:
    """Find the corner that the step under way passes first; return when, −1 if that is not for the loops.

    The motion over the step is taken for cubic, how far it is from a corner for a parabola through the values at both
    ends and in the middle.
    """
    c = m.corners
    f = m.flat
    earliest = 2.0
    copy_on(f.padded, f.step, c.step)
    for k in range(c.lines + c.turns + c.rails):
        part_way(m, 1.0)
        end = c.sides[k] * value(c, f, k)
        if not within(c, k, value(c, f, k)):
            part_way(m, 0.0)
            start = c.sides[k] * value(c, f, k)
            if c.last[k] == 1 or not start > c.dust[k]:
                return -1.0
            part_way(m, 0.5)
            share = zero_of(start, c.sides[k] * value(c, f, k), end, c.dust[k])
            if share < earliest:
                earliest = share
                c.which = k
    return earliest * m.h if earliest <= 1.0 else -1.0


@seldom
def part_way(m: March, share: float) -> None:
    """Put nodes where they are after a share of the step."""
    f = m.flat
    s = share
    for i in range(0, f.padded, 8):
        way = eight(m.corners.step[i:])
        start = m.h * eight(m.v[i:])
        end = m.h * eight(f.v[i:])
        put(f.step[i:], s * (start + s * ((3.0 * way - 2.0 * start - end) + s * (start + end - 2.0 * way))))
    reach(m)


@seldom
def zero_of(start: float, middle: float, end: float, dust: float) -> float:
    """Return where the parabola through three values is zero: in the first half if that is over by its end."""
    early = middle < -dust
    slope = 4.0 * middle - 3.0 * start - end
    if not early:
        slope = end - start
    bend = 2.0 * (start - 2.0 * middle + end)
    at = start if early else middle
    root = math.sqrt(max(slope * slope - 4.0 * bend * at, 0.0))
    q = -0.5 * (slope + root if slope > 0.0 else slope - root)
    s = at / q if q != 0.0 else 0.25
    if not (s >= 0.0 and s <= 0.5):
        s = q / bend if bend != 0.0 else 0.25
    if not (s >= 0.0 and s <= 0.5):
        s = 0.25
    return s if early else 0.5 + s


@seldom
def short_of(m: March, guess: float, h: float) -> bool:
    """Take steps that end ever nearer to a corner, on this side of it; tell whether the last one does so.

    The time left to the corner is in ``when``. Only an end on this side tells when the corner is.
    """
    c = m.corners
    b = c.bracket
    opened(b, h)
    dust = c.dust[c.which]
    lead = max(LEAD * h, _ROUND_OFF * (m.t + h))
    back = lead
    at = guess - lead
    best = 0.0
    last = -1.0
    before = 0.0
    for _ in range(MOST):
        if at <= SMALLEST * h or b.high - b.low <= max(LEAD_MOST * h, lead):
            break
        if not towards(m, at):
            return False
        end = m.h
        above = distance(m) - dust
        off = time_left(m) if above > 0.0 or last < 0.0 else 0.0
        on = to_zero(last, before, end, above) if last >= 0.0 else off
        missed = above > 0.0 and end < at - lead  # no step ends there
        before = above
        narrow(b, end if above > 0.0 else at, above)
        if above > 0.0:
            b.high = at if missed else b.high
            last = end
            best = end
            back = lead
            c.when = max(off, 0.0) if off < math.inf else 0.0
            if near_enough(off * above / (above + dust), h, lead, missed):
                return True
            at = inside(b, end + (off if missed else on) - lead)
        else:
            last = at
            back = 4.0 * back
            at = inside(b, at + on - back)
    if not (best > 0.0 and towards(m, best)):
        return False
    c.when += best - m.h
    return distance(m) > dust and c.when <= ASTRAY * h


@seldom
def opened(b: Bracket, h: float) -> None:
    """Begin with a whole step."""
    b.low = 0.0
    b.high = h
    b.ahead = 0.0
    b.behind = 0.0
    b.count = 0


@seldom
def towards(m: March, h: float) -> bool:
    """Take a step to a corner, or just short of it: where a force jumps there, no step ends on it."""
    m.exact = 1
    done = False
    k = 0
    while k < TRIES and not done:
        m.h = h * (1.0 - shorter(k))
        m.phase = FRESH
        done = step(m) == DONE
        if done:
            reach(m)
            done = decided(m) == DONE
        k += 1
    m.exact = 0
    return done


@seldom
def distance(m: March) -> float:
    """Return how far from the corner the step ends; below zero it has passed it."""
    c = m.corners
    return c.sides[c.which] * value(c, m.flat, c.which)


@seldom
def time_left(m: March) -> float:
    """Return how much later than at the end of the step the corner is met, by the slope there."""
    c = m.corners
    f = m.flat
    copy_on(f.padded, f.step, c.step)
    here = distance(m)
    part_way(m, 1.0 - _SLOPE)
    slope = (here - distance(m)) / (_SLOPE * m.h)
    copy_on(f.padded, c.step, f.step)
    reach(m)
    return -here / slope if slope != 0.0 else math.inf
