"""Motion along stiff lines, where steps change their length.

Along a line that it does not resolve, generalised alpha with steps of one length h has places that are right, speeds
that are ahead by κ h² times their second derivative, κ = 1/6 − β + (γ − 1/2)/2, and accelerations of its own that are
ahead by (α_m − α_f) h times it: so Newmark's formulas go through the places of a line that keeps its length (Arnold,
Brüls & Cardona 2015 show how the order of the forces hangs on that). A step of another length that sets out with what
the last one left takes the difference for an acceleration, and the tension goes to and fro for some steps, off by a
first order. So both are given what the step to come would have.

A line that keeps its length l has l''' = 0: with w and a, what its ends' relative velocity and acceleration have across
it, and s, how fast they part, that gives the second derivative of the speed along it, −3 (w·a − s w²/l)/l, without a
look at accelerations along the line, which go to and fro themselves.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexctrl.dynamics.scales import once
from flexctrl.dynamics.swift.stiff_lines import ends_of, frequencies, giving_way, mobility
from flexctrl.kernels.native import Reals, Wholes, seldom
from flexctrl.model.flat.flat import clear
from flexctrl.model.model import Model
from flexctrl.structure.drives import Winch
from flexctrl.structure.lines import Rope

__all__ = ["CHANGED", "Lags", "lag_share", "lagged", "lags_of"]

CHANGED = 1e-6
"""Share of a step by which another one is of another length."""
_ALONG = 7
"""Coordinates that lengthen a line: three of each end, and the motor that pays it out."""
_SWEEPS, _LEFT = 40, 1e-3
_TINY = 1e-300


@dataclass
class Lags:
    """Lines that give way between nodes that move freely or not at all.

    Attributes
    ----------
    count, size : int
        Of lines; of vectors.
    nodes : Wholes
        At the ends (2 each).
    cells : Wholes
        Degrees of freedom that lengthen each (7); −1 for none.
    drives, ratios : Wholes, Reals
        The drive that pays it out, and how much it shortens the line; of no account where that is 0.
    lengths : Reals
        How long each is before it pulls; 0 where it pushes as well.
    firm : Reals
        Frequencies [rad/s].
    light : Reals
        One over the mass of each degree of freedom.
    rows : Reals
        How far a unit of each degree of freedom lengthens each line (7).
    own : Reals
        How much each line would lengthen under a unit of its own pull; 0 where it is out of account.
    wanted : Reals
        Second derivative of the speed along each.
    change : Reals
        Second derivative of the rates of the degrees of freedom, as far as pulls along the lines make it.
    """

    LASTING = ("count",)

    count: int
    size: int
    nodes: Wholes
    cells: Wholes
    drives: Wholes
    ratios: Reals
    lengths: Reals
    firm: Reals
    light: Reals
    rows: Reals
    own: Reals
    wanted: Reals
    change: Reals


def lag_share(beta: float, gamma: float) -> float:
    """Return κ: speeds along stiff lines are ahead by κ h² times their second derivative."""
    return 1.0 / 6.0 - beta + 0.5 * (gamma - 0.5)


def lags_of(model: Any, place: np.ndarray, padded: int) -> Lags:
    """Return the lines of a model that may lag.

    Parameters
    ----------
    model : Plant
    place : numpy.ndarray of int, shape (n,)
        Where each degree of freedom stands in the vectors.
    padded : int
        Length of these, ≥ n.
    """
    lines = list(_lines(model))
    k = [line for line, _ in lines]
    winches = [line if isinstance(line, Winch) else None for line in k]
    light = np.zeros(padded)
    if k:
        light[place] = once(model, mobility)
    return Lags(
        count=len(k),
        size=padded,
        nodes=np.array([ends_of(model, line) for line in k], dtype=int).ravel(),
        cells=np.array([_cells(model, line, np.append(place, -1)) for line in k], dtype=int).ravel(),
        drives=np.array([0 if w is None else model.structure.drives.index(w) for w in winches], dtype=int),
        ratios=np.array([0.0 if w is None else -1.0 / w.effective_ratio for w in winches]),
        lengths=np.array([line.length if isinstance(line, Rope | Winch) else 0.0 for line in k]),
        firm=np.array([frequency for _, frequency in lines]),
        light=light,
        rows=np.zeros(_ALONG * len(k)),
        own=np.zeros(len(k)),
        wanted=np.zeros(len(k)),
        change=np.zeros(padded),
    )


def _lines(model: Any) -> Iterator[tuple[Any, float]]:
    """Lines that turn between nodes with freedoms of their own or none, and their frequencies [rad/s]."""
    found = once(model, frequencies).tolist()
    if found:
        motion = model.motion
        following = set(motion.nodes[(motion.place[motion.nodes, :3] >= motion.n).any(axis=1)].tolist())
        for line, frequency in zip(giving_way(model), found, strict=True):
            if frequency > 0.0 and not following & set(ends_of(model, line)):
                yield line, frequency


def _cells(model: Model, line: Any, place: np.ndarray) -> list[int]:
    m = model.motion
    cells = [int(place[m.place[end, j]]) for end in ends_of(model, line) for j in range(3)]
    return [*cells, int(place[m.sources[model.structure.drives.index(line)]]) if isinstance(line, Winch) else -1]


@seldom
def lagged(g: Lags, pose: Reals, driven: Reals, v: Reals, rate: Reals, span: float) -> bool:
    """Find how rates change along stiff lines, in ``change``; tell whether there are any.

    Parameters
    ----------
    g : Lags
    pose : Reals
        Places and rotations of the nodes (12 each).
    driven : Reals
        Source angles of the drives.
    v, rate : Reals
        Rates and accelerations.
    span : float
        What a line vibrates by in that tells whether it is stiff [s].
    """
    some = False
    for k in range(g.count):
        g.own[k] = 0.0
        if span * g.firm[k] > 1.0 and taut(g, k, pose, driven):
            g.own[k] = given(g, k)
            g.wanted[k] = hastened(g, k, pose, v, rate)
            some = some or g.own[k] > 0.0
    if some:
        relax(g)
    return some


@seldom
def taut(g: Lags, k: int, pose: Reals, driven: Reals) -> bool:
    """Find which way a line points, and how degrees of freedom lengthen it; tell whether it pulls."""
    row = g.rows[_ALONG * k :]
    start = pose[12 * g.nodes[2 * k] :]
    end = pose[12 * g.nodes[2 * k + 1] :]
    x = end[0] - start[0]
    y = end[1] - start[1]
    z = end[2] - start[2]
    length = math.sqrt(x * x + y * y + z * z)
    short = 1.0 / max(length, _TINY)
    row[3] = short * x
    row[4] = short * y
    row[5] = short * z
    row[6] = g.ratios[k]
    for j in range(3):
        row[j] = -row[3 + j]
    paid = row[6] * driven[g.drives[k]] if row[6] != 0.0 else 0.0
    return length > 0.0 and length + paid >= g.lengths[k]


@seldom
def given(g: Lags, k: int) -> float:
    """Return how much a line would lengthen under a unit of its own pull."""
    total = 0.0
    for j in range(_ALONG):
        i = g.cells[_ALONG * k + j]
        if i >= 0:
            total += g.rows[_ALONG * k + j] * g.rows[_ALONG * k + j] * g.light[i]
    return total


@seldom
def hastened(g: Lags, k: int, pose: Reals, v: Reals, rate: Reals) -> float:
    """Return the second derivative of the speed along a line that keeps its length."""
    row = g.rows[_ALONG * k :]
    start = pose[12 * g.nodes[2 * k] :]
    end = pose[12 * g.nodes[2 * k + 1] :]
    cells = g.cells[_ALONG * k :]
    length = 0.0
    parting = 0.0
    speed = 0.0
    both = 0.0
    along = 0.0
    for j in range(3):
        a = cells[j]
        b = cells[3 + j]
        w = (v[b] if b >= 0 else 0.0) - (v[a] if a >= 0 else 0.0)
        c = (rate[b] if b >= 0 else 0.0) - (rate[a] if a >= 0 else 0.0)
        length += row[3 + j] * (end[j] - start[j])
        parting += row[3 + j] * w
        along += row[3 + j] * c
        speed += w * w
        both += w * c
    across = max(speed - parting * parting, 0.0)
    return -3.0 * (both - parting * along - parting * across / length) / length


@seldom
def relax(g: Lags) -> None:
    """Find what pulls along the lines must make of the rates, for what is wanted along all of them."""
    clear(g.size, g.change)
    most = 0.0
    for k in range(g.count):
        if g.own[k] > 0.0:
            most = max(most, abs(g.wanted[k]))
    for _ in range(_SWEEPS):
        left = 0.0
        for k in range(g.count):
            if g.own[k] > 0.0:
                left = max(left, abs(pulled(g, k)))
        if left <= _LEFT * most:
            return


@seldom
def pulled(g: Lags, k: int) -> float:
    """Add what one line still wants; return that."""
    gap = g.wanted[k]
    for j in range(_ALONG):
        i = g.cells[_ALONG * k + j]
        if i >= 0:
            gap -= g.rows[_ALONG * k + j] * g.change[i]
    for j in range(_ALONG):
        i = g.cells[_ALONG * k + j]
        if i >= 0:
            g.change[i] += gap / g.own[k] * g.rows[_ALONG * k + j] * g.light[i]
    return gap
