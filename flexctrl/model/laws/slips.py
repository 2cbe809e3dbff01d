"""How fast the sides of dry contacts move against each other, and what that is in the degrees of freedom."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.frozen import frozen
from flexctrl.kernels.kernel import Kernel, Run
from flexctrl.model.forces import Forces
from flexctrl.model.laws.families import Family
from flexctrl.model.laws.friction_kinds import slip_of
from flexctrl.model.laws.kinds import DRIVE_SLOT, NODE_SLOT, Kind, moved, symbols_of
from flexctrl.model.state import State

if TYPE_CHECKING:
    import casadi as ca

__all__ = ["Slips"]


@frozen(eq=False)
class Slips:
    """Slip speeds of some families of dry contacts.

    Attributes
    ----------
    forces : Forces
    families : tuple of Family
    """

    forces: Forces
    families: tuple[Family, ...]

    @cached_property
    def order(self) -> np.ndarray:
        """Number of each contact among the inner freedoms, in the order of all results."""
        drives = len(self.forces.motion.drives)
        return np.concatenate([np.zeros(0, dtype=int), *(f.drives[:, -1] - drives for f in self.families)])

    def at(self, state: State, v: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return slip speeds, their rates, and the angles or travels of the contacts."""
        found = [r[:, :3] for r in self._found(state, v, a)]
        speeds, rates, places = np.vstack([np.zeros((0, 3)), *found]).T
        return speeds, rates, places

    def speeds(self, state: State) -> np.ndarray:
        """Return the slip speeds."""
        return self.at(state, state.v, np.zeros_like(state.v))[0]

    def rows(self, state: State) -> np.ndarray:
        """Return W (contacts × n): slip speeds from the rates of the degrees of freedom."""
        motion, still = self.forces.motion, np.zeros(self.forces.motion.n)
        W = np.zeros((self.order.size, motion.n))
        gradients = [row for found in self._found(state, still, still) for row in found[:, 3:]]
        for row, places, gradient in zip(W, self.cells, gradients, strict=True):
            raw = np.zeros(motion.raw)
            np.add.at(raw, places, gradient)
            row[:] = motion.collect(state, raw)
        return W

    @cached_property
    def cells(self) -> tuple[np.ndarray, ...]:
        """Raw places that each contact moves."""
        source_base = self.forces.motion.source_base
        return tuple(cells for f in self.families for cells in f.scatter(source_base)[:, :-1])

    def _found(self, state: State, v: np.ndarray, a: np.ndarray) -> list[np.ndarray]:
        """Per family, one row a contact: speed, its rate, place, slope of the speed on the raw rates."""
        z, found = self.forces.slots(state, v, a), []
        for f, run in zip(self.families, self._runs, strict=True):
            results = np.zeros(f.count * (f.kernels.kind.width + 2))
            run(z, results)
            found.append(results.reshape(f.count, -1))
        return found

    def each(self, scatter: Sequence[np.ndarray]) -> tuple[Run, ...]:
        """Return the kernel of each contact (see `at` and `cells`): where it adds speed, rate, place and gradient."""
        base, backend = self.forces.drive_base, self.forces.backend
        alone = ((_slip_kernel(f.kernels.kind), f, i) for f in self.families for i in range(f.count))
        return tuple(
            backend.bind(kernel, f.gather(base)[[i]], f.parameters[[i]], goal[None])
            for (kernel, f, i), goal in zip(alone, scatter, strict=True)
        )

    @cached_property
    def _runs(self) -> tuple[Run, ...]:
        made = []
        for f in self.families:
            kernel = _slip_kernel(f.kernels.kind)
            scatter = np.arange(f.count * kernel.n_out).reshape(f.count, kernel.n_out)
            made.append(self.forces.backend.bind(kernel, f.gather(self.forces.drive_base), f.parameters, scatter))
        return tuple(made)


@cache
def _slip_kernel(kind: Kind) -> Kernel:
    """Slip speed, its rate, place, slope of the speed on the raw rates."""
    import casadi as ca

    symbols, parameters = symbols_of(kind)
    nodes = moved(kind, symbols, ca.SX(kind.width, 1), ca.SX(3, 1))
    sides = slip_of(kind)(nodes, symbols[NODE_SLOT * kind.nodes :], parameters)
    rate = ca.jtimes(sides.speed, symbols, _onward(kind, symbols))
    outputs = ca.vertcat(sides.speed, rate, sides.place, sides.gradient)
    return Kernel(f"{kind.name}_slip", symbols, parameters, ca.cse(ca.densify(outputs)))


def _onward(kind: Kind, symbols: ca.SX) -> ca.SX:
    """The rates of all slots."""
    import casadi as ca

    rates = []
    for i in range(kind.nodes):
        s = symbols[NODE_SLOT * i : NODE_SLOT * (i + 1)]
        R = ca.reshape(s[3:12], 3, 3).T
        rates.append(ca.vertcat(s[12:15], ca.vec((ca.skew(s[15:18]) @ R).T), s[18:24], ca.SX(6, 1)))
    for k in range(kind.drives):
        s = symbols[NODE_SLOT * kind.nodes + DRIVE_SLOT * k :]
        rates.append(ca.vertcat(s[1], s[2], ca.SX(2, 1)))
    return ca.vertcat(*rates)
