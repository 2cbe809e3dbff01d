"""Loops of rigid parts in compiled loops: steps at which one may be about to lock or to branch are left to plain ones.

The steps themselves close the loops: that is in the kernels of the linkage. What is looked at after each is whether
they did, and the tests of `Motion.dead_point` in a stricter form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexctrl.kernels.kernel import Kernel
from flexctrl.kernels.native import Reals, Runs, seldom
from flexctrl.model.flat.flat import clear, drive
from flexctrl.model.flat.flattened import Flattened
from flexctrl.model.flat.workspace import Flat
from flexctrl.model.laws.kinds import NODE_SLOT
from flexctrl.model.motion import APART

__all__ = ["Closing", "closing_of", "in_doubt", "settled"]

_OPEN = 1e-12
_LEVER = 100.0
_PIVOT = 1e-3
_ENDLESS = 1e300


@dataclass
class Closing:
    """The loops of a linkage.

    Attributes
    ----------
    looks, loops, spare, free : int
        All conditions; those that close loops; those only watched; freedoms of the linkage that do not follow from
        others.
    look : Runs
        The kernel of the gaps of the loops, how fast they open with the freedoms, and how that changes with those
        that follow, by columns.
    found, work : Reals
        What it finds; room for the elimination.
    watch : Runs
        The kernel of the gaps of what is only watched.
    gaps : Reals
        What it finds.
    before : Reals
        How fast the loops opened with the freedoms that follow, at the start of the step, by columns.
    turning : float
        How fast that changed there, in itself [1/s].
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
    look: Runs
    found: Reals
    work: Reals
    watch: Runs
    gaps: Reals
    before: Reals
    most: float
    play: float
    open: float = 0.0
    turning: float = 0.0


def closing_of(F: Flattened) -> Closing:
    """Return the loops of a model."""
    motion, base = F.model.motion, F.model.motion.linkage
    loops = len(base.loops) if F.model.large and not base.idle else 0
    spare, free = len(base.spare) if F.model.large else 0, base.free if loops else 0
    nodes = NODE_SLOT * motion.nodes[:, None]
    pose, moving = (nodes + np.arange(12)).ravel()[None], (nodes + 12 + np.arange(6)).ravel()[None]
    found, gaps = np.zeros(loops * (1 + free + 2 * loops)), np.zeros(spare)

    def bound(kernel: Kernel, gather: np.ndarray, size: int) -> Runs:
        return (F.model.backend.bind(kernel, gather, np.zeros((1, 0)), np.arange(size)[None]),)

    look = bound(base.gauge, np.hstack([pose, moving]), found.size) if loops else ()
    watch = bound(base.playing, pose, spare) if spare else ()
    work, before = np.zeros(loops * (free + 3 * loops)), np.zeros(loops * loops)
    return Closing(loops + spare, loops, spare, free, look, found, work, watch, gaps, before, _OPEN, APART)


@seldom
def settled(c: Closing, f: Flat) -> None:
    """Take up a state that has been entered."""
    looked(c, f)
    taken_up(c)
    c.turning = _ENDLESS if locking(c) else farthest_off(c, c.free + c.loops, 0.0)


@seldom
def looked(c: Closing, f: Flat) -> None:
    """Look at the loops."""
    drive(f)
    clear(c.loops * (1 + c.free + 2 * c.loops), c.found)
    c.look[0](f.z, c.found)


@seldom
def taken_up(c: Closing) -> None:
    """Keep how fast the loops open with the freedoms that follow."""
    start = c.loops * (1 + c.free)
    for i in range(c.loops * c.loops):
        c.before[i] = c.found[start + i]


@seldom
def in_doubt(c: Closing, f: Flat, h: float) -> bool:
    """Tell whether a loop may be at a dead point after the step under way, or something is open; take it up."""
    if c.spare > 0 and comes_apart(c, f):
        return True
    if c.loops == 0:
        return False
    looked(c, f)
    for i in range(c.loops):
        if not abs(c.found[i]) <= c.most:
            return True
        c.open = max(c.open, abs(c.found[i]))
    if locking(c):
        return True
    came = farthest_off(c, c.free + 2 * c.loops, 1.0)
    turning = farthest_off(c, c.free + c.loops, 0.0)
    doubt = not max(came, h * max(turning, c.turning)) < 1.0
    c.turning = turning
    taken_up(c)
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
    width = c.free + 3 * n
    for j in range(c.free + n):
        most = 0.0
        for i in range(n):
            most = max(most, abs(c.found[n + n * j + i]))
        if j >= c.free and not most > 0.0:
            return True
        scale = 1.0 / most if j >= c.free else 1.0
        for i in range(n):
            c.work[width * i + j] = scale * c.found[n + n * j + i]
            if j >= c.free:
                c.work[width * i + j + n] = scale * c.found[n + n * (j + n) + i]
                c.work[width * i + j + 2 * n] = scale * c.before[n * (j - c.free) + i]
    for k in range(n):
        if not eliminated(c, k):
            return True
    return far(c)


@seldom
def eliminated(c: Closing, k: int) -> bool:
    """Eliminate the dependent freedom k from the rows after it; tell whether its pivot is no small one."""
    n = c.loops
    width = c.free + 3 * n
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
        share = c.work[width * i + c.free + k] / c.work[width * k + c.free + k]
        if i != k and share != 0.0:
            for j in range(width):
                c.work[width * i + j] -= share * c.work[width * k + j]
    return True


@seldom
def far(c: Closing) -> bool:
    """Tell whether some freedom moves the dependent ones much further than the loop by itself."""
    n = c.loops
    width = c.free + 3 * n
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
def farthest_off(c: Closing, start: int, own: float) -> float:
    """Return how far some slopes are from so many times those of the loops, in the measure of these."""
    n = c.loops
    width = c.free + 3 * n
    most = 0.0
    for i in range(n):
        size = 0.0
        for j in range(n):
            found = c.work[width * i + start + j] / c.work[width * i + c.free + i]
            size += abs(found - own) if i == j else abs(found)
        most = max(most, size)
    return most
