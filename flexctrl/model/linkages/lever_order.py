"""In which order the followers of a long linkage are worked off, and what is shortened before."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flexctrl.structure.relations import Copy, Follow, Ride, dependencies

__all__ = ["in_runs", "shortened"]


def shortened(follows: Sequence[Follow], rest: np.ndarray) -> list[Follow]:
    """Let what is pinned to a rider ride on its master: chains of links are levers of one kind then."""
    riders: dict[int, Ride] = {f.node: f for f in follows if isinstance(f, Ride)}
    copies: dict[int, list[Copy]] = defaultdict(list)
    for f in follows:
        if isinstance(f, Copy) and f.freedom < 3:
            copies[f.node].append(f)
    found: list[Follow] = []
    for f in follows:
        mine = copies.get(f.node, []) if isinstance(f, Copy) and f.freedom < 3 else []
        master = riders.get(f.master) if len(mine) == 3 and len({c.master for c in mine}) == 1 else None
        if master is None or not np.array_equal(rest[f.node], rest[master.node]):
            found.append(f)
        elif f is mine[0]:
            riders[f.node] = replace(master, node=f.node)
            found.append(riders[f.node])
    return found


def in_runs(follows: Sequence[Follow]) -> list[Follow]:
    """Order followers so that masters come first, and as many of a kind as can be one after the other."""
    waiting, behind = dependencies(follows)
    ready: dict[object, deque[int]] = defaultdict(deque)
    for i in range(len(follows)):
        if not waiting[i]:
            ready[_sort(follows[i])].append(i)
    order = []
    while kind := next((k for k, some in ready.items() if some), None):
        while ready[kind]:
            i = ready[kind].popleft()
            order.append(follows[i])
            for j in behind.get(i, ()):
                waiting[j] -= 1
                if not waiting[j]:
                    ready[_sort(follows[j])].append(j)
    return order


def _sort(f: Follow) -> tuple[object, ...]:
    return (type(f), isinstance(f, Ride) and f.along is not None, f.freedom if isinstance(f, Copy) else -1)
