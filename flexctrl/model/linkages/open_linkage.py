"""Followers and drives as casadi expressions: how nodes ride on their masters, loops of rigid parts left open.

Only places and rates are written down; all else follows by differentiation (`flexctrl.model.linkages.linkage`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.frozen import ByFields, frozen
from flexctrl.mechanics.corotation import NodeMotion
from flexctrl.mechanics.pieces import DriveMotion, hoist_motion, linear_motion, rotary_motion
from flexctrl.mechanics.rotation import rotation_of, rotation_vector
from flexctrl.mechanics.track import travelled, travelling
from flexctrl.structure.drives import Drive, RotaryDrive, Winch
from flexctrl.structure.freedoms import Vector
from flexctrl.structure.relations import Copy, Fit, Follow, Ride, Track, Turn

if TYPE_CHECKING:
    import casadi as ca


def span_of(places: np.ndarray) -> float:
    """Return about how far some places reach, a power of two; 1 for the origin.

    Parameters
    ----------
    places : numpy.ndarray
        [m].

    Returns
    -------
    float
        [m].
    """
    reach = float(np.abs(places).max(initial=0.0))
    return 2.0 ** round(math.log2(reach)) if reach else 1.0


@frozen
class Link:
    """A drive between two nodes of a linkage; ``rigid`` if its shaft ties the source angle to the joint."""

    drive: Drive
    node: int
    base: int
    rest: Vector
    rigid: bool


@frozen
class Loop:
    """A condition that closes a loop of rigid parts: a freedom of ``node`` is that of ``other``, or held (−1)."""

    node: int
    freedom: int
    other: int


@frozen(eq=False)
class OpenLinkage(ByFields):
    """The nodes that follow, lead or are driven, in numbers of their own, and how they move with loops left open.

    The freedoms of a linkage are its independent ones, then as many dependent ones as loops are closed.

    Attributes
    ----------
    cells : numpy.ndarray of int, shape (count, 6)
        Number of each nodal freedom among the linkage's; one past the last for none.
    rest : numpy.ndarray, shape (count, 3)
        Positions at rest.
    follows : tuple of Ride, Turn, Copy or Track
        In an order in which they can be evaluated; ``own`` counts from 1 among the linkage's freedoms.
    lines : tuple of (int, numpy.ndarray)
        Nodes that turn about body axes (columns).
    links : tuple of Link
    loops : tuple of Loop or Fit
        Independent conditions.
    free : int
        Independent freedoms.
    spare : tuple of Loop or Fit
        Conditions that say nothing more where the machine is drawn: they are watched, not met.
    """

    cells: np.ndarray
    rest: np.ndarray
    follows: tuple[Follow, ...]
    lines: tuple[tuple[int, np.ndarray], ...]
    links: tuple[Link, ...]
    loops: tuple[Loop | Fit, ...]
    free: int
    spare: tuple[Loop | Fit, ...] = ()

    @property
    def count(self) -> int:
        """Number of nodes."""
        return len(self.cells)

    @cached_property
    def span(self) -> float:
        """About how long the linkage is: a power of two, so that what is divided by it keeps its digits [m]."""
        return span_of(self.rest)

    def _loop_slopes(self, pose: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return how fast loops open, as in `gaps`, with the independent and with the dependent freedoms."""
        import casadi as ca

        every = ca.SX.sym("every", self.free + len(self.loops))
        motion = self._open_rates(pose, every)
        opening = [_opening(loop, pose, motion) / self._yardstick(loop) for loop in self.loops]
        G = ca.jacobian(ca.vertcat(*opening), every)
        return G[:, : self.free], G[:, self.free :]

    @property
    def tracks(self) -> tuple[Track, ...]:
        """What travels along rails."""
        return tuple(f for f in self.follows if isinstance(f, Track))

    def _open_rates(self, pose: ca.SX, every: ca.SX, off: ca.SX | None = None) -> list[tuple[ca.SX, ca.SX]]:
        """Return velocities and spins of all nodes, loops left open; ``off`` are those of trolleys off their rails."""
        base = [self._base(i, every) for i in range(self.count)]
        motion = [(b[:3], b[3:]) for b in base]
        for node, axes in self.lines:
            motion[node] = (motion[node][0], attitude(pose[:, node]) @ axes @ motion[node][1])
        for follow in self.follows:
            motion[follow.node] = self._followed(follow, motion, pose, every)
            if off is not None and isinstance(follow, Track):
                v, w = motion[follow.node]
                motion[follow.node] = (v + off[:, self.tracks.index(follow)], w)
        return motion

    def _open_raw(self, pose: ca.SX, motion: Sequence[tuple[ca.SX, ca.SX]]) -> ca.SX:
        """Return raw rates of all nodes and of the source angles behind rigid shafts."""
        import casadi as ca

        drives = [self._drive_motion(link, pose, motion) for link in self.links if link.rigid]
        return ca.vertcat(*[ca.vertcat(v, w) for v, w in motion], *[m.p["ratio"] * m.driven_rate for m in drives])

    def _on_rails(self, pose: ca.SX, force: ca.SX) -> ca.SX:
        """Return what raw forces, inertia among them, push trolleys off their rails with, shape (3 tracks).

        The work of all on a motion off the rails; what closes loops works on it too, as much as it takes for the
        dependent freedoms to be in balance.
        """
        import casadi as ca

        every, off = ca.SX.sym("every", self.free + len(self.loops)), ca.SX.sym("off", 3, len(self.tracks))
        both, own = ca.vertcat(every, ca.vec(off)), every.numel()
        motion = self._open_rates(pose, every, off)
        work = ca.jtimes(self._open_raw(pose, motion), both, force, True)
        if not self.loops:
            return work[own:]
        G = ca.jacobian(ca.vertcat(*[_opening(loop, pose, motion) for loop in self.loops]), both)
        return work[own:] - G[:, own:].T @ ca.solve(G[:, self.free : own].T, work[self.free : own])

    def _base(self, node: int, every: ca.SX) -> ca.SX:
        """Return the six values that a node's freedoms have by themselves."""
        import casadi as ca

        size = every.shape[0]
        return ca.vertcat(*[every[int(k)] if k < size else ca.SX(0) for k in self.cells[node]])

    def _followed(
        self, f: Follow, motion: Sequence[tuple[ca.SX, ca.SX]], pose: ca.SX, every: ca.SX
    ) -> tuple[ca.SX, ca.SX]:
        """Velocity and spin of a follower; own rates are absolute along the axis, so rows read as the join table."""
        import casadi as ca

        (v, w), (mv, mw) = motion[f.node], motion[f.master]
        if isinstance(f, Track):
            axes = [attitude(pose[:, i]) @ ca.DM(f.along) for i in f.rail]
            moves = [(*motion[i], t) for i, t in zip(f.rail, axes, strict=True)]
            nodes = [(pose[:3, i], t, u, ca.cross(spin, t)) for i, (u, spin, t) in zip(f.rail, moves, strict=True)]
            return travelling(pose[0, f.gauge], motion[f.gauge][0][0], f.places, nodes), w
        if isinstance(f, Turn):
            a = attitude(pose[:, f.master]) @ ca.DM(f.axis)
            return v, mw + a * (_own(f.own, every) - ca.dot(a, mw))
        if isinstance(f, Ride):
            moved = mv + ca.cross(mw, pose[:3, f.node] - pose[:3, f.master])
            if f.along is not None:
                a = attitude(pose[:, f.master]) @ ca.DM(f.along)
                moved = moved + a * (_own(f.own, every) - ca.dot(a, mv))
            return moved, w
        if f.freedom == 3:
            return v, mw
        return ca.vertcat(*[mv[k] if k == f.freedom else v[k] for k in range(3)]), w

    def _gaps(self, pose: ca.SX, conditions: Sequence[Loop | Fit]) -> ca.SX:
        """Return how far conditions are open [rad, or shares of the span]."""
        import casadi as ca

        shaped = ca.reshape(pose, 12, self.count)
        return ca.vertcat(*[self._gap(c, shaped) / self._yardstick(c) for c in conditions])

    def _yardstick(self, loop: Loop | Fit) -> float:
        turns = loop.axis is not None if isinstance(loop, Fit) else loop.freedom >= 3
        return 1.0 if turns else self.span

    def _gap(self, loop: Loop | Fit, pose: ca.SX) -> ca.SX:
        import casadi as ca

        x, R = pose[:3, loop.node], attitude(pose[:, loop.node])
        if isinstance(loop, Fit):
            across = attitude(pose[:, loop.master]) @ ca.DM(loop.across)
            if loop.axis is not None:
                return ca.dot(across, R @ ca.DM(loop.axis))
            arm = self.rest[loop.node] - self.rest[loop.master]
            return ca.dot(across, x - pose[:3, loop.master]) - float(np.dot(loop.across, arm))
        moved = x - ca.DM(self.rest[loop.node])
        if loop.other >= 0:
            moved = moved - (pose[:3, loop.other] - ca.DM(self.rest[loop.other]))
            R = R @ attitude(pose[:, loop.other]).T
        return moved[loop.freedom] if loop.freedom < 3 else rotation_vector(R)[loop.freedom - 3]

    def _open_place(self, old: ca.SX, step: ca.SX) -> ca.SX:
        import casadi as ca

        moved = [self._base(i, step) for i in range(self.count)]
        old_R = [attitude(old[:, i]) for i in range(self.count)]
        for node, axes in self.lines:
            moved[node] = ca.vertcat(moved[node][:3], old_R[node] @ axes @ moved[node][3:])
        x = [old[:3, i] + m[:3] for i, m in enumerate(moved)]
        R = [r if m[3:].is_zero() else rotation_of(m[3:]) @ r for m, r in zip(moved, old_R, strict=True)]
        for f in self.follows:
            n, m = f.node, f.master
            if isinstance(f, Turn):
                axis = ca.DM(f.axis)
                turned = ca.dot(old_R[m] @ axis, rotation_vector(R[m] @ old_R[m].T))
                phi = twist(old_R[m].T @ old_R[n], axis) + _own(f.own, step) - turned
                K = ca.skew(axis)
                R[n] = R[m] @ (ca.DM.eye(3) + ca.sin(phi) * K + (1.0 - ca.cos(phi)) * (K @ K))
            elif isinstance(f, Ride):
                slid = self._slid(f, x, R, old, _own(f.own, step))
                x[n] = x[m] + R[m] @ (ca.DM(self.rest[n] - self.rest[m]) + slid)
            elif isinstance(f, Track):
                axis = ca.DM(f.along)
                x[n] = travelled(x[f.gauge][0], f.places, [(x[i], R[i] @ axis) for i in f.rail])
            elif f.freedom == 3:
                R[n] = R[m]
            else:
                value = x[m][f.freedom] + float(self.rest[n, f.freedom] - self.rest[m, f.freedom])
                x[n] = ca.vertcat(*[value if k == f.freedom else x[n][k] for k in range(3)])
        return ca.vertcat(*[ca.vertcat(p, ca.vec(q.T)) for p, q in zip(x, R, strict=True)])

    def _slid(self, f: Ride, x: list[ca.SX], R: list[ca.SX], old: ca.SX, step: ca.SX) -> ca.SX:
        """How far a slide stands out along its axis; the master's part of the step is seen along the mean axis."""
        import casadi as ca

        if f.along is None:
            return ca.SX(3, 1)
        along, m = ca.DM(f.along), f.master
        old_R = attitude(old[:, m])
        arm = old_R.T @ (old[:3, f.node] - old[:3, m]) - ca.DM(self.rest[f.node] - self.rest[m])
        mean = (R[m] + old_R) @ along
        mean = mean / ca.sqrt(ca.dot(mean, mean))
        return along * (ca.dot(along, arm) + step - ca.dot(mean, x[m] - old[:3, m]))

    def _drive_motion(self, link: Link, pose: ca.SX, motion: Sequence[tuple[ca.SX, ca.SX]]) -> DriveMotion:
        import casadi as ca

        def node(i: int) -> NodeMotion:
            zero = ca.SX.zeros(3)
            return NodeMotion(pose[:3, i], attitude(pose[:, i]), *motion[i], zero, zero)

        d = link.drive
        p = ca.SX([d.stiffness, d.damping, d.inertia, d.effective_ratio, *d.direction, *link.rest])
        return drive_motion(type(d), node(link.node), node(link.base), p)


def drive_motion(kind: type[Drive], node: NodeMotion, base: NodeMotion, p: ca.SX) -> DriveMotion:
    """Return how a drive of some kind moves between its node and its base."""
    import casadi as ca

    if issubclass(kind, RotaryDrive):
        return rotary_motion(node, base, ca.SX.zeros(3), ca.SX(0), p)
    return (hoist_motion if issubclass(kind, Winch) else linear_motion)(node, base, ca.SX.zeros(3), p)


def _opening(loop: Loop | Fit, pose: ca.SX, motion: Sequence[tuple[ca.SX, ca.SX]]) -> ca.SX:
    """Return the rate of a loop's gap."""
    import casadi as ca

    v, w = motion[loop.node]
    if isinstance(loop, Loop):
        rate = ca.vertcat(v, w)[loop.freedom]
        return rate if loop.other < 0 else rate - ca.vertcat(*motion[loop.other])[loop.freedom]
    mv, mw = motion[loop.master]
    across = attitude(pose[:, loop.master]) @ ca.DM(loop.across)
    if loop.axis is not None:
        return ca.dot(w - mw, ca.cross(attitude(pose[:, loop.node]) @ ca.DM(loop.axis), across))
    arm = pose[:3, loop.node] - pose[:3, loop.master]
    return ca.dot(across, v - mv) + ca.dot(mw, ca.cross(across, arm))


def _own(number: int, values: ca.SX) -> ca.SX:
    import casadi as ca

    return values[number - 1] if number else ca.SX(0)


def attitude(pose: ca.SX) -> ca.SX:
    """Return the rotation matrix in a node's pose: position, then the matrix by rows."""
    import casadi as ca

    return ca.reshape(pose[3:12], 3, 3).T


def twist(Q: ca.SX, axis: ca.DM | ca.SX) -> ca.SX:
    """The angle of a rotation about an axis, between −π and π."""
    import casadi as ca

    axial = ca.vertcat(Q[2, 1] - Q[1, 2], Q[0, 2] - Q[2, 0], Q[1, 0] - Q[0, 1])
    return ca.atan2(0.5 * ca.dot(axial, axis), 0.5 * (Q[0, 0] + Q[1, 1] + Q[2, 2] - 1.0))


def renumbered(follow: Follow, local: dict[int, int], own: dict[int, int]) -> Follow:
    """Return a follower in the node and freedom numbers of a linkage."""
    if isinstance(follow, Track):
        rail = tuple(local[n] for n in follow.rail)
        return replace(follow, node=local[follow.node], gauge=local[follow.gauge], rail=rail)
    node, master = local[follow.node], local[follow.master]
    if isinstance(follow, Copy):
        return Copy(node, follow.freedom, master)
    number = own.get(follow.own, 0)
    if isinstance(follow, Turn):
        return Turn(node, master, follow.axis, number)
    return Ride(node, master, follow.along, number)
