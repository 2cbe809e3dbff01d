"""Long linkages in a flat model: where levers read and write, and the entries of unfolded tangents."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexctrl.kernels.kernel import Run
from flexctrl.model.flat.fronts import Plan, plan_of
from flexctrl.model.laws.kinds import DRIVE_SLOT, NODE_SLOT
from flexctrl.model.linkages.levers import Places
from flexctrl.model.unfolded import one

if TYPE_CHECKING:
    from flexctrl.model.flat.layout import Layout

__all__ = ["lever_places", "together", "unfolded_plan", "unfolded_tangents"]


def lever_places(layout: Layout) -> Places:
    """Return where the workspace holds what levers read and write."""
    m, starts = layout.motion, layout.starts
    own = np.append(layout.position[m.linked], m.n)
    slots = NODE_SLOT * m.nodes
    speeds = (slots[:, None] + 12 + np.arange(6)).ravel()
    rigid = layout.forces.drive_base + DRIVE_SLOT * np.flatnonzero(m.rigid)
    return Places(
        slots=slots,
        before=starts["pose"] + 12 * m.nodes,
        step=starts["step"] + own,
        v=starts["v"] + own,
        a=starts["rate"] + own,
        rates=np.append(speeds, rigid + 1),
        changes=np.append(speeds + 6, rigid + 2),
        force=starts["force"] + layout.targets[m.linked_cells],
        goal=starts["force"] + own,
    )


def unfolded_plan(layout: Layout) -> Plan:
    """Return how unfolded tangents are eliminated: what levers say from the followers to their masters."""
    u = layout.forces.unfolded
    some = [u.pattern, *u.pieces(*layout.forces.pattern), layout.entries[:2]]
    rows, columns = (np.concatenate(each) for each in zip(*some, strict=True))
    kept = (rows >= 0) & (columns >= 0)
    return plan_of(*u.filled(rows[kept], columns[kept]), u.size, layout.motion.n, u.after)


def unfolded_tangents(layout: Layout) -> list[Run]:
    """Slopes of pieces by the degrees of freedom, and by what levers say; of levers; ones on the diagonal."""
    u, bind, spare, plan = layout.forces.unfolded, layout.backend.bind, layout.plan.length, layout.plan
    seeds, units = layout.starts["seeds"] + np.arange(3), layout.starts["units"] + np.arange(9).reshape(3, 3)
    runs = []
    for (rows, columns), seed in zip(u.pieces(*layout.forces.pattern), (seeds, *units), strict=True):
        kept = (rows >= 0) & (columns >= 0)
        places = np.full(len(rows), spare)
        places[kept] = plan.places(rows[kept], columns[kept])
        for f, start in zip(layout.forces.families, layout.forces.block_starts, strict=True):
            size = f.kernels.kind.width**2
            scatter = places[start : start + f.count * size].reshape(f.count, size)
            some = (scatter < spare).any(axis=1)
            gather = np.hstack([f.gather(layout.forces.drive_base), np.tile(seed, (f.count, 1))])
            if some.any():
                runs.append(bind(f.kernels.tangent, gather[some], f.parameters[some], scatter[some]))
    for share in u.shares:
        kept = share.rows >= 0
        places = np.full(share.rows.shape, spare)
        places[kept] = plan.places(share.rows[kept], share.columns[kept])
        runs += share.bound(layout.backend, share.gather(layout.lever_places, seeds, int(units[0, 0])), places)
    said = np.arange(layout.motion.n, u.size)
    ones = np.full((len(said), 1), units[0, 0])
    return [*runs, bind(one(), ones, np.zeros((len(said), 0)), plan.places(said, said)[:, None])]


def together(plan: Plan) -> tuple[np.ndarray, np.ndarray]:
    """Return all pairs of degrees of freedom that are in a front together."""
    f, own = plan.fronts, np.full(plan.fronts.n, -1)
    own[f.seats] = plan.order
    rows, columns = [np.zeros(0, dtype=int)], [np.zeros(0, dtype=int)]
    for k in range(f.count):
        pivots, others = f.first[k] + np.arange(f.pivots[k]), f.others[f.rest[k] : f.rest[k] + f.size[k] - f.pivots[k]]
        some = own[np.append(pivots, others)]
        some = some[some >= 0]
        rows.append(np.repeat(some, len(some)))
        columns.append(np.tile(some, len(some)))
    return np.concatenate(rows), np.concatenate(columns)
