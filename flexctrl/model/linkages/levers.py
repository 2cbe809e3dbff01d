"""Long linkages: levers worked off one after the other in loops, from masters to followers and back.

What a linkage of few freedoms has in one expression would grow with their number, and its levers with the square.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from functools import cached_property
from itertools import groupby
from typing import NamedTuple

import numpy as np

from flexctrl.frozen import frozen
from flexctrl.kernels.kernel import Backend, Compiled, Run, best_backend
from flexctrl.mechanics.rotation import exponential
from flexctrl.model.linkages.lever_kinds import (
    LEAN,
    MOTION,
    POSE,
    RIDE,
    SAME_TURN,
    SLIDE,
    TURN,
    LeverKind,
    Work,
    same,
    shaft,
)
from flexctrl.model.linkages.lever_order import in_runs, shortened
from flexctrl.model.linkages.linkage import Linkage
from flexctrl.structure.relations import Copy, Follow, Ride, Turn

__all__ = ["Group", "Levers", "Places", "long_or_short"]

LONG = 40
"""Independent freedoms from which on levers are worked off in loops."""

_SLOT = 24


@frozen(eq=False)
class Group:
    """Levers of one kind, to be worked off in this order.

    Attributes
    ----------
    kind : LeverKind
    nodes : numpy.ndarray of int, shape (levers, nodes a lever)
    owns : numpy.ndarray of int, shape (levers, own freedoms a lever)
        One past the last for none.
    parameters : numpy.ndarray, shape (levers, parameters)
    said : numpy.ndarray of int, shape (levers, count)
        Which entries of the linkage's raw motion they say.
    """

    kind: LeverKind
    nodes: np.ndarray
    owns: np.ndarray
    parameters: np.ndarray
    said: np.ndarray


class _One(NamedTuple):
    """A lever: the first entry of the linkage's raw motion that it says."""

    kind: LeverKind
    nodes: tuple[int, ...]
    owns: tuple[int, ...]
    parameters: tuple[float, ...]
    first: int


@frozen(eq=False)
class Places:
    """Where a workspace holds what levers read and write.

    Attributes
    ----------
    slots, before : numpy.ndarray of int, (count,)
        Slots of the nodes; their poses at the start of the step.
    step, v, a : numpy.ndarray of int, (free + 1,)
        Steps, rates and accelerations of the independent freedoms, and a zero.
    rates, changes, force : numpy.ndarray of int, (raw,)
        Rates and accelerations of what levers say, and forces on the raw freedoms, as far as they are such.
    goal : numpy.ndarray of int, (free + 1,)
        Forces on the independent freedoms, and room for what is on none.
    """

    slots: np.ndarray
    before: np.ndarray
    step: np.ndarray
    v: np.ndarray
    a: np.ndarray
    rates: np.ndarray
    changes: np.ndarray
    force: np.ndarray
    goal: np.ndarray

    def poses(self, group: Group) -> np.ndarray:
        """Return where the poses of the nodes are."""
        return _spread(self.slots[group.nodes], POSE)

    def motions(self, group: Group, offset: int) -> np.ndarray:
        """Return where their rates or accelerations are."""
        return _spread(self.slots[group.nodes] + offset, MOTION)


def _spread(first: np.ndarray, count: int) -> np.ndarray:
    return np.asarray((first[:, :, None] + np.arange(count)).reshape(len(first), first.shape[1] * count))


def at_once(backend: Backend, work: Work, gather: np.ndarray, parameters: np.ndarray, scatter: np.ndarray) -> list[Run]:
    """Return the run of a kernel over levers that do not read what others of them write."""
    return [backend.bind(work.kernel, gather[:, work.reads], parameters, scatter[:, work.writes])]


def in_turn(backend: Backend, work: Work, gather: np.ndarray, parameters: np.ndarray, scatter: np.ndarray) -> list[Run]:
    """Return runs of a kernel over levers that may read what those before have written."""
    gather, scatter = gather[:, work.reads], scatter[:, work.writes]
    if isinstance(backend, Compiled):  # item after item
        return [replace(backend, lanes=1).bind(work.kernel, gather, parameters, scatter)]
    rows = zip(gather, parameters, scatter, strict=True)
    return [backend.bind(work.kernel, g[None], p[None], s[None]) for g, p, s in rows]


class Runs(NamedTuple):
    """What levers do, bound to a workspace: place, rates, accelerations, forces back."""

    placing: tuple[Run, ...]
    rating: tuple[Run, ...]
    changing: tuple[Run, ...]
    carrying: tuple[Run, ...]


class Levers(Linkage):
    """A long linkage without loops."""

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """All levers, masters first."""
        leaning = [
            _One(LEAN, (i,), tuple(self.cells[i, 3:].tolist()), tuple(axes.ravel().tolist()), MOTION * i + 3)
            for i, axes in self.lines
        ]
        led = [self._lever(f) for f in in_runs(shortened(self.follows, self.rest))]
        shafts, ground = [], MOTION * self.count
        for k, link in enumerate(link for link in self.links if link.rigid):
            d = link.drive
            p = (d.stiffness, d.damping, d.inertia, d.effective_ratio, *d.direction, *link.rest)
            kind = shaft(type(d))  # type: ignore[arg-type]
            shafts.append(_One(kind, (link.node, link.base), (), p, ground + k))
        found = groupby([*leaning, *led, *shafts], key=lambda one: id(one.kind))
        return tuple(_grouped(list(some), self.free) for _, some in found)

    def _lever(self, f: Follow) -> _One:
        arm = tuple((self.rest[f.node] - self.rest[f.master]).tolist())
        nodes, own = (f.node, f.master), ((f.own - 1 if f.own else self.free),) if isinstance(f, Ride | Turn) else ()
        place = MOTION * f.node
        if isinstance(f, Turn):
            return _One(TURN, nodes, own, f.axis, place + 3)
        if isinstance(f, Ride):
            slides = f.along is not None
            return _One(SLIDE if slides else RIDE, nodes, own if slides else (), (*arm, *(f.along or ())), place)
        assert isinstance(f, Copy)
        if f.freedom == 3:
            return _One(SAME_TURN, nodes, (), (), place + 3)
        return _One(same(f.freedom), nodes, (), (arm[f.freedom],), place + f.freedom)

    @property
    def raw(self) -> int:
        """Raw freedoms: six a node, then source angles behind rigid shafts."""
        return MOTION * self.count + sum(link.rigid for link in self.links)

    @cached_property
    def said(self) -> np.ndarray:
        """Which raw freedoms are said by levers."""
        found = np.zeros(self.raw, dtype=bool)
        for group in self.groups:
            found[group.said] = True
        return found

    @cached_property
    def owned(self) -> np.ndarray:
        """Independent freedom that each raw one is; ``free`` for those that are held or said by levers."""
        cells = np.append(np.minimum(self.cells.ravel(), self.free), np.full(self.raw - self.cells.size, self.free))
        return np.where(self.said, self.free, cells)

    def bound(self, backend: Backend, at: Places) -> Runs:
        """Return what levers do on a workspace.

        Places are found on what own freedoms have moved already; forces go from the last follower back.
        """
        found: list[list[Run]] = [[], [], [], []]
        for group in self.groups:
            kind, p = group.kind, group.parameters
            ordered = at_once if kind.nodes == 1 else in_turn
            before, poses = _spread(at.before[group.nodes], POSE), at.poses(group)
            speeds, changes = at.motions(group, POSE), at.motions(group, POSE + MOTION)
            steps, v, a = at.step[group.owns], at.v[group.owns], at.a[group.owns]
            if kind.place is not None:
                now = at.slots[group.nodes[:, :1]] + kind.placed
                found[0] += ordered(backend, kind.placing, np.hstack([before, poses, steps]), p, now)
            found[1] += ordered(backend, kind.rating, np.hstack([poses, speeds, v]), p, at.rates[group.said])
            reading = np.hstack([poses, speeds, changes, v, a])
            found[2] += ordered(backend, kind.changing, reading, p, at.changes[group.said])
            goals = np.hstack([at.force[_spread(MOTION * group.nodes, MOTION)], at.goal[group.owns]])
            back = ordered(backend, kind.carrying, np.hstack([poses, at.force[group.said]])[::-1], p[::-1], goals[::-1])
            found[3][:0] = back
        return Runs(*(tuple(runs) for runs in found))

    @cached_property
    def _own(self) -> tuple[Runs, Places, np.ndarray]:
        """The levers on a workspace of their own: slots and poses before; steps, rates, accelerations; forces."""
        n, free = self.count, self.free + 1
        ends = np.cumsum(
            [0, _SLOT * n, POSE * n, free, free, free, self.raw - MOTION * n, self.raw - MOTION * n, self.raw, free]
        )
        start = ends[:-1].tolist()
        slots, nodes = _SLOT * np.arange(n), np.arange(n)
        raw = (slots[:, None] + np.arange(MOTION)).ravel()
        rigid = np.arange(self.raw - MOTION * n)
        at = Places(
            slots=slots,
            before=start[1] + POSE * nodes,
            step=start[2] + np.arange(free),
            v=start[3] + np.arange(free),
            a=start[4] + np.arange(free),
            rates=np.append(raw + POSE, start[5] + rigid),
            changes=np.append(raw + POSE + MOTION, start[6] + rigid),
            force=start[7] + np.arange(self.raw),
            goal=start[8] + np.arange(free),
        )
        return self.bound(best_backend(), at), at, np.zeros(int(ends[-1]))

    @cached_property
    def _turns(self) -> np.ndarray:
        """Nodes that turn by freedoms of their own."""
        return np.flatnonzero((self.owned[: self.cells.size].reshape(-1, 6)[:, 3:] < self.free).any(axis=1))

    @cached_property
    def place(self) -> Callable[..., np.ndarray]:
        """(old pose, step of the independent freedoms) → new pose (count, 12)."""
        runs, at, z = self._own
        slots = z[: _SLOT * self.count].reshape(-1, _SLOT)

        def call(pose: np.ndarray, step: np.ndarray) -> np.ndarray:
            old, moved = pose.reshape(-1, POSE), np.append(step, 0.0)[self.owned[: self.cells.size]].reshape(-1, 6)
            slots[:, :POSE] = old
            slots[:, :3] += moved[:, :3]
            turned = exponential(moved[self._turns, 3:]) @ old[self._turns, 3:].reshape(-1, 3, 3)
            slots[self._turns, 3:POSE] = turned.reshape(-1, 9)
            z[at.before[0] : at.before[0] + old.size] = old.ravel()
            z[at.step] = np.append(step, 0.0)
            for run in runs.placing:
                run(z, z)
            return np.asarray(slots[:, :POSE].ravel())

        return call

    @cached_property
    def rates(self) -> Callable[..., np.ndarray]:
        """(pose, independent rates) → raw rates: (count, 6), then the source angles of rigid shafts."""
        runs, at, z = self._own

        def call(pose: np.ndarray, rate: np.ndarray) -> np.ndarray:
            z[: _SLOT * self.count].reshape(-1, _SLOT)[:, :POSE] = pose.reshape(-1, POSE)
            z[at.v] = np.append(rate, 0.0)
            z[at.rates] = np.append(rate, 0.0)[self.owned]
            for run in runs.rating:
                run(z, z)
            return z[at.rates]

        return call

    @cached_property
    def accelerations(self) -> Callable[..., np.ndarray]:
        """(pose, independent rates, their rates) → raw accelerations."""
        runs, at, z = self._own

        def call(pose: np.ndarray, rate: np.ndarray, change: np.ndarray) -> np.ndarray:
            self.rates(pose, rate)
            z[at.a] = np.append(change, 0.0)
            z[at.changes] = np.append(change, 0.0)[self.owned]
            for run in runs.changing:
                run(z, z)
            return z[at.changes]

        return call

    def carried(self, pose: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return the forces on all raw freedoms with those that followers hand on to them, shape (raw,)."""
        runs, at, z = self._own
        z[: _SLOT * self.count].reshape(-1, _SLOT)[:, :POSE] = pose.reshape(-1, POSE)
        z[at.force], z[at.goal] = force, 0.0
        for run in runs.carrying:
            run(z, z)
        return z[at.force]

    @cached_property
    def collect(self) -> Callable[..., np.ndarray]:
        """(pose, raw forces) → forces on the independent freedoms."""
        _, at, z = self._own

        def call(pose: np.ndarray, force: np.ndarray) -> np.ndarray:
            raw = self.carried(pose, force)
            own = np.bincount(self.owned, weights=raw, minlength=self.free + 1)
            return np.asarray((own + z[at.goal])[:-1])

        return call

    def matrix_at(self, pose: np.ndarray) -> np.ndarray:
        """Return T at a pose."""
        (runs, at, z), found = self._own, np.empty((self.free, self.raw))
        self.rates(pose, np.zeros(self.free))
        own = [np.flatnonzero(self.owned == i) for i in range(self.free)]
        for i, row in enumerate(found):
            z[at.v[i]] = z[at.rates[own[i]]] = 1.0
            for run in runs.rating:
                run(z, z)
            row[:] = z[at.rates]
            z[at.v[i]] = z[at.rates[own[i]]] = 0.0
        return found.T


def long_or_short(linkage: Linkage) -> Linkage:
    """Return a linkage as it is best worked off: in loops where it is long and has neither loops nor rails."""
    if linkage.free <= LONG or linkage.loops or linkage.spare or linkage.tracks:
        return linkage
    return Levers(**{f.name: getattr(linkage, f.name) for f in fields(linkage)})


def _grouped(some: list[_One], free: int) -> Group:
    kind, count = some[0].kind, len(some)
    owns = np.array([one.owns for one in some], dtype=int).reshape(count, kind.owns)
    return Group(
        kind,
        nodes=np.array([one.nodes for one in some], dtype=int),
        owns=np.minimum(owns, free),
        parameters=np.array([one.parameters for one in some], dtype=float).reshape(count, kind.parameters),
        said=np.array([one.first for one in some], dtype=int)[:, None] + np.arange(kind.count),
    )
