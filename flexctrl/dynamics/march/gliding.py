"""Exact steps of linear equations in compiled loops, on modal states alone: nodes are placed where they are wanted."""

from __future__ import annotations

from flexctrl.dynamics.march.clock import later
from flexctrl.dynamics.march.corners import beyond, within
from flexctrl.dynamics.march.record import CORNER, DONE, WANTS_TANGENT, March
from flexctrl.kernels.eights import eight, larger, put, total
from flexctrl.kernels.native import Reals, seldom
from flexctrl.model.flat.flat import keep, load, place, pull
from flexctrl.model.gauges import show

__all__ = ["back", "glide", "land", "leap", "level"]

_ALIKE = 1e-9
_NOTHING = 1e-150
"""Below this a modal state is zero: processors are slow with the smallest numbers there are."""


def glide(m: March) -> int:
    """Take a step and enter it in books and rows, or ask for its tables."""
    e = m.leap
    if abs(m.h - e.h) > _ALIKE * m.h:
        return WANTS_TANGENT
    g = m.gauges
    inputs = e.size - 1 - e.modes
    if e.aloft == 0:
        if e.state[e.size - 1] == 1.0:
            product(e.size, e.sights, e.state, e.seen, e.sight)
        else:
            for j in range(inputs):
                e.sight[g.rows + j] = way(m, j)
        e.aloft = 1
    work = 0.0
    for j in range(inputs):
        work -= m.flat.u[j] * e.sight[g.rows + j]
    onward(m)
    product(e.size, e.sights, e.state, e.seen, e.sight)
    if m.watching == 1 and sees_corner(m):
        back(m)
        return CORNER
    for j in range(inputs):
        work += m.flat.u[j] * e.sight[g.rows + j]
    m.gained += work
    m.lost += e.lost
    for i in range(g.rows):
        g.sums[i] = e.sight[i]
    m.t = later(m.t, m.h)
    row = m.rows[(1 + g.outputs) * m.done :]
    row[0] = m.t
    show(g, m.flat.z, row[1:])
    m.done += 1
    return DONE


def sees_corner(m: March) -> bool:
    """Tell whether the step passes a corner of a line's law of force."""
    c = m.corners
    arms = m.leap.sight[m.gauges.rows + m.leap.size - 1 - m.leap.modes :]
    for k in range(c.lines):
        arm = arms[3 * k :]
        if not within(c, k, beyond(c, k, arm[0], arm[1], arm[2])):
            return True
    return False


@seldom
def back(m: March) -> None:
    """Undo a step."""
    e = m.leap
    for i in range(0, e.wide, 8):
        put(e.state[i:], eight(e.before[i:]))
    e.lost = 0.0


def way(m: March, j: int) -> float:
    """Return the way of an input: what its work is done along."""
    f = m.flat
    sums = 0.0 * eight(f.q)
    for i in range(0, f.padded, 8):
        sums = sums + eight(f.q[i:]) * eight(m.leap.ways[f.padded * j + i :])
    return total(sums)


def onward(m: March) -> None:
    """Go to the modal state at the end of the step; enter what is lost."""
    e = m.leap
    for k in range(e.modes, e.size - 1):
        e.state[k] = m.flat.u[k - e.modes]
    e.state[e.size - 1] = 1.0
    e.lost = 0.0
    if m.losing == 1:
        e.lost = lost_apart(m) if e.parted == 1 else lost(m)
    for i in range(0, e.wide, 8):
        put(e.before[i:], eight(e.state[i:]))
    if e.paired == 1:
        by_pairs(m)
    else:
        product(e.size, e.wide, e.state, e.transition, e.after)
    for i in range(e.modes):
        e.state[i] = e.after[i] if abs(e.after[i]) > _NOTHING else 0.0


def by_pairs(m: March) -> None:
    """Go on with each pair by itself."""
    e = m.leap
    half = e.modes // 2
    for i in range(0, half, 8):
        first = eight(e.state[i:])
        second = eight(e.state[half + i :])
        own = eight(e.transition[i:]) * first + eight(e.transition[half + i :]) * second
        other = eight(e.transition[2 * half + i :]) * first + eight(e.transition[3 * half + i :]) * second
        for j in range(e.modes, e.size):
            own = own + e.state[j] * eight(e.transition[4 * half + e.modes * (j - e.modes) + i :])
            other = other + e.state[j] * eight(e.transition[5 * half + e.modes * (j - e.modes) + i :])
        put(e.after[i:], own)
        put(e.after[half + i :], other)


def lost_apart(m: March) -> float:
    """Return the energy dissipated over the step that is about to be taken, where nothing couples pairs."""
    e = m.leap
    half = e.modes // 2
    sums = 0.0 * eight(e.state)
    for i in range(0, half, 8):
        first = eight(e.state[i:])
        second = eight(e.state[half + i :])
        own = eight(e.losses[i:]) * first + eight(e.losses[half + i :]) * second
        other = eight(e.losses[2 * half + i :]) * second
        for j in range(e.modes, e.size):
            own = own + e.state[j] * eight(e.losses[3 * half + e.modes * (j - e.modes) + i :])
            other = other + e.state[j] * eight(e.losses[4 * half + e.modes * (j - e.modes) + i :])
        sums = sums + own * first + other * second
    few = e.size - e.modes
    rest = e.losses[3 * half + e.modes * few :]
    found = total(sums)
    for j in range(few):
        for k in range(few):
            found += e.state[e.modes + j] * rest[few * j + k] * e.state[e.modes + k]
    return found


def lost(m: March) -> float:
    """Return the energy dissipated over the step that is about to be taken.

    Eight columns at a time, from the rows of the diagonal on, in four sums: they wait for one another.
    """
    e = m.leap
    sums = 0.0 * eight(e.state)
    for i in range(0, e.wide, 8):
        a = 0.0 * sums
        b = a
        c = a
        d = a
        j = i
        while j + 4 <= e.size:
            row = e.losses[e.wide * j + i :]
            a = a + e.state[j] * eight(row)
            b = b + e.state[j + 1] * eight(row[e.wide :])
            c = c + e.state[j + 2] * eight(row[2 * e.wide :])
            d = d + e.state[j + 3] * eight(row[3 * e.wide :])
            j += 4
        while j < e.size:
            a = a + e.state[j] * eight(e.losses[e.wide * j + i :])
            j += 1
        sums = sums + eight(e.state[i:]) * ((a + b) + (c + d))
    return total(sums)


def product(count: int, length: int, weights: Reals, rows: Reals, out: Reals) -> None:
    """Write the sum of rows with weights, 32 entries at a time where there are as many: sums wait for one another."""
    i = 0
    while i + 32 <= length:
        a = 0.0 * eight(weights)
        b = a
        c = a
        d = a
        for j in range(count):
            row = rows[length * j + i :]
            a = a + weights[j] * eight(row)
            b = b + weights[j] * eight(row[8:])
            c = c + weights[j] * eight(row[16:])
            d = d + weights[j] * eight(row[24:])
        put(out[i:], a)
        put(out[i + 8 :], b)
        put(out[i + 16 :], c)
        put(out[i + 24 :], d)
        i += 32
    while i + 16 <= length:
        a = 0.0 * eight(weights)
        b = a
        for j in range(count):
            row = rows[length * j + i :]
            a = a + weights[j] * eight(row)
            b = b + weights[j] * eight(row[8:])
        put(out[i:], a)
        put(out[i + 8 :], b)
        i += 16
    while i < length:
        a = 0.0 * eight(weights)
        for j in range(count):
            a = a + weights[j] * eight(rows[length * j + i :])
        put(out[i:], a)
        i += 8


@seldom
def land(m: March) -> None:
    """Bring degrees of freedom and nodes to where the modal state is."""
    f = m.flat
    e = m.leap
    level(m)
    for i in range(0, f.padded, 8):
        put(f.step[i:], 0.0 * eight(f.step[i:]))
        put(m.v[i:], eight(f.v[i:]))
        put(m.reach[i:], larger(eight(m.reach[i:]), abs(eight(f.q[i:]) - eight(m.first[i:]))))
    place(f)
    keep(f)
    load(f)
    pull(f)
    for i in range(0, f.padded, 8):
        put(m.pulled[i:], eight(f.force[i:]))
    e.aloft = 0


def level(m: March) -> None:
    """Bring degrees of freedom to where the modal state is; not by a step: to the bit the same always."""
    e = m.leap
    product(e.size, m.flat.padded, e.state, e.places, m.flat.q)
    product(e.size, m.flat.padded, e.state, e.rates, m.flat.v)


@seldom
def unfold(m: March) -> None:
    """Work out the step and the rates from the modal state."""
    f = m.flat
    e = m.leap
    product(e.size, f.padded, e.state, e.places, f.step)
    product(e.size, f.padded, e.state, e.rates, f.v)
    for i in range(0, f.padded, 8):
        put(f.step[i:], eight(f.step[i:]) - eight(f.q[i:]))


@seldom
def leap(m: March) -> int:
    """Take a step that is placed and entered as others are, or ask for its tables."""
    if abs(m.h - m.leap.h) > _ALIKE * m.h:
        return WANTS_TANGENT
    onward(m)
    unfold(m)
    return DONE
