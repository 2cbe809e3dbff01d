"""Driven coordinates of all drives, and source angles that rigid shafts tie to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexctrl.mechanics.rotation import cross, skew_arrays
from flexctrl.model.followers import Blocks, Pose
from flexctrl.structure.drives import RotaryDrive
from flexctrl.structure.structure import Structure


@dataclass(frozen=True)
class Gears:
    """All drives of a machine; ``a`` is a drive's axis as its base carries it, ``b`` as its node does.

    Attributes
    ----------
    node, base : numpy.ndarray of int
        The driven node and the one that carries the motor.
    axis, arm : numpy.ndarray, shape (drives, 3)
        Axis and lever at rest.
    ratio : numpy.ndarray
        Motor angle per driven coordinate.
    rotary : numpy.ndarray of bool
    rigid : numpy.ndarray of bool
        Whether the shaft is rigid: θ_d = R s.
    """

    node: np.ndarray
    base: np.ndarray
    axis: np.ndarray
    arm: np.ndarray
    ratio: np.ndarray
    rotary: np.ndarray
    rigid: np.ndarray

    @property
    def count(self) -> int:
        """Number of drives."""
        return len(self.node)

    def _axes(self, R: np.ndarray) -> np.ndarray:
        return np.einsum("kij,kj->ki", R[self.base], self.axis)

    def _mean_axes(self, R: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return a, b and 1 + a·b: the angle's rate is (a + b)/(1 + a·b) · (ω − ω_base)."""
        a, b = self._axes(R), np.einsum("kij,kj->ki", R[self.node], self.axis)
        return a, b, 1.0 + np.einsum("ki,ki->k", a, b)[:, None]

    def driven(self, pose: Pose) -> np.ndarray:
        """Driven coordinates: angles between −π and π (see `rotary_motion`), travels in m."""
        x, R = pose.x, pose.R
        tilt = self._mean_axes(R)[2][:, 0] - 1.0
        Q = np.swapaxes(R[self.base], 1, 2) @ R[self.node]
        axial = np.stack([Q[:, 2, 1] - Q[:, 1, 2], Q[:, 0, 2] - Q[:, 2, 0], Q[:, 1, 0] - Q[:, 0, 1]], axis=1)
        sine = 0.5 * np.einsum("ki,ki->k", axial, self.axis)
        angle = np.arctan2(sine, 0.5 * (np.trace(Q, axis1=1, axis2=2) - tilt))
        travel = np.einsum("ki,ki->k", self._axes(R), x[self.node] - x[self.base])
        return np.where(self.rotary, angle, travel - np.einsum("ki,ki->k", self.axis, self.arm))

    def unwind(self, pose: Pose, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the driven coordinates next to their values before, and the whole turns in them."""
        driven = self.driven(pose)
        turns = np.where(self.rotary, np.round((before - driven) / (2.0 * np.pi)), 0.0)
        return driven + 2.0 * np.pi * turns, turns

    def gradient(self, pose: Pose) -> np.ndarray:
        """∂s/∂(raw motion of node, then of base), shape (drives, 12)."""
        a, b, both = self._mean_axes(pose.R)
        turning, along = cross(a, pose.x[self.node] - pose.x[self.base]), (a + b) / both
        rotary = np.hstack([0 * a, along, 0 * a, -along])
        return np.where(self.rotary[:, None], rotary, np.hstack([a, 0 * a, -a, turning]))

    def rates(self, pose: Pose, V: np.ndarray) -> np.ndarray:
        """Return R ṡ for nodal velocities V (nodes, 6)."""
        both = np.hstack([V[self.node], V[self.base]])
        return self.ratio * np.einsum("ki,ki->k", self.gradient(pose), both)

    def accelerations(self, pose: Pose, A: np.ndarray, V: np.ndarray) -> np.ndarray:
        """Return R s̈."""
        (a, b, one), w = self._mean_axes(pose.R), V[self.base, 3:]
        turning, spin = cross(w, a), V[self.node, 3:] - w
        closing = np.einsum("ki,ki->k", spin, cross(b, a))[:, None]
        along = (turning + cross(V[self.node, 3:], b) - (a + b) * closing / one) / one
        arm, moving = pose.x[self.node] - pose.x[self.base], V[self.node, :3] - V[self.base, :3]
        both = np.hstack([A[self.node], A[self.base]])
        extra = np.where(
            self.rotary,
            np.einsum("ki,ki->k", along, spin),
            np.einsum("ki,ki->k", 2.0 * turning, moving) + np.einsum("ki,ki->k", cross(turning, arm), w),
        )
        return self.ratio * (np.einsum("ki,ki->k", self.gradient(pose), both) + extra)

    def collect(self, pose: Pose, F: np.ndarray, torque: np.ndarray) -> None:
        """Give torques on rigidly tied source angles back to the nodes."""
        push = (self.ratio * np.where(self.rigid, torque, 0.0))[:, None] * self.gradient(pose)
        np.add.at(F, self.node, push[:, :6])
        np.add.at(F, self.base, push[:, 6:])

    def rows(self, pose: Pose, source_base: int, out: Blocks) -> None:
        """Add the rows of rigidly tied source angles."""
        k = np.flatnonzero(self.rigid)
        columns = np.hstack([_cells(self.node[k]), _cells(self.base[k])])
        out.add(source_base + k[:, None], columns, (self.ratio[:, None] * self.gradient(pose))[k][:, None, :])

    def stiffen(self, pose: Pose, torque: np.ndarray, out: Blocks) -> None:
        """Add the change of `collect`'s result with the turning of both sides: δa = δθ_base × a, δb = δθ × b."""
        t = (self.ratio * np.where(self.rigid, torque, 0.0))[:, None, None]
        a, b, one = self._mean_axes(pose.R)
        arm = pose.x[self.node] - pose.x[self.base]
        turn, spin = t * skew_arrays(a), _cells(self.base)[:, 3:]
        r, s = self.rotary[:, None, None], ~self.rotary[:, None, None]
        closing = (a + b)[:, :, None] * (cross(b, a) / one)[:, None, :]
        for side, axis, sign in ((self.node, b, 1.0), (self.base, a, -1.0)):
            change = t * (-skew_arrays(axis) - sign * closing) / one[:, :, None] * r
            out.add(_cells(self.node)[:, 3:], _cells(side)[:, 3:], change)
            out.add(_cells(self.base)[:, 3:], _cells(side)[:, 3:], -change)
        out.add(_cells(self.node)[:, :3], spin, -turn * s)
        out.add(_cells(self.base)[:, :3], spin, turn * s)
        out.add(_cells(self.base)[:, 3:], spin, skew_arrays(arm) @ turn * s)
        out.add(_cells(self.base)[:, 3:], _cells(self.node)[:, :3], turn * s)
        out.add(_cells(self.base)[:, 3:], _cells(self.base)[:, :3], -turn * s)


def _cells(node: np.ndarray) -> np.ndarray:
    return 6 * node[:, None] + np.arange(6)


def gears_of(structure: Structure, elastic: Sequence[str]) -> Gears:
    """Return the drives of a structure; those not in ``elastic`` have rigid shafts."""
    drives, ground = structure.drives, len(structure.nodes)
    at = np.array([*(n.position for n in structure.nodes), (0.0, 0.0, 0.0)])
    node = np.array([structure.number(d.node) for d in drives], dtype=int)
    base = np.array([ground if d.against is None else structure.number(d.against) for d in drives], dtype=int)
    return Gears(
        node,
        base,
        np.array([d.direction for d in drives]).reshape(-1, 3),
        at[node] - at[base],
        np.array([d.effective_ratio for d in drives]),
        np.array([isinstance(d, RotaryDrive) for d in drives], dtype=bool),
        np.array([d.name not in elastic for d in drives], dtype=bool),
    )
