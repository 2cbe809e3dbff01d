"""Parts that a jump of forces would throw, in compiled loops: see `flexctrl.dynamics.swift.thrown`."""

from __future__ import annotations

from flexctrl.dynamics.march.axes import mark, solved, turned_too_far
from flexctrl.dynamics.march.record import March
from flexctrl.dynamics.march.step import press_all, sloped, to_rate
from flexctrl.dynamics.swift.thrown import AT_HAND, BLURRED, CORRECTIONS, THROWN
from flexctrl.kernels.eights import eight, larger, largest, put, total
from flexctrl.kernels.native import seldom
from flexctrl.model.flat.flat import clear, drive, place
from flexctrl.model.flat.fronts import factor, whose
from flexctrl.model.flat.solving import copy_on

__all__ = ["at_rest_in", "firm", "inputs_may_throw", "may_throw", "temper", "temper_jump"]

_FIRM = 1e30
"""What holds freedoms of first order, over what stands for their mass."""
_TURNED = 0.3


def may_throw(m: March) -> bool:
    """Tell whether forces that jump may throw parts over a step."""
    return m.throws == 1 and m.asking == 0 and m.h * m.firmest < BLURRED


def inputs_may_throw(m: March) -> bool:
    """Tell whether inputs that jump may; `start_anew` asks by itself, and laws that read are not asked in between."""
    if m.throws == 0 or m.unsure == 1 or (m.answering == 1 and m.answer.reading > 0):
        return False
    return m.h * (m.gamma * m.damping + m.beta * m.h * m.holding) > THROWN and may_throw(m)


@seldom
def temper_jump(m: March) -> None:
    """Let accelerations that have jumped with the inputs jump by less, where parts would be thrown."""
    f = m.flat
    copy_on(f.padded, f.rate, m.fresh)
    copy_on(f.padded, m.rate, m.before)
    if not felt(m):
        return
    at_hand = m.made_for <= m.h * AT_HAND and m.h <= m.made_for * AT_HAND
    if at_hand and not turned_too_far(m.axes, m.tangent, f, _TURNED):
        share = to_rate(m) * (m.h / m.made_for) * (m.h / m.made_for)
    elif firm(m):
        m.factorisations += 1
        share = 1.0 / (m.beta * m.h * m.h)
    else:
        share = 0.0
    if share > 0.0:
        lessened(m, share)
    copy_on(f.padded, m.fresh, f.rate)
    drive(f)


@seldom
def temper(m: March) -> bool:
    """Let accelerations that a run sets out with be less, where parts would be thrown: by what `firm` has made.

    Tell whether they are.
    """
    f = m.flat
    copy_on(f.padded, m.rate, m.fresh)
    clear(f.padded, m.before)
    less = felt(m) and lessened(m, 1.0 / (m.beta * m.h * m.h))
    copy_on(f.padded, m.fresh, m.rate)
    copy_on(f.padded, m.fresh, f.rate)
    return less


def felt(m: March) -> bool:
    """Tell whether a step feels that accelerations jump."""
    most = 0.0 * eight(m.weight)
    for i in range(0, m.flat.padded, 8):
        most = larger(most, abs(eight(m.fresh[i:]) - eight(m.before[i:])) * eight(m.weight[i:]))
    return m.beta * m.h * m.h * largest(most) > m.least


@seldom
def lessened(m: March, share: float) -> bool:
    """Put tempered accelerations in the place of fresh ones, where these throw parts; tell whether they do.

    ``share`` makes forces held over a step of the tangent.
    """
    f = m.flat
    copy_on(f.padded, m.before, f.rate)
    for k in range(CORRECTIONS):
        press_all(m)
        f.force[f.n] = 0.0
        if k == 0:
            copy_on(f.padded, f.force, m.asked)
        solved(m.axes, m.tangent, m.fronts, f.force)
        if k == 0 and not thrown(m, share):
            return False
        for i in range(0, f.padded, 8):
            put(f.rate[i:], eight(f.rate[i:]) - share * eight(f.force[i:]))
    copy_on(f.padded, f.rate, m.fresh)
    return True


@seldom
def thrown(m: March, share: float) -> bool:
    """Tell whether forces do far more work over the mass alone than held."""
    f = m.flat
    free = 0.0 * eight(m.weight)
    held = free
    for i in range(0, f.padded, 8):
        free = free + eight(m.asked[i:]) * (eight(m.fresh[i:]) - eight(m.before[i:]))
        held = held - eight(m.asked[i:]) * eight(f.force[i:])
    work = THROWN * share * total(held)
    return work > 0.0 and total(free) > work


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
    at_rest_in(m)
    sloped(m, 1.0, m.gamma / (m.beta * m.h), 1.0 / (m.beta * m.h * m.h))
    copy_on(f.padded, m.rate, f.rate)
    for k in range(m.flows.count):
        m.entries[m.flows.cells[k]] = -_FIRM * m.flows.mass
    where = factor(m.fronts, m.entries, m.tangent.diagonal, m.tangent.down, m.tangent.up)
    m.made_for = -1.0
    if where >= 0:
        m.worst = whose(m.fronts, where)
        return False
    mark(m.axes, m.tangent, f)
    return True
