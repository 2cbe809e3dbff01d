"""Corners of laws of force in compiled loops: a step ends just before one, and the next starts anew beyond.

As `flexctrl.dynamics.events.switching` does. What is out of the common (corners where a run
ends, met at once or through a sheave; steps to one that fail) is left to them.
"""

from __future__ import annotations

from flexctrl.dynamics.events.nearing import LEAST, NUDGES
from flexctrl.dynamics.march.books import accept, reach
from flexctrl.dynamics.march.closing import in_doubt
from flexctrl.dynamics.march.corners import Corners, comes_through, value, within
from flexctrl.dynamics.march.holding import lets_go
from flexctrl.dynamics.march.impact import follow_impact, stiffness
from flexctrl.dynamics.march.joining import start_anew
from flexctrl.dynamics.march.judging import chosen
from flexctrl.dynamics.march.landing import shortened
from flexctrl.dynamics.march.record import CORNER, DONE, FRESH, TURN, TURNED, March
from flexctrl.kernels.eights import eight, put
from flexctrl.kernels.native import seldom
from flexctrl.model.flat.flat import clear, keep
from flexctrl.model.flat.solving import copy_on

__all__ = ["turn_corner"]

_SHARE = 1e-4


@seldom
def turn_corner(m: March, size: float) -> int:
    """Take the step under way again, to just before the first corner that it passes, and start anew beyond that one.

    Steps are of some size from there on. Where that is not for the loops, nothing has happened.
    """
    h = m.h
    if m.corners.turning == 0 or m.leaping == 1 or m.contacts.stuck > 0:
        return CORNER
    found = shortened(m)
    end = m.h
    if not found or in_the_way(m) or (m.contacts.count > 0 and lets_go(m)):
        m.h = h
        m.phase = FRESH
        return CORNER
    m.corners.when += m.t + end
    accept(m)
    m.h = size
    flip(m.corners, m.corners.which)
    controlled = m.paced == 1 and chosen(m)
    if controlled:
        m.size = size
        m.follow = max(0, m.follow - 1)
    before = stiffness(m, -_SHARE * size) if controlled else 0.0
    if not nudged(m):
        return TURN
    turn_with_it(m)
    if controlled:
        follow_impact(m, stiffness(m, _SHARE * size) - before)
        m.h = min(size, m.cap) if m.follow > 0 else size
        m.led = m.h
    return TURNED if start_anew(m) == DONE else TURN


@seldom
def turn_with_it(m: March) -> None:
    """Change sides at the corners that the way beyond one has led over: they are met with it."""
    c = m.corners
    for k in range(c.lines + c.turns + c.rails):
        if c.last[k] == 0 and not within(c, k, value(c, m.flat, k)):
            flip(c, k)


@seldom
def flip(c: Corners, k: int) -> None:
    """Note that a corner is passed."""
    c.sides[k] = -c.sides[k]


@seldom
def in_the_way(m: March) -> bool:
    """Tell whether something other than a corner may happen over the step under way."""
    if comes_through(m.corners, m.flat):
        return True
    return m.closing.looks > 0 and in_doubt(m.closing, m.flat, m.h)


@seldom
def nudged(m: March) -> bool:
    """Go on beyond the corner, as far as needed to be sure of that; tell whether that could be."""
    c = m.corners
    f = m.flat
    span = max(LEAST * m.h, c.when - m.t)
    copy_on(f.padded, m.v, f.v)
    for _ in range(NUDGES):
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
