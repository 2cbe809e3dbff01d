"""Generalised alpha in compiled loops: many steps of one length, of controlled error, from sample to sample."""

from __future__ import annotations

import math

from flexctrl.dynamics.events.nearing import SHORTEST, SMALLEST
from flexctrl.dynamics.march.answering import commanded, strayed_off, take
from flexctrl.dynamics.march.books import accept, draw, drawn_now, reach, settle, shelve, unseen
from flexctrl.dynamics.march.closing import in_doubt
from flexctrl.dynamics.march.corners import passes
from flexctrl.dynamics.march.gliding import back, glide, land, leap, level
from flexctrl.dynamics.march.guessing import restore
from flexctrl.dynamics.march.holding import lets_go
from flexctrl.dynamics.march.joining import lengthen, started
from flexctrl.dynamics.march.judging import compared, growth, judge
from flexctrl.dynamics.march.jumping import jump, weighed
from flexctrl.dynamics.march.law import Law, enter_inputs, enter_leg, obeyed, said
from flexctrl.dynamics.march.record import (
    CONTROLLED,
    CORNER,
    DONE,
    FIXED,
    FRESH,
    JUMP,
    REFACTOR,
    REMADE,
    SAMPLED,
    SETTLE,
    SHORT,
    SILENT,
    SINGULAR,
    START,
    WANTS_MASS,
    WANTS_TANGENT,
    WEIGHED,
    March,
)
from flexctrl.dynamics.march.siding import decided
from flexctrl.dynamics.march.step import refactored, sloped, step, to_rate, to_v
from flexctrl.dynamics.march.turning import start_anew, turn_corner
from flexctrl.dynamics.swift.thrown import AT_HAND
from flexctrl.kernels.native import seldom
from flexctrl.model.flat.flat import energy

__all__ = ["run"]


@seldom
def run(m: March) -> int:
    """Do the task that is set."""
    status = task(m)
    if m.lags.count > 0 and m.phase == FRESH:
        restore(m)
    if m.leaping == 1 and m.leap.aloft == 1:
        land(m)
    return status


@seldom
def task(m: March) -> int:
    """Do it, maybe on modal states alone."""
    if m.task == FIXED:
        return fixed(m)
    if m.paced == 1 and m.task == CONTROLLED:
        return controlled(m)
    if m.paced == 1 and m.task == SAMPLED:
        return sampled(m)
    if m.task == JUMP:
        return jump(m)
    if m.task == START:
        return started(m)
    if m.task == SETTLE:
        return settle(m)
    if m.task == REMADE or m.task == WEIGHED:
        return made_again(m)
    return refactored(m) if m.task == REFACTOR else weighed(m)


@seldom
def made_again(m: March) -> int:
    """Make a matrix again in the workspace in which it was made."""
    if m.task == WEIGHED:
        sloped(m, 0.0, 0.0, 1.0)
        return weighed(m)
    sloped(m, 1.0, to_v(m), to_rate(m))
    return refactored(m)


def sampled(m: March) -> int:
    """Go from sample to sample of the law as long as there is room, and as it says numbers."""
    law = m.law
    while True:
        if law.away == 0 and not set_out(m, law):
            return DONE
        status = fixed(m) if law.pace > 0.0 else hurried(m)
        if status == WANTS_TANGENT:
            return status
        if status == WANTS_MASS:
            return status
        law.away = 0
        if m.done > law.start:
            enter_leg(law, m.done - law.start)
            enter_inputs(law, law.start, m.done)
        there = m.done == m.wanted if law.pace > 0.0 else m.stop - m.t <= 1e-12 * m.until
        if status != DONE or not there:
            return status
        m.t = m.stop
        m.rows[(1 + m.gauges.outputs) * (m.done - 1)] = m.stop
        if m.stop >= law.nearly:
            return DONE
        if not said(law, m.rows[(1 + m.gauges.outputs) * (m.done - 1) + 1 :]):
            return SILENT
        law.passed += 1
        if obeyed(law):
            m.jumping = 1
        enter_inputs(law, m.done - 1, m.done)


def set_out(m: March, law: Law) -> bool:
    """Set out for the next sample; tell whether there is room."""
    m.stop = float(law.passed + 1) * law.period
    if m.stop > law.last or law.legs >= law.wanted or law.passed - law.first >= law.samples:
        return False
    if law.pace > 0.0:
        wanted = math.ceil((m.stop - m.t) / law.pace - 1e-6) + 0.0
        count = max(1, int(wanted))
        if m.done + count > law.room:
            return False
        m.h = (m.stop - m.t) / float(count)
        m.wanted = m.done + count
        law.size = m.h
    else:
        if m.done >= law.room:
            return False
        m.wanted = law.room
        law.size = m.size
    law.away = 1
    law.start = m.done
    law.begun = m.t
    return True


def hurried(m: March) -> int:
    """Let the inputs jump if they are to, then take steps of controlled error."""
    if m.jumping == 1:
        if m.flows.count > 0 or m.throws == 1:
            m.h = m.size
        status = jump(m)
        if status != DONE:
            return status
        m.jumping = 0
    return controlled(m)


def fixed(m: March) -> int:
    """Take steps of one length until all wanted are done or no state can be kept; or one needs a tangent or fails.

    Inputs that are told to jump do so first.
    """
    if m.leaping == 1 and m.leap.gliding == 1 and m.keeping == 0:
        return glided(m)
    if m.jumping == 1:
        status = jump(m)
        if status != DONE:
            return status
        m.jumping = 0
    if m.throws == 1 and m.leaping == 0 and m.taken > 0.0 and m.h > AT_HAND * m.taken:
        lengthen(m)
    m.taken = m.h
    while m.done < m.wanted and m.kept < m.shelf and m.absurd == 0:
        status = advanced(m)
        if status != DONE:
            return status
        if m.watching == 1 and passes(m.corners, m.flat):
            if m.answering == 1:
                return CORNER
            if m.leaping == 1:
                back(m)
            return turn_corner(m, m.h)
        if m.closing.looks > 0 and in_doubt(m.closing, m.flat, m.h):
            return CORNER
        if m.contacts.count > 0 and lets_go(m):
            return CORNER
        accepted(m)
    return DONE


def advanced(m: March) -> int:
    """Solve a step, and put nodes where it ends if that is looked at."""
    if m.leaping == 1:
        status = leap(m)
    elif m.answering == 1:
        status = commanded(m)
    else:
        status = step(m)
    if status != DONE or unseen(m):
        return status
    reach(m)
    if m.corners.jumping == 0 or m.leaping == 1 or m.answering == 1:
        return DONE
    return decided(m)


def accepted(m: March) -> None:
    """Go on to the end of the step."""
    if m.answering == 1:
        take(m)
    accept(m)


def glided(m: March) -> int:
    """Take exact steps of one length on modal states alone, but where a state is to be kept."""
    m.jumping = 0
    while m.done < m.wanted and m.kept < m.shelf and m.absurd == 0:
        status = glide(m)
        if status != DONE:
            return status
        if drawn_now(m):
            level(m)
            energy(m.flat)
            draw(m)
        if m.t >= m.due:
            land(m)
            shelve(m)
    return DONE


def controlled(m: March) -> int:
    """Take steps of controlled error until all wanted are done, the stop is reached or the end would be passed."""
    again = False
    while m.done < m.wanted and m.kept < m.shelf and m.absurd == 0 and m.stop - m.t > 1e-12 * m.until:
        if m.phase == FRESH:
            if not again:
                m.tried = m.size
                m.refused = m.rejected
            m.h = m.size if again else fitted(min(capped(m), m.largest), m.stop - m.t)
            if m.t + m.h > m.until * (1.0 + 1e-12):
                return DONE
            if m.led > 0.0 and m.h != m.led and not led(m):
                return unmarched(m)
        if m.h < SMALLEST * max(SHORTEST * m.until, m.t):
            return SHORT
        status = advanced(m)
        if status == WANTS_TANGENT:
            return status
        if status == SINGULAR:
            return status
        if status != DONE and m.answering == 1 and m.answer.spoken == 1:  # a law that jumps is for plain steps
            return unmarched(m)
        error = 0.0
        if status == DONE:
            judge(m)
            error = max(compared(m), strayed_off(m)) if m.answering == 1 else compared(m)
        again = status != DONE or error > 1.0
        if again:
            m.rejected += 1
            m.size = 0.25 * m.h if status != DONE else m.h * max(0.2, 0.9 * growth(error))
            continue
        grown = grown_by(m, 0.9 * growth(error))
        if m.watching == 1 and passes(m.corners, m.flat):
            if m.answering == 1:
                return unmarched(m)
            status = turn_corner(m, grown)
            return unmarched(m) if status == CORNER else status
        if m.closing.looks > 0 and in_doubt(m.closing, m.flat, m.h):
            return unmarched(m)
        if m.contacts.count > 0 and lets_go(m):
            return unmarched(m)
        m.size = grown
        m.led = 0.0
        m.follow = max(0, m.follow - 1)
        accepted(m)
    return DONE


def grown_by(m: March, factor: float) -> float:
    """Return the length of the next step where the error of this one would let it grow by a factor."""
    if factor > 1.3 and m.h > 0.5 * m.size:
        return m.h * min(2.5, factor)
    return m.h * factor if factor < 1.0 else m.size


def unmarched(m: March) -> int:
    """Leave a step to be taken by itself, as if it had not been tried."""
    m.size = m.tried
    m.rejected = m.refused
    return CORNER


@seldom
def led(m: March) -> bool:
    """Start anew at the corner where the march stands, for a step of another length; tell whether that could be."""
    m.led = m.h
    return m.corners.turning == 1 and start_anew(m) == DONE


def capped(m: March) -> float:
    """Return the next step, short enough to follow an impact."""
    return min(m.size, m.cap) if m.follow > 0 else m.size


def fitted(h: float, left: float) -> float:
    """Return a step that ends at the stop or leaves room for another."""
    if h > 0.99 * left:
        return left
    return 0.5 * left if h > 0.5 * left else h
