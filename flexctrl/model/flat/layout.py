"""The layout of a flat model: which entry of the workspace each kernel reads and adds to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from flexctrl.kernels.kernel import Backend, Kernel, Run
from flexctrl.mechanics.rotation import turn_kernel
from flexctrl.model.flat.axes import Axes, axes_of
from flexctrl.model.flat.entire import Entire, entire_of
from flexctrl.model.flat.entries import entry, entry_energy, entry_slope
from flexctrl.model.flat.flat import HIDDEN, Flat
from flexctrl.model.flat.fronts import Plan, plan_of
from flexctrl.model.gauges import Gauges, gauges_of
from flexctrl.model.laws.kinds import DRIVE_SLOT, NODE_SLOT
from flexctrl.model.linkages.levers import Levers, Places
from flexctrl.model.model import Model
from flexctrl.model.state import Dry, State
from flexctrl.model.unfolded import one

__all__ = ["Flattened", "Layout"]

_ALIGNED = 64
_ROUND_OFF = 1e-12


@dataclass(frozen=True, eq=False)
class Flattened:
    """A model on flat vectors, and how to bring states there and back.

    Attributes
    ----------
    model : Model
    flat : Flat
    gauges : Gauges
        Its outputs.
    axes : Axes
        Of its tangents.
    plan : Plan
        How its tangents are eliminated; degrees of freedom stand in that order.
    pattern : tuple of numpy.ndarray
        Rows and columns of their entries (with repeats).
    constants : tuple of int and numpy.ndarray
        What the workspace holds from some place on that never changes.
    entire : Entire
        Kernels of the whole machine, where it has few freedoms.
    """

    model: Model
    flat: Flat
    gauges: Gauges
    axes: Axes
    plan: Plan
    pattern: tuple[np.ndarray, np.ndarray]
    constants: tuple[int, np.ndarray]
    entire: Entire

    def ordered(self, x: np.ndarray) -> np.ndarray:
        """Return values of the degrees of freedom in the order of elimination, padded with zeros."""
        out = np.zeros(self.flat.padded)
        out[: self.flat.n] = x[self.plan.order]
        return out

    def own(self, x: np.ndarray) -> np.ndarray:
        """Return values of the degrees of freedom in the model's order."""
        out = np.empty(self.flat.n)
        out[self.plan.order] = x[: self.flat.n]
        return out

    def enter(self, state: State) -> None:
        """Put a state at the start of a step."""
        f, forces, (first, values) = self.flat, self.model.forces, self.constants
        still = np.zeros(f.n)
        f.z[first : first + values.size] = values
        f.z[: forces.slot_count] = forces.slots(state, state.v, still)
        f.pose.reshape(-1, 12)[:] = np.hstack([state.x, state.R.reshape(-1, 9)])
        f.q[:], f.driven[:] = self.ordered(state.q), state.driven
        self.gauges.shown[:], self.gauges.summed[:] = state.shown, self.model.motion.winding @ state.q
        f.step[:], f.v[:], f.rate[:] = 0.0, self.ordered(state.v), 0.0

    @property
    def keeps_shape(self) -> bool:
        """Whether what never changes in poses is as the kernels of the whole machine take it to be."""
        return bool((abs(self.flat.z[self.entire.cells] - self.entire.values) <= _ROUND_OFF).all())

    def state(self, v: np.ndarray, t: float, dry: Dry) -> State:
        """Return the state at the start of the step, with rates ``v`` in the order of elimination.

        Its outputs have been read.
        """
        found = self.pose_state(self.flat.pose, self.flat.q, v, self.flat.driven, t, dry)
        return replace(found, shown=self.gauges.shown.copy())

    def pose_state(
        self, pose: np.ndarray, q: np.ndarray, v: np.ndarray, driven: np.ndarray, t: float, dry: Dry
    ) -> State:
        """Return the state of a pose (12 a node) and values in the order of elimination."""
        rows = pose.reshape(-1, 12)
        x, R = rows[:, :3].copy(), rows[:, 3:].reshape(-1, 3, 3).copy()
        return State(x, R, self.own(q), self.own(v), driven.copy(), t, dry)


class Layout:
    """The workspace of a model, part by part."""

    def __init__(self, model: Model) -> None:
        self.model, self.motion, self.forces = model, model.motion, model.forces
        self.backend: Backend = model.backend
        m = self.motion
        self.padded = (m.n // 8 + 1) * 8
        self.linked = m.said
        self.carried = -(-len(self.linked) // 8) * 8
        self.sizes = self._sizes()
        ends = np.cumsum([0, *(-(-size // 8) * 8 for size in self.sizes.values())])
        self.starts = dict(zip(self.sizes, ends.tolist(), strict=False))
        self.length = int(ends[-1])

    def _sizes(self) -> dict[str, int]:
        return {
            "slots": self.forces.slot_count,
            "seeds": 3,
            "pose": 12 * len(self.motion.place),
            **dict.fromkeys(("step", "v", "rate"), self.padded),
            **dict.fromkeys(("force", "load"), self.padded + self.carried),
            "q": self.padded,
            **dict.fromkeys(("found", "about", "driven"), len(self.motion.drives)),
            "answer": self.padded,
            "books": 3,
            "u": len(self.model.inputs),
            "shift": 0,
            "units": 9 if self.unfolds else 0,
        }

    @cached_property
    def pattern(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows and columns of the tangent in degrees of freedom; which entries of the blocks they are, if plain."""
        m = self.motion
        raw = self.forces.pattern
        if self.unfolds:
            return (*_together(self.plan), np.zeros(0, dtype=int))
        if m.plain:
            rows, columns = (m.cells[cells] for cells in raw)
            kept = np.flatnonzero((rows < m.n) & (columns < m.n))
            return rows[kept], columns[kept], kept
        found = self._slopes().tocoo()
        return found.row, found.col, np.zeros(0, dtype=int)

    def _slopes(self) -> sp.csr_matrix:
        """A matrix with all entries that slopes have: those of levers in a place where none vanishes by chance, as
        pieces push on them even where they do not (slack ropes), as they turn in motion, and all along rails. Through
        rigid loops all may depend on all."""
        m, rng = self.motion, np.random.default_rng(0)
        step, v, a = rng.uniform(0.1, 0.4, (3, m.n))
        u = rng.uniform(0.5, 1.0, len(self.model.inputs))
        pushed = sp.csr_matrix((np.ones(len(self.forces.pattern[0])), self.forces.pattern), shape=(m.raw, m.raw))
        found = sp.csr_matrix((m.n, m.n))
        for moved in m.along_rails(step):
            state = m.advance(m.rest, moved, v, 0.0)
            T = abs(m.jacobian(state))
            found = found + abs(self.model.slope(state, v, a, (1.0, 2.0, 3.0), u)) + T.T @ pushed @ T
        if not m.linkage.loops:
            return found
        closed = np.isin(np.arange(m.n), m.linked).astype(float)
        return found + sp.csr_matrix(np.outer(closed, closed))

    @cached_property
    def entries(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows and columns of what acts on the degrees of freedom themselves; its entries of K, C, M and of a load."""
        damping = self.model.viscous.tocoo()
        values = np.zeros((damping.nnz, 4))
        values[:, 1] = damping.data
        return damping.row, damping.col, values

    @property
    def unfolds(self) -> bool:
        """Whether tangents are unfolded, what levers say being unknowns of their own."""
        return self.long and not self.model.signals.follows and not self.model.gusts

    @cached_property
    def plan(self) -> Plan:
        if self.unfolds:
            u, entries = self.forces.unfolded, self.entries[:2]
            some = [u.pattern, *u.pieces(*self.forces.pattern), entries]
            rows, columns = (np.concatenate(each) for each in zip(*some, strict=True))
            kept = (rows >= 0) & (columns >= 0)
            return plan_of(*u.filled(rows[kept], columns[kept]), u.size, self.motion.n, u.after)
        rows, columns = (np.concatenate([a, b]) for a, b in zip(self.pattern[:2], self.entries[:2], strict=True))
        return plan_of(rows, columns, self.motion.n)

    @cached_property
    def position(self) -> np.ndarray:
        """Place of each degree of freedom in the order of elimination; the last entry is for none."""
        return np.append(self.plan.position, self.motion.n)

    @cached_property
    def targets(self) -> np.ndarray:
        """Where each raw force is added, from the start of ``force``."""
        found = self.position[self.motion.owned]
        found[self.linked] = self.padded + np.arange(len(self.linked))
        return found

    def made(self, spare: int = 0) -> Flattened:
        """Return the model on a workspace of its own, with so many entries more behind it."""
        z = _aligned(self.length + spare)
        part = {name: z[start : start + self.sizes[name]] for name, start in self.starts.items()}
        for hidden in HIDDEN & set(part):
            del part[hidden]
        vectors: dict[str, Any] = {"z": z, **part}
        flat = Flat(
            **vectors,
            **self.numbers,
            **self.tables,
            **self.runs,
            entire=self.entire.runs,
            quick=len(self.entire.runs),
            pressing=int(self.entire.pressing),
        )
        shown, summed = np.zeros((2, self._gauges.turning))
        gauges = replace(self._gauges, sums=np.zeros(self._gauges.rows), shown=shown, summed=summed)
        return Flattened(self.model, flat, gauges, self._axes, self.plan, self.pattern[:2], self.constants, self.entire)

    @property
    def constants(self) -> tuple[int, np.ndarray]:
        """What the workspace holds from some place on that never changes."""
        return self.starts["units"], np.eye(3).ravel()[: self.sizes["units"]]

    @cached_property
    def entire(self) -> Entire:
        """Kernels of the whole machine."""
        return entire_of(self)

    @cached_property
    def _gauges(self) -> Gauges:
        return gauges_of(self.model, self.starts["q"], self.plan.position)

    @cached_property
    def _axes(self) -> Axes:
        return axes_of(self.model, self.plan, self.pattern[:2])

    @cached_property
    def own(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Nodes with freedoms of their own alone, or beside what levers say; those that move, and those that turn."""
        m = self.motion
        own = np.setdiff1d(np.arange(len(m.place)), [] if m.plain or self.long else m.nodes)
        moved, turned = (own[(self._owned[own, cells] < m.n).any(axis=1)] for cells in (slice(3), slice(3, 6)))
        return own, moved, turned

    @property
    def long(self) -> bool:
        """Whether levers are worked off in loops."""
        return isinstance(self.motion.linkage, Levers)

    @cached_property
    def _owned(self) -> np.ndarray:
        """Degree of freedom of each node's six, shape (nodes, 6)."""
        return self.motion.owned[: self.motion.source_base].reshape(-1, 6)

    @cached_property
    def _kept(self) -> tuple[np.ndarray, np.ndarray]:
        """Nodes that move and nodes that turn by freedoms of their own or by levers."""
        said = np.zeros(self.motion.raw, dtype=bool)
        said[self.linked if self.long else []] = True
        nodes = said[: self.motion.source_base].reshape(-1, 2, 3)
        moves, turns = (np.flatnonzero(nodes[:, k].any(axis=1)) for k in (0, 1))
        return np.union1d(self.own[1], moves), np.union1d(self.own[2], turns)

    @cached_property
    def _whole(self) -> np.ndarray:
        """Nodes whose six degrees of freedom are their own and follow each other."""
        own = self.own[0]
        cells = self.position[self._owned[own]]
        return own[(np.diff(cells, axis=1) == 1).all(axis=1) & (cells[:, -1] < self.motion.n)]

    @cached_property
    def tables(self) -> dict[str, Any]:
        m, owned = self.motion, self._owned
        own, moved, turned = (np.setdiff1d(nodes, self._whole) for nodes in (self.own[0], *self._kept))
        cells = self.position[owned[own]]
        nodes, freedoms = np.nonzero(cells < m.n)
        loads = self.model.signals.loads.tocoo()
        return {
            "whole": np.column_stack([self._whole, self.position[owned[self._whole, 0]]]).ravel(),
            "moved": moved,
            "turned": turned,
            "linked": np.zeros(0, dtype=int) if m.plain or self.long else m.nodes,
            "cells": self.position[owned].ravel(),
            "slots": NODE_SLOT * own[nodes] + 12 + freedoms,
            "sources": cells[nodes, freedoms],
            "shafts": self.position[np.concatenate([m.sources, m.inner])],
            "rigid": m.rigid.astype(np.int64),
            "rotary": m.rotary.astype(np.int64),
            "ratios": m.ratios,
            "spun": self._spun,
            "inputs": np.concatenate([self.targets[loads.row], loads.col]).astype(np.int64),
            "unit": loads.data.astype(float),
            "follows": self._follows(),
            "toward": np.array([d for f in self.model.signals.follows for d in f.direction], dtype=float),
        }

    @cached_property
    def numbers(self) -> dict[str, Any]:
        m, tables = self.motion, self.tables
        return {
            "n": m.n,
            "padded": self.padded,
            "size": self.length,
            "nodes": len(m.place),
            "wholes": len(self._whole),
            "moving": len(tables["moved"]),
            "turning": len(tables["turned"]),
            "turns": len(self.runs["turn"]),
            "linking": len(tables["linked"]),
            "placed": len(self.runs["placing"]),
            "levers": len(self.runs["rating"]),
            "slopes": len(self.runs["tangents"]),
            "rates": len(tables["slots"]),
            "drives": len(m.drives),
            "spinning": len(self._spun),
            "inner": m.inner.size,
            "pieces": len(self.runs["forces"]),
            "shifting": self.sizes["shift"],
            "unit_loads": len(tables["unit"]),
            "gusting": len(self.runs["gusts"]),
            "following": len(self.model.signals.follows),
            "carried": self.carried,
            "entries": self.plan.length,
            "drive_base": self.forces.drive_base,
        }

    @cached_property
    def runs(self) -> dict[str, Any]:
        m, turned = self.motion, self.own[2]
        own_tangents = (m.plain and not self.model.signals.follows) or self.unfolds
        damped = bool(self.model.viscous.nnz)
        return {
            "turn": (self._turn(turned),) if len(turned) else (),
            **self._linkage(),
            "winding": self._winding("pose") if m.drives else (),
            "forces": (*self._forces(), *([self._entry_forces()] if damped else [])),
            "tangents": (*([self._entry_slopes()] if damped else []), *self._tangents()) if own_tangents else (),
            "energies": (*self._energies(), *([self._entry_energies()] if damped else [])),
            "shifts": (),
            "gusts": (self._gusts(),) if self.model.gusts else (),
        }

    @property
    def _coordinates(self) -> tuple[str, ...]:
        """What adds up to the coordinates at the start of a step, as the equations count them."""
        return ("q",)

    def _entry_forces(self) -> Run:
        rows, columns, values = self.entries
        at = self.position[columns]
        place = (*self._coordinates, "step")
        gather = np.column_stack([self.starts[name] + at for name in (*place, "v", "rate")])
        scatter = self.starts["force"] + self.position[rows][:, None]
        return self.backend.bind(entry(len(place)), gather, values, scatter)

    def _entry_slopes(self) -> Run:
        rows, columns, values = self.entries
        seeds = np.tile(self.starts["seeds"] + np.arange(3), (len(rows), 1))
        return self.backend.bind(entry_slope(), seeds, values, self.plan.places(rows, columns)[:, None])

    def _entry_energies(self) -> Run:
        rows, columns, values = self.entries
        place = self._coordinates
        ends = [self.starts[name] + self.position[cells] for cells in (rows, columns) for name in (*place, "v")]
        books = np.tile(np.arange(3), (len(rows), 1))
        return self.backend.bind(entry_energy(len(place)), np.column_stack(ends), values, books)

    def _follows(self) -> np.ndarray:
        follows = self.model.signals.follows
        return np.array([w for f in follows for w in (f.input, f.node, *self.targets[f.cell : f.cell + 3])], dtype=int)

    def _bind(self, kernel: Kernel, gather: np.ndarray, scatter: np.ndarray) -> Run:
        """One item."""
        return self.backend.bind(kernel, gather[None], np.zeros((1, 0)), scatter[None])

    def _turn(self, nodes: np.ndarray) -> Run:
        old = self.starts["pose"] + 12 * nodes[:, None] + 3 + np.arange(9)
        theta = self.starts["step"] + self.position[self._owned[nodes, 3:]]
        new = NODE_SLOT * nodes[:, None] + 3 + np.arange(9)
        return self.backend.bind(turn_kernel(), np.hstack([old, theta]), np.zeros((len(nodes), 0)), new)

    def _linkage(self) -> dict[str, tuple[Run, ...]]:
        """What levers do: places, rates, accelerations, forces."""
        m, starts = self.motion, self.starts
        if m.plain:
            return dict.fromkeys(("placing", "rating", "changing", "carrying"), ())
        if isinstance(m.linkage, Levers):
            runs = m.linkage.bound(self.backend, self.lever_places)
            return {name: getattr(runs, name) for name in ("placing", "rating", "changing", "carrying")}
        place, rates, accelerations, collect = m.linkage.kernels[:4]
        rigid = self.forces.drive_base + DRIVE_SLOT * np.flatnonzero(m.rigid)
        slot = NODE_SLOT * m.nodes[:, None]
        pose, own = (slot + np.arange(12)).ravel(), self.position[m.linked]
        before = (starts["pose"] + 12 * m.nodes[:, None] + np.arange(12)).ravel()
        v, a = starts["v"] + own, starts["rate"] + own
        speeds, changes = ((slot + k + np.arange(6)).ravel() for k in (12, 18))
        raw = starts["force"] + self.padded + np.arange(len(self.linked))
        return {
            "placing": (self._bind(place, np.concatenate([before, starts["step"] + own]), pose),),
            "rating": (self._bind(rates, np.concatenate([pose, v]), np.concatenate([speeds, rigid + 1])),),
            "changing": (
                self._bind(accelerations, np.concatenate([pose, v, a]), np.concatenate([changes, rigid + 2])),
            ),
            "carrying": (self._bind(collect, np.concatenate([pose, raw]), starts["force"] + own),),
        }

    @cached_property
    def lever_places(self) -> Places:
        """Where the workspace holds what levers read and write."""
        m, starts = self.motion, self.starts
        own = np.append(self.position[m.linked], m.n)
        slots = NODE_SLOT * m.nodes
        speeds = (slots[:, None] + 12 + np.arange(6)).ravel()
        rigid = self.forces.drive_base + DRIVE_SLOT * np.flatnonzero(m.rigid)
        return Places(
            slots=slots,
            before=starts["pose"] + 12 * m.nodes,
            step=starts["step"] + own,
            v=starts["v"] + own,
            a=starts["rate"] + own,
            rates=np.append(speeds, rigid + 1),
            changes=np.append(speeds + 6, rigid + 2),
            force=starts["force"] + self.targets[m.linked_cells],
            goal=starts["force"] + own,
        )

    @cached_property
    def _spun(self) -> np.ndarray:
        return self.position[self.motion.linked] if self.motion.rotary.any() else np.zeros(0, dtype=int)

    def _winding(self, levers: str) -> tuple[Run, Run]:
        """Driven coordinates, and what a step adds to them with levers of some pose."""
        m, drives = self.motion, np.arange(len(self.motion.drives))
        pose = (NODE_SLOT * m.nodes[:, None] + np.arange(12)).ravel()
        before = (self.starts[levers] + 12 * m.nodes[:, None] + np.arange(12)).ravel()
        step = self.starts["step"] + self.position[m.linked]
        return (
            self._bind(m.linkage.kernels[4], pose, self.starts["found"] + drives),
            self._bind(m.linkage.kernels[5], np.concatenate([before, step]), self.starts["about"] + drives),
        )

    def _forces(self) -> list[Run]:
        base, sources = self.forces.drive_base, self.motion.source_base
        goal = self.starts["force"] + self.targets
        bind = self.backend.bind
        return [
            bind(f.kernels.force, f.gather(base), f.parameters, goal[f.scatter(sources)]) for f in self.forces.families
        ]

    def _gusts(self) -> Run:
        gusts, goal = self.model.gusts, self.starts["force"] + self.targets
        gather = gusts.gather(self.starts["u"])
        return self.backend.bind(gusts.kernels.force, gather, gusts.parameters, goal[gusts.scatter])

    def _gust_slopes(self, places: np.ndarray) -> Run:
        """Into the blocks of the nodes in the wind."""
        gusts, bind = self.model.gusts, self.backend.bind
        seeds = np.tile(self.starts["seeds"] + np.arange(3), (len(gusts.nodes), 1))
        gather = np.hstack([gusts.gather(self.starts["u"]), seeds])
        scatter = places[self.forces.wind_blocks].reshape(-1, 9)
        return bind(gusts.kernels.tangent, gather, gusts.parameters, scatter)

    def _energies(self) -> list[Run]:
        base, bind = self.forces.drive_base, self.backend.bind
        return [
            bind(f.kernels.energy, f.gather(base), f.parameters, np.tile(np.arange(3), (f.count, 1)))
            for f in self.forces.families
        ]

    def _unfolded(self) -> list[Run]:
        """Slopes of pieces by the degrees of freedom, and by what levers say; of levers; ones on the diagonal."""
        u, backend, spare = self.forces.unfolded, self.backend, self.plan.length
        rows, columns = self.forces.pattern
        seeds, units = self.starts["seeds"] + np.arange(3), self.starts["units"] + np.arange(9).reshape(3, 3)
        runs = []
        for (r, c), seed in zip(u.pieces(rows, columns), (seeds, *units), strict=True):
            kept = (r >= 0) & (c >= 0)
            places = np.full(len(r), spare)
            places[kept] = self.plan.places(r[kept], c[kept])
            for f, start in zip(self.forces.families, self.forces.block_starts, strict=True):
                size = f.kernels.kind.width**2
                scatter = places[start : start + f.count * size].reshape(f.count, size)
                some = (scatter < spare).any(axis=1)
                gather = np.hstack([f.gather(self.forces.drive_base), np.tile(seed, (f.count, 1))])
                if some.any():
                    runs.append(backend.bind(f.kernels.tangent, gather[some], f.parameters[some], scatter[some]))
        for share in u.shares:
            kept = share.rows >= 0
            places = np.full(share.rows.shape, spare)
            places[kept] = self.plan.places(share.rows[kept], share.columns[kept])
            runs += share.bound(backend, share.gather(self.lever_places, seeds, int(units[0, 0])), places)
        said = np.arange(self.motion.n, u.size)
        ones = np.full((len(said), 1), units[0, 0])
        diagonal = self.plan.places(said, said)[:, None]
        return [*runs, backend.bind(one(), ones, np.zeros((len(said), 0)), diagonal)]

    def _tangents(self) -> list[Run]:
        if self.unfolds:
            return self._unfolded()
        rows, columns, kept = self.pattern
        places = np.full(self.forces.entries, self.plan.length)
        places[kept] = self.plan.places(rows, columns)
        runs = []
        for f, start in zip(self.forces.families, self.forces.block_starts, strict=True):
            size = f.kernels.kind.width**2
            seeds = np.tile(self.starts["seeds"] + np.arange(3), (f.count, 1))
            gather = np.hstack([f.gather(self.forces.drive_base), seeds])
            scatter = places[start : start + f.count * size].reshape(f.count, size)
            runs.append(self.backend.bind(f.kernels.tangent, gather, f.parameters, scatter))
        return [*runs, self._gust_slopes(places)] if self.model.gusts else runs


def _together(plan: Plan) -> tuple[np.ndarray, np.ndarray]:
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


def _aligned(size: int) -> np.ndarray:
    """Return zeros that begin on a cache line."""
    room = np.zeros(size + _ALIGNED // 8)
    skip = -room.ctypes.data % _ALIGNED // 8
    return room[skip : skip + size]
