"""The kinds of levers that long linkages are made of, each a few small functions of the nodes it ties together.

Only place and rate of a follower are written down; accelerations, forces given back and all slopes follow by
differentiation, as for whole linkages (`flexctrl.model.linkages.linkage`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.frozen import frozen
from flexctrl.kernels.kernel import Kernel
from flexctrl.mechanics.corotation import NodeMotion
from flexctrl.mechanics.rotation import rotation_of, rotation_vector
from flexctrl.model.linkages.open_linkage import attitude, drive_motion, twist
from flexctrl.structure.drives import Drive

if TYPE_CHECKING:
    import casadi as ca

POSE, MOTION = 12, 6
_Nodes = Sequence[tuple["ca.SX", "ca.SX"]]
"""Position and rotation of each node, or its velocity and spin."""
Rate = Callable[[_Nodes, _Nodes, "ca.SX", "ca.SX"], "ca.SX"]
"""(places, motions, own rates, parameters) → rates of the follower. Its own node stands first."""
Place = Callable[[_Nodes, _Nodes, "ca.SX", "ca.SX"], "ca.SX"]
"""(places before, places now, own steps, parameters) → where the follower is now."""


@frozen(eq=False)
class Work:
    """A kernel that reads and writes only what it must.

    Attributes
    ----------
    kernel : Kernel
    reads, writes : numpy.ndarray of int
        What its inputs and outputs are, among all there might be.
    """

    kernel: Kernel
    reads: np.ndarray
    writes: np.ndarray


@frozen(eq=False)
class LeverKind:
    """A kind of lever.

    Attributes
    ----------
    name : str
    nodes, owns, parameters : int
        How many nodes it has to do with (the follower first), own freedoms and parameters.
    first, count : int
        Which entries of the follower's motion it says, or of a source angle (``nodes`` stand for its node and base).
    rate, place : callable
        No place: where it is, is found otherwise.
    """

    name: str
    nodes: int
    owns: int
    parameters: int
    first: int
    count: int
    rate: Rate
    place: Place | None

    @cached_property
    def placing(self) -> Work:
        """(poses before, poses now, own steps) → entries of the follower's pose."""
        import casadi as ca

        assert self.place is not None
        before = ca.SX.sym("before", POSE * self.nodes)
        found = self.place(_placed(before), _placed(self._pose), self._v, self._p)
        return self._work("place", [before, self._pose, self._v], found, replaces=True)

    @property
    def placed(self) -> np.ndarray:
        """Which entries of the follower's pose it says."""
        return np.arange(3, POSE) if self.first == 3 else self.first + np.arange(self.count)

    @cached_property
    def rating(self) -> Work:
        """(poses, motions, own rates) → rates of the follower."""
        return self._work("rate", [self._pose, self._V, self._v], self._rate, replaces=True)

    @cached_property
    def changing(self) -> Work:
        """(poses, motions, their rates, own rates, their rates) → accelerations of the follower."""
        inputs = [self._pose, self._V, self._A, self._v, self._a]
        return self._work("acceleration", inputs, self._acceleration, replaces=True)

    @cached_property
    def carrying(self) -> Work:
        """(poses, force on the follower) → what it adds to forces on the nodes and on the own freedoms."""
        return self._work("carry", [self._pose, self._force], self._carried)

    @cached_property
    def sloping(self) -> Work:
        """(poses, motions, their rates, own rates, their rates, force, seeds of all columns) → slopes, by columns.

        Rows: the follower's place, rate and acceleration, with a minus sign; forces on the nodes and own freedoms.
        Columns: places of the nodes, rates, accelerations; own steps, rates, accelerations; the force, with a minus
        sign. All but the last come times their seed.
        """
        import casadi as ca

        d = ca.SX.sym("d", MOTION * self.nodes)
        e = ca.SX.sym("e", self.owns)
        moved = ca.substitute(ca.vertcat(self._rate, self._acceleration, self._carried), self._pose, self._moved(d))
        still = ca.SX.zeros(d.numel())
        by_place = ca.substitute(ca.jacobian(moved, d), d, still)
        reach = self.rate(_placed(self._pose), _moving(d), e, self._p)
        rows = ca.vertcat(self._rate, self._acceleration, self._carried)
        none = ca.SX(self.count, d.numel())
        nothing = ca.SX(self.count, self.owns)
        forces = self._carried.numel()
        blank = ca.SX(forces, d.numel() + self.owns)
        columns = [
            ca.vertcat(-ca.jacobian(reach, d), -by_place[: 2 * self.count, :], by_place[2 * self.count :, :]),
            *(
                ca.vertcat(none, -ca.jacobian(rows, x)[: 2 * self.count, :], blank[:, : d.numel()])
                for x in (self._V, self._A)
            ),
            ca.vertcat(-ca.jacobian(reach, e), ca.SX(2 * self.count, self.owns), blank[:, d.numel() :]),
            *(
                ca.vertcat(nothing, -ca.jacobian(rows, x)[: 2 * self.count, :], blank[:, d.numel() :])
                for x in (self._v, self._a)
            ),
        ]
        seeds = ca.SX.sym("seeds", self.columns - self.count)
        led = ca.horzcat(*columns) @ ca.diag(seeds)
        back = ca.vertcat(ca.SX(3 * self.count, self.count), -ca.jacobian(self._carried, self._force))
        inputs = [self._pose, self._V, self._A, self._v, self._a, self._force, seeds]
        return self._work("slope", inputs, ca.vec(ca.densify(ca.horzcat(led, back))))

    @property
    def rows(self) -> int:
        """Rows of its slopes."""
        return 3 * self.count + MOTION * self.nodes + self.owns

    @property
    def columns(self) -> int:
        """Columns of its slopes."""
        return 3 * (MOTION * self.nodes + self.owns) + self.count

    def _work(self, what: str, inputs: Sequence[ca.SX], outputs: ca.SX, replaces: bool = False) -> Work:
        import casadi as ca

        every = ca.vertcat(*inputs)
        writes = np.array([i for i in range(outputs.numel()) if replaces or not outputs[i].is_zero()], dtype=int)
        outputs = ca.vertcat(*[outputs[int(i)] for i in writes])
        used = {s.element_hash() for s in ca.symvar(outputs)}
        reads = np.array([i for i in range(every.numel()) if every[i].element_hash() in used], dtype=int)
        inputs_used = ca.vertcat(ca.SX(0, 1), *[every[int(i)] for i in reads])
        return Work(Kernel(f"{self.name}_{what}", inputs_used, self._p, outputs, replaces), reads, writes)

    def _moved(self, d: ca.SX) -> ca.SX:
        """Poses after a small motion, to first order."""
        import casadi as ca

        places, ways = _placed(self._pose), _moving(d)
        return ca.vertcat(
            *[ca.vertcat(x + u, ca.vec((R + ca.skew(w) @ R).T)) for (x, R), (u, w) in zip(places, ways, strict=True)]
        )

    @cached_property
    def _pose(self) -> ca.SX:
        return _symbols("pose", POSE * self.nodes)

    @cached_property
    def _V(self) -> ca.SX:
        return _symbols("motion", MOTION * self.nodes)

    @cached_property
    def _A(self) -> ca.SX:
        return _symbols("change", MOTION * self.nodes)

    @cached_property
    def _v(self) -> ca.SX:
        return _symbols("v", self.owns)

    @cached_property
    def _a(self) -> ca.SX:
        return _symbols("a", self.owns)

    @cached_property
    def _p(self) -> ca.SX:
        return _symbols("p", self.parameters)

    @cached_property
    def _force(self) -> ca.SX:
        return _symbols("force", self.count)

    @cached_property
    def _rate(self) -> ca.SX:
        return self.rate(_placed(self._pose), _moving(self._V), self._v, self._p)

    @cached_property
    def _acceleration(self) -> ca.SX:
        import casadi as ca

        moving = [
            ca.vertcat(v, ca.vec((ca.skew(w) @ R).T))
            for (_, R), (v, w) in zip(_placed(self._pose), _moving(self._V), strict=True)
        ]
        led = self.rate(_placed(self._pose), _moving(self._A), self._a, self._p)
        return led + ca.jtimes(self._rate, self._pose, ca.vertcat(*moving))

    @cached_property
    def _carried(self) -> ca.SX:
        import casadi as ca

        return ca.jtimes(self._rate, ca.vertcat(self._V, self._v), self._force, True)


def _symbols(name: str, count: int) -> ca.SX:
    import casadi as ca

    return ca.SX.sym(name, count)


def _placed(pose: ca.SX) -> _Nodes:
    return [(pose[i : i + 3], attitude(pose[i : i + POSE])) for i in range(0, pose.numel(), POSE)]


def _moving(motion: ca.SX) -> _Nodes:
    return [(motion[i : i + 3], motion[i + 3 : i + MOTION]) for i in range(0, motion.numel(), MOTION)]


def _rows(R: ca.SX) -> ca.SX:
    """A rotation row by row, freed of round-off drift."""
    import casadi as ca

    return ca.vec((R @ (1.5 * ca.DM.eye(3) - 0.5 * R.T @ R)).T)


def _ride_rate(P: _Nodes, V: _Nodes, own: ca.SX, p: ca.SX) -> ca.SX:
    import casadi as ca

    return V[1][0] + ca.cross(V[1][1], P[1][1] @ p)


def _ride_place(before: _Nodes, now: _Nodes, own: ca.SX, p: ca.SX) -> ca.SX:
    return now[1][0] + now[1][1] @ p


def _slide_rate(P: _Nodes, V: _Nodes, own: ca.SX, p: ca.SX) -> ca.SX:
    import casadi as ca

    axis = P[1][1] @ p[3:]
    return V[1][0] + ca.cross(V[1][1], P[0][0] - P[1][0]) + axis * (own - ca.dot(axis, V[1][0]))


def _slide_place(before: _Nodes, now: _Nodes, own: ca.SX, p: ca.SX) -> ca.SX:
    import casadi as ca

    (x, _), (xm, Rm) = before
    arm, along = p[:3], p[3:]
    slid = ca.dot(along, Rm.T @ (x - xm) - arm)
    mean = (now[1][1] + Rm) @ along
    mean = mean / ca.sqrt(ca.dot(mean, mean))
    return now[1][0] + now[1][1] @ (arm + along * (slid + own - ca.dot(mean, now[1][0] - xm)))


def _turn_rate(P: _Nodes, V: _Nodes, own: ca.SX, p: ca.SX) -> ca.SX:
    import casadi as ca

    axis = P[1][1] @ p
    return V[1][1] + axis * (own - ca.dot(axis, V[1][1]))


def _turn_place(before: _Nodes, now: _Nodes, own: ca.SX, p: ca.SX) -> ca.SX:
    import casadi as ca

    (_, R), (_, Rm) = before
    turned = ca.dot(Rm @ p, rotation_vector(now[1][1] @ Rm.T))
    phi, K = twist(Rm.T @ R, p) + own - turned, ca.skew(p)
    return _rows(now[1][1] @ (ca.DM.eye(3) + ca.sin(phi) * K + (1.0 - ca.cos(phi)) * (K @ K)))


def _lean_rate(P: _Nodes, V: _Nodes, own: ca.SX, p: ca.SX) -> ca.SX:
    import casadi as ca

    return P[0][1] @ ca.reshape(p, 3, 3).T @ own


def _lean_place(before: _Nodes, now: _Nodes, own: ca.SX, p: ca.SX) -> ca.SX:
    import casadi as ca

    R = before[0][1]
    return _rows(rotation_of(R @ ca.reshape(p, 3, 3).T @ own) @ R)


def _same_turn_place(before: _Nodes, now: _Nodes, own: ca.SX, p: ca.SX) -> ca.SX:
    import casadi as ca

    return ca.vec(now[1][1].T)


RIDE = LeverKind("ride", 2, 0, 3, 0, 3, _ride_rate, _ride_place)
SLIDE = LeverKind("slide", 2, 1, 6, 0, 3, _slide_rate, _slide_place)
TURN = LeverKind("turn", 2, 1, 3, 3, 3, _turn_rate, _turn_place)
LEAN = LeverKind("lean", 1, 3, 9, 3, 3, _lean_rate, _lean_place)
SAME_TURN = LeverKind("same_turn", 2, 0, 0, 3, 3, lambda P, V, own, p: V[1][1], _same_turn_place)


@cache
def same(freedom: int) -> LeverKind:
    """Return the kind of levers whose follower has one displacement of its master."""

    def rate(P: _Nodes, V: _Nodes, own: ca.SX, p: ca.SX) -> ca.SX:
        return V[1][0][freedom]

    def place(before: _Nodes, now: _Nodes, own: ca.SX, p: ca.SX) -> ca.SX:
        return now[1][0][freedom] + p

    return LeverKind(f"same_{freedom}", 2, 0, 1, freedom, 1, rate, place)


@cache
def shaft(kind: type[Drive]) -> LeverKind:
    """Return the kind of rigid shafts of a kind of drives: node and base say how fast the motor turns."""

    def rate(P: _Nodes, V: _Nodes, own: ca.SX, p: ca.SX) -> ca.SX:
        import casadi as ca

        zero = ca.SX.zeros(3)
        node, base = (NodeMotion(*place, *motion, zero, zero) for place, motion in zip(P, V, strict=True))
        m = drive_motion(kind, node, base, p)
        return m.p["ratio"] * m.driven_rate

    return LeverKind(f"shaft_{kind.__name__}", 2, 0, 10, 0, 1, rate, None)
