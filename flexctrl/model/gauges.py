"""The outputs of a flat model: sums of entries of the workspace, angles of them, tensions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexctrl.effects.backlash import gaps_of
from flexctrl.effects.effect import Effect
from flexctrl.kernels.kernel import Kernel, Run
from flexctrl.kernels.native import Reals, Runs, Wholes
from flexctrl.mechanics.corotation import NodeMotion
from flexctrl.mechanics.pieces import LINE_PARAMETERS, line_motion
from flexctrl.mechanics.winch import WINCH_PARAMETERS
from flexctrl.model.laws.families import winch_parameters
from flexctrl.model.laws.kinds import DRIVE_SLOT, NODE_SLOT
from flexctrl.model.laws.loose_kinds import loose_spring
from flexctrl.model.laws.part_kinds import rope_pull, spring_pull
from flexctrl.model.model import Model
from flexctrl.model.signals import winch_tension
from flexctrl.model.turned import angle_went, face, turned
from flexctrl.structure.drives import Winch
from flexctrl.structure.lines import Rope, Spring
from flexctrl.structure.outputs import (
    AngularVelocity,
    DriveAngle,
    DriveSpeed,
    Output,
    Position,
    Rotation,
    SwayAngle,
    Tension,
)

__all__ = ["Gauges", "gauges_of", "read", "show"]


@dataclass
class Gauges:
    """How outputs are read.

    Attributes
    ----------
    outputs, rows : int
        Number of outputs; of sums.
    moving : int
        Whether some output reads rates.
    starts, cells : Wholes
        Where each sum begins; the entries of the workspace in it.
    weights, levels, sums : Reals
        Of the entries; what each sum begins with.
    plain : Wholes
        Outputs that are a sum: output, sum.
    angles : Wholes
        Angles of two sums: output, opposite, adjacent.
    turns : Wholes
        Rotations: output, slot of the node's rotation, of the base's, and a sum that grows about as much.
    axes : Reals
    shown, summed, faced : Reals
        Rotations, these sums, and quaternions (4 each) when they were last read.
    facing : Reals
        Of one of them, before.
    tensions : Runs
    """

    outputs: int
    rows: int
    plains: int
    angled: int
    turning: int
    tense: int
    moving: int
    starts: Wholes
    cells: Wholes
    weights: Reals
    levels: Reals
    sums: Reals
    plain: Wholes
    angles: Wholes
    turns: Wholes
    axes: Reals
    shown: Reals
    summed: Reals
    faced: Reals
    facing: Reals
    tensions: Runs


def read(g: Gauges, z: Reals, y: Reals) -> None:
    """Read all outputs; angles not far from where they were last."""
    for i in range(g.rows):
        total = g.levels[i]
        for k in range(g.starts[i], g.starts[i + 1]):
            total += g.weights[k] * z[g.cells[k]]
        g.sums[i] = total
    for i in range(g.outputs):
        y[i] = 0.0
    for k in range(g.tense):
        g.tensions[k](z, y)
    show(g, z, y)


def show(g: Gauges, z: Reals, y: Reals) -> None:
    """Tell the outputs that are sums, angles of sums, and rotations."""
    for k in range(g.plains):
        y[g.plain[2 * k]] = g.sums[g.plain[2 * k + 1]]
    for k in range(g.angled):
        y[g.angles[3 * k]] = math.atan2(g.sums[g.angles[3 * k + 1]], g.sums[g.angles[3 * k + 2]])
    for k in range(g.turning):
        at = g.turns[4 * k :]
        for i in range(4):
            g.facing[i] = g.faced[4 * k + i]
        face(z[at[1] :], z[at[2] :], g.faced[4 * k :])
        swept = angle_went(g.facing, g.faced[4 * k :], g.axes[3 * k :], g.sums[at[3]] - g.summed[k])
        g.shown[k] = turned(z[at[1] :], z[at[2] :], g.axes[3 * k :], g.shown[k] + swept)
        g.summed[k] = g.sums[at[3]]
        y[at[0]] = g.shown[k]


def gauges_of(model: Model, q_start: int, position: np.ndarray) -> Gauges:
    """Return the gauges of a model.

    Parameters
    ----------
    model : Model
    q_start : int
        Where the degrees of freedom stand in the workspace.
    position : numpy.ndarray of int
        Their order there.

    Returns
    -------
    Gauges
    """
    builder = _Builder(model, q_start, position)
    for i, output in enumerate(model.structure.outputs):
        builder.add(i, output)
    return builder.made()


class _Builder:
    def __init__(self, model: Model, q_start: int, position: np.ndarray) -> None:
        self.model, self.s, self.drive_base = model, model.structure, model.forces.drive_base
        self.q_start, self.position = q_start, position
        self.sums: list[tuple[np.ndarray, np.ndarray]] = []
        self.plain: list[tuple[int, int]] = []
        self.angles: list[tuple[int, int, int]] = []
        self.turns: list[tuple[int, int, int, int]] = []
        self.twists = iter(zip(model.motion.twists.axes, model.motion.winding, strict=True))
        self.axes: list[np.ndarray] = []
        self.gaps = gaps_of(model.effects)
        self.winches: list[tuple[int, Winch]] = []
        self.lines: dict[tuple[bool, bool], list[tuple[int, Rope | Spring]]] = {}
        self.moving = False

    def add(self, i: int, output: Output) -> None:
        if isinstance(output, DriveAngle | DriveSpeed):
            drive = [d.name for d in self.s.drives].index(output.drive)
            rate = int(isinstance(output, DriveSpeed))
            self.moving |= bool(rate)
            self.plain.append((i, self._sum(np.array([self.drive_base + DRIVE_SLOT * drive + rate]), np.ones(1))))
        elif isinstance(output, SwayAngle):
            ends = (self.s.number(output.load), self.s.number(output.top))
            across, down = (self._between(ends, 0, np.array(d)) for d in (output.direction, output.down))
            self.angles.append((i, across, down))
        elif isinstance(output, Tension):
            line, self.moving = self.s.part(output.line), True
            if isinstance(line, Winch):
                self.winches.append((i, line))
            else:
                assert isinstance(line, Rope | Spring)
                kind = isinstance(line, Rope), self.gaps.get(line.name, 0.0) > 0.0
                self.lines.setdefault(kind, []).append((i, line))
        elif isinstance(output, Rotation):
            self._rotation(i, output)
        else:
            offset = 0 if isinstance(output, Position) else 15 if isinstance(output, AngularVelocity) else 12
            ends = (self.s.number(output.at), -1 if output.minus is None else self.s.number(output.minus))
            self.plain.append((i, self._between(ends, offset, np.array(output.direction))))
            self.moving |= offset > 0

    def _sum(self, cells: np.ndarray, weights: np.ndarray) -> int:
        self.sums.append((cells, weights))
        return len(self.sums) - 1

    def _between(self, ends: tuple[int, int], offset: int, direction: np.ndarray) -> int:
        """A component of a node's vector less that of another (−1: of none)."""
        signed = [(node, sign) for node, sign in zip(ends, (1.0, -1.0), strict=True) if node >= 0]
        cells = np.concatenate([NODE_SLOT * node + offset + np.arange(3) for node, _ in signed])
        return self._sum(cells, np.concatenate([sign * direction for _, sign in signed]))

    def _rotation(self, i: int, output: Rotation) -> None:
        at = self.s.number(output.at)
        base = len(self.s.nodes) if output.minus is None else self.s.number(output.minus)
        axis, winding = next(self.twists)
        about = self._sum(self.q_start + self.position[winding.indices], winding.data)
        self.turns.append((i, NODE_SLOT * at + 3, NODE_SLOT * base + 3, about))
        self.axes.append(axis)

    def made(self) -> Gauges:
        empty = np.zeros(0)
        runs = tuple(self._tensions(slack, loose, lines) for (slack, loose), lines in self.lines.items())
        runs += (self._hoists(),) if self.winches else ()
        return Gauges(
            outputs=len(self.s.outputs),
            rows=len(self.sums),
            plains=len(self.plain),
            angled=len(self.angles),
            turning=len(self.turns),
            tense=len(runs),
            moving=int(self.moving),
            starts=np.cumsum([0, *(len(cells) for cells, _ in self.sums)]),
            cells=np.concatenate([empty, *(cells for cells, _ in self.sums)]).astype(int),
            weights=np.concatenate([empty, *(weights for _, weights in self.sums)]),
            levels=np.zeros(len(self.sums)),
            sums=np.zeros(len(self.sums)),
            plain=np.array(self.plain, dtype=int).ravel(),
            angles=np.array(self.angles, dtype=int).ravel(),
            turns=np.array(self.turns, dtype=int).ravel(),
            axes=np.concatenate([empty, *self.axes]),
            shown=np.zeros(len(self.turns)),
            summed=np.zeros(len(self.turns)),
            faced=np.zeros(4 * len(self.turns)),
            facing=np.zeros(4),
            tensions=runs,
        )

    def _hoists(self) -> Run:
        names = [d.name for d in self.s.drives]
        gather = []
        for _, winch in self.winches:
            slots = [NODE_SLOT * self.s.number(n) + np.arange(3) for n in (winch.node, winch.against)]
            source = self.drive_base + DRIVE_SLOT * names.index(winch.name)
            gather.append(np.concatenate([*slots, [source], *(k + 12 for k in slots), [source + 1]]))
        parameters = [winch_parameters(w) for _, w in self.winches]
        scatter = np.array([[i] for i, _ in self.winches])
        kernel = _hoist(self.model.effects)
        return self.model.backend.bind(kernel, np.array(gather), np.array(parameters), scatter)

    def _tensions(self, slack: bool, loose: bool, lines: list[tuple[int, Rope | Spring]]) -> Run:
        slots = [(NODE_SLOT * self.s.number(line.end), NODE_SLOT * self.s.number(line.start)) for _, line in lines]
        gather = [np.concatenate([k + np.arange(3) for k in (a, b, a + 12, b + 12)]) for a, b in slots]
        gaps = [[self.gaps[line.name]] if loose else [] for _, line in lines]
        parameters = [[p.stiffness, p.length, p.damping, *gap] for (_, p), gap in zip(lines, gaps, strict=True)]
        kernel = _pull(slack, loose, self.model.effects)
        scatter = np.array([[i] for i, _ in lines])
        return self.model.backend.bind(kernel, np.array(gather), np.array(parameters), scatter)


def _hoist(effects: tuple[Effect, ...]) -> Kernel:
    """Tension of a winch from what `winch_tension` reads."""
    import casadi as ca

    z, p = ca.SX.sym("z", 14), ca.SX.sym("p", len(WINCH_PARAMETERS))
    return Kernel("hoist", z, p, ca.fmax(winch_tension(effects)(z, p)[0], 0.0))


def _pull(slack: bool, loose: bool, effects: tuple[Effect, ...]) -> Kernel:
    """Tension from places and velocities of end and start (12), of what goes slack or not, with play or without."""
    import casadi as ca

    z, p, still = ca.SX.sym("z", 12), ca.SX.sym("p", len(LINE_PARAMETERS) + loose), ca.SX(3, 1)
    end, start = (NodeMotion(z[k : k + 3], ca.SX.eye(3), z[6 + k : 9 + k], still, still, still) for k in (0, 3))
    if loose:
        return Kernel("tension", z, p, loose_spring(effects, start, end, p)[1])
    m = line_motion(start, end, p)
    tension = ca.fmax(rope_pull(effects, m), 0.0) if slack else spring_pull(effects, m)
    return Kernel("tension", z, p, tension)
