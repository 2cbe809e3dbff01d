"""Followers and drives as casadi expressions: how nodes ride on their masters.

Only places and rates are written down. Accelerations, the forces given back to masters, the matrix T
and its change with the pose all follow from the rates by differentiation:
V = T(pose) (base, own), A = T (base, own)' + dT/dt (base, own), collected = Tᵀ F.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.mechanics.beam import NodeMotion
from flexctrl.mechanics.pieces import DriveMotion, linear_motion, rotary_motion
from flexctrl.mechanics.rotation import rotation_vector
from flexctrl.structure.drives import Drive, RotaryDrive
from flexctrl.structure.freedoms import Vector
from flexctrl.structure.ties import Copy, Follow, Ride, Turn

if TYPE_CHECKING:
    import casadi as ca


@dataclass(frozen=True)
class Link:
    """A drive between two nodes of a linkage; ``rigid`` if its shaft ties the source angle to the joint."""

    drive: Drive
    node: int
    base: int
    rest: Vector
    rigid: bool


@dataclass(frozen=True, eq=False)
class Linkage:
    """The nodes that follow or lead, in numbers of their own, and the functions of their motion.

    Attributes
    ----------
    count : int
        Nodes.
    rest : numpy.ndarray, shape (count, 3)
        Positions at rest.
    follows : tuple of Ride, Turn or Copy
        In an order in which they can be evaluated; ``own`` counts from 1 among the own freedoms here.
    lines : tuple of (int, numpy.ndarray)
        Nodes that turn about body axes (columns).
    links : tuple of Link
    owns : int
        Own freedoms of hinges and slides.
    """

    count: int
    rest: np.ndarray
    follows: tuple[Follow, ...]
    lines: tuple[tuple[int, np.ndarray], ...]
    links: tuple[Link, ...]
    owns: int

    @cached_property
    def place(self) -> Callable[..., np.ndarray]:
        """(old pose, pose with own freedoms moved, own steps) → new pose (count, 12)."""
        return _callable("place", [self._old, self._pose, self._own], self._placed())

    @cached_property
    def rates(self) -> Callable[..., np.ndarray]:
        """(pose, base rates, own rates) → raw rates: (count, 6), then the source angles of rigid shafts."""
        return _callable("rates", [self._pose, self._base, self._own], self._raw)

    @cached_property
    def accelerations(self) -> Callable[..., np.ndarray]:
        """(pose, base rates, own rates, their rates) → raw accelerations."""
        import casadi as ca

        base, own = ca.SX.sym("base_rate", 6, self.count), ca.SX.sym("own_rate", self.owns)
        V = ca.reshape(self._raw[: 6 * self.count], 6, self.count)
        turning = [ca.skew(V[3:, i]) @ _rotation(self._pose[:, i]) for i in range(self.count)]
        moving = ca.vertcat(*[ca.vertcat(V[:3, i], ca.vec(w.T)) for i, w in enumerate(turning)])
        carried = ca.jtimes(self._raw, ca.vec(self._pose), moving)
        pushed = ca.substitute(self._raw, ca.vertcat(ca.vec(self._base), self._own), ca.vertcat(ca.vec(base), own))
        return _callable("accelerations", [self._pose, self._base, self._own, base, own], pushed + carried)

    @cached_property
    def collect(self) -> Callable[..., np.ndarray]:
        """(pose, raw forces) → forces on base rates (6 count), then on own rates."""
        return _callable("collect", [self._pose, self._force], self._collected)

    @cached_property
    def matrix(self) -> Callable[..., np.ndarray]:
        """Pose → T, shape (raw, 6 count + owns), column by column."""
        import casadi as ca

        T = ca.jacobian(self._raw, ca.vertcat(ca.vec(self._base), self._own))
        return _callable("matrix", [self._pose], ca.vec(ca.densify(T)))

    @cached_property
    def stiffening(self) -> Callable[..., np.ndarray]:
        """(pose, raw forces) → ∂collected/∂(raw motion of the nodes), shape (6 count + owns, 6 count), by columns."""
        import casadi as ca

        d = ca.SX.sym("d", 6, self.count)
        moved = [
            ca.vertcat(
                self._pose[:3, i] + d[:3, i],
                ca.vec((_rotation(self._pose[:, i]) + ca.skew(d[3:, i]) @ _rotation(self._pose[:, i])).T),
            )
            for i in range(self.count)
        ]
        collected = ca.substitute(self._collected, ca.vec(self._pose), ca.vertcat(*moved))
        slope = ca.substitute(ca.jacobian(collected, ca.vec(d)), ca.vec(d), ca.SX.zeros(6 * self.count))
        return _callable("stiffening", [self._pose, self._force], ca.vec(ca.densify(slope)))

    @cached_property
    def driven(self) -> Callable[..., np.ndarray]:
        """Pose → driven coordinates of all drives; angles between −π and π."""
        import casadi as ca

        still = [(ca.SX.zeros(3), ca.SX.zeros(3))] * self.count
        values = [self._drive_motion(link, self._pose, still).driven for link in self.links]
        return _callable("driven", [self._pose], ca.vertcat(*values, ca.SX(0, 1)))

    def matrix_at(self, pose: np.ndarray) -> np.ndarray:
        """Return T at a pose."""
        return self.matrix(pose).reshape(6 * self.count + self.owns, -1).T

    def stiffening_at(self, pose: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return ∂collected/∂(raw motion) at a pose under constant raw forces."""
        return self.stiffening(pose, force).reshape(6 * self.count, -1).T

    @cached_property
    def _symbols(self) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        import casadi as ca

        return (
            ca.SX.sym("pose", 12, self.count),
            ca.SX.sym("old", 12, self.count),
            ca.SX.sym("base", 6, self.count),
            ca.SX.sym("own", self.owns),
        )

    @property
    def _pose(self) -> ca.SX:
        return self._symbols[0]

    @property
    def _old(self) -> ca.SX:
        return self._symbols[1]

    @property
    def _base(self) -> ca.SX:
        return self._symbols[2]

    @property
    def _own(self) -> ca.SX:
        return self._symbols[3]

    @cached_property
    def _force(self) -> ca.SX:
        import casadi as ca

        return ca.SX.sym("force", self._raw.shape[0])

    @cached_property
    def _collected(self) -> ca.SX:
        import casadi as ca

        return ca.jtimes(self._raw, ca.vertcat(ca.vec(self._base), self._own), self._force, True)

    @cached_property
    def _raw(self) -> ca.SX:
        """Raw rates of all nodes and of the source angles behind rigid shafts."""
        import casadi as ca

        motion = [(self._base[:3, i], self._base[3:, i]) for i in range(self.count)]
        for node, axes in self.lines:
            motion[node] = (motion[node][0], _rotation(self._pose[:, node]) @ axes @ motion[node][1])
        for follow in self.follows:
            motion[follow.node] = self._followed(follow, motion)
        sources = []
        for link in self.links:
            if link.rigid:
                drive = self._drive_motion(link, self._pose, motion)
                sources.append(drive.p["ratio"] * drive.driven_rate)
        return ca.vertcat(*[ca.vertcat(v, w) for v, w in motion], *sources)

    def _followed(self, f: Follow, motion: Sequence[tuple[ca.SX, ca.SX]]) -> tuple[ca.SX, ca.SX]:
        """Velocity and spin of a follower; own rates are absolute along the axis, so rows read as the join table."""
        import casadi as ca

        (v, w), (mv, mw) = motion[f.node], motion[f.master]
        if isinstance(f, Turn):
            a = _rotation(self._pose[:, f.master]) @ ca.DM(f.axis)
            return v, mw + a * (self._rate(f.own) - ca.dot(a, mw))
        if isinstance(f, Ride):
            moved = mv + ca.cross(mw, self._pose[:3, f.node] - self._pose[:3, f.master])
            if f.along is not None:
                a = _rotation(self._pose[:, f.master]) @ ca.DM(f.along)
                moved = moved + a * (self._rate(f.own) - ca.dot(a, mv))
            return moved, w
        if f.freedom == 3:
            return v, mw
        return ca.vertcat(*[mv[k] if k == f.freedom else v[k] for k in range(3)]), w

    def _rate(self, own: int) -> ca.SX:
        import casadi as ca

        return self._own[own - 1] if own else ca.SX(0)

    def _placed(self) -> ca.SX:
        import casadi as ca

        x = [self._pose[:3, i] for i in range(self.count)]
        R = [_rotation(self._pose[:, i]) for i in range(self.count)]
        old_R = [_rotation(self._old[:, i]) for i in range(self.count)]
        for f in self.follows:
            n, m = f.node, f.master
            if isinstance(f, Turn):
                axis = ca.DM(f.axis)
                turned = ca.dot(old_R[m] @ axis, rotation_vector(R[m] @ old_R[m].T))
                phi = _twist(old_R[m].T @ old_R[n], axis) + self._rate(f.own) - turned
                K = ca.skew(axis)
                R[n] = R[m] @ (ca.DM.eye(3) + ca.sin(phi) * K + (1.0 - ca.cos(phi)) * (K @ K))
            elif isinstance(f, Ride):
                x[n] = x[m] + R[m] @ (ca.DM(self.rest[n] - self.rest[m]) + self._slid(f, x, R, old_R))
            elif f.freedom == 3:
                R[n] = R[m]
            else:
                moved = x[m][f.freedom] + float(self.rest[n, f.freedom] - self.rest[m, f.freedom])
                x[n] = ca.vertcat(*[moved if k == f.freedom else x[n][k] for k in range(3)])
        return ca.vertcat(*[ca.vertcat(p, ca.vec(q.T)) for p, q in zip(x, R, strict=True)])

    def _slid(self, f: Ride, x: list[ca.SX], R: list[ca.SX], old_R: list[ca.SX]) -> ca.SX:
        """How far a slide stands out along its axis; the master's part of the step is seen along the mean axis."""
        import casadi as ca

        if f.along is None:
            return ca.SX(3, 1)
        along, m = ca.DM(f.along), f.master
        arm = old_R[m].T @ (self._old[:3, f.node] - self._old[:3, m]) - ca.DM(self.rest[f.node] - self.rest[m])
        mean = (R[m] + old_R[m]) @ along
        mean = mean / ca.sqrt(ca.dot(mean, mean))
        return along * (ca.dot(along, arm) + self._rate(f.own) - ca.dot(mean, x[m] - self._old[:3, m]))

    def _drive_motion(self, link: Link, pose: ca.SX, motion: Sequence[tuple[ca.SX, ca.SX]]) -> DriveMotion:
        import casadi as ca

        def node(i: int) -> NodeMotion:
            zero = ca.SX.zeros(3)
            return NodeMotion(pose[:3, i], _rotation(pose[:, i]), *motion[i], zero, zero)

        d = link.drive
        p = ca.SX([d.stiffness, d.damping, d.inertia, d.effective_ratio, *d.direction, *link.rest])
        if isinstance(d, RotaryDrive):
            return rotary_motion(node(link.node), node(link.base), ca.SX.zeros(3), ca.SX(0), p)
        return linear_motion(node(link.node), node(link.base), ca.SX.zeros(3), p)


def _rotation(pose: ca.SX) -> ca.SX:
    import casadi as ca

    return ca.reshape(pose[3:12], 3, 3).T


def _twist(Q: ca.SX, axis: ca.DM) -> ca.SX:
    """The angle of a rotation about an axis, between −π and π."""
    import casadi as ca

    axial = ca.vertcat(Q[2, 1] - Q[1, 2], Q[0, 2] - Q[2, 0], Q[1, 0] - Q[0, 1])
    return ca.atan2(0.5 * ca.dot(axial, axis), 0.5 * (Q[0, 0] + Q[1, 1] + Q[2, 2] - 1.0))


def _callable(name: str, arguments: list[ca.SX], result: ca.SX) -> Callable[..., np.ndarray]:
    """Return a casadi function on numpy arrays, one item a column = one row of a C-ordered array."""
    import casadi as ca

    function = ca.Function(name, arguments, [ca.densify(result)], {"cse": True})
    inputs = [np.zeros(a.numel()) for a in arguments]
    output = np.zeros(result.numel())
    buffer, evaluate = function.buffer()
    for i, array in enumerate(inputs):
        if array.size:
            buffer.set_arg(i, array.data)  # type: ignore[call-arg]
    if output.size:
        buffer.set_res(0, output.data)  # type: ignore[call-arg]

    def call(*arrays: np.ndarray, keep: object = buffer) -> np.ndarray:
        for own, given in zip(inputs, arrays, strict=True):
            own[:] = given.ravel()
        if output.size:
            evaluate()
        return output.copy()

    return call


def renumbered(follow: Follow, local: dict[int, int], own: dict[int, int]) -> Follow:
    """Return a follower in the node and own numbers of a linkage; an own freedom that is held becomes 0."""
    node, master = local[follow.node], local[follow.master]
    if isinstance(follow, Copy):
        return Copy(node, follow.freedom, master)
    number = own.get(follow.own, 0)
    if isinstance(follow, Turn):
        return Turn(node, master, follow.axis, number)
    return Ride(node, master, follow.along, number)
