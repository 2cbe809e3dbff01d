"""Followers: nodes that ride on a master, in batches that can be worked at once.

Each batch knows how its nodes' place, velocity and acceleration come from their masters', and gives
the forces on its nodes back to them. All vectors are in space axes; ``a`` is the axis as the master
carries it. ``own`` numbers the degree of freedom of the relative motion (one past the last: none); its
rate is the absolute one along the axis, so that at rest every row reads as the join table does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from flexctrl.mechanics.rotation import cross, exponential, skew_arrays
from flexctrl.structure.ties import Copy, Follow, Ride, Turn


@dataclass
class Pose:
    """Positions (nodes, 3) and rotations (nodes, 3, 3) being worked out."""

    x: np.ndarray
    R: np.ndarray


@dataclass
class Blocks:
    """Entries of a matrix over raw and own freedoms, collected as (rows, columns, values)."""

    rows: list[np.ndarray] = field(default_factory=list)
    columns: list[np.ndarray] = field(default_factory=list)
    values: list[np.ndarray] = field(default_factory=list)

    def add(self, rows: np.ndarray, columns: np.ndarray, values: np.ndarray) -> None:
        """Add blocks: rows (k, r), columns (k, c), values (k, r, c)."""
        shape = np.broadcast_shapes(values.shape, (rows.shape[0], rows.shape[1], columns.shape[1]))
        self.rows.append(np.broadcast_to(rows[:, :, None], shape).ravel())
        self.columns.append(np.broadcast_to(columns[:, None, :], shape).ravel())
        self.values.append(np.broadcast_to(values, shape).ravel())


class Batch(Protocol):
    """Followers of one kind whose masters are all known."""

    def place(self, new: Pose, old: Pose, step: np.ndarray) -> None:
        """Put the nodes in their new place after a step of the own freedoms (padded with 0)."""

    def rates(self, pose: Pose, V: np.ndarray, own: np.ndarray) -> None:
        """Fill in the nodes' velocities in V (nodes, 6)."""

    def accelerations(self, pose: Pose, A: np.ndarray, V: np.ndarray, own: np.ndarray, own_rate: np.ndarray) -> None:
        """Fill in the nodes' accelerations in A (nodes, 6)."""

    def collect(self, pose: Pose, F: np.ndarray, own: np.ndarray) -> None:
        """Give the forces F (nodes, 6) on the nodes back to masters and own freedoms."""

    def rows(self, pose: Pose, raw: int, out: Blocks) -> None:
        """Add the rows of ∂(rates of the nodes)/∂(raw, own); own columns start at ``raw``."""

    def stiffen(self, pose: Pose, F: np.ndarray, raw: int, out: Blocks) -> None:
        """Add the change of `collect`'s result with the masters' motion under constant forces F."""


def _six(node: np.ndarray, offset: int) -> np.ndarray:
    return 6 * node[:, None] + offset + np.arange(3)


_EYE = np.eye(3)[None]


@dataclass(frozen=True)
class Riding:
    """Points of bodies and slides: x = x_m + R_m (arm + s·along)."""

    node: np.ndarray
    master: np.ndarray
    arm: np.ndarray
    along: np.ndarray
    own: np.ndarray

    def _axis(self, R: np.ndarray) -> np.ndarray:
        return np.einsum("kij,kj->ki", R[self.master], self.along)

    def place(self, new: Pose, old: Pose, step: np.ndarray) -> None:
        m = self.master
        local = np.einsum("kji,kj->ki", old.R[m], old.x[self.node] - old.x[m])
        slide = np.einsum("ki,ki->k", self.along, local - self.arm)
        middle = 0.5 * (self._axis(old.R) + self._axis(new.R))
        length = np.sqrt(np.einsum("ki,ki->k", middle, middle))
        middle /= np.where(length > 0.0, length, 1.0)[:, None]
        slide += step[self.own] - np.einsum("ki,ki->k", middle, new.x[m] - old.x[m])
        arm = self.arm + self.along * slide[:, None]
        new.x[self.node] = new.x[m] + np.einsum("kij,kj->ki", new.R[m], arm)

    def rates(self, pose: Pose, V: np.ndarray, own: np.ndarray) -> None:
        m, a = self.master, self._axis(pose.R)
        v = V[m, :3]
        sliding = (own[self.own] - np.einsum("ki,ki->k", a, v))[:, None]
        V[self.node, :3] = v + cross(V[m, 3:], pose.x[self.node] - pose.x[m]) + a * sliding

    def accelerations(self, pose: Pose, A: np.ndarray, V: np.ndarray, own: np.ndarray, own_rate: np.ndarray) -> None:
        m, a = self.master, self._axis(pose.R)
        d, w = pose.x[self.node] - pose.x[m], V[m, 3:]
        turning = cross(w, a)
        rate = (own[self.own] - np.einsum("ki,ki->k", a, V[m, :3]))[:, None]
        change = own_rate[self.own] - np.einsum("ki,ki->k", a, A[m, :3]) - np.einsum("ki,ki->k", turning, V[m, :3])
        A[self.node, :3] = A[m, :3] + cross(A[m, 3:], d) + cross(w, cross(w, d))
        A[self.node, :3] += 2.0 * rate * turning + a * change[:, None]

    def collect(self, pose: Pose, F: np.ndarray, own: np.ndarray) -> None:
        a, f = self._axis(pose.R), F[self.node, :3].copy()
        F[self.node, :3] = 0.0
        along = np.einsum("ki,ki->k", a, f)
        np.add.at(own, self.own, along)
        np.add.at(F[:, :3], self.master, f - a * along[:, None])
        np.add.at(F[:, 3:], self.master, cross(pose.x[self.node] - pose.x[self.master], f))

    def rows(self, pose: Pose, raw: int, out: Blocks) -> None:
        a = self._axis(pose.R)
        d = pose.x[self.node] - pose.x[self.master]
        mine = _six(self.node, 0)
        out.add(mine, _six(self.master, 0), _EYE - a[:, :, None] * a[:, None, :])
        out.add(mine, _six(self.master, 3), -skew_arrays(d))
        out.add(mine, raw + self.own[:, None], a[:, :, None])

    def stiffen(self, pose: Pose, F: np.ndarray, raw: int, out: Blocks) -> None:
        a, f = self._axis(pose.R), F[self.node, :3]
        moment, spin = _six(self.master, 3), _six(self.master, 3)
        out.add(moment, _six(self.node, 0), -skew_arrays(f))
        out.add(moment, _six(self.master, 0), skew_arrays(f))
        _stiffen_axis(a, f, _six(self.master, 0), raw + self.own[:, None], spin, out)


@dataclass(frozen=True)
class Turning:
    """Hinges: R = R_m exp(φ·axis)."""

    node: np.ndarray
    master: np.ndarray
    axis: np.ndarray
    own: np.ndarray

    def _axis(self, R: np.ndarray) -> np.ndarray:
        return np.einsum("kij,kj->ki", R[self.master], self.axis)

    def angle(self, R: np.ndarray) -> np.ndarray:
        """φ between −π and π."""
        Q = np.swapaxes(R[self.master], 1, 2) @ R[self.node]
        axial = np.stack([Q[:, 2, 1] - Q[:, 1, 2], Q[:, 0, 2] - Q[:, 2, 0], Q[:, 1, 0] - Q[:, 0, 1]], axis=1)
        return np.arctan2(0.5 * np.einsum("ki,ki->k", axial, self.axis), 0.5 * (np.trace(Q, axis1=1, axis2=2) - 1.0))

    def place(self, new: Pose, old: Pose, step: np.ndarray) -> None:
        turned = np.einsum("ki,ki->k", self._axis(old.R), step_of(new, old, self.master))
        phi = self.angle(old.R) + step[self.own] - turned
        new.R[self.node] = new.R[self.master] @ exponential(self.axis * phi[:, None])

    def rates(self, pose: Pose, V: np.ndarray, own: np.ndarray) -> None:
        a, w = self._axis(pose.R), V[self.master, 3:]
        V[self.node, 3:] = w + a * (own[self.own] - np.einsum("ki,ki->k", a, w))[:, None]

    def accelerations(self, pose: Pose, A: np.ndarray, V: np.ndarray, own: np.ndarray, own_rate: np.ndarray) -> None:
        a, w, b = self._axis(pose.R), V[self.master, 3:], A[self.master, 3:]
        rate = (own[self.own] - np.einsum("ki,ki->k", a, w))[:, None]
        change = (own_rate[self.own] - np.einsum("ki,ki->k", a, b))[:, None]
        A[self.node, 3:] = b + a * change + cross(w, a) * rate

    def collect(self, pose: Pose, F: np.ndarray, own: np.ndarray) -> None:
        a, c = self._axis(pose.R), F[self.node, 3:].copy()
        F[self.node, 3:] = 0.0
        along = np.einsum("ki,ki->k", a, c)
        np.add.at(own, self.own, along)
        np.add.at(F[:, 3:], self.master, c - a * along[:, None])

    def rows(self, pose: Pose, raw: int, out: Blocks) -> None:
        a = self._axis(pose.R)
        out.add(_six(self.node, 3), _six(self.master, 3), _EYE - a[:, :, None] * a[:, None, :])
        out.add(_six(self.node, 3), raw + self.own[:, None], a[:, :, None])

    def stiffen(self, pose: Pose, F: np.ndarray, raw: int, out: Blocks) -> None:
        a, spin = self._axis(pose.R), _six(self.master, 3)
        _stiffen_axis(a, F[self.node, 3:], spin, raw + self.own[:, None], spin, out)


def _stiffen_axis(
    a: np.ndarray, f: np.ndarray, rest: np.ndarray, own: np.ndarray, spin: np.ndarray, out: Blocks
) -> None:
    """Change of own += a·f, rest += f − a (a·f) when the master's spin turns the axis: δa = δθ × a."""
    turning = cross(a, f)
    out.add(own, spin, turning[:, None, :])
    along = np.einsum("ki,ki->k", a, f)[:, None, None]
    out.add(rest, spin, skew_arrays(a) * along - a[:, :, None] * turning[:, None, :])


def step_of(new: Pose, old: Pose, node: np.ndarray) -> np.ndarray:
    """Return the rotation vectors in space axes that turned some nodes from ``old`` to ``new``."""
    Q = new.R[node] @ np.swapaxes(old.R[node], 1, 2)
    axial = 0.5 * np.stack([Q[:, 2, 1] - Q[:, 1, 2], Q[:, 0, 2] - Q[:, 2, 0], Q[:, 1, 0] - Q[:, 0, 1]], axis=1)
    sine = np.sqrt(np.einsum("ki,ki->k", axial, axial))
    angle = np.arctan2(sine, 0.5 * (np.trace(Q, axis1=1, axis2=2) - 1.0))
    return axial * np.where(sine > 1e-8, angle / np.where(sine > 1e-8, sine, 1.0), 1.0)[:, None]


@dataclass(frozen=True)
class CopiedPlace:
    """One displacement is the master's."""

    node: np.ndarray
    master: np.ndarray
    freedom: np.ndarray
    offset: np.ndarray

    def place(self, new: Pose, old: Pose, step: np.ndarray) -> None:
        new.x[self.node, self.freedom] = new.x[self.master, self.freedom] + self.offset

    def rates(self, pose: Pose, V: np.ndarray, own: np.ndarray) -> None:
        V[self.node, self.freedom] = V[self.master, self.freedom]

    def accelerations(self, pose: Pose, A: np.ndarray, V: np.ndarray, own: np.ndarray, own_rate: np.ndarray) -> None:
        A[self.node, self.freedom] = A[self.master, self.freedom]

    def collect(self, pose: Pose, F: np.ndarray, own: np.ndarray) -> None:
        f = F[self.node, self.freedom].copy()
        F[self.node, self.freedom] = 0.0
        np.add.at(F, (self.master, self.freedom), f)

    def rows(self, pose: Pose, raw: int, out: Blocks) -> None:
        mine, its = 6 * self.node + self.freedom, 6 * self.master + self.freedom
        out.add(mine[:, None], its[:, None], np.ones((len(mine), 1, 1)))

    def stiffen(self, pose: Pose, F: np.ndarray, raw: int, out: Blocks) -> None:
        pass


@dataclass(frozen=True)
class CopiedRotation:
    """The rotation is the master's."""

    node: np.ndarray
    master: np.ndarray

    def place(self, new: Pose, old: Pose, step: np.ndarray) -> None:
        new.R[self.node] = new.R[self.master]

    def rates(self, pose: Pose, V: np.ndarray, own: np.ndarray) -> None:
        V[self.node, 3:] = V[self.master, 3:]

    def accelerations(self, pose: Pose, A: np.ndarray, V: np.ndarray, own: np.ndarray, own_rate: np.ndarray) -> None:
        A[self.node, 3:] = A[self.master, 3:]

    def collect(self, pose: Pose, F: np.ndarray, own: np.ndarray) -> None:
        c = F[self.node, 3:].copy()
        F[self.node, 3:] = 0.0
        np.add.at(F[:, 3:], self.master, c)

    def rows(self, pose: Pose, raw: int, out: Blocks) -> None:
        out.add(_six(self.node, 3), _six(self.master, 3), np.broadcast_to(_EYE, (len(self.node), 3, 3)))

    def stiffen(self, pose: Pose, F: np.ndarray, raw: int, out: Blocks) -> None:
        pass


def batches(follows: Sequence[Follow], rest: np.ndarray, none: int) -> tuple[Batch, ...]:
    """Group followers, already in order, into batches of one kind that do not wait for each other.

    Parameters
    ----------
    follows : sequence of Ride, Turn or Copy
    rest : numpy.ndarray, shape (nodes, 3)
        Positions at rest.
    none : int
        The number that stands for no own freedom.
    """
    found: list[Batch] = []
    waiting: list[Follow] = []
    for follow in follows:
        if waiting and (_kind(follow) != _kind(waiting[0]) or follow.master in {w.node for w in waiting}):
            found.append(_batch(waiting, rest, none))
            waiting = []
        waiting.append(follow)
    return (*found, _batch(waiting, rest, none)) if waiting else ()


def _kind(follow: Follow) -> tuple[type, bool]:
    return (type(follow), isinstance(follow, Copy) and follow.freedom == 3)


def _batch(follows: Sequence[Follow], rest: np.ndarray, none: int) -> Batch:
    node = np.array([f.node for f in follows])
    master = np.array([f.master for f in follows])
    first = follows[0]
    if isinstance(first, Copy):
        if first.freedom == 3:
            return CopiedRotation(node, master)
        freedom = np.array([f.freedom for f in follows if isinstance(f, Copy)])
        return CopiedPlace(node, master, freedom, rest[node, freedom] - rest[master, freedom])
    own = np.array([f.own - 1 if f.own else none for f in follows if not isinstance(f, Copy)])
    if isinstance(first, Turn):
        return Turning(node, master, np.array([f.axis for f in follows if isinstance(f, Turn)]), own)
    along = np.array([f.along or (0.0, 0.0, 0.0) for f in follows if isinstance(f, Ride)])
    return Riding(node, master, rest[node] - rest[master], along, own)
