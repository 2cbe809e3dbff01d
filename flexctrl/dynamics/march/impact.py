"""Impacts at corners in compiled loops: how stiff and heavy what hits is; see `flexctrl.dynamics.events.impact`."""

from __future__ import annotations

import math

from flexctrl.dynamics.events.impact import LASTING, SMALL, STEPS, finer
from flexctrl.dynamics.march.books import reach
from flexctrl.dynamics.march.record import March
from flexctrl.dynamics.march.step import press_all
from flexctrl.kernels.eights import eight, put, total
from flexctrl.kernels.native import seldom
from flexctrl.model.flat.flat import clear, load

__all__ = ["follow_impact", "stiffness"]


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
    load(f)  # which machines with kernels for all of it go without
    press_all(m)
    power = 0.0 * eight(m.weight)
    f.force[f.n] = 0.0
    for i in range(0, f.padded, 8):
        power = power + eight(f.force[i:]) * eight(m.v[i:])
    return total(power)


@seldom
def follow_impact(m: March, stiffer: float) -> None:
    """Follow an impact by short steps; see `events.impact.lasts`."""
    mass = along_rates(m, 0.0, 0.0) - along_rates(m, 0.0, 1.0)
    clear(m.flat.padded, m.flat.step)
    reach(m)
    m.follow = 0
    m.cap = 0.0
    if stiffer > 0.0 and mass > 2.0 * SMALL * m.turnover:
        times = finer(m.relative + m.absolute / max(m.reached, m.absolute), 3.0)
        m.follow = int(LASTING * times)
        m.cap = math.sqrt(mass / stiffer) / (STEPS * times)
