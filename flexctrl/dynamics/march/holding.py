"""Generalised alpha in compiled loops: what sticks is held, in steps and where inputs jump.

The forces that hold it are found beside each Newton correction: the tangent is that of the machine without them.
"""

from __future__ import annotations

from flexctrl.dynamics.march.axes import solved
from flexctrl.dynamics.march.contacts import (
    Contacts,
    feel,
    held_up,
    may_switch,
    mobility,
    overcome,
    sticks,
    take_up,
)
from flexctrl.dynamics.march.record import Factors, March
from flexctrl.kernels.eights import eight, put
from flexctrl.kernels.native import seldom
from flexctrl.model.flat.flat import drive, push
from flexctrl.model.flat.workspace import Flat

__all__ = ["begun", "follows", "held", "lets_go", "settled_lead"]


def held(m: March, factors: Factors, ease: float) -> bool:
    """Take from a motion that forces would bring about, found in their place, what the contacts that stick prevent.

    ``ease`` as in `held_up`. Tell whether that can be done.
    """
    c = m.contacts
    f = m.flat
    for k in range(c.count):
        if sticks(c, f, k):
            row = c.rows[c.padded * k :]
            answer = c.answers[c.padded * k :]
            for i in range(0, f.padded, 8):
                put(answer[i:], eight(row[i:]))
            solved(m.axes, factors, m.fronts, answer)
    if not prevented(c, f, ease):
        return False
    for k in range(c.count):
        c.bearing[k] = c.sums[k]
    return flatly(m, ease)  # what rounding has left


def lets_go(m: March) -> bool:
    """Tell whether a contact may stick or break loose over the step; if none does, go on to its end."""
    c = m.contacts
    f = m.flat
    drive(f)
    feel(c, f)
    if c.watched == 1 and may_switch(c, f, m.h):
        return True
    take_up(c)
    return False


def follows(m: March) -> bool:
    """Take up what inputs that have jumped make of contacts; tell whether all that stick bear it."""
    c = m.contacts
    f = m.flat
    if c.stuck > 0 and c.watched == 1 and overcome(c, f):
        return False
    for k in range(c.count):
        c.borne[k] = c.bearing[k]
    drive(f)
    feel(c, f)
    for k in range(c.count):
        c.changes[k] = c.found[c.width * k + 1]
    return True


@seldom
def begun(m: March) -> None:
    """Take up how contacts slip where the march has been put, and what holds those that stick."""
    c = m.contacts
    f = m.flat
    for i in range(0, f.padded, 8):
        put(f.rate[i:], eight(m.rate[i:]))
    drive(f)
    feel(c, f)
    push(f)
    for i in range(0, f.padded, 8):
        put(f.force[i:], eight(c.ease[i:]) * eight(f.force[i:]))
    flatly(m, 0.0)
    for k in range(c.count):
        c.bearing[k] = c.sums[k] / mobility(c, k) if sticks(c, f, k) else 0.0
    take_up(c)
    c.known = 1


@seldom
def settled_lead(m: March) -> None:
    """Let no lead of the method's own accelerations on the true ones be left along what sticks."""
    f = m.flat
    for i in range(0, f.padded, 8):
        put(f.force[i:], eight(m.algorithmic[i:]) - eight(m.rate[i:]))
    if flatly(m, 0.0):
        for i in range(0, f.padded, 8):
            put(m.algorithmic[i:], eight(m.rate[i:]) + eight(f.force[i:]))


def flatly(m: March, ease: float) -> bool:
    """Do as `held` as if each degree of freedom moved by itself, for forces measured by what each contact moves.

    That is exact where a contact holds a degree of freedom.
    """
    c = m.contacts
    f = m.flat
    f.force[f.n] = 0.0
    for k in range(c.count):
        if sticks(c, f, k):
            row = c.rows[c.padded * k :]
            answer = c.answers[c.padded * k :]
            felt = mobility(c, k)
            for i in range(0, c.padded, 8):
                put(answer[i:], eight(c.ease[i:]) * eight(row[i:]) / felt)
    return prevented(c, f, ease)


def prevented(c: Contacts, f: Flat, ease: float) -> bool:
    """Take away what the contacts that stick prevent; tell whether that can be done."""
    if not held_up(c, f, ease):
        return False
    for k in range(c.count):
        if sticks(c, f, k):
            answer = c.answers[c.padded * k :]
            for i in range(0, f.padded, 8):
                put(f.force[i:], eight(f.force[i:]) - c.sums[k] * eight(answer[i:]))
    return True
