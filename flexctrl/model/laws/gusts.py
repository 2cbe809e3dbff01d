"""Gusts: what the wind's inputs add to the force of the mean wind."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from flexctrl.effects.effect import Effect
from flexctrl.effects.rotating_frame import RotatingFrame
from flexctrl.effects.wind import Wind
from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.kernels.kernel import Kernel
from flexctrl.model.laws.families import Family
from flexctrl.model.laws.kinds import NODE_SLOT, moved
from flexctrl.model.laws.wind_kinds import WIND, drag
from flexctrl.structure.inputs import WindSpeed
from flexctrl.structure.structure import Structure

if TYPE_CHECKING:
    import casadi as ca

__all__ = ["GustKernels", "Gusts", "check_gusts", "gusts_of"]


@frozen
class GustKernels:
    """Kernels of what some gusts add to the drag of a node: they read its slot, then the gusts' speeds.

    Attributes
    ----------
    count : int
        Number of gusts.
    frames : tuple of Effect
        The frame that turns, if there is one.
    """

    count: int
    frames: tuple[Effect, ...]

    @cached_property
    def force(self) -> Kernel:
        """The force, 3 components."""
        z, p, force = self._force(None)
        return Kernel("gust_force", z, p, force)

    @cached_property
    def tangent(self) -> Kernel:
        """Its slope on the node's own motion, column by column; three seeds are read after the gusts."""
        import casadi as ca

        seeds, increment = ca.SX.sym("seeds", 3), ca.SX.sym("increment", 3)
        z, p, force = self._force((increment, seeds))
        slope = ca.substitute(ca.jacobian(force, increment), increment, ca.SX.zeros(3))
        return Kernel("gust_tangent", ca.vertcat(z, seeds), p, ca.densify(ca.vec(slope)))

    @cached_property
    def reach(self) -> Kernel:
        """Its slope on the gusts, column by column."""
        import casadi as ca

        z, p, force = self._force(None)
        return Kernel("gust_reach", z, p, ca.densify(ca.vec(ca.jacobian(force, z[NODE_SLOT:]))))

    def _force(self, increment: tuple[ca.SX, ca.SX] | None) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Symbols of what is read, parameters (those of the wind, then directions), and the force."""
        import casadi as ca

        z, p = ca.SX.sym("z", NODE_SLOT + self.count), ca.SX.sym("p", WIND.parameters + 3 * self.count)
        step, seeds = increment or (ca.SX(3, 1), ca.SX(3, 1))
        node = moved(WIND, z[:NODE_SLOT], step, seeds)[0]
        gust = ca.reshape(p[WIND.parameters :], 3, self.count) @ z[NODE_SLOT:]
        windy = ca.vertcat(p[0], p[1:4] + gust)
        return z, p, drag(self.frames, node, windy) - drag(self.frames, node, p[:4])


_kernels = cache(GustKernels)


@frozen(eq=False)
class Gusts:
    """The gusts of a model, none if it has no wind.

    Attributes
    ----------
    inputs : numpy.ndarray of int, shape (gusts,)
        Numbers of the inputs they are.
    nodes : numpy.ndarray of int, shape (pieces,)
        Those that have a drag area.
    kernels : GustKernels
    parameters : numpy.ndarray, shape (pieces, 4 + 3 gusts)
    """

    inputs: np.ndarray
    nodes: np.ndarray
    kernels: GustKernels
    parameters: np.ndarray

    def __bool__(self) -> bool:
        return bool(self.inputs.size and self.nodes.size)

    def gather(self, speeds: int) -> np.ndarray:
        """Return what each piece reads of a vector that has the speeds of the inputs from some place on."""
        slots = NODE_SLOT * self.nodes[:, None] + np.arange(NODE_SLOT)
        return np.hstack([slots, np.tile(speeds + self.inputs, (len(self.nodes), 1))])

    @property
    def scatter(self) -> np.ndarray:
        """Raw freedoms that each piece pushes, shape (pieces, 3)."""
        return 6 * self.nodes[:, None] + np.arange(3)

    def force(self, z: np.ndarray, u: np.ndarray, raw: int) -> np.ndarray:
        """Return the raw forces of the gusts, from slots and inputs, shape (raw,)."""
        if not self._blow(u):
            return np.zeros(raw)
        values = self._evaluated(self.kernels.force, np.append(z, u), self.gather(len(z)))
        return np.bincount(self.scatter.ravel(), weights=values.ravel(), minlength=raw)

    def slope(self, z: np.ndarray, u: np.ndarray, seeds: Sequence[float]) -> np.ndarray:
        """Return the slope of each piece, column by column, shape (9 pieces,)."""
        if not self._blow(u):
            return np.zeros(9 * len(self.nodes))
        gather = np.hstack([self.gather(len(z)), np.tile(len(z) + len(u) + np.arange(3), (len(self.nodes), 1))])
        return self._evaluated(self.kernels.tangent, np.concatenate([z, u, seeds]), gather).ravel()

    def matrix(self, z: np.ndarray, u: np.ndarray, seeds: Sequence[float], raw: int) -> sp.csr_matrix:
        """Return the slope over the raw freedoms, shape (raw, raw)."""
        rows, columns = np.repeat(self.scatter[:, None], 3, axis=1), np.repeat(self.scatter[:, :, None], 3, axis=2)
        return sp.csr_matrix((self.slope(z, u, seeds), (rows.ravel(), columns.ravel())), shape=(raw, raw))

    def reach(self, z: np.ndarray, u: np.ndarray, raw: int) -> np.ndarray:
        """Return ∂(raw forces)/∂(inputs) in a state, shape (raw, inputs)."""
        found = np.zeros((raw, len(u)))
        if self:
            blocks = self._evaluated(self.kernels.reach, np.append(z, u), self.gather(len(z)))
            for cells, block in zip(self.scatter, blocks.reshape(len(self.nodes), -1, 3), strict=True):
                found[np.ix_(cells, self.inputs)] += block.T
        return found

    def _blow(self, u: np.ndarray) -> bool:
        return bool(self) and bool(u[self.inputs].any())

    def _evaluated(self, kernel: Kernel, vector: np.ndarray, gather: np.ndarray) -> np.ndarray:
        return np.array(kernel.function()(vector[gather].T, self.parameters.T)).T


def gusts_of(structure: Structure, effects: Sequence[Effect], families: Sequence[Family]) -> Gusts:
    """Return the gusts of a structure under some effects.

    Parameters
    ----------
    structure : Structure
    effects : sequence of Effect
    families : sequence of Family
        Those of the model, the wind's among them.

    Returns
    -------
    Gusts
    """
    frames = tuple(e for e in effects if isinstance(e, RotatingFrame))
    wind = next((f for f in families if f.kernels.kind is WIND), None)
    found = [(i, s) for i, s in enumerate(structure.inputs) if isinstance(s, WindSpeed)]
    nodes, rows = (np.zeros((0, 1), dtype=int), np.zeros((0, 4))) if wind is None else (wind.nodes, wind.parameters)
    ways = [d for _, s in found for d in s.direction]
    return Gusts(
        np.array([i for i, _ in found], dtype=int),
        nodes[:, 0],
        _kernels(len(found), frames),
        np.hstack([rows, np.tile(ways, (len(rows), 1))]),
    )


def check_gusts(structure: Structure, effects: Sequence[Effect]) -> None:
    """Raise StructureError for gusts that would turn in a frame that turns.

    Parameters
    ----------
    structure : Structure
    effects : sequence of Effect

    Raises
    ------
    StructureError
    """
    frames = [e for e in effects if isinstance(e, RotatingFrame) and any(e.rate)]
    windy = any(isinstance(e, Wind) for e in effects)
    for signal in (s for s in structure.inputs if windy and isinstance(s, WindSpeed)):
        for frame in (f for f in frames if f.turns(signal.direction)):
            raise StructureError(
                f"WindSpeed {signal.name!r}: direction {signal.direction} would turn in a frame that turns about "
                f"{frame.rate}; let gusts blow along the axis, or describe the machine in axes that do not turn"
            )


def idle_gusts(structure: Structure, effects: Sequence[Effect]) -> tuple[str, ...]:
    """Return what to tell of gusts that find nothing to blow on.

    Parameters
    ----------
    structure : Structure
    effects : sequence of Effect

    Returns
    -------
    tuple of str
    """
    blown = any(isinstance(e, Wind) and e.density and e.shares(structure) for e in effects)
    idle = [] if blown else [s.name for s in structure.inputs if isinstance(s, WindSpeed)]
    return tuple(
        f"input {name} does nothing: a WindSpeed blows on the areas of the effect Wind, and there are none; "
        'give e.g. Wind({"load": 12.0})'
        for name in idle
    )
