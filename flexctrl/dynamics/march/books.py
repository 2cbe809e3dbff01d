"""Generalised alpha in compiled loops: accepted steps, their books and records."""

from __future__ import annotations

from flexctrl.dynamics.march.clock import later
from flexctrl.dynamics.march.closing import settled
from flexctrl.dynamics.march.guessing import blended
from flexctrl.dynamics.march.holding import begun
from flexctrl.dynamics.march.judging import follow, lean, miss, tighten
from flexctrl.dynamics.march.record import DONE, March
from flexctrl.dynamics.records.absurd import ALIKE, FAR, OFTEN, absurd, borne_out, looking, missed, unlooked
from flexctrl.kernels.eights import eight, larger, largest, put, total
from flexctrl.kernels.native import seldom
from flexctrl.model.flat.flat import arrive, clear, dissipate, drive, energy, keep, keep_tiles, load, place, pull, stand
from flexctrl.model.flat.solving import copy_on
from flexctrl.model.gauges import read

__all__ = ["accept", "draw", "drawn_now", "reach", "settle", "shelve", "unseen"]

_TINY = 1e-300


def accept(m: March) -> None:
    """Go on to the end of the step, where the nodes have been placed unless `unseen`; enter it in books and records."""
    f = m.flat
    if unseen(m):
        keep_tiles(f)
    else:
        keep(f)
    if m.leaping == 0 and looking(m.entered):
        miss(m)
    zero = 0.0 * eight(m.weight)
    one = zero + 1.0
    still = zero
    onward = zero
    shared = zero
    square = zero
    far = zero
    steady = zero
    pull = zero
    spun = zero
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
        far = larger(far, zero - larger(zero - one, zero - way))  # no more than 1, whatever it was before
        put(m.reach[i:], reach)
        put(m.trend[i:], change)
        put(m.algorithmic[i:], blended(m, rate, eight(m.rate[i:]), eight(m.algorithmic[i:])))
        put(m.rate[i:], rate)
        spun = larger(spun, abs(eight(f.v[i:])) * eight(m.turns[i:]) * eight(m.weight[i:]))
        put(m.v[i:], eight(f.v[i:]))
    m.reached = max(m.reached, largest(far))
    if m.parts > 1:
        follow(m)
    lean(m, total(shared), total(square))
    tighten(m, total(onward) / max(total(still), _TINY), 0.5 * largest(steady), largest(pull))
    m.turned = max(m.turned, m.h * largest(spun))
    m.t = later(m.t, m.h)
    m.came = m.h
    m.lagging = 0.0
    enter(m)
    note(m)
    m.done += 1
    if m.swift < 0:
        m.swift = 1 if m.swift == -1 else m.swift + 1


def unseen(m: March) -> bool:
    """Tell whether nothing asks where nodes are before a step is accepted: tiles of them are placed with that."""
    if m.flat.tiles.count == 0 or m.leaping == 1 or m.answering == 1:
        return False
    return m.watching == 0 and m.closing.looks == 0 and m.contacts.count == 0 and m.corners.jumping == 0


def reach(m: March) -> None:
    """Put nodes and drives where the step takes them."""
    if m.swift == 1 or m.whole == 1:
        arrive(m.flat)
    else:
        place(m.flat)


def enter(m: March) -> None:
    """Enter the step in the books: work of the inputs, and what was lost."""
    f = m.flat
    work = 0.0 * eight(m.weight)
    if f.gusting > 0:
        drive(f)
    if f.carried > 0 or f.following > 0 or f.gusting > 0 or m.answering == 1:
        pull(f)
        for i in range(0, f.padded, 8):
            work = work + 0.5 * (eight(m.pulled[i:]) + eight(f.force[i:])) * eight(f.step[i:])
            put(m.pulled[i:], eight(f.force[i:]))
    elif f.unit_loads > 0:
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
        lost = 0.5 * m.h * (m.power + f.books[2])
        m.power = f.books[2]
        m.lost += lost if lost <= unlooked(m.entered, m.made, m.unseen, m.turnover) else looked_at(m, lost)
    if due:
        draw(m)


@seldom
def looked_at(m: March, lost: float) -> float:
    """Return what a step has dissipated, of which quadrature says so much; as `Books` does."""
    f = m.flat
    energy(f)
    gap = f.books[0] + f.books[1] - m.begun - m.gained + m.lost
    if borne_out(lost, gap + lost, m.unseen, m.turnover):
        return lost
    told = lost
    if ended(m, 0.0, 0.0) or ended(m, 0.5 * m.h, lost):
        least = m.h * halfway(m)
        if lost > ALIKE * least:
            told = min(lost, max(least, m.made - gap))
            m.unseen += min(told, lost - told)
    copy_on(f.padded, m.v, f.v)
    drive(f)
    energy(f)
    return told


@seldom
def ended(m: March, onward: float, least: float) -> bool:
    """Tell whether drag ends what rates have beside a course, whose rates change for so long, and takes so much."""
    f = m.flat
    mix(m, 1.0, onward)
    swing = f.books[0]
    drag = f.books[2]
    mix(m, -1.0, onward)
    return m.h * min(drag, f.books[2]) > max(swing, FAR * least)


@seldom
def mix(m: March, beside: float, onward: float) -> None:
    """Work out energies at what rates have beside a course, or at its reverse."""
    f = m.flat
    for i in range(0, f.padded, 8):
        mean = eight(f.step[i:]) * (1.0 / m.h)
        put(f.v[i:], beside * (eight(m.v[i:]) - mean - onward * eight(m.rate[i:])))
    drive(f)
    energy(f)


@seldom
def halfway(m: March) -> float:
    """Return what is dissipated at the mean rates, where half of the step has led; as `Books` does.

    All has been kept already: it is half a step back from there.
    """
    f = m.flat
    for i in range(0, f.padded, 8):
        step = eight(f.step[i:])
        put(f.v[i:], step * (1.0 / m.h))
        put(f.force[i:], step)
        put(f.step[i:], -0.5 * step)
    reach(m)
    drive(f)
    energy(f)
    lost = f.books[2]
    clear(f.padded, f.step)
    copy_on(f.padded, m.v, f.v)
    reach(m)
    stand(f)
    copy_on(f.padded, f.force, f.step)
    return lost


def drawn_now(m: March) -> bool:
    """Count a step; tell whether the balance is to be drawn after it."""
    m.entered += 1
    return m.drawing == 1 and (m.entered < OFTEN or m.entered % OFTEN == 0)


@seldom
def draw(m: March) -> None:
    """Draw the balance; as `Books.close` does."""
    kinetic = m.flat.books[0]
    stored = m.flat.books[1]
    m.made = kinetic + stored - m.begun - m.gained + m.lost
    m.gap = max(m.gap, missed(m.made, m.unseen))
    turned = max(abs(m.gained), max(m.lost, abs(stored + kinetic - m.begun)))
    swung = max(kinetic, max(abs(kinetic - m.moving), abs(stored - (m.begun - m.moving))))
    m.turnover = max(m.turnover, max(turned, swung))
    if m.lawful == 1 and absurd(m.entered, m.made - m.unseen, m.turnover, m.reached, m.begun):
        m.absurd = 1


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
    copy_on(nodes, f.pose, state)
    copy_on(f.padded, f.q, state[nodes:])
    copy_on(f.padded, m.v, state[nodes + f.padded :])
    copy_on(f.drives, f.driven, state[nodes + 2 * f.padded :])
    copy_on(m.gauges.turning, m.gauges.shown, state[angles:])
    state[width - 1] = m.t
    m.kept += 1
    m.due = m.t + m.spacing


@seldom
def settle(m: March) -> int:
    """Take up the state that has been entered: loads, and what outputs read."""
    f = m.flat
    load(f)
    pull(f)
    copy_on(f.padded, f.force, m.pulled)
    if m.contacts.count > 0 and m.contacts.known == 0:
        begun(m)
    if m.losing == 1:
        drive(f)
        energy(f)
        m.power = f.books[2]
    if m.closing.loops > 0:
        settled(m.closing, f)
    return DONE
