"""Accelerations beyond a corner of a law of force, in compiled loops; as `outset.join` finds them."""

from __future__ import annotations

from flexctrl.dynamics.march.axes import solved
from flexctrl.dynamics.march.books import reach
from flexctrl.dynamics.march.flowing import released
from flexctrl.dynamics.march.jumping import jump
from flexctrl.dynamics.march.record import DONE, SINGULAR, March
from flexctrl.dynamics.march.step import press_all
from flexctrl.dynamics.march.tempering import at_rest_in, firm, may_throw, temper
from flexctrl.kernels.eights import eight, put
from flexctrl.kernels.native import seldom
from flexctrl.model.flat.flat import clear, energy
from flexctrl.model.flat.solving import copy_on

__all__ = ["lengthen", "start_anew", "started"]

_SHARE = 1e-4


@seldom
def start_anew(m: March) -> int:
    """Find the accelerations under the law of force that holds from now on, and the method's own.

    The lead of these on the true ones is (α_m − α_f) h times the rate of the accelerations; see `outset.join`.
    """
    f = m.flat
    m.made_for = -1.0
    m.lean = 1.0
    m.came = 0.0
    clear(f.padded, m.trend)
    clear(f.padded, f.step)
    copy_on(f.padded, m.v, f.v)
    reach(m)
    m.unsure = 1
    status = jump(m)
    m.unsure = 0
    if status != DONE:
        return status
    clear(f.padded, f.step)
    copy_on(f.padded, m.v, f.v)
    copy_on(f.padded, m.rate, f.rate)
    at_rest_in(m)
    if m.losing == 1 and m.flows.count == 0:
        energy(f)
        m.power = f.books[2]
    if not firm(m):
        return SINGULAR
    m.factorisations += 1
    if may_throw(m):
        temper(m)
    forces_change(m)
    at_rest_in(m)
    give_lead(m)
    return DONE


@seldom
def started(m: March) -> int:
    """Find the accelerations with which a run sets out, and the method's own."""
    f = m.flat
    m.unsure = 1  # no rates are known that a change of the inputs could be added to
    status = jump(m)
    m.unsure = 0
    if status == DONE and may_throw(m):
        if not firm(m):
            return SINGULAR
        if temper(m):
            m.factorisations += 1
            copy_on(f.padded, m.rate, m.algorithmic)
        at_rest_in(m)
    return status


@seldom
def lengthen(m: March) -> None:
    """Make accelerations anew where those of a far shorter step would throw parts over the one about to be taken."""
    f = m.flat
    clear(f.padded, f.step)
    copy_on(f.padded, m.v, f.v)
    if may_throw(m) and firm(m) and temper(m):
        m.factorisations += 1
        copy_on(f.padded, m.rate, m.algorithmic)
        clear(f.padded, m.trend)
        m.lean = 1.0
    at_rest_in(m)


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
    copy_on(f.padded, m.v, f.v)


@seldom
def forces_in(m: March, t: float) -> None:
    """Sum up the forces a time later."""
    f = m.flat
    for i in range(0, f.padded, 8):
        put(f.step[i:], t * eight(m.v[i:]))
        put(f.v[i:], eight(m.v[i:]) + t * eight(m.rate[i:]))
    press_all(m)


@seldom
def give_lead(m: March) -> None:
    """Give the method's own accelerations their lead."""
    c = m.corners
    f = m.flat
    released(m.flows, c.change)
    copy_on(f.padded, c.change, f.force)
    f.force[f.n] = 0.0
    solved(m.axes, m.tangent, m.fronts, f.force)
    released(m.flows, f.force)
    share = (m.alpha_f - m.alpha_m) / (m.beta * m.h)
    for i in range(0, f.padded, 8):
        put(m.algorithmic[i:], eight(m.rate[i:]) + share * eight(f.force[i:]))
