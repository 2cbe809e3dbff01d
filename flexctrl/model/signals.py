"""Inputs and outputs of a model, ready to be evaluated and linearised."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from flexctrl.effects.backlash import gaps_of
from flexctrl.effects.effect import Effect
from flexctrl.effects.motor_lag import MotorLag
from flexctrl.frozen import frozen
from flexctrl.mechanics.corotation import NodeMotion
from flexctrl.mechanics.pieces import line_motion
from flexctrl.mechanics.winch import WINCH_PARAMETERS, paid_out
from flexctrl.model.laws.families import winch_parameters
from flexctrl.model.laws.frictions import lag_compliance
from flexctrl.model.laws.loose_kinds import loose_spring
from flexctrl.model.laws.part_kinds import rope_pull, spring_pull
from flexctrl.model.motion import Motion
from flexctrl.model.state import State
from flexctrl.structure.drives import Winch
from flexctrl.structure.inputs import FollowerForce, FollowerTorque, Force, Input, MotorTorque, WindSpeed
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
    Velocity,
)
from flexctrl.structure.structure import Structure

if TYPE_CHECKING:
    import casadi as ca

Gauge = Callable[[State, np.ndarray], float]
Slope = Callable[[State, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]


@frozen
class Measure:
    """One output: its value, and its slope as (cells, on raw motion, cells, on raw rates)."""

    value: Gauge
    slope: Slope


@frozen
class Following:
    """An input that turns with a node: number of input and node, first raw cell it pushes, direction at rest."""

    input: int
    node: int
    cell: int
    direction: np.ndarray


@frozen
class Signals:
    """What acts on a model and what is measured of it.

    Attributes
    ----------
    loads : scipy.sparse.csr_matrix, shape (raw, inputs)
        Raw forces of unit inputs that keep their directions.
    follows : tuple of Following
        Those that turn with their nodes.
    measures : tuple of Measure
    """

    loads: sp.csr_matrix
    follows: tuple[Following, ...]
    measures: tuple[Measure, ...]

    def loads_at(self, state: State) -> sp.csr_matrix:
        """Return the raw forces of unit inputs in a state, shape (raw, inputs)."""
        if not self.follows:
            return self.loads
        turned = [(f.cell + k, f.input, v) for f in self.follows for k, v in enumerate(state.R[f.node] @ f.direction)]
        raw, inputs = self.loads.shape
        return self.loads + _matrix(turned, raw, inputs)

    def turning(self, state: State, u: np.ndarray) -> sp.csr_matrix:
        """Return ∂(raw forces of the inputs)/∂(raw motion): those that follow turn with their nodes, F → F + δ×F."""
        entries = []
        for f in self.follows:
            x, y, z = u[f.input] * (state.R[f.node] @ f.direction)
            skew = ((0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0))
            spins = 6 * f.node + 3
            entries += [(f.cell + i, spins + j, skew[i][j]) for i in range(3) for j in range(3)]
        return _matrix(entries, self.loads.shape[0], self.loads.shape[0])

    def outputs(self, state: State, rates: np.ndarray) -> np.ndarray:
        """Return the outputs of a state with raw rates."""
        return np.array([m.value(state, rates) for m in self.measures])

    def slopes(self, state: State, rates: np.ndarray, raw: int) -> tuple[sp.csr_matrix, sp.csr_matrix]:
        """Return ∂outputs/∂(raw motion) and ∂outputs/∂(raw rates)."""
        slopes = [m.slope(state, rates) for m in self.measures]
        return _slope([s[:2] for s in slopes], raw), _slope([s[2:] for s in slopes], raw)

    def sight(self, state: State, rates: np.ndarray, raw: int) -> sp.csr_matrix:
        """Return ∂outputs/∂(raw motion) alone."""
        return _slope([m.slope(state, rates)[:2] for m in self.measures], raw)


def _slope(rows: Sequence[tuple[np.ndarray, np.ndarray]], raw: int) -> sp.csr_matrix:
    """Cells of rows and what is in them, as a matrix."""
    ends = np.cumsum([0, *(len(cells) for cells, _ in rows)])
    cells, values = (np.concatenate(part) for part in zip(_none, *rows, strict=True))
    found = sp.csr_matrix((values, cells, ends), shape=(len(rows), raw))
    found.sum_duplicates()
    return found


def _matrix(entries: list, rows: int, columns: int) -> sp.csr_matrix:
    r, c, v = (np.array(part) for part in zip(*entries, strict=True)) if entries else (np.zeros(0, int),) * 3
    return sp.csr_matrix((v, (r, c)), shape=(rows, columns), dtype=float)


def signals_of(structure: Structure, effects: tuple[Effect, ...], motion: Motion) -> Signals:
    """Return the signals of a structure under some effects."""
    entries = [
        (cell, i, value)
        for i, signal in enumerate(structure.inputs)
        for cell, value in _load(structure, effects, motion, signal)
    ]
    loads = _matrix(entries, motion.raw, len(structure.inputs))
    follows = tuple(f for i, signal in enumerate(structure.inputs) for f in _follow(structure, i, signal))
    return Signals(loads, follows, tuple(_measure(structure, effects, motion, o) for o in structure.outputs))


def _load(s: Structure, effects: tuple[Effect, ...], motion: Motion, signal: Input) -> list[tuple[int, float]]:
    if isinstance(signal, MotorTorque):
        drive = _drive(s, signal.drive)
        return [(motion.source_base + drive, 1.0), *_lagging(s, effects, motion, drive)]
    if isinstance(signal, FollowerForce | FollowerTorque | WindSpeed):
        return []
    offset = 0 if isinstance(signal, Force) else 3
    return [(6 * s.number(n) + offset + k, d) for n in signal.at for k, d in enumerate(signal.direction) if d]


def _follow(s: Structure, number: int, signal: Input) -> list[Following]:
    if not isinstance(signal, FollowerForce | FollowerTorque):
        return []
    offset, direction = 0 if isinstance(signal, FollowerForce) else 3, np.array(signal.direction)
    return [Following(number, s.number(n), 6 * s.number(n) + offset, direction) for n in signal.at]


def _lagging(s: Structure, effects: tuple[Effect, ...], motion: Motion, drive: int) -> list[tuple[int, float]]:
    """The load on the inner freedom of a motor whose torque builds up."""
    inner, name = motion.inner_base, s.drives[drive].name
    for effect in effects:
        lagged = [n for n, _ in effect.acting] if isinstance(effect, MotorLag) else []
        if name in lagged:
            return [(inner + lagged.index(name), lag_compliance(s.drives[drive]))]
        inner += len(effect.inner(s))
    return []


def _drive(s: Structure, name: str) -> int:
    return [d.name for d in s.drives].index(name)


def _measure(s: Structure, effects: tuple[Effect, ...], motion: Motion, output: Output) -> Measure:
    if isinstance(output, DriveAngle):
        return _drive_angle(motion, _drive(s, output.drive))
    if isinstance(output, DriveSpeed):
        cell = motion.source_base + _drive(s, output.drive)
        return Measure(lambda state, rates: float(rates[cell]), lambda state, rates: (*_none, *_one(cell)))
    if isinstance(output, SwayAngle):
        return _sway(s, output)
    if isinstance(output, Tension):
        line = s.part(output.line)
        return _hoist(s, effects, motion, line) if isinstance(line, Winch) else _tension(s, effects, output)
    if isinstance(output, Rotation):
        return _rotation(s, output)
    return _linear(s, output)


_none = (np.zeros(0, dtype=int), np.zeros(0))


def _one(cell: int) -> tuple[np.ndarray, np.ndarray]:
    return np.array([cell]), np.array([1.0])


def _linear(s: Structure, output: Position | Velocity | AngularVelocity) -> Measure:
    direction = np.array(output.direction)
    offset = 3 if isinstance(output, AngularVelocity) else 0
    signs = [(s.number(output.at), 1.0), *([(s.number(output.minus), -1.0)] if output.minus else [])]
    cells = np.concatenate([6 * n + offset + np.arange(3) for n, _ in signs])
    weights = np.concatenate([sign * direction for _, sign in signs])
    if isinstance(output, Position):
        nodes, signed = np.array([n for n, _ in signs]), np.array([sign for _, sign in signs])
        return Measure(
            lambda state, rates: float(signed @ (state.x[nodes] @ direction)),
            lambda state, rates: (cells, weights, *_none),
        )
    return Measure(lambda state, rates: float(weights @ rates[cells]), lambda state, rates: (*_none, cells, weights))


def _drive_angle(motion: Motion, drive: int) -> Measure:
    number, ratio = int(motion.sources[drive]), float(motion.ratios[drive])
    cell = motion.source_base + drive
    if motion.rigid[drive]:
        return Measure(
            lambda state, rates: ratio * float(state.driven[drive]), lambda state, rates: (*_one(cell), *_none)
        )
    return Measure(lambda state, rates: float(state.q[number]), lambda state, rates: (*_one(cell), *_none))


def _pair(top: int, load: int) -> np.ndarray:
    return np.concatenate([6 * load + np.arange(3), 6 * top + np.arange(3)])


def _sway(s: Structure, output: SwayAngle) -> Measure:
    top, load = s.number(output.top), s.number(output.load)
    along, down = np.array(output.direction), np.array(output.down)
    cells = _pair(top, load)

    def value(state: State, rates: np.ndarray) -> float:
        d = state.x[load] - state.x[top]
        return float(np.arctan2(along @ d, down @ d))

    def slope(state: State, rates: np.ndarray) -> tuple:
        d = state.x[load] - state.x[top]
        a, b = along @ d, down @ d
        g = (b * along - a * down) / (a * a + b * b)
        return (cells, np.concatenate([g, -g]), *_none)

    return Measure(value, slope)


def _tension(s: Structure, effects: tuple[Effect, ...], output: Tension) -> Measure:
    line = s.part(output.line)
    assert isinstance(line, Rope | Spring)
    start, end = s.number(line.start), s.number(line.end)
    cells, pull = _pair(start, end), _pull(line, effects)

    def evaluated(state: State, rates: np.ndarray) -> np.ndarray:
        return pull(np.concatenate([state.x[end], state.x[start], rates[cells]])).full().ravel()

    def value(state: State, rates: np.ndarray) -> float:
        tension = float(evaluated(state, rates)[0])
        return max(tension, 0.0) if isinstance(line, Rope) else tension

    def slope(state: State, rates: np.ndarray) -> tuple:
        g = evaluated(state, rates)[1:]
        return (cells, g[:6], cells, g[6:])

    return Measure(value, slope)


def _hoist(s: Structure, effects: tuple[Effect, ...], motion: Motion, winch: Winch) -> Measure:
    """The tension in the rope of a winch."""
    pair, drive = _pair(s.number(winch.against), s.number(winch.node)), _drive(s, winch.name)
    cells, number = np.append(pair, motion.source_base + drive), motion.sources[drive]
    kernel, parameters = winch_tension(effects), winch_parameters(winch)

    def evaluated(state: State, rates: np.ndarray) -> np.ndarray:
        places = state.x[[s.number(winch.node), s.number(winch.against)]].ravel()
        z = np.concatenate([places, state.q[[number]], rates[cells]])
        return kernel(z, parameters).full().ravel()

    def slope(state: State, rates: np.ndarray) -> tuple:
        g = evaluated(state, rates)[1:]
        return (cells, g[:7], cells, g[7:])

    return Measure(lambda state, rates: max(float(evaluated(state, rates)[0]), 0.0), slope)


def winch_tension(effects: tuple[Effect, ...]) -> ca.Function:
    """Return a winch's tension and its slope: from place, place, angle of load, drum and motor, and their rates."""
    import casadi as ca

    z, p, still = ca.SX.sym("z", 14), ca.SX.sym("p", len(WINCH_PARAMETERS)), ca.SX(3, 1)
    node, base = (NodeMotion(z[k : k + 3], ca.SX.eye(3), z[7 + k : 10 + k], still, still, still) for k in (0, 3))
    tension = rope_pull(effects, paid_out(node, base, ca.vertcat(z[6], z[13], 0.0), p))
    return ca.Function("hoist", [z, p], [ca.vertcat(tension, ca.densify(ca.gradient(tension, z)))])


def _pull(line: Rope | Spring, effects: tuple[Effect, ...]) -> ca.Function:
    """Return tension and its slope from places and velocities of end and start (12)."""
    import casadi as ca

    z, still = ca.SX.sym("z", 12), ca.SX(3, 1)
    end, start = (NodeMotion(z[k : k + 3], ca.SX.eye(3), z[6 + k : 9 + k], still, still, still) for k in (0, 3))
    p, gap = [line.stiffness, line.length, line.damping], gaps_of(effects).get(line.name, 0.0)
    m = line_motion(start, end, ca.SX(p))
    tension = rope_pull(effects, m) if isinstance(line, Rope) else spring_pull(effects, m)
    if gap:
        tension = loose_spring(effects, start, end, ca.SX([*p, gap]))[1]
    return ca.Function("pull", [z], [ca.vertcat(tension, ca.densify(ca.gradient(tension, z)))])


def _rotation(s: Structure, output: Rotation) -> Measure:
    at = s.number(output.at)
    base = len(s.nodes) if output.minus is None else s.number(output.minus)
    axis = np.array(output.direction)
    number = [o.name for o in s.outputs if isinstance(o, Rotation)].index(output.name)
    cells = np.concatenate([6 * at + 3 + np.arange(3), 6 * base + 3 + np.arange(3)])

    def value(state: State, rates: np.ndarray) -> float:
        return float(state.shown[number])

    def slope(state: State, rates: np.ndarray) -> tuple:
        a, b = state.R[base] @ axis, state.R[at] @ axis
        g = (a + b) / (1.0 + a @ b)
        return (cells, np.concatenate([g, -g]), *_none)

    return Measure(value, slope)
