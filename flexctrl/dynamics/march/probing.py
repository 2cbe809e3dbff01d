"""Tangents in compiled loops where levers turn them: differences of the forces, many columns at a time.

Where nodes are placed by others (drives, rigid parts, rails), the tangent of pieces is not that of the machine: what
levers do as they turn comes on top. Here the forces themselves are asked. Columns without a row in common are probed
together (A. R. Curtis, M. J. D. Powell, J. K. Reid, J. Inst. Maths Applics 13 (1974) 117). Where one would reach over
a corner of a law of force, they are probed the other way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexctrl.dynamics.march.corners import Corners, value
from flexctrl.kernels.eights import eight, put
from flexctrl.kernels.native import Reals, Wholes, seldom
from flexctrl.model.flat.flat import arrive, clear, drive, place, press_entire, push
from flexctrl.model.flat.flattened import Flattened
from flexctrl.model.flat.workspace import Flat

__all__ = ["Probes", "probe", "probes_of"]

_STEP = 1e-7
"""Of a place, in yardsticks; rates and accelerations that come with it only add to the forces."""
_SLIGHT = 1e-3
"""Of the rates there are, where steps have failed: drag is no longer linear in more."""
_PULL = 1e4
"""Of an acceleration alone, in which forces are linear."""


@dataclass
class Probes:
    """Which columns are probed together, and where their entries go.

    Attributes
    ----------
    groups : int
        0: tangents are made otherwise.
    starts, columns : Wholes
        Where each group begins; the degrees of freedom in it.
    firsts, rows, cells : Wholes
        Where the entries of each of these columns begin; their rows, and where they stand in the fronts.
    size : Reals
        What an error of 1 is, of each of them.
    base, step, v, rate, driven : Reals
        Forces and motion between probes.
    """

    LASTING = ("groups",)

    groups: int
    starts: Wholes
    columns: Wholes
    firsts: Wholes
    rows: Wholes
    cells: Wholes
    size: Reals
    base: Reals
    step: Reals
    v: Reals
    rate: Reals
    driven: Reals


def probes_of(F: Flattened, weight: np.ndarray) -> Probes:
    """Return the probes of a model; none if its tangents are those of its pieces."""
    if F.flat.tangents:
        none, empty = np.zeros(0, dtype=int), np.zeros(0)
        return Probes(0, none, none, none, none, none, empty, empty, empty, empty, empty, empty)
    found = F.model.__dict__.get("_probed")
    if found is None:
        found = F.model.__dict__["_probed"] = _grouped(F)
    groups, starts, columns, firsts, rows, cells = found
    base, step, v, rate = np.zeros((4, F.flat.padded))
    # what has no yardstick only adds to the forces
    units, driven = F.model.motion.unjudged, F.flat.driven
    plain = np.array([units.get(name, 1.0) for name in F.model.coordinates]) / _STEP
    far = np.divide(1.0, weight, out=plain, where=weight > 0.0)
    size, driven = F.ordered(far), np.zeros_like(driven)
    return Probes(groups, starts, columns, firsts, rows, cells, size, base, step, v, rate, driven)


def _grouped(F: Flattened) -> tuple[int, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Columns in groups that share no row, and the entries of each."""
    n, order = F.flat.n, F.plan.position
    damping = F.model.viscous.tocoo()
    keys = np.concatenate([n * F.pattern[1] + F.pattern[0], n * damping.col + damping.row])
    own = np.unique(keys)
    columns, rows = own // n, own % n
    cells = F.plan.places(rows, columns)
    bounds = np.searchsorted(columns, np.arange(n + 1))
    taken: list[np.ndarray] = []
    groups: list[list[int]] = []
    for j in np.argsort(-np.diff(bounds), kind="stable").tolist():
        mine = rows[bounds[j] : bounds[j + 1]]
        k = next((k for k, used in enumerate(taken) if not used[mine].any()), len(taken))
        if k == len(taken):
            taken.append(np.zeros(n, dtype=bool))
            groups.append([])
        taken[k][mine] = True
        groups[k].append(j)
    chosen = np.array([j for group in groups for j in group], dtype=int)
    entries = np.concatenate([np.arange(bounds[j], bounds[j + 1]) for j in chosen.tolist()])
    return (
        len(groups),
        np.cumsum([0, *map(len, groups)]),
        order[chosen],
        np.cumsum([0, *np.diff(bounds)[chosen].tolist()]),
        order[rows[entries]],
        cells[entries],
    )


@seldom
def probe(
    p: Probes,
    f: Flat,
    c: Corners,
    whole: int,
    on_place: float,
    on_rate: float,
    on_acceleration: float,
    least: float,
    entries: Reals,
) -> None:
    """Fill in the slope of the forces, by kernels of the whole machine maybe, for motions that add these times an
    increment; increments as small as ``least`` where rates would not be as they are."""
    clear(f.entries, entries)
    for i in range(f.drives):
        p.driven[i] = f.driven[i]
        f.driven[i] = f.found[i] - f.about[i]  # what the step adds to it brings it there, whole turns and all
    for i in range(0, f.padded, 8):
        put(p.step[i:], eight(f.step[i:]))
        put(p.v[i:], eight(f.v[i:]))
        put(p.rate[i:], eight(f.rate[i:]))
    far = _STEP if on_place > 0.0 else _PULL
    if least < far and on_rate > 0.0:
        far = max(least, min(far, _SLIGHT * swiftest(p, f) / on_rate))
    forces(f, whole, on_place)
    for i in range(0, f.padded, 8):
        put(p.base[i:], eight(f.force[i:]))
    watched = on_place > 0.0 and c.lines + c.turns + c.rails > 0
    if watched:
        seen(c, f, whole)
    for k in range(p.groups):
        way = far
        try_out(p, f, k, way * on_place, way * on_rate, way * on_acceleration)
        forces(f, whole, on_place)
        if watched and strays(c, f, whole):
            way = -far
            try_out(p, f, k, way * on_place, way * on_rate, way * on_acceleration)
            forces(f, whole, on_place)
        for g in range(p.starts[k], p.starts[k + 1]):
            j = p.columns[g]
            share = 1.0 / (way * p.size[j])
            for i in range(p.firsts[g], p.firsts[g + 1]):
                row = p.rows[i]
                entries[p.cells[i]] = (f.force[row] - p.base[row]) * share
        try_out(p, f, k, 0.0, 0.0, 0.0)
    forces(f, whole, on_place)
    for i in range(f.drives):
        f.driven[i] = p.driven[i]


def try_out(p: Probes, f: Flat, k: int, on_place: float, on_rate: float, on_acceleration: float) -> None:
    """Add increments to the motion of a group as it was, in yardsticks."""
    for g in range(p.starts[k], p.starts[k + 1]):
        j = p.columns[g]
        f.step[j] = p.step[j] + on_place * p.size[j]
        f.v[j] = p.v[j] + on_rate * p.size[j]
        f.rate[j] = p.rate[j] + on_acceleration * p.size[j]


@seldom
def seen(c: Corners, f: Flat, whole: int) -> None:
    """Take up how far parts are beyond their corners where the motion under way is."""
    if whole == 1:
        arrive(f)
    for k in range(c.lines + c.turns + c.rails):
        c.there[k] = value(c, f, k)


@seldom
def strays(c: Corners, f: Flat, whole: int) -> bool:
    """Tell whether a probe has passed a corner: the law of force beyond is not the one whose slope is asked for."""
    if whole == 1:
        arrive(f)
    passed = False
    for k in range(c.lines + c.turns + c.rails):
        passed = passed or c.there[k] * value(c, f, k) < 0.0
    return passed


def swiftest(p: Probes, f: Flat) -> float:
    """Return the largest rate there is, in yardsticks."""
    most = 0.0
    for i in range(f.n):
        most = max(most, abs(f.v[i]) / p.size[i])
    return most


def forces(f: Flat, whole: int, on_place: float) -> None:
    """Sum up the forces of the motion under way."""
    if whole == 1:
        press_entire(f)
        return
    if on_place > 0.0:
        place(f)
    drive(f)
    push(f)
