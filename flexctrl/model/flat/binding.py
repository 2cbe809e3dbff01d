"""The kernels of a flat model, bound to what they read and add to in its workspace."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.kernels.kernel import Kernel, Run
from flexctrl.mechanics.rotation import near_rotation_of, rotation_of, turn_kernel
from flexctrl.model.flat.entries import entry, entry_energy, entry_slope
from flexctrl.model.flat.unfolding import unfolded_tangents
from flexctrl.model.laws.kinds import DRIVE_SLOT, NODE_SLOT
from flexctrl.model.linkages.levers import Levers

if TYPE_CHECKING:
    from flexctrl.model.flat.layout import Layout

__all__ = [
    "energies",
    "entry_energies",
    "entry_forces",
    "entry_slopes",
    "forces",
    "gusts",
    "linkage",
    "tangents",
    "turn",
    "winding",
]


def forces(layout: Layout) -> list[Run]:
    """Sums of the forces of all pieces, in the order of tiles."""
    base, sources = layout.forces.drive_base, layout.motion.source_base
    goal = layout.starts["force"] + layout.targets
    bind = layout.backend.bind
    return [
        bind(f.kernels.force, f.gather(base)[order], f.parameters[order], goal[f.scatter(sources)[order]])
        for f, order in zip(layout.forces.families, layout.tiling.orders, strict=True)
    ]


def energies(layout: Layout) -> list[Run]:
    """Sums of their energies."""
    base, bind = layout.forces.drive_base, layout.backend.bind
    return [
        bind(f.kernels.energy, f.gather(base), f.parameters, np.tile(np.arange(3), (f.count, 1)))
        for f in layout.forces.families
    ]


def tangents(layout: Layout) -> list[Run]:
    """Their tangents, added to the fronts."""
    if layout.unfolds:
        return unfolded_tangents(layout)
    rows, columns, kept = layout.pattern
    places = np.full(layout.forces.entries, layout.plan.length)
    places[kept] = layout.plan.places(rows, columns)
    runs = []
    families = zip(layout.forces.families, layout.forces.block_starts, layout.tiling.orders, strict=True)
    for f, start, order in families:
        size = f.kernels.kind.width**2
        seeds = np.tile(layout.starts["seeds"] + np.arange(3), (f.count, 1))
        gather = np.hstack([f.gather(layout.forces.drive_base), seeds])
        scatter = places[start : start + f.count * size].reshape(f.count, size)
        runs.append(layout.backend.bind(f.kernels.tangent, gather[order], f.parameters[order], scatter[order]))
    return [*runs, _gust_slopes(layout, places)] if layout.model.gusts else runs


def gusts(layout: Layout) -> Run:
    """Forces of gusts."""
    gusts, goal = layout.model.gusts, layout.starts["force"] + layout.targets
    gather = gusts.gather(layout.starts["u"])
    return layout.backend.bind(gusts.kernels.force, gather, gusts.parameters, goal[gusts.scatter])


def _gust_slopes(layout: Layout, places: np.ndarray) -> Run:
    """Into the blocks of the nodes in the wind."""
    gusts, bind = layout.model.gusts, layout.backend.bind
    seeds = np.tile(layout.starts["seeds"] + np.arange(3), (len(gusts.nodes), 1))
    gather = np.hstack([gusts.gather(layout.starts["u"]), seeds])
    scatter = places[layout.forces.wind_blocks].reshape(-1, 9)
    return bind(gusts.kernels.tangent, gather, gusts.parameters, scatter)


def turn(layout: Layout, nodes: np.ndarray) -> tuple[Run, Run]:
    """Rotations of nodes, turned by a step that turns them little, or by any."""
    old = layout.starts["pose"] + 12 * nodes[:, None] + 3 + np.arange(9)
    theta = layout.starts["step"] + layout.position[layout.owned[nodes, 3:]]
    new = NODE_SLOT * nodes[:, None] + 3 + np.arange(9)
    both, none = np.hstack([old, theta]), np.zeros((len(nodes), 0))
    near, far = (layout.backend.bind(turn_kernel(by), both, none, new) for by in (near_rotation_of, rotation_of))
    return near, far


def linkage(layout: Layout) -> dict[str, tuple[Run, ...]]:
    """Places, rates and accelerations of nodes that follow, and the forces on them on the degrees of freedom."""
    m, starts = layout.motion, layout.starts
    if m.plain:
        return dict.fromkeys(("placing", "rating", "changing", "carrying"), ())
    if isinstance(m.linkage, Levers):
        return m.linkage.bound(layout.backend, layout.lever_places)._asdict()
    place, rates, accelerations, collect = m.linkage.kernels[:4]
    rigid = layout.forces.drive_base + DRIVE_SLOT * np.flatnonzero(m.rigid)
    slot = NODE_SLOT * m.nodes[:, None]
    pose, own = (slot + np.arange(12)).ravel(), layout.position[m.linked]
    before = (starts["pose"] + 12 * m.nodes[:, None] + np.arange(12)).ravel()
    v, a = starts["v"] + own, starts["rate"] + own
    speeds, changes = ((slot + k + np.arange(6)).ravel() for k in (12, 18))
    raw = starts["force"] + layout.padded + np.arange(len(layout.linked))
    speed, change = np.concatenate([speeds, rigid + 1]), np.concatenate([changes, rigid + 2])
    return {
        "placing": (_bind(layout, place, np.concatenate([before, starts["step"] + own]), pose),),
        "rating": (_bind(layout, rates, np.concatenate([pose, v]), speed),),
        "changing": (_bind(layout, accelerations, np.concatenate([pose, v, a]), change),),
        "carrying": (_bind(layout, collect, np.concatenate([pose, raw]), starts["force"] + own),),
    }


def winding(layout: Layout, levers: str) -> tuple[Run, Run]:
    """Driven coordinates, and what a step adds to them with levers of some pose."""
    m, drives = layout.motion, np.arange(len(layout.motion.drives))
    pose = (NODE_SLOT * m.nodes[:, None] + np.arange(12)).ravel()
    before = (layout.starts[levers] + 12 * m.nodes[:, None] + np.arange(12)).ravel()
    step = layout.starts["step"] + layout.position[m.linked]
    return (
        _bind(layout, m.linkage.kernels[4], pose, layout.starts["found"] + drives),
        _bind(layout, m.linkage.kernels[5], np.concatenate([before, step]), layout.starts["about"] + drives),
    )


def entry_forces(layout: Layout) -> Run:
    """Forces of entries of matrices."""
    rows, columns, values = layout.entries
    at = layout.position[columns]
    place = (*layout.coordinates, "step")
    gather = np.column_stack([layout.starts[name] + at for name in (*place, "v", "rate")])
    scatter = layout.starts["force"] + layout.position[rows][:, None]
    return layout.backend.bind(entry(len(place)), gather, values, scatter)


def entry_slopes(layout: Layout) -> Run:
    """Those entries, added to the fronts."""
    rows, columns, values = layout.entries
    seeds = np.tile(layout.starts["seeds"] + np.arange(3), (len(rows), 1))
    return layout.backend.bind(entry_slope(), seeds, values, layout.plan.places(rows, columns)[:, None])


def entry_energies(layout: Layout) -> Run:
    """Their energies."""
    rows, columns, values = layout.entries
    place = layout.coordinates
    ends = [layout.starts[name] + layout.position[cells] for cells in (rows, columns) for name in (*place, "v")]
    books = np.tile(np.arange(3), (len(rows), 1))
    return layout.backend.bind(entry_energy(len(place)), np.column_stack(ends), values, books)


def _bind(layout: Layout, kernel: Kernel, gather: np.ndarray, scatter: np.ndarray) -> Run:
    """One item."""
    return layout.backend.bind(kernel, gather[None], np.zeros((1, 0)), scatter[None])
