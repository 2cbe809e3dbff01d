"""Generalised alpha in compiled loops: the guess that a step begins with."""

from __future__ import annotations

import math

from flexctrl.dynamics.alpha.coning import LARGEST, eta
from flexctrl.dynamics.march.lagging import CHANGED, lag_share, lagged
from flexctrl.dynamics.march.record import EVALUATE, PRESSED, March
from flexctrl.kernels.eights import Eight, eight, larger, largest, put, rounded
from flexctrl.kernels.native import Reals, seldom
from flexctrl.model.flat.flat import press_beyond, press_tile

__all__ = ["blended", "cone", "predict", "restore"]


def predict(m: March) -> None:
    """Guess the end of the step: accelerations change as in the last one, by the share that told that one best."""
    f = m.flat
    if m.lags.count > 0:
        hasten(m)
    m.iteration = 0
    m.last = math.inf
    m.contraction = 0.0
    m.strayed = 0.0
    m.short = 0.0
    spun = 0.0 * eight(m.turns)
    if tiled(m):
        m.phase = PRESSED
        coned = 0
        for k in range(f.tiles.count):
            last = f.tiles.freedoms[k + 1]
            spun = larger(spun, guess(m, f.tiles.freedoms[k], last))
            first = coned
            while coned < m.coning and m.cones[3 * coned + 2] < last:
                coned += 1
            cone(m, f.v, -1.0, first, coned)
            press_tile(f, k)
        press_beyond(f)
    else:
        m.phase = EVALUATE
        spun = guess(m, 0, f.padded)
        cone(m, f.v, -1.0, 0, m.coning)
    m.fastest = largest(spun)


def tiled(m: March) -> bool:
    """Tell whether forces are summed up tile by tile, and nothing acts on the guess before that."""
    return m.flat.tiles.count > 0 and m.contacts.count == 0 and m.answering == 0 and m.swift != 1


def guess(m: March, first: int, last: int) -> Eight:
    """Guess the end of the step for some freedoms; return their rates at its start, if they turn something."""
    f = m.flat
    h = m.h
    spun = 0.0 * eight(m.turns)
    for i in range(first, last, 8):
        rate = eight(m.rate[i:]) + m.lean * eight(m.trend[i:])
        own = eight(m.algorithmic[i:])
        lead = blended(m, rate, eight(m.rate[i:]), own)
        put(f.rate[i:], rate)
        put(f.step[i:], h * eight(m.v[i:]) + h * h * ((0.5 - m.beta) * own + m.beta * lead))
        put(f.v[i:], eight(m.v[i:]) + h * ((1.0 - m.gamma) * own + m.gamma * lead))
        spun = larger(spun, abs(eight(m.v[i:])) * eight(m.turns[i:]))
    return spun


@seldom
def hasten(m: March) -> None:
    """Give motion along stiff lines what the step to come would have; see `lagging`."""
    f = m.flat
    if m.lagging == m.h:
        return
    restore(m)
    if not (m.came > 0.0 and abs(m.h - m.came) > CHANGED * m.came):
        return
    if lagged(m.lags, f.pose, f.driven, m.v, m.rate, min(m.h, m.came)):
        m.lagging = m.h
        speeds = lag_share(m.beta, m.gamma) * (m.h * m.h - m.came * m.came)
        own = (m.alpha_m - m.alpha_f) * (m.h - m.came)
        for i in range(0, f.padded, 8):
            change = eight(m.lags.change[i:])
            put(m.left[i:], eight(m.v[i:]))
            put(m.own[i:], eight(m.algorithmic[i:]))
            put(m.v[i:], eight(m.v[i:]) + speeds * change)
            put(m.algorithmic[i:], eight(m.algorithmic[i:]) + own * change)


@seldom
def restore(m: March) -> None:
    """Set the start of the step back to what the last one left."""
    if m.lagging > 0.0:
        for i in range(0, m.flat.padded, 8):
            put(m.v[i:], eight(m.left[i:]))
            put(m.algorithmic[i:], eight(m.own[i:]))
    m.lagging = 0.0


def cone(m: March, spins: Reals, share: float, first: int, last: int) -> None:
    """Add to some freedoms' step what it has beside the integral of spins, for a share of others at its end."""
    h = m.h
    cells = m.cones[0:]
    v = m.v[0:]
    step = m.flat.step[0:]
    for k in range(first, last):
        x = cells[3 * k]
        y = cells[3 * k + 1]
        z = cells[3 * k + 2]
        p = h * v[x]
        q = h * v[y]
        r = h * v[z]
        a = spins[x]
        b = spins[y]
        c = spins[z]
        weight = share * h * eta(min(p * p + q * q + r * r, LARGEST))
        step[x] += weight * (q * c - r * b)
        step[y] += weight * (r * a - p * c)
        step[z] += weight * (p * b - q * a)


def blended(m: March, rate: Eight, before: Eight, own: Eight) -> Eight:
    """Return the method's own acceleration after a step, from the true ones at both ends and its own before.

    Rounded, as it is kept: what errors go by is the same number wherever it is worked out.
    """
    return rounded(1.0 / (1.0 - m.alpha_m), (1.0 - m.alpha_f) * rate + m.alpha_f * before - m.alpha_m * own)
