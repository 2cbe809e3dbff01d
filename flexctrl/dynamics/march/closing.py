"""Loops of rigid parts in compiled loops: steps at which one may be about to lock or to branch are left to plain ones.

The steps themselves close the loops: that is in the kernels of the linkage. What is looked at after each is whether
they did, and the tests of `Motion.dead_point` and `Motion.turned_back` in a stricter form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexctrl.kernels.kernel import Kernel
from flexctrl.kernels.native import Reals, Runs, Wholes, seldom
from flexctrl.model.flat.flat import clear, drive
from flexctrl.model.flat.flattened import Flattened
from flexctrl.model.flat.workspace import Flat
from flexctrl.model.laws.kinds import NODE_SLOT
from flexctrl.model.motion import APART

__all__ = ["Closing", "closing_of", "in_doubt", "settled"]

_OPEN = 1e-12
_LEVER = 100.0
_PIVOT = 1e-3
_FULL = 0.05
_UNEXPLAINED = 2.0


@dataclass
class Closing:
    """The loops of a linkage.

    Attributes
    ----------
    looks, loops, spare, free, rates : int
        All conditions; those that close loops; those only watched; freedoms of the linkage that do not follow from
        others; raw rates.
    look : Runs
        The kernel of the gaps of the loops, and how fast they open with the freedoms, by columns.
    found, work : Reals
        What it finds; room for the elimination.
    watch : Runs
        The kernel of the gaps of what is only watched.
    gaps : Reals
        What it finds.
    cells : Wholes
        The raw rates in the workspace.
    speeds : Reals
        Their values at the start of the step.
    most, play : float
        How far a loop may be open, and what is only watched [rad, or shares of what it spans].
    open : float
        How far any has been.
    """

    LASTING = ("looks", "loops", "spare")

    looks: int
    loops: int
    spare: int
    free: int
    rates: int
    look: Runs
    found: Reals
    work: Reals
    watch: Runs
    gaps: Reals
    cells: Wholes
    speeds: Reals
    most: float
    play: float
    open: float = 0.0


def closing_of(F: Flattened) -> Closing:
    """Return the loops of a model."""
    motion, base = F.model.motion, F.model.motion.linkage
    loops = len(base.loops) if F.model.large and not base.idle else 0
    spare, free = len(base.spare) if F.model.large else 0, base.free if loops else 0
    nodes = NODE_SLOT * motion.nodes[:, None]
    pose = (nodes + np.arange(12)).ravel()[None]
    cells = (nodes + 12 + np.arange(6)).ravel() if loops else np.zeros(0, dtype=int)
    found, gaps = np.zeros(loops * (1 + free + loops)), np.zeros(spare)

    def bound(kernel: Kernel, size: int) -> Runs:
        return (F.model.backend.bind(kernel, pose, np.zeros((1, 0)), np.arange(size)[None]),)

    look = bound(base.gauge, found.size) if loops else ()
    watch = bound(base.playing, spare) if spare else ()
    work, speeds = np.zeros(loops * (free + loops)), np.zeros(cells.size)
    return Closing(
        loops + spare, loops, spare, free, cells.size, look, found, work, watch, gaps, cells, speeds, _OPEN, APART
    )


@seldom
def settled(c: Closing, f: Flat) -> None:
    """Take up the rates of a state that has been entered."""
    drive(f)
    for i in range(c.rates):
        c.speeds[i] = f.z[c.cells[i]]


@seldom
def in_doubt(c: Closing, f: Flat, h: float) -> bool:
    """Tell whether a loop may be at a dead point after the step under way, or something is open; take up its rates."""
    if c.spare > 0 and comes_apart(c, f):
        return True
    if c.loops == 0:
        return False
    clear(c.loops * (1 + c.free + c.loops), c.found)
    c.look[0](f.z, c.found)
    for i in range(c.loops):
        if not abs(c.found[i]) <= c.most:
            return True
        c.open = max(c.open, abs(c.found[i]))
    if locking(c):
        return True
    drive(f)
    doubt = sent_back(c, f, h)
    for i in range(c.rates):
        c.speeds[i] = f.z[c.cells[i]]
    return doubt


@seldom
def comes_apart(c: Closing, f: Flat) -> bool:
    """Tell whether something that is only watched is open after the step under way."""
    clear(c.spare, c.gaps)
    c.watch[0](f.z, c.gaps)
    for i in range(c.spare):
        if not abs(c.gaps[i]) <= c.play:
            return True
        c.open = max(c.open, abs(c.gaps[i]))
    return False


@seldom
def locking(c: Closing) -> bool:
    """Tell whether dependent freedoms move far with the others: work that out, by elimination."""
    n = c.loops
    width = c.free + n
    for j in range(width):
        most = 0.0
        for i in range(n):
            most = max(most, abs(c.found[n + n * j + i]))
        if j >= c.free and not most > 0.0:
            return True
        scale = 1.0 / most if j >= c.free else 1.0
        for i in range(n):
            c.work[width * i + j] = scale * c.found[n + n * j + i]
    for k in range(n):
        if not eliminated(c, k):
            return True
    return far(c)


@seldom
def eliminated(c: Closing, k: int) -> bool:
    """Eliminate the dependent freedom k from the rows after it; tell whether its pivot is no small one."""
    n = c.loops
    width = c.free + n
    best = k
    for i in range(k + 1, n):
        if abs(c.work[width * i + c.free + k]) > abs(c.work[width * best + c.free + k]):
            best = i
    if not abs(c.work[width * best + c.free + k]) > _PIVOT:
        return False
    for j in range(width):
        kept = c.work[width * k + j]
        c.work[width * k + j] = c.work[width * best + j]
        c.work[width * best + j] = kept
    for i in range(n):
        if i != k:
            share = c.work[width * i + c.free + k] / c.work[width * k + c.free + k]
            for j in range(width):
                c.work[width * i + j] -= share * c.work[width * k + j]
    return True


@seldom
def far(c: Closing) -> bool:
    """Tell whether some freedom moves the dependent ones much further than the loop by itself."""
    n = c.loops
    width = c.free + n
    for j in range(c.free):
        own = 0.0
        moved = 0.0
        for i in range(n):
            own = max(own, abs(c.found[n + n * j + i]))
            moved = max(moved, abs(c.work[width * i + j] / c.work[width * i + c.free + i]))
        if moved > _LEVER * own:
            return True
    return False


@seldom
def sent_back(c: Closing, f: Flat, h: float) -> bool:
    """Tell whether parts that move at full speed have turned back over the step, more than they were pulled."""
    fastest = 0.0
    for i in range(c.rates):
        fastest = max(fastest, max(abs(c.speeds[i]), abs(f.z[c.cells[i]])))
    for i in range(c.rates):
        first = c.speeds[i]
        last = f.z[c.cells[i]]
        fast = max(abs(first), abs(last)) > _FULL * fastest
        if first * last < 0.0 and fast and abs(last - first) > _UNEXPLAINED * h * abs(f.z[c.cells[i] + 6]):
            return True
    return False
