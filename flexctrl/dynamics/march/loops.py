"""Generalised alpha in compiled loops: many steps, their books and records; jumps of the inputs."""

from __future__ import annotations

import math

from flexctrl.dynamics.easing import eased_change, eased_rate, unresolved
from flexctrl.dynamics.march.axes import mark, solved, turned_too_far
from flexctrl.dynamics.march.clock import later
from flexctrl.dynamics.march.closing import in_doubt, settled
from flexctrl.dynamics.march.corners import passes
from flexctrl.dynamics.march.flowing import flow_on, pivot, released
from flexctrl.dynamics.march.gliding import back, glide, land, leap, level
from flexctrl.dynamics.march.law import Law, enter_inputs, enter_leg, obeyed, said
from flexctrl.dynamics.march.record import (
    CONTROLLED,
    CORNER,
    DONE,
    FAILED,
    FIXED,
    FRESH,
    JUMP,
    OFTEN,
    REFACTOR,
    REMADE,
    SAMPLED,
    SETTLE,
    SHORT,
    SILENT,
    SINGULAR,
    WANTS_MASS,
    WANTS_TANGENT,
    WEIGHED,
    March,
)
from flexctrl.dynamics.march.step import blended, refactored, sloped, step, to_rate, to_v
from flexctrl.kernels.eights import eight, larger, largest, put, total
from flexctrl.kernels.native import Reals, seldom
from flexctrl.model.flat.flat import (
    accelerate,
    arrive,
    clear,
    dissipate,
    drive,
    energy,
    keep,
    load,
    place,
    press_entire,
    pull,
    push,
)
from flexctrl.model.flat.fronts import factor
from flexctrl.model.gauges import read

__all__ = ["run"]

_SMALLEST = 1e-12
_MASS_TURNED = 0.1
_SOLUTIONS = 8
_EXACT = 1e-13
_NEAR = 1e-9
_ROUND_OFF = 1e-9
_CONTRACTING = 0.5
_TINY = 1e-300
_LEFT = 0.02
_SURE = 1e-4
_DOUBT = 4.0
_TRUSTED = 8
_QUIET, _LAST = 1e-7, 1e-14


@seldom
def run(m: March) -> int:
    """Do the task that is set."""
    status = task(m)
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
    while m.done < m.wanted and m.kept < m.shelf:
        status = leap(m) if m.leaping == 1 else step(m)
        if status != DONE:
            return status
        reach(m)
        if m.watching == 1 and passes(m.corners, m.flat):
            if m.leaping == 1:
                back(m)
            return CORNER
        if m.closing.loops > 0 and in_doubt(m.closing, m.flat, m.h):
            return CORNER
        accept(m)
    return DONE


def glided(m: March) -> int:
    """Take exact steps of one length on modal states alone, but where a state is to be kept."""
    m.jumping = 0
    while m.done < m.wanted and m.kept < m.shelf:
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
    while m.done < m.wanted and m.kept < m.shelf and m.stop - m.t > 1e-12 * m.until:
        if m.phase == FRESH:
            m.h = m.size if again else fitted(min(m.size, m.largest), m.stop - m.t)
            if m.t + m.h > m.until * (1.0 + 1e-12):
                return DONE
        if m.h < _SMALLEST * max(1.0, m.t):
            return SHORT
        status = step(m)
        if status == WANTS_TANGENT:
            return status
        if status == SINGULAR:
            return status
        error = 0.0
        if status == DONE:
            judge(m)
            error = compared(m)
        if status != DONE or error > 1.0:
            m.rejected += 1
            m.size = 0.25 * m.h if status != DONE else m.h * max(0.2, 0.9 * growth(error))
            again = True
            continue
        again = False
        reach(m)
        if m.watching == 1 and passes(m.corners, m.flat):
            return CORNER
        if m.closing.loops > 0 and in_doubt(m.closing, m.flat, m.h):
            return CORNER
        factor = 0.9 * growth(error)
        if factor > 1.3 and m.h > 0.5 * m.size:
            m.size = m.h * min(2.5, factor)
        elif factor < 1.0:
            m.size = m.h * factor
        accept(m)
    return DONE


def fitted(h: float, left: float) -> float:
    """Return a step that ends at the stop or leaves room for another."""
    if h > 0.99 * left:
        return left
    return 0.5 * left if h > 0.5 * left else h


def growth(error: float) -> float:
    """Return by what a step may be longer for an error of 1: it grows with the cube."""
    return math.pow(max(error, 1e-9), -1.0 / 3.0)


def judge(m: March) -> None:
    """Work out the error: by how much the method's own acceleration changes."""
    f = m.flat
    local = 0.0 * eight(m.weight)
    for i in range(0, f.padded, 8):
        own = eight(m.algorithmic[i:])
        lead = blended(m, eight(f.rate[i:]), eight(m.rate[i:]), own)
        local = larger(local, abs(lead - own) * eight(m.weight[i:]))
    m.error = abs(m.beta - 1.0 / 6.0) * m.h * m.h * largest(local)


def compared(m: March) -> float:
    """Return the error over what is allowed: in every part of the machine by how far that has been."""
    if m.parts == 1:
        return m.error / (m.absolute + m.relative * m.reached)
    f = m.flat
    worst = 0.0
    for i in range(f.n):
        rate = (1.0 - m.alpha_f) * f.rate[i] + m.alpha_f * m.rate[i] - m.alpha_m * m.algorithmic[i]
        local = abs(rate * (1.0 / (1.0 - m.alpha_m)) - m.algorithmic[i]) * m.weight[i]
        worst = max(worst, local / (m.absolute + m.relative * m.farthest[m.part[i]]))
    return abs(m.beta - 1.0 / 6.0) * m.h * m.h * worst


def accept(m: March) -> None:
    """Go on to the end of the step, where the nodes have been placed; enter it in the books and records."""
    f = m.flat
    keep(f)
    zero = 0.0 * eight(m.weight)
    one = zero + 1.0
    still = zero
    onward = zero
    shared = zero
    square = zero
    far = zero
    steady = zero
    pull = zero
    for i in range(0, f.padded, 8):
        rate = eight(f.rate[i:])
        change = rate - eight(m.rate[i:])
        still = still + abs(change) * eight(m.weight[i:])
        before = eight(m.trend[i:])
        steady = larger(steady, (abs(change + before) - abs(change - before)) * eight(m.weight[i:]))
        pull = larger(pull, abs(rate) * eight(m.weight[i:]))
        onward = onward + abs(change - before) * eight(m.weight[i:])
        told = eight(m.weight[i:]) * before
        shared = shared + told * eight(m.weight[i:]) * change
        square = square + told * told
        reach = larger(eight(m.reach[i:]), abs(eight(f.q[i:]) - eight(m.first[i:])))
        way = reach * eight(m.weight[i:])
        far = larger(far, way + one - larger(way, one))
        put(m.reach[i:], reach)
        put(m.trend[i:], change)
        put(m.algorithmic[i:], blended(m, rate, eight(m.rate[i:]), eight(m.algorithmic[i:])))
        put(m.rate[i:], rate)
        put(m.v[i:], eight(f.v[i:]))
    m.reached = max(m.reached, largest(far))
    if m.parts > 1:
        follow(m)
    lean(m, total(shared), total(square))
    tighten(m, total(onward) / max(total(still), _TINY), 0.5 * largest(steady), largest(pull))
    m.t = later(m.t, m.h)
    enter(m)
    note(m)
    m.done += 1
    if m.swift < 0:
        m.swift = 1 if m.swift == -1 else m.swift + 1


def follow(m: March) -> None:
    """Take up how far each part of the machine has been."""
    for i in range(m.flat.n):
        way = m.reach[i] * m.weight[i]
        m.farthest[m.part[i]] = max(m.farthest[m.part[i]], way + 1.0 - max(way, 1.0))


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


def lean(m: March, shared: float, square: float) -> None:
    """Choose the share of the last change of accelerations that the next one is expected to be."""
    m.lean = min(1.0, max(-1.0, shared / square)) if square > 0.0 else 1.0


def enter(m: March) -> None:
    """Enter the step in the books: work of the inputs, and what was lost."""
    f = m.flat
    work = 0.0 * eight(m.weight)
    if f.gusting > 0:
        drive(f)
    if f.carried > 0 or f.following > 0 or f.gusting > 0:
        pull(f)
        for i in range(0, f.padded, 8):
            work = work + 0.5 * (eight(m.pulled[i:]) + eight(f.force[i:])) * eight(f.step[i:])
            put(m.pulled[i:], eight(f.force[i:]))
    else:
        for i in range(0, f.padded, 8):
            work = work + eight(f.load[i:]) * eight(f.step[i:])
    m.gained += total(work)
    due = drawn_now(m)
    if m.losing == 1 or due:
        if m.swift != 1 and m.whole != 1:
            drive(f)
        if due:
            energy(f)
        elif m.leaping == 0:
            dissipate(f)
    if m.leaping == 1:
        m.lost += m.leap.lost
    elif m.losing == 1:
        m.lost += 0.5 * m.h * (m.power + f.books[2])
        m.power = f.books[2]
    if due:
        draw(m)


def drawn_now(m: March) -> bool:
    """Count a step; tell whether the balance is to be drawn after it."""
    m.entered += 1
    return m.drawing == 1 and (m.entered < OFTEN or m.entered % OFTEN == 0)


def reach(m: March) -> None:
    """Put nodes and drives where the step takes them."""
    if m.swift == 1 or m.whole == 1:
        arrive(m.flat)
    else:
        place(m.flat)


@seldom
def draw(m: March) -> None:
    """Draw the balance; as `Books.close` does."""
    kinetic = m.flat.books[0]
    stored = m.flat.books[1]
    m.made = kinetic + stored - m.begun - m.gained + m.lost
    m.gap = max(m.gap, abs(m.made))
    turned = max(abs(m.gained), max(m.lost, abs(stored + kinetic - m.begun)))
    swung = max(kinetic, max(abs(kinetic - m.moving), abs(stored - (m.begun - m.moving))))
    m.turnover = max(m.turnover, max(turned, swung))


def note(m: March) -> None:
    """Write down outputs and, where it is wanted, the state."""
    f = m.flat
    row = m.rows[(1 + m.gauges.outputs) * m.done :]
    row[0] = m.t
    if m.gauges.moving == 1 and m.losing == 0 and m.swift != 1 and m.whole != 1:
        drive(f)
    read(m.gauges, f.z, row[1:])
    if m.keeping == 1 or m.t >= m.due:
        shelve(m)


def shelve(m: March) -> None:
    """Keep the state."""
    f = m.flat
    nodes = 12 * f.nodes
    angles = nodes + 2 * f.padded + f.drives
    width = angles + m.gauges.turning + 1
    state = m.states[width * m.kept :]
    copy(nodes, f.pose, state)
    copy(f.padded, f.q, state[nodes:])
    copy(f.padded, m.v, state[nodes + f.padded :])
    copy(f.drives, f.driven, state[nodes + 2 * f.padded :])
    copy(m.gauges.turning, m.gauges.shown, state[angles:])
    state[width - 1] = m.t
    m.kept += 1
    m.due = m.t + m.spacing


def copy(n: int, x: Reals, y: Reals) -> None:
    """Copy entries."""
    for i in range(n):
        y[i] = x[i]


@seldom
def settle(m: March) -> int:
    """Take up the state that has been entered: loads, and what outputs read."""
    f = m.flat
    load(f)
    pull(f)
    copy(f.padded, f.force, m.pulled)
    if m.losing == 1:
        drive(f)
        energy(f)
        m.power = f.books[2]
    if m.closing.loops > 0:
        settled(m.closing, f)
    return DONE


def jump(m: March) -> int:
    """Let the accelerations follow a jump of the inputs: solve for them with the mass, kept as tangents are.

    The method's own accelerations keep their lead on the true ones.
    """
    f = m.flat
    clear(f.padded, f.step)
    copy(f.padded, m.v, f.v)
    if m.swift == 1 and answered(m):
        return changed(m)
    load(f)
    if m.leaping == 1:
        pull(f)
        copy(f.padded, f.force, m.pulled)
        return DONE
    if m.mass_for != 1.0 or spent(m) or turned_too_far(m.axes, m.mass, f, _MASS_TURNED):
        status = massed(m)
        if status != DONE:
            return status
    if m.flows.count > 0:
        flow_on(m.flows, f, m.h)
    if m.attempt == 1 or m.unsure == 1 or m.flows.count > 0 or not small(m):
        status = solved_for(m)
        if status != DONE:
            return status
    if m.flows.count > 0:
        run_on(m)
    return changed(m)


def answered(m: March) -> bool:
    """Find the accelerations from kernels of the whole machine; tell whether they are numbers."""
    f = m.flat
    accelerate(f)
    sums = 0.0 * eight(m.weight)
    for i in range(0, f.padded, 8):
        put(f.rate[i:], eight(f.answer[i:]))
        sums = sums + abs(eight(f.answer[i:]))
    return math.isfinite(total(sums))


def changed(m: March) -> int:
    """Take up accelerations that have jumped, and the inputs' forces."""
    f = m.flat
    for i in range(0, f.padded, 8):
        change = eight(f.rate[i:]) - eight(m.rate[i:])
        put(m.algorithmic[i:], eight(m.algorithmic[i:]) + change)
        put(m.rate[i:], eight(f.rate[i:]))
    pull(f)
    copy(f.padded, f.force, m.pulled)
    return DONE


@seldom
def run_on(m: March) -> None:
    """Enter the rates of first order after a jump, how they change, and what is dissipated."""
    f = m.flat
    for k in range(m.flows.count):
        i = m.flows.places[k]
        m.v[i] = m.flows.rates[k]
        f.rate[i] = m.flows.changes[k]
        if m.flows.settles[k] == 1 and unresolved(m.v[i], f.rate[i], m.h):
            m.v[i] = eased_rate(m.flows.rates[k], m.flows.changes[k], m.h, m.beta, m.gamma)
            f.rate[i] = eased_change(m.flows.rates[k], m.flows.changes[k], m.h, m.beta, m.gamma)
            f.v[i] = m.v[i]
            m.algorithmic[i] = m.rate[i]
    if m.losing == 1:
        drive(f)
        energy(f)
        m.power = f.books[2]


def spent(m: March) -> bool:
    """Tell whether the mass was looked at in vain when last it was, and can be made here."""
    return m.asking == 0 and m.probes.groups == 0 and m.believed > _TRUSTED


def small(m: March) -> bool:
    """Add what the change of the inputs gives; tell whether that is right within tolerance.

    The mass is believed to be as good as it was found to be when that was last looked at.
    """
    f = m.flat
    pull(f)
    for i in range(0, f.padded, 8):
        put(f.force[i:], eight(f.force[i:]) - eight(m.pulled[i:]))
        put(f.rate[i:], eight(m.rate[i:]))
    f.force[f.n] = 0.0
    solved(m.axes, m.mass, m.fronts, f.force)
    size = m.made_for * m.made_for * m.beta * added(m)
    if m.made_for > 0.0 and size * _LEFT <= m.tolerance:
        return True
    if m.missed >= 0.0 and m.believed < _TRUSTED and m.made_for > 0.0 and size * max(m.missed, _SURE) <= m.tolerance:
        m.believed += 1
        return True
    return False


@seldom
def solved_for(m: March) -> int:
    """Solve for the accelerations, once more with the mass made anew if need be."""
    while not balanced(m):
        if m.attempt == 1:
            m.attempt = 0
            return FAILED
        m.attempt = 1
        m.mass_for = 0.0
        status = massed(m)
        if status != DONE:
            return status
    m.attempt = 0
    return DONE


@seldom
def massed(m: March) -> int:
    """Make the mass for the present shape, or ask for it."""
    if m.asking == 1:
        return WANTS_MASS
    drive(m.flat)
    sloped(m, 0.0, 0.0, 1.0)
    return weighed(m)


@seldom
def balanced(m: March) -> bool:
    """Solve for the accelerations as exactly as steps are; tell whether the mass, of another shape maybe, was good."""
    f = m.flat
    share = m.made_for * m.made_for * m.beta if m.made_for > 0.0 else math.inf
    copy(f.padded, m.rate, f.rate)
    released(m.flows, f.rate)
    last = math.inf
    first = 0.0
    for k in range(_SOLUTIONS):
        if m.whole == 1:
            press_entire(f)
        else:
            drive(f)
            push(f)
        f.force[f.n] = 0.0
        released(m.flows, f.force)
        solved(m.axes, m.mass, m.fronts, f.force)
        change = added(m)
        if k == 0:
            first = change
        if k == 1:
            m.missed = _DOUBT * change / max(first, _TINY)
            in_vain = m.made_for > 0.0 and first * share * m.missed > m.tolerance
            m.believed = _TRUSTED + 1 if in_vain else 0
        size = change / max(largest_rate(m), _TINY)
        if size <= _EXACT or change * share <= m.tolerance:
            return True
        if not size < _CONTRACTING * last:  # with a mass of this very shape it is round-off that is left
            return size <= _NEAR or (m.attempt == 1 and change * share <= _ROUND_OFF)
        last = size
    return last <= _NEAR


def added(m: March) -> float:
    """Correct accelerations by what is in the place of the forces; return its size, NaN where it is not finite."""
    f = m.flat
    most = 0.0 * eight(m.weight)
    sums = most
    for i in range(0, f.padded, 8):
        change = eight(f.force[i:])
        put(f.rate[i:], eight(f.rate[i:]) - change)
        most = larger(most, abs(change) * eight(m.weight[i:]))
        sums = sums + abs(change)
    return largest(most) if math.isfinite(total(sums)) else math.nan


@seldom
def largest_rate(m: March) -> float:
    """Return the size of the largest acceleration."""
    size = 0.0 * eight(m.weight)
    for i in range(0, m.flat.padded, 8):
        size = larger(size, abs(eight(m.flat.rate[i:])) * eight(m.weight[i:]))
    return largest(size)


@seldom
def weighed(m: March) -> int:
    """Factorise the mass that has been filled in for the present shape."""
    f = m.flat
    pivot(m.flows, m.entries)
    where = factor(m.fronts, m.entries, m.mass.diagonal, m.mass.down, m.mass.up)
    m.mass_for = 0.0
    for i in range(f.n):
        if not m.mass.diagonal[i] > m.dust[i]:
            where = i
    if where >= 0:
        return SINGULAR
    m.mass_for = 1.0
    m.missed = 0.0
    m.believed = 0
    m.weighings += 1
    mark(m.axes, m.mass, f)
    return DONE
