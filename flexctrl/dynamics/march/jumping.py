"""Generalised alpha in compiled loops: accelerations follow a jump of the inputs."""

from __future__ import annotations

import math

from flexctrl.dynamics.march.axes import mark, solved, turned_too_far
from flexctrl.dynamics.march.contacts import bear_more, feel
from flexctrl.dynamics.march.flowing import feel_mean, flow_on, pivot, released
from flexctrl.dynamics.march.holding import follows, held, settled_lead
from flexctrl.dynamics.march.record import DONE, FAILED, SINGULAR, WANTS_MASS, March
from flexctrl.dynamics.march.step import sloped
from flexctrl.dynamics.march.tempering import inputs_may_throw, temper_jump
from flexctrl.dynamics.swift.easing import eased_change, eased_rate
from flexctrl.kernels.eights import eight, larger, largest, put, total
from flexctrl.kernels.native import seldom
from flexctrl.model.flat.flat import accelerate, clear, drive, energy, load, press_entire, pull, push
from flexctrl.model.flat.fronts import factor, seat
from flexctrl.model.flat.solving import copy_on

__all__ = ["jump", "weighed"]

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


def jump(m: March) -> int:
    """Let the accelerations follow a jump of the inputs: solve for them with the mass, kept as tangents are.

    The method's own accelerations keep their lead on the true ones.
    """
    f = m.flat
    clear(f.padded, f.step)
    copy_on(f.padded, m.v, f.v)
    if m.swift == 1 and answered(m):
        if inputs_may_throw(m):
            load(f)
            temper_jump(m)
        return changed(m)
    load(f)
    if m.leaping == 1:
        pull(f)
        copy_on(f.padded, f.force, m.pulled)
        return DONE
    if m.mass_for != 1.0 or spent(m) or turned_too_far(m.axes, m.mass, f, _MASS_TURNED):
        status = massed(m)
        if status != DONE:
            return status
    if m.flows.count > 0:
        flow_on(m.flows, f, m.h)
        feel_mean(m.flows, f, m.h, m.beta, m.gamma)
    if m.attempt == 1 or m.unsure == 1 or m.flows.count > 0 or not small(m):
        status = solved_for(m)
        if status != DONE:
            return status
    if m.contacts.count > 0 and not follows(m):
        return FAILED
    if m.flows.count > 0:
        run_on(m)
    if inputs_may_throw(m):
        temper_jump(m)
    changed(m)
    if m.contacts.count > 0 and m.contacts.stuck > 0:
        settled_lead(m)
    return DONE


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
    copy_on(f.padded, f.force, m.pulled)
    return DONE


@seldom
def run_on(m: March) -> None:
    """Enter the rates of first order after a jump, how they change, and what is dissipated."""
    f = m.flat
    for k in range(m.flows.count):
        i = m.flows.places[k]
        m.v[i] = m.flows.rates[k]
        f.rate[i] = m.flows.changes[k]
        if m.flows.shares[k] < 1.0:
            m.v[i] = eased_rate(m.flows.rates[k], m.flows.changes[k], m.h, m.beta, m.gamma)
            f.rate[i] = eased_change(m.flows.rates[k], m.flows.changes[k], m.h, m.beta, m.gamma)
            f.v[i] = m.v[i]
            m.algorithmic[i] = m.rate[i]
    if m.losing == 1:
        m.power = felt_power(m)


@seldom
def felt_power(m: March) -> float:
    """Return the power whose mean with the one at the end is dissipated over the step; see `swift.fleeting`."""
    f = m.flat
    over = 0
    for k in range(m.flows.count):
        if m.flows.shares[k] < 1.0:
            f.v[m.flows.places[k]] = 0.0
            over += 1
    lost = wasted(m)
    if over > 0:
        left = lost
        for k in range(m.flows.count):
            if m.flows.shares[k] < 1.0:
                i = m.flows.places[k]
                f.v[i] = m.flows.rates[k]
                lost += m.flows.shares[k] * (wasted(m) - left)
                f.v[i] = 0.0
        for k in range(m.flows.count):
            f.v[m.flows.places[k]] = m.v[m.flows.places[k]]
        drive(f)
    return lost


@seldom
def wasted(m: March) -> float:
    """Return the power that the motion under way dissipates."""
    drive(m.flat)
    energy(m.flat)
    return m.flat.books[2]


def spent(m: March) -> bool:
    """Tell whether the mass was looked at in vain when last it was, and can be made here."""
    return m.asking == 0 and m.probes.groups == 0 and m.believed > _TRUSTED


def small(m: March) -> bool:
    """Add what the change of the inputs gives; tell whether that is right within tolerance.

    The mass is believed to be as good as it was found to be when that was last looked at.
    """
    f = m.flat
    if m.contacts.count > 0 and m.contacts.stuck > 0:
        feel(m.contacts, f)
    pull(f)
    for i in range(0, f.padded, 8):
        put(f.force[i:], eight(f.force[i:]) - eight(m.pulled[i:]))
        put(f.rate[i:], eight(m.rate[i:]))
    f.force[f.n] = 0.0
    solved(m.axes, m.mass, m.fronts, f.force)
    if m.contacts.count > 0 and m.contacts.stuck > 0:
        if not held(m, m.mass, 0.0):
            return False
        bear_more(m.contacts)
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
    if m.probes.groups > 0:  # whose last digits hang on where they start from
        copy_on(m.flat.padded, m.rate, m.flat.rate)
    drive(m.flat)
    sloped(m, 0.0, 0.0, 1.0)
    return weighed(m)


@seldom
def balanced(m: March) -> bool:
    """Solve for the accelerations as exactly as steps are; tell whether the mass, of another shape maybe, was good."""
    f = m.flat
    share = m.made_for * m.made_for * m.beta if m.made_for > 0.0 else math.inf
    copy_on(f.padded, m.rate, f.rate)
    released(m.flows, f.rate)
    last = math.inf
    first = 0.0
    for k in range(_SOLUTIONS):
        if m.whole == 1:
            press_entire(f)
        else:
            drive(f)
            if m.contacts.count > 0 and m.contacts.stuck > 0:
                feel(m.contacts, f)
            push(f)
        f.force[f.n] = 0.0
        released(m.flows, f.force)
        solved(m.axes, m.mass, m.fronts, f.force)
        if m.contacts.count > 0 and m.contacts.stuck > 0 and not held(m, m.mass, 1.0):
            return False
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
        if not m.mass.diagonal[seat(m.fronts, i)] > m.dust[i]:
            where = i
    if where >= 0:
        return SINGULAR
    m.mass_for = 1.0
    m.missed = 0.0
    m.believed = 0
    m.weighings += 1
    mark(m.axes, m.mass, f)
    return DONE
