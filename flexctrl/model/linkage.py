"""Followers and drives as casadi expressions: how nodes ride on their masters.

Only places and rates are written down. Accelerations, the forces given back to masters, the matrix T
and its change with the pose all follow from the rates by differentiation: V = T(pose) w,
A = T ẇ + Ṫ w, collected = Tᵀ F. Loops of rigid parts are closed by making some freedoms depend on the others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.kernels.kernel import Kernel
from flexctrl.mechanics.beam import NodeMotion
from flexctrl.mechanics.pieces import DriveMotion, hoist_motion, linear_motion, rotary_motion
from flexctrl.mechanics.rotation import rotation_of, rotation_vector
from flexctrl.structure.drives import Drive, RotaryDrive, Winch
from flexctrl.structure.freedoms import Vector
from flexctrl.structure.relations import Copy, Fit, Follow, Ride, Turn

if TYPE_CHECKING:
    import casadi as ca

Terms = tuple[list["ca.SX"], "ca.SX"]
"""Arguments of a function and what it gives."""
_LOST = 1e-6
"""Reciprocal condition of a loop that may move on in several ways."""

_PAST = 2e-6
"""How far past such a position a step goes [rad or m]."""

_CLOSING = 4
"""Newton corrections that close loops after a step; the contraction is the turn within the step."""


@dataclass(frozen=True)
class Link:
    """A drive between two nodes of a linkage; ``rigid`` if its shaft ties the source angle to the joint."""

    drive: Drive
    node: int
    base: int
    rest: Vector
    rigid: bool


@dataclass(frozen=True)
class Loop:
    """A condition that closes a loop of rigid parts: a freedom of ``node`` is that of ``other``, or held (−1)."""

    node: int
    freedom: int
    other: int


@dataclass(frozen=True, eq=False)
class Linkage:
    """The nodes that follow, lead or are driven, in numbers of their own, and the functions of their motion.

    The freedoms of a linkage are its independent ones, then as many dependent ones as loops are closed.

    Attributes
    ----------
    cells : numpy.ndarray of int, shape (count, 6)
        Number of each nodal freedom among the linkage's; one past the last for none.
    rest : numpy.ndarray, shape (count, 3)
        Positions at rest.
    follows : tuple of Ride, Turn or Copy
        In an order in which they can be evaluated; ``own`` counts from 1 among the linkage's freedoms.
    lines : tuple of (int, numpy.ndarray)
        Nodes that turn about body axes (columns).
    links : tuple of Link
    loops : tuple of Loop or Fit
        Independent conditions.
    free : int
        Independent freedoms.
    """

    cells: np.ndarray
    rest: np.ndarray
    follows: tuple[Follow, ...]
    lines: tuple[tuple[int, np.ndarray], ...]
    links: tuple[Link, ...]
    loops: tuple[Loop | Fit, ...]
    free: int

    @property
    def count(self) -> int:
        """Number of nodes."""
        return len(self.cells)

    @cached_property
    def place(self) -> Callable[..., np.ndarray]:
        """(old pose, step of the independent freedoms) → new pose (count, 12)."""
        return _callable("place", *self._placing)

    @cached_property
    def rates(self) -> Callable[..., np.ndarray]:
        """(pose, independent rates) → raw rates: (count, 6), then the source angles of rigid shafts."""
        return _callable("rates", *self._rating)

    @cached_property
    def accelerations(self) -> Callable[..., np.ndarray]:
        """(pose, independent rates, their rates) → raw accelerations."""
        return _callable("accelerations", *self._accelerating)

    @cached_property
    def drift(self) -> Callable[..., np.ndarray]:
        """(pose, independent rates, their rates) → how raw rates and accelerations change with the pose.

        ∂(raw rates)/∂(own motion), ∂(raw accelerations)/∂(own motion), ∂(raw accelerations)/∂(own rates), each of
        shape (raw, free), by columns: all of it the turning of levers.
        """
        import casadi as ca

        step = ca.SX.sym("step", self.free)
        d = ca.reshape(ca.substitute(self._raw, self._rate, step)[: 6 * self.count], 6, self.count)
        after = ca.substitute(ca.vertcat(self._raw, self._accelerations), ca.vec(self._pose), self._moved(d))
        by_pose = ca.substitute(ca.jacobian(after, step), step, ca.SX.zeros(self.free))
        by_rate = ca.jacobian(self._accelerations, self._rate)
        slopes = ca.vertcat(ca.vec(ca.densify(by_pose)), ca.vec(ca.densify(by_rate)))
        return _callable("drift", [self._pose, self._rate, self._change], slopes)

    @cached_property
    def collect(self) -> Callable[..., np.ndarray]:
        """(pose, raw forces) → forces on the independent freedoms."""
        return _callable("collect", *self._collecting)

    @cached_property
    def kernels(self) -> tuple[Kernel, Kernel, Kernel, Kernel, Kernel]:
        """The same as kernels of one item: `place`, its rotations freed of drift, to `collect`, and `driven`."""
        import casadi as ca

        arguments, pose = self._placing
        pose = ca.reshape(pose, 12, self.count)
        square = [_orthonormal(_rotation(pose[:, i])) for i in range(self.count)]
        kept = ca.vertcat(*[ca.vertcat(pose[:3, i], ca.vec(R.T)) for i, R in enumerate(square)])
        return (
            _kernel("place", arguments, kept),
            _kernel("rates", *self._rating),
            _kernel("accelerations", *self._accelerating),
            _kernel("collect", *self._collecting),
            _kernel("driven", *self._driving),
        )

    @property
    def _placing(self) -> Terms:
        return [self._pose, self._rate], self._closed_place()

    @property
    def _rating(self) -> Terms:
        return [self._pose, self._rate], self._raw

    @property
    def _accelerating(self) -> Terms:
        return [self._pose, self._rate, self._change], self._accelerations

    @property
    def _collecting(self) -> Terms:
        return [self._pose, self._force], self._collected

    @property
    def _driving(self) -> Terms:
        import casadi as ca

        still = [(ca.SX.zeros(3), ca.SX.zeros(3))] * self.count
        values = [self._drive_motion(link, self._pose, still).driven for link in self.links]
        return [self._pose], ca.vertcat(*values, ca.SX(0, 1))

    @cached_property
    def matrix(self) -> Callable[..., np.ndarray]:
        """Pose → T, shape (raw, free), column by column."""
        import casadi as ca

        return _callable("matrix", [self._pose], ca.vec(ca.densify(ca.jacobian(self._raw, self._rate))))

    @cached_property
    def stiffening(self) -> Callable[..., np.ndarray]:
        """(pose, raw forces) → ∂collected/∂(raw motion of the nodes), shape (free, 6 count), by columns."""
        import casadi as ca

        d = ca.SX.sym("d", 6, self.count)
        collected = ca.substitute(self._collected, ca.vec(self._pose), self._moved(d))
        slope = ca.substitute(ca.jacobian(collected, ca.vec(d)), ca.vec(d), ca.SX.zeros(6 * self.count))
        return _callable("stiffening", [self._pose, self._force], ca.vec(ca.densify(slope)))

    @cached_property
    def driven(self) -> Callable[..., np.ndarray]:
        """Pose → driven coordinates of all drives; angles between −π and π."""
        return _callable("driven", *self._driving)

    @cached_property
    def grip(self) -> Callable[..., np.ndarray]:
        """Pose → how fast loops open with the independent freedoms, then with the dependent ones, by columns."""
        import casadi as ca

        return _callable("grip", [self._pose], ca.vec(ca.densify(ca.horzcat(*self._loop_slopes(self._pose)))))

    @cached_property
    def gaps(self) -> Callable[..., np.ndarray]:
        """Pose → how far loops are open [m or rad]."""
        return _callable("gaps", [self._pose], self._gaps(self._pose))

    def _moved(self, d: ca.SX) -> ca.SX:
        """Return the pose after a small raw motion of the nodes, shape (6, count), to first order."""
        import casadi as ca

        x, R = self._pose[:3, :], [_rotation(self._pose[:, i]) for i in range(self.count)]
        turned = [r + ca.skew(d[3:, i]) @ r for i, r in enumerate(R)]
        return ca.vertcat(*[ca.vertcat(x[:, i] + d[:3, i], ca.vec(r.T)) for i, r in enumerate(turned)])

    def placed(self, pose: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Return the pose after a step of any size, with loops closed as far as round-off lets them be.

        A step that ends in the very position where a loop branches goes a little further, or nothing would say
        which way the loop moves on.
        """
        new, length = self._closed(pose, step), np.abs(step).max(initial=0.0)
        if self.loops and length > 0.0 and reciprocal_condition(self.slopes_at(new)[1]) < _LOST:
            return self._closed(pose, step * (1.0 + _PAST / length))
        return new

    def _closed(self, pose: np.ndarray, step: np.ndarray) -> np.ndarray:
        new, gap = self.place(pose, step), np.inf
        floor = 1e-14 * max(1.0, np.abs(self.rest).max(initial=0.0))
        while self.loops and floor < (now := np.abs(self.gaps(new)).max()) < 0.5 * gap:
            new, gap = self.place(new, np.zeros(self.free)), now
        return new

    def slopes_at(self, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how fast loops open with the independent and with the dependent freedoms, the latter scaled to 1."""
        slopes = self.grip(pose).reshape(-1, len(self.loops)).T
        within = slopes[:, self.free :]
        return slopes[:, : self.free], within / np.abs(within).max(axis=0)

    def matrix_at(self, pose: np.ndarray) -> np.ndarray:
        """Return T at a pose."""
        return self.matrix(pose).reshape(self.free, self._raw.shape[0]).T

    def stiffening_at(self, pose: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return ∂collected/∂(raw motion) at a pose under constant raw forces."""
        return self.stiffening(pose, force).reshape(6 * self.count, self.free).T

    def drift_at(self, pose: np.ndarray, rate: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Return the three matrices of `drift` at a pose, shape (3, raw, free)."""
        flat = self.drift(pose, rate, change)
        rows = self._raw.shape[0]
        by_pose = flat[: 2 * rows * self.free].reshape(self.free, 2, rows).transpose(1, 2, 0)
        return np.concatenate([by_pose, flat[2 * rows * self.free :].reshape(1, self.free, rows).transpose(0, 2, 1)])

    @cached_property
    def _pose(self) -> ca.SX:
        import casadi as ca

        return ca.SX.sym("pose", 12, self.count)

    @cached_property
    def _rate(self) -> ca.SX:
        import casadi as ca

        return ca.SX.sym("rate", self.free)

    @cached_property
    def _force(self) -> ca.SX:
        import casadi as ca

        return ca.SX.sym("force", self._raw.shape[0])

    @cached_property
    def _change(self) -> ca.SX:
        import casadi as ca

        return ca.SX.sym("change", self.free)

    @cached_property
    def _accelerations(self) -> ca.SX:
        """Raw accelerations: T times the rates' rates, and T changing on its way."""
        import casadi as ca

        V = ca.reshape(self._raw[: 6 * self.count], 6, self.count)
        turning = [ca.skew(V[3:, i]) @ _rotation(self._pose[:, i]) for i in range(self.count)]
        moving = ca.vertcat(*[ca.vertcat(V[:3, i], ca.vec(w.T)) for i, w in enumerate(turning)])
        carried = ca.jtimes(self._raw, ca.vec(self._pose), moving)
        return ca.substitute(self._raw, self._rate, self._change) + carried

    @cached_property
    def _collected(self) -> ca.SX:
        import casadi as ca

        return ca.jtimes(self._raw, self._rate, self._force, True)

    @cached_property
    def _raw(self) -> ca.SX:
        """Raw rates of all nodes and of the source angles behind rigid shafts."""
        import casadi as ca

        motion = self._open_rates(self._pose, self._all(self._pose, self._rate))
        drives = [self._drive_motion(link, self._pose, motion) for link in self.links if link.rigid]
        return ca.vertcat(*[ca.vertcat(v, w) for v, w in motion], *[m.p["ratio"] * m.driven_rate for m in drives])

    def _all(self, pose: ca.SX, rate: ca.SX) -> ca.SX:
        """Return all freedoms' rates: the dependent ones keep the loops closed."""
        import casadi as ca

        if not self.loops:
            return rate
        onto, within = self._loop_slopes(pose)
        return ca.vertcat(rate, -ca.solve(within, onto @ rate))

    def _loop_slopes(self, pose: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return how fast loops open with the independent and with the dependent freedoms."""
        import casadi as ca

        every = ca.SX.sym("every", self.free + len(self.loops))
        motion = self._open_rates(pose, every)
        opening = [_opening(loop, pose, motion) for loop in self.loops]
        G = ca.jacobian(ca.vertcat(*opening), every)
        return G[:, : self.free], G[:, self.free :]

    def _open_rates(self, pose: ca.SX, every: ca.SX) -> list[tuple[ca.SX, ca.SX]]:
        """Return velocities and spins of all nodes, loops left open."""
        base = [self._base(i, every) for i in range(self.count)]
        motion = [(b[:3], b[3:]) for b in base]
        for node, axes in self.lines:
            motion[node] = (motion[node][0], _rotation(pose[:, node]) @ axes @ motion[node][1])
        for follow in self.follows:
            motion[follow.node] = self._followed(follow, motion, pose, every)
        return motion

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
        if isinstance(f, Turn):
            a = _rotation(pose[:, f.master]) @ ca.DM(f.axis)
            return v, mw + a * (_own(f.own, every) - ca.dot(a, mw))
        if isinstance(f, Ride):
            moved = mv + ca.cross(mw, pose[:3, f.node] - pose[:3, f.master])
            if f.along is not None:
                a = _rotation(pose[:, f.master]) @ ca.DM(f.along)
                moved = moved + a * (_own(f.own, every) - ca.dot(a, mv))
            return moved, w
        if f.freedom == 3:
            return v, mw
        return ca.vertcat(*[mv[k] if k == f.freedom else v[k] for k in range(3)]), w

    def _closed_place(self) -> ca.SX:
        """Return the new pose; the dependent steps are found by Newton's method with the slopes after a first guess.

        Not with those before the step: where a loop may branch, these would throw the parts about.
        """
        import casadi as ca

        old, step = self._pose, self._rate
        if not self.loops:
            return self._open_place(old, step)
        dependent = self._all(old, step)[self.free :]
        _, within = self._loop_slopes(ca.reshape(self._open_place(old, ca.vertcat(step, dependent)), 12, self.count))
        for _ in range(_CLOSING):
            dependent = dependent - ca.solve(within, self._gaps(self._open_place(old, ca.vertcat(step, dependent))))
        return self._open_place(old, ca.vertcat(step, dependent))

    def _gaps(self, pose: ca.SX) -> ca.SX:
        """Return how far loops are open [m or rad]."""
        import casadi as ca

        shaped = ca.reshape(pose, 12, self.count)
        return ca.vertcat(*[self._gap(loop, shaped) for loop in self.loops])

    def _gap(self, loop: Loop | Fit, pose: ca.SX) -> ca.SX:
        import casadi as ca

        x, R = pose[:3, loop.node], _rotation(pose[:, loop.node])
        if isinstance(loop, Fit):
            across = _rotation(pose[:, loop.master]) @ ca.DM(loop.across)
            if loop.axis is not None:
                return ca.dot(across, R @ ca.DM(loop.axis))
            arm = self.rest[loop.node] - self.rest[loop.master]
            return ca.dot(across, x - pose[:3, loop.master]) - float(np.dot(loop.across, arm))
        moved = x - ca.DM(self.rest[loop.node])
        if loop.other >= 0:
            moved = moved - (pose[:3, loop.other] - ca.DM(self.rest[loop.other]))
            R = R @ _rotation(pose[:, loop.other]).T
        return moved[loop.freedom] if loop.freedom < 3 else rotation_vector(R)[loop.freedom - 3]

    def _open_place(self, old: ca.SX, step: ca.SX) -> ca.SX:
        import casadi as ca

        moved = [self._base(i, step) for i in range(self.count)]
        old_R = [_rotation(old[:, i]) for i in range(self.count)]
        for node, axes in self.lines:
            moved[node] = ca.vertcat(moved[node][:3], old_R[node] @ axes @ moved[node][3:])
        x = [old[:3, i] + m[:3] for i, m in enumerate(moved)]
        R = [rotation_of(m[3:]) @ r for m, r in zip(moved, old_R, strict=True)]
        for f in self.follows:
            n, m = f.node, f.master
            if isinstance(f, Turn):
                axis = ca.DM(f.axis)
                turned = ca.dot(old_R[m] @ axis, rotation_vector(R[m] @ old_R[m].T))
                phi = _twist(old_R[m].T @ old_R[n], axis) + _own(f.own, step) - turned
                K = ca.skew(axis)
                R[n] = R[m] @ (ca.DM.eye(3) + ca.sin(phi) * K + (1.0 - ca.cos(phi)) * (K @ K))
            elif isinstance(f, Ride):
                slid = self._slid(f, x, R, old, _own(f.own, step))
                x[n] = x[m] + R[m] @ (ca.DM(self.rest[n] - self.rest[m]) + slid)
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
        old_R = _rotation(old[:, m])
        arm = old_R.T @ (old[:3, f.node] - old[:3, m]) - ca.DM(self.rest[f.node] - self.rest[m])
        mean = (R[m] + old_R) @ along
        mean = mean / ca.sqrt(ca.dot(mean, mean))
        return along * (ca.dot(along, arm) + step - ca.dot(mean, x[m] - old[:3, m]))

    def _drive_motion(self, link: Link, pose: ca.SX, motion: Sequence[tuple[ca.SX, ca.SX]]) -> DriveMotion:
        import casadi as ca

        def node(i: int) -> NodeMotion:
            zero = ca.SX.zeros(3)
            return NodeMotion(pose[:3, i], _rotation(pose[:, i]), *motion[i], zero, zero)

        d = link.drive
        p = ca.SX([d.stiffness, d.damping, d.inertia, d.effective_ratio, *d.direction, *link.rest])
        if isinstance(d, RotaryDrive):
            return rotary_motion(node(link.node), node(link.base), ca.SX.zeros(3), ca.SX(0), p)
        motion_of = hoist_motion if isinstance(d, Winch) else linear_motion
        return motion_of(node(link.node), node(link.base), ca.SX.zeros(3), p)


def _opening(loop: Loop | Fit, pose: ca.SX, motion: Sequence[tuple[ca.SX, ca.SX]]) -> ca.SX:
    """Return the rate of a loop's gap."""
    import casadi as ca

    v, w = motion[loop.node]
    if isinstance(loop, Loop):
        rate = ca.vertcat(v, w)[loop.freedom]
        return rate if loop.other < 0 else rate - ca.vertcat(*motion[loop.other])[loop.freedom]
    mv, mw = motion[loop.master]
    across = _rotation(pose[:, loop.master]) @ ca.DM(loop.across)
    if loop.axis is not None:
        return ca.dot(w - mw, ca.cross(_rotation(pose[:, loop.node]) @ ca.DM(loop.axis), across))
    arm = pose[:3, loop.node] - pose[:3, loop.master]
    return ca.dot(across, v - mv) + ca.dot(mw, ca.cross(across, arm))


def _orthonormal(R: ca.SX) -> ca.SX:
    """Return R with its round-off drift from orthonormality removed."""
    import casadi as ca

    return R @ (1.5 * ca.DM.eye(3) - 0.5 * R.T @ R)


def _kernel(name: str, arguments: list[ca.SX], result: ca.SX) -> Kernel:
    import casadi as ca

    inputs = ca.vertcat(*[ca.vec(a) for a in arguments])
    return Kernel(name, inputs, ca.SX.sym("p", 0), ca.cse(ca.densify(result)))


def _own(number: int, values: ca.SX) -> ca.SX:
    import casadi as ca

    return values[number - 1] if number else ca.SX(0)


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


def reciprocal_condition(A: np.ndarray) -> float:
    """Return LAPACK's estimate of 1/cond(A) in the 1-norm; 0 for a singular or undefined matrix."""
    from scipy.linalg.lapack import dgecon, dgetrf

    lu, _, info = dgetrf(A)
    return float(dgecon(lu, np.abs(A).sum(axis=0).max())[0]) if info == 0 else 0.0


def renumbered(follow: Follow, local: dict[int, int], own: dict[int, int]) -> Follow:
    """Return a follower in the node and freedom numbers of a linkage."""
    node, master = local[follow.node], local[follow.master]
    if isinstance(follow, Copy):
        return Copy(node, follow.freedom, master)
    number = own.get(follow.own, 0)
    if isinstance(follow, Turn):
        return Turn(node, master, follow.axis, number)
    return Ride(node, master, follow.along, number)
