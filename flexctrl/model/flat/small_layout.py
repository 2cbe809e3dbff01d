"""The layout of a model that moves little: its matrices entry by entry, and places as they grow with these.

Forces are load − K q − C v − M a, so every stored entry of the matrices is a piece of its own. Nodes are where T q
takes them from the drawn shape, rotations by the exponential of theirs, as in `Model.advance`.
"""

from __future__ import annotations

from functools import cache, cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from flexctrl.kernels.kernel import Kernel, Run
from flexctrl.mechanics.rotation import rotation_of, turned_rows
from flexctrl.model.flat import binding
from flexctrl.model.flat.axes import Axes
from flexctrl.model.flat.layout import Layout
from flexctrl.model.flat.small_gauges import small_gauges
from flexctrl.model.gauges import Gauges
from flexctrl.model.laws.kinds import DRIVE_SLOT, NODE_SLOT

__all__ = ["SmallLayout"]


class SmallLayout(Layout):
    """The workspace of a model in small motion."""

    def _sizes(self) -> dict[str, int]:
        nodes = len(self.motion.place)
        self.carried, self.linked = 0, np.zeros(0, dtype=int)
        return super()._sizes() | {
            **dict.fromkeys(("force", "load"), self.padded),
            "shift": self.motion.raw,
            "drawn": 12 * nodes,
            "back": self.padded if self.model.about else 0,
        }

    @property
    def long(self) -> bool:
        """Levers are constant numbers."""
        return False

    @cached_property
    def constants(self) -> tuple[int, np.ndarray]:
        rest, first, last = self.model.rest, self.starts["drawn"], self.starts["back"]
        values = np.zeros(last - first + self.sizes["back"])
        values[: 12 * len(rest.x)] = np.hstack([rest.x, rest.R.reshape(-1, 9)]).ravel()
        if self.model.about:
            values[last - first + self.plan.position] = -rest.q
        return first, values

    @property
    def coordinates(self) -> tuple[str, ...]:
        """From where it rests on: what is small, and nothing of which is lost to what is not."""
        return ("q", "back") if self.model.about else ("q",)

    @cached_property
    def entries(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows and columns of all entries of K, C and M, and their values, shape (entries, 4).

        The last column holds the constant load, on the diagonal.
        """
        seeds = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        K, C, M = (sp.csr_matrix(-self.model.slope(*self._still, seed, self._u)) for seed in seeds)
        load = sp.diags(self.model.balance(*self._still), format="csr")
        found = (abs(K) + abs(C) + abs(M) + sp.identity(self.motion.n)).tocoo()
        values = [np.asarray(matrix[found.row, found.col]).ravel() for matrix in (K, C, M, load)]
        return found.row, found.col, np.column_stack(values)

    @property
    def _still(self) -> tuple[Any, np.ndarray, np.ndarray]:
        return self.model.rest, np.zeros(self.motion.n), np.zeros(self.motion.n)

    @property
    def _u(self) -> np.ndarray:
        return np.zeros(len(self.model.inputs))

    @cached_property
    def pattern(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        rows, columns, _ = self.entries
        return rows, columns, np.zeros(0, dtype=int)

    @cached_property
    def _axes(self) -> Axes:
        none = np.zeros(0, dtype=int)
        return Axes(0, 0, 0, none, none, none, none, 0, none, np.zeros(0))

    @cached_property
    def own(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        none = np.zeros(0, dtype=int)
        return none, none, none

    @cached_property
    def _gauges(self) -> Gauges:
        return small_gauges(self)

    @cached_property
    def _levers(self) -> sp.coo_matrix:
        """Raw motion per unit of each degree of freedom."""
        return sp.coo_matrix(self.motion.jacobian(self.motion.rest))

    @cached_property
    def tables(self) -> dict[str, Any]:
        unit = np.eye(len(self.model.inputs))
        columns = [self.model.loads(self.model.rest, u) for u in unit]
        loads = sp.coo_matrix(np.array(columns).reshape(len(unit), self.motion.n).T)
        return super().tables | {
            "linked": np.arange(len(self.motion.place)),
            "inputs": np.concatenate([self.position[loads.row], loads.col]).astype(np.int64),
            "unit": loads.data.astype(float),
        }

    @cached_property
    def runs(self) -> dict[str, Any]:
        cells = np.arange(self.motion.raw)
        return {
            "turn": (),
            **self._linkage(),
            "winding": binding.winding(self, "drawn") if self.motion.drives else (),
            "forces": (binding.entry_forces(self),),
            "tangents": (binding.entry_slopes(self),),
            "energies": (binding.entry_energies(self),),
            "shifts": (self._along((*self.coordinates, "step"), cells, self.starts["shift"]),),
            "gusts": (),
        }

    def _linkage(self) -> dict[str, tuple[Run, ...]]:
        """Poses from how far nodes are shifted, their rates and their accelerations."""
        nodes = np.arange(len(self.motion.place))
        drawn = self.starts["drawn"] + 12 * nodes[:, None] + np.arange(12)
        shift = self.starts["shift"] + 6 * nodes[:, None] + np.arange(6)
        pose = NODE_SLOT * nodes[:, None] + np.arange(12)
        none = np.zeros((len(nodes), 0))
        place = self.backend.bind(_shifted(), np.hstack([drawn, shift]), none, pose)
        rates, changes = (self._along((of,), cells, 0) for of, cells in self._rate_cells)
        return {"placing": (place,), "rating": (rates,), "changing": (changes,), "carrying": ()}

    @property
    def _rate_cells(self) -> tuple[tuple[str, np.ndarray], ...]:
        """Where rates and accelerations of raw motion stand: of nodes, and of source angles behind rigid shafts."""
        m = self.motion
        nodes = NODE_SLOT * np.arange(len(m.place))[:, None] + np.arange(6)
        drives = self.forces.drive_base + DRIVE_SLOT * np.arange(len(m.drives))
        return tuple(
            (of, np.concatenate([(nodes + offset).ravel(), np.where(m.rigid, drives + own, -1)]))
            for of, offset, own in (("v", 12, 1), ("rate", 18, 2))
        )

    def _along(self, of: tuple[str, ...], cells: np.ndarray, start: int) -> Run:
        """The levers on a sum of vectors, added up in some cells; −1 for none."""
        T = self._levers
        cells = np.append(cells, np.full(self.motion.raw - len(cells), -1))[T.row]
        kept = cells >= 0
        gather = np.column_stack([self.starts[name] + self.position[T.col[kept]] for name in of])
        return self.backend.bind(_lever(len(of)), gather, T.data[kept][:, None], start + cells[kept][:, None])


@cache
def _shifted() -> Kernel:
    """(pose at rest, displacement, rotation vector) → pose."""
    import casadi as ca

    pose, shift = ca.SX.sym("pose", 12), ca.SX.sym("shift", 6)
    turned = turned_rows(pose[3:], rotation_of(shift[3:]))
    return Kernel("shifted", ca.vertcat(pose, shift), ca.SX.sym("p", 0), ca.vertcat(pose[:3] + shift[:3], turned))


@cache
def _lever(count: int) -> Kernel:
    """A lever on a sum."""
    import casadi as ca

    x, arm = ca.SX.sym("x", count), ca.SX.sym("arm")
    return Kernel("lever", x, arm, arm * ca.sum1(x))
