"""The layout of a flat model: which entry of the workspace each kernel reads and adds to."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from flexctrl.kernels.kernel import Backend
from flexctrl.model.flat import binding
from flexctrl.model.flat.axes import Axes, axes_of
from flexctrl.model.flat.entire import Entire, entire_of
from flexctrl.model.flat.flattened import Flattened
from flexctrl.model.flat.fronts import Plan, plan_of
from flexctrl.model.flat.tiles import Tiles, Tiling, tiles_of, tiling_of
from flexctrl.model.flat.unfolding import lever_places, together, unfolded_plan
from flexctrl.model.flat.workspace import HIDDEN, Flat
from flexctrl.model.gauges import Gauges, gauges_of
from flexctrl.model.laws.kinds import NODE_SLOT
from flexctrl.model.linkages.levers import Levers, Places
from flexctrl.model.model import Model

__all__ = ["Layout"]

_ALIGNED = 64


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
            "u": len(self.model.inputs),
            "seeds": 3,
            "pose": 12 * len(self.motion.place),
            **dict.fromkeys(("step", "v", "rate"), self.padded),
            **dict.fromkeys(("force", "load"), self.padded + self.carried),
            "q": self.padded,
            **dict.fromkeys(("found", "about", "driven"), len(self.motion.drives)),
            "answer": self.padded,
            "books": 3,
            "shift": 0,
            "units": 9 if self.unfolds else 0,
        }

    @property
    def long(self) -> bool:
        """Whether levers are worked off in loops."""
        return isinstance(self.motion.linkage, Levers)

    @property
    def unfolds(self) -> bool:
        """Whether tangents are unfolded, what levers say being unknowns of their own."""
        return self.long and not self.model.signals.follows and not self.model.gusts

    @cached_property
    def pattern(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows and columns of the tangent in degrees of freedom; which entries of the blocks they are, if plain."""
        m = self.motion
        raw = self.forces.pattern
        if self.unfolds:
            return (*together(self.plan), np.zeros(0, dtype=int))
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

    @cached_property
    def plan(self) -> Plan:
        if self.unfolds:
            return unfolded_plan(self)
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
            tiles=self.tiles,
            entire=self.entire.runs,
            quick=len(self.entire.runs),
            pressing=int(self.entire.pressing),
        )
        shown, summed = np.zeros((2, self._gauges.turning))
        gauges = replace(
            self._gauges,
            sums=np.zeros(self._gauges.rows),
            shown=shown,
            summed=summed,
            faced=np.zeros(4 * len(shown)),
            facing=np.zeros(4),
        )
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
        moved, turned = (own[(self.owned[own, cells] < m.n).any(axis=1)] for cells in (slice(3), slice(3, 6)))
        return own, moved, turned

    @cached_property
    def owned(self) -> np.ndarray:
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
    def lever_places(self) -> Places:
        """Where the workspace holds what levers read and write."""
        return lever_places(self)

    @cached_property
    def whole(self) -> np.ndarray:
        """Nodes whose six degrees of freedom are their own and follow each other, in the order of elimination."""
        own = self.own[0]
        cells = self.position[self.owned[own]]
        found = own[(np.diff(cells, axis=1) == 1).all(axis=1) & (cells[:, -1] < self.motion.n)]
        return found[np.argsort(self.position[self.owned[found, 0]])]

    @cached_property
    def turned(self) -> np.ndarray:
        """Nodes that turn by freedoms of their own alone, or beside what levers say; whole ones first."""
        return np.concatenate([self.whole, np.setdiff1d(self.own[2], self.whole)])

    @cached_property
    def tiling(self) -> Tiling:
        """How nodes and pieces are cut into tiles."""
        return tiling_of(self)

    @cached_property
    def tiles(self) -> Tiles:
        """The tiles as loops read them."""
        families = len(self.forces.families)
        kernels = (self.runs["turn"], *(self.runs[name][:families] for name in ("forces", "tangents")))
        return tiles_of(self.tiling, *kernels)

    @cached_property
    def tables(self) -> dict[str, Any]:
        m, owned = self.motion, self.owned
        own, moved, turned = (np.setdiff1d(nodes, self.whole) for nodes in (self.own[0], *self._kept))
        cells = self.position[owned[own]]
        nodes, freedoms = np.nonzero(cells < m.n)
        loads = self.model.signals.loads.tocoo()
        return {
            "whole": np.column_stack([self.whole, self.position[owned[self.whole, 0]]]).ravel(),
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
            "posed": self.starts["seeds"],
            "nodes": len(m.place),
            "wholes": len(self.whole),
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
        m, turned = self.motion, self.turned
        own_tangents = (m.plain and not self.model.signals.follows) or self.unfolds
        damped = bool(self.model.viscous.nnz)
        return {
            "turn": binding.turn(self, turned) if len(turned) else (),
            **binding.linkage(self),
            "winding": binding.winding(self, "pose") if m.drives else (),
            "forces": (*binding.forces(self), *([binding.entry_forces(self)] if damped else [])),
            "tangents": (*binding.tangents(self), *([binding.entry_slopes(self)] if damped else []))
            if own_tangents
            else (),
            "energies": (*binding.energies(self), *([binding.entry_energies(self)] if damped else [])),
            "shifts": (),
            "gusts": (binding.gusts(self),) if self.model.gusts else (),
        }

    @property
    def coordinates(self) -> tuple[str, ...]:
        """What adds up to the coordinates at the start of a step, as the equations count them."""
        return ("q",)

    def _follows(self) -> np.ndarray:
        follows = self.model.signals.follows
        return np.array([w for f in follows for w in (f.input, f.node, *self.targets[f.cell : f.cell + 3])], dtype=int)

    @cached_property
    def _spun(self) -> np.ndarray:
        return self.position[self.motion.linked] if self.motion.rotary.any() else np.zeros(0, dtype=int)


def _aligned(size: int) -> np.ndarray:
    """Return zeros that begin on a cache line."""
    room = np.zeros(size + _ALIGNED // 8)
    skip = -room.ctypes.data % _ALIGNED // 8
    return room[skip : skip + size]
