"""Corners of laws of force in compiled loops: a step ends just before one, and the next starts anew beyond.

As `flexctrl.dynamics.landing` and `flexctrl.dynamics.switching` do. What is out of the common (corners where a run
ends, met at once or through a sheave; steps to one that fail) is left to them.
"""

from __future__ import annotations

import math

from flexctrl.dynamics.impact import LASTING, SEEN, SMALL, STEPS
from flexctrl.dynamics.march.axes import mark, solved
from flexctrl.dynamics.march.books import accept, copy, reach
from flexctrl.dynamics.march.closing import in_doubt
from flexctrl.dynamics.march.corners import comes_through, crossed, value, within
from flexctrl.dynamics.march.flowing import released
from flexctrl.dynamics.march.jumping import jump
from flexctrl.dynamics.march.record import CONTROLLED, CORNER, DONE, FRESH, SAMPLED, SINGULAR, TURN, TURNED, March
from flexctrl.dynamics.march.step import sloped, step
from flexctrl.kernels.eights import eight, put, total
from flexctrl.kernels.native import seldom
from flexctrl.model.flat.flat import clear, drive, energy, keep, place, press_entire, push
from flexctrl.model.flat.fronts import factor, whose

__all__ = ["start_anew", "turn_corner"]

_LANDINGS, _MOST, _QUICK = 12, 60, 8
_SMALLEST, _BRIEF = 1e-12, 1e-6
_LEAD, _LEAD_MOST, _LEAD_FAR = 1e-8, 1e-7, 1e-4
_ROUND_OFF = 8.0 * 2.0**-52
_SLOPE, _TRIES = 1e-2, 9
_NUDGES, _LEAST = 8, 1e-9
_SHARE, _CLEAR = 1e-4, 1e-3
_FIRM = 1e30
"""What holds freedoms of first order, over what stands for their mass."""


@seldom
def turn_corner(m: March, size: float) -> int:
    """Take the step under way again, to just before the first corner that it passes, and start anew beyond that one.

    Steps are of some size from there on. Where that is not for the loops, nothing has happened.
    """
    h = m.h
    if m.corners.turning == 0 or m.leaping == 1 or m.contacts.count > 0:
        return CORNER
    found = shortened(m)
    end = m.h
    if not found or in_the_way(m):
        m.h = h
        m.phase = FRESH
        return CORNER
    m.corners.when += m.t + end
    accept(m)
    m.h = size
    m.corners.sides[m.corners.which] = -m.corners.sides[m.corners.which]
    chosen = m.task == CONTROLLED or (m.task == SAMPLED and m.law.pace == 0.0)
    if chosen:
        m.size = size
        m.follow = max(0, m.follow - 1)
    before = stiffness(m, -_SHARE * size) if chosen else 0.0
    if not nudged(m):
        return TURN
    if chosen:
        follow_impact(m, stiffness(m, _SHARE * size) - before)
        m.h = min(size, m.cap) if m.follow > 0 else size
        m.led = m.h
    return TURNED if start_anew(m) == DONE else TURN


@seldom
def in_the_way(m: March) -> bool:
    """Tell whether something other than a corner may happen over the step under way."""
    if comes_through(m.corners, m.flat):
        return True
    return m.closing.looks > 0 and in_doubt(m.closing, m.flat, m.h)


# -- where


@seldom
def shortened(m: March) -> bool:
    """Take steps that end just before the first corner passed; on a shorter step that may be another one."""
    whole = m.h
    for _ in range(_LANDINGS):
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
    copy(f.padded, f.step, c.step)
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

    The time left to the corner is in ``when``. As in `landing`: only an end on this side tells when the corner is.
    """
    c = m.corners
    dust = c.dust[c.which]
    lead = max(_LEAD * h, _ROUND_OFF * (m.t + h))
    low = 0.0
    high = h
    ahead = 0.0
    behind = 0.0
    back = lead
    at = guess - lead
    best = 0.0
    last = -1.0
    before = 0.0
    for count in range(_MOST):
        if at <= _SMALLEST * h or high - low <= max(_LEAD_MOST * h, lead):
            break
        if not towards(m, at):
            return False
        end = m.h
        above = distance(m) - dust
        off = time_left(m) if above > 0.0 or last < 0.0 else 0.0
        on = off
        if last >= 0.0:
            on = above * (end - last) / (before - above) if before != above else math.nan
        missed = above > 0.0 and end < at - lead  # no step ends there
        before = above
        if above > 0.0:
            low = end
            ahead = above
            high = at if missed else high
            last = end
            best = end
            back = lead
            c.when = max(off, 0.0)
            near = off * above / (above + dust)
            if near >= 0.0 and near <= max((_LEAD_FAR if missed else _LEAD_MOST) * h, lead):
                return True
            at = end + on - lead
        else:
            high = at
            behind = above
            last = at
            back = 4.0 * back
            at = at + on - back
        at = inside(low, high, ahead, behind, at, count + 1)
    if not (best > 0.0 and towards(m, best)):
        return False
    c.when += best - m.h
    return distance(m) > dust


@seldom
def inside(low: float, high: float, ahead: float, behind: float, at: float, count: int) -> float:
    """Return a time if it is between two; else where a straight line is zero, or the middle."""
    if count >= _QUICK:
        return 0.5 * (low + high)
    if not (low < at and at < high) and ahead > 0.0 and behind < 0.0:
        at = low + (high - low) * ahead / (ahead - behind)
    return at if low < at and at < high else 0.5 * (low + high)


@seldom
def towards(m: March, h: float) -> bool:
    """Take a step to a corner, or just short of it: where a force jumps there, no step ends on it."""
    for k in range(_TRIES):
        m.h = h * (1.0 - shorter(k))
        m.phase = FRESH
        if step(m) == DONE:
            reach(m)
            return True
    return False


@seldom
def shorter(k: int) -> float:
    """Return by what share a step is shorter in a try."""
    if k < 2:
        return 1e-9 * float(k)
    if k < 6:
        return math.pow(10.0, float(2 * k - 12))
    return 0.05 if k == 6 else 0.2 if k == 7 else 0.5


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
    copy(f.padded, f.step, c.step)
    here = distance(m)
    part_way(m, 1.0 - _SLOPE)
    slope = (here - distance(m)) / (_SLOPE * m.h)
    copy(f.padded, c.step, f.step)
    reach(m)
    return -here / slope if slope != 0.0 else 0.0


# -- beyond


@seldom
def nudged(m: March) -> bool:
    """Go on beyond the corner, as far as needed to be sure of that; tell whether that could be."""
    c = m.corners
    f = m.flat
    span = max(_LEAST * m.h, c.when - m.t)
    copy(f.padded, m.v, f.v)
    for _ in range(_NUDGES):
        for i in range(0, f.padded, 8):
            put(f.step[i:], span * eight(m.v[i:]))
        reach(m)
        if c.sides[c.which] * value(c, f, c.which) > c.dust[c.which]:
            keep(f)
            return True
        span *= 4.0
    clear(f.padded, f.step)
    reach(m)
    return False


@seldom
def stiffness(m: March, t: float) -> float:
    """Return v·K v for the rates v, told from forces on the way to a time from now."""
    f = m.flat
    there = along_rates(m, t, 0.0)
    further = along_rates(m, 2.0 * t, 0.0)
    here = along_rates(m, 0.0, 0.0)
    clear(f.padded, f.step)
    reach(m)
    return (3.0 * here - 4.0 * there + further) * (0.5 / t)


@seldom
def along_rates(m: March, t: float, share: float) -> float:
    """Return the power of all forces where the rates lead within a time, with accelerations that are a share of them.

    Rates are as they are now.
    """
    f = m.flat
    for i in range(0, f.padded, 8):
        put(f.step[i:], t * eight(m.v[i:]))
        put(f.v[i:], eight(m.v[i:]))
        put(f.rate[i:], share * eight(m.v[i:]))
    press_all(m)
    power = 0.0 * eight(m.weight)
    f.force[f.n] = 0.0
    for i in range(0, f.padded, 8):
        power = power + eight(f.force[i:]) * eight(m.v[i:])
    return total(power)


@seldom
def follow_impact(m: March, stiffer: float) -> None:
    """Follow an impact by short steps, where these would not see it; see `flexctrl.dynamics.impact.lasts`."""
    mass = along_rates(m, 0.0, 0.0) - along_rates(m, 0.0, 1.0)
    clear(m.flat.padded, m.flat.step)
    reach(m)
    m.follow = 0
    m.cap = 0.0
    if not (stiffer > 0.0 and mass > 2.0 * SMALL * m.turnover):
        return
    period = math.sqrt(mass / stiffer)
    deep = False
    for i in range(m.flat.n):
        allowed = m.absolute + m.relative * (m.reached if m.parts == 1 else m.farthest[m.part[i]])
        deep = deep or abs(m.v[i]) * period * m.weight[i] >= SEEN * allowed
    if not deep:
        m.follow = LASTING
        m.cap = period / STEPS


@seldom
def start_anew(m: March) -> int:
    """Find the accelerations under the law of force that holds from now on, and the method's own.

    The lead of these on the true ones is (α_m − α_f) h times the rate of the accelerations; see `alpha.Stepper.join`.
    """
    f = m.flat
    m.made_for = -1.0
    m.lean = 1.0
    clear(f.padded, m.trend)
    clear(f.padded, f.step)
    copy(f.padded, m.v, f.v)
    reach(m)
    m.unsure = 1
    status = jump(m)
    m.unsure = 0
    if status != DONE:
        return status
    clear(f.padded, f.step)
    copy(f.padded, m.v, f.v)
    copy(f.padded, m.rate, f.rate)
    at_rest_in(m)
    if m.losing == 1:
        energy(f)
        m.power = f.books[2]
    if not firm(m):
        return SINGULAR
    forces_change(m)
    at_rest_in(m)
    give_lead(m)
    return DONE


@seldom
def at_rest_in(m: March) -> None:
    """Put nodes and drives where the march stands."""
    place(m.flat)
    drive(m.flat)


@seldom
def firm(m: March) -> bool:
    """Factorise the forces that answer accelerations over a step, in the place of the tangent; tell if that can be."""
    f = m.flat
    clear(f.padded, f.rate)
    if m.probes.groups > 0:  # differences are not to reach back over the corner
        for i in range(0, f.padded, 8):
            put(f.step[i:], _CLEAR * m.h * eight(m.v[i:]))
    at_rest_in(m)
    sloped(m, 1.0, m.gamma / (m.beta * m.h), 1.0 / (m.beta * m.h * m.h))
    clear(f.padded, f.step)
    copy(f.padded, m.rate, f.rate)
    for k in range(m.flows.count):
        m.entries[m.flows.cells[k]] = -_FIRM * m.flows.mass
    where = factor(m.fronts, m.entries, m.tangent.diagonal, m.tangent.down, m.tangent.up)
    m.made_for = -1.0
    if where >= 0:
        m.worst = whose(m.fronts, where)
        return False
    m.factorisations += 1
    mark(m.axes, m.tangent, f)
    return True


@seldom
def forces_change(m: March) -> None:
    """Work out how fast forces change, as the motion goes on with its accelerations: in the place of the forces."""
    c = m.corners
    f = m.flat
    t = _SHARE * m.h
    forces_in(m, 0.0)
    for i in range(0, f.padded, 8):
        put(c.change[i:], -3.0 * eight(f.force[i:]))
    forces_in(m, t)
    for i in range(0, f.padded, 8):
        put(c.change[i:], eight(c.change[i:]) + 4.0 * eight(f.force[i:]))
    forces_in(m, 2.0 * t)
    for i in range(0, f.padded, 8):
        put(c.change[i:], (eight(c.change[i:]) - eight(f.force[i:])) * (0.5 / t))
    clear(f.padded, f.step)
    copy(f.padded, m.v, f.v)


@seldom
def forces_in(m: March, t: float) -> None:
    """Sum up the forces a time later."""
    f = m.flat
    for i in range(0, f.padded, 8):
        put(f.step[i:], t * eight(m.v[i:]))
        put(f.v[i:], eight(m.v[i:]) + t * eight(m.rate[i:]))
    press_all(m)


@seldom
def press_all(m: March) -> None:
    """Sum up the forces of the motion under way."""
    f = m.flat
    if m.whole == 1:
        press_entire(f)
        return
    place(f)
    drive(f)
    push(f)


@seldom
def give_lead(m: March) -> None:
    """Give the method's own accelerations their lead."""
    c = m.corners
    f = m.flat
    released(m.flows, c.change)
    copy(f.padded, c.change, f.force)
    f.force[f.n] = 0.0
    solved(m.axes, m.tangent, m.fronts, f.force)
    released(m.flows, f.force)
    share = (m.alpha_f - m.alpha_m) / (m.beta * m.h)
    for i in range(0, f.padded, 8):
        put(m.algorithmic[i:], eight(m.rate[i:]) + share * eight(f.force[i:]))
