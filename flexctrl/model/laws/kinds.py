"""Kinds of pieces and the sum of what all effects do to each, as casadi kernels.

Kernels read node slots of a flat vector z and add forces to a raw vector. A node's slot holds
x (3), R (9, row by row), velocity (6) and acceleration (6); a drive's slot θ_d, its two rates, and the
whole turns of its joint; an inner freedom's slot its value, its two rates, and its phase. The tangents read
three seeds more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import TYPE_CHECKING

from flexctrl.effects.effect import Effect
from flexctrl.kernels.kernel import Kernel
from flexctrl.mechanics import beam, beam_inertia, pieces, winch
from flexctrl.mechanics.beam import NodeMotion
from flexctrl.mechanics.beam_tangent import beam_slope

if TYPE_CHECKING:
    import casadi as ca

NODE_SLOT = 24
DRIVE_SLOT = 4


@dataclass(frozen=True)
class Shares:
    """What acts on a piece: forces of inertia, all other forces, kinetic and stored energy.

    ``lost`` is the power it takes from the machine, for pieces where that is not what forces lose at standstill.
    """

    inertia: ca.SX
    force: ca.SX
    kinetic: ca.SX
    stored: ca.SX
    lost: ca.SX | None = None


Physics = Callable[[tuple[Effect, ...], Sequence[NodeMotion], "ca.SX", "ca.SX"], Shares]
"""(effects, node motions, slots of drives and inner freedoms, parameters) → what acts on the piece."""

Slope = Callable[[tuple[Effect, ...], Sequence[NodeMotion], "ca.SX", "ca.SX"], "ca.SX"]
"""(effects, node motions, parameters, seeds) → ∂force/∂(raw motion)."""


@dataclass(frozen=True)
class Kind:
    """A kind of piece.

    Attributes
    ----------
    name : str
    nodes : int
        Nodes a piece.
    freedoms : int
        Raw freedoms a node that the piece pushes (3 or 6).
    drives : int
        Source angles and inner freedoms a piece.
    parameters : int
    physics : callable
    slope : callable, optional
        The tangent, where there is a quicker way to it than differentiating the physics.
    """

    name: str
    nodes: int
    freedoms: int
    drives: int
    parameters: int
    physics: Physics
    slope: Slope | None = None

    @property
    def width(self) -> int:
        """Raw freedoms a piece pushes."""
        return self.nodes * self.freedoms + self.drives


@dataclass(frozen=True)
class Kernels:
    """The kernels of one kind under some effects; made when first used, once a process (`kernels_of`)."""

    kind: Kind
    effects: tuple[Effect, ...]

    @cached_property
    def force(self) -> Kernel:
        """Kernel of the sum of all forces, inertia included."""
        symbols, parameters, shares = self._rest
        return _kernel(f"{self.kind.name}_force", symbols, parameters, shares.force + shares.inertia)

    @cached_property
    def energy(self) -> Kernel:
        """Kernel of kinetic energy, stored energy and dissipated power."""
        import casadi as ca

        symbols, parameters, shares = self._rest
        velocities = self._velocities(symbols)
        still = ca.substitute(shares.force, velocities, ca.SX.zeros(velocities.numel()))
        power = ca.dot(still - shares.force, self._raw_rates(symbols)) if shares.lost is None else shares.lost
        return _kernel(
            f"{self.kind.name}_energy", symbols, parameters, ca.vertcat(shares.kinetic, shares.stored, power), True
        )

    @cached_property
    def tangent(self) -> Kernel:
        """Kernel of ∂force/∂(raw motion), column by column.

        Three more inputs say how a raw increment moves the piece: it changes place, velocity
        and acceleration by that factor. (1, 0, 0) gives −K, (0, 1, 0) gives −C, (0, 0, 1) gives −M.
        """
        import casadi as ca

        symbols, parameters = symbols_of(self.kind)
        seeds = ca.SX.sym("seeds", 3)
        slope = self._slope(symbols, parameters, seeds)
        return _kernel(f"{self.kind.name}_tangent", ca.vertcat(symbols, seeds), parameters, ca.vec(ca.densify(slope)))

    def _slope(self, symbols: ca.SX, parameters: ca.SX, seeds: ca.SX) -> ca.SX:
        import casadi as ca

        zero = ca.SX(self.kind.width, 1)
        if self.kind.slope is not None and not _turning(self.effects):
            return self.kind.slope(self.effects, moved(self.kind, symbols, zero, seeds), parameters, seeds)
        increment = ca.SX.sym("increment", self.kind.width)
        shares = self._evaluate(symbols, parameters, increment, seeds)
        slope = ca.jacobian(ca.cse(shares.force + shares.inertia), increment)
        return ca.substitute(slope, increment, ca.densify(zero))

    @cached_property
    def _rest(self) -> tuple[ca.SX, ca.SX, Shares]:
        import casadi as ca

        kind = self.kind
        symbols, parameters = symbols_of(kind)
        return symbols, parameters, self._evaluate(symbols, parameters, ca.SX(kind.width, 1), ca.SX(3, 1))

    def _evaluate(self, symbols: ca.SX, parameters: ca.SX, increment: ca.SX, seeds: ca.SX) -> Shares:
        import casadi as ca

        nodes = moved(self.kind, symbols, increment, seeds)
        slot = symbols[NODE_SLOT * self.kind.nodes :]
        if self.kind.drives:
            slot = slot + ca.kron(increment[self.kind.nodes * self.kind.freedoms :], ca.vertcat(seeds, 0))
        return self.kind.physics(self.effects, nodes, slot, parameters)

    def _velocities(self, symbols: ca.SX) -> ca.SX:
        """All velocity symbols, rates of sources and inner freedoms included: zeroed to find what dissipates."""
        import casadi as ca

        count = self.kind.nodes
        found = [symbols[NODE_SLOT * i + 12 : NODE_SLOT * i + 18] for i in range(count)]
        return ca.vertcat(*found, *self._slot_rates(symbols))

    def _raw_rates(self, symbols: ca.SX) -> ca.SX:
        import casadi as ca

        count = self.kind.nodes
        found = [symbols[NODE_SLOT * i + 12 : NODE_SLOT * i + 12 + self.kind.freedoms] for i in range(count)]
        return ca.vertcat(*found, *self._slot_rates(symbols))

    def _slot_rates(self, symbols: ca.SX) -> list[ca.SX]:
        first = NODE_SLOT * self.kind.nodes + 1
        return [symbols[first + DRIVE_SLOT * k] for k in range(self.kind.drives)]


def symbols_of(kind: Kind) -> tuple[ca.SX, ca.SX]:
    """Return symbols of the slots that a piece reads, and of its parameters."""
    import casadi as ca

    return ca.SX.sym("z", NODE_SLOT * kind.nodes + DRIVE_SLOT * kind.drives), ca.SX.sym("p", kind.parameters)


def moved(kind: Kind, symbols: ca.SX, increment: ca.SX, seeds: ca.SX) -> list[NodeMotion]:
    """Return the motion of a piece's nodes after a raw increment, by factors ``seeds`` on place, rate, acceleration."""
    import casadi as ca

    nodes = []
    for i in range(kind.nodes):
        d = increment[kind.freedoms * i : kind.freedoms * (i + 1)]
        d = d if kind.freedoms == 6 else ca.vertcat(d, ca.SX(3, 1))
        nodes.append(_node_motion(symbols[NODE_SLOT * i : NODE_SLOT * (i + 1)], d, seeds))
    return nodes


def _node_motion(slot: ca.SX, d: ca.SX, seeds: ca.SX) -> NodeMotion:
    import casadi as ca

    R = ca.reshape(slot[3:12], 3, 3).T
    turned = R if d.is_zero() else R + ca.skew(seeds[0] * d[3:]) @ R
    return NodeMotion(
        slot[:3] + seeds[0] * d[:3],
        turned,
        slot[12:15] + seeds[1] * d[:3],
        slot[15:18] + seeds[1] * d[3:],
        slot[18:21] + seeds[2] * d[:3],
        slot[21:24] + seeds[2] * d[3:],
    )


def _kernel(name: str, inputs: ca.SX, parameters: ca.SX, outputs: ca.SX, seldom: bool = False) -> Kernel:
    import casadi as ca

    return Kernel(name, inputs, parameters, ca.densify(outputs), seldom=seldom)


@cache
def kernels_of(kind: Kind, effects: tuple[Effect, ...]) -> Kernels:
    """Return the kernels of a kind under some effects; equal values share them."""
    return Kernels(kind, effects)


def _beam(effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], slot: ca.SX, parameters: ca.SX) -> Shares:
    import casadi as ca

    modal = modes_in(slot)
    m = beam.beam_motion(nodes[0], nodes[1], parameters, modal)
    force, middle = beam.no_force(), 0.5 * (nodes[0].x + nodes[1].x)
    for effect in effects:
        force = force + effect.beam(m)
    stored = sum((e.beam_energy(m, middle) for e in effects), ca.SX(1, 1))
    felt, carried = m, ca.SX(1, 1)
    if _turning(effects):
        first, second = nodes
        felt = beam.beam_motion(seen_outside(effects, first), seen_outside(effects, second), parameters, modal)
        parked = (seen_outside(effects, _still(first)), seen_outside(effects, _still(second)))
        still = tuple(0.0 * eta if k else eta for k, eta in enumerate(modal))
        carried = beam_inertia.kinetic_energy(beam.beam_motion(*parked, parameters, still))
    inertia = whole_force(felt, beam_inertia.inertial_force(felt))
    return Shares(inertia, whole_force(m, force), beam_inertia.kinetic_energy(m), stored - carried)


def modes_in(slot: ca.SX) -> tuple[ca.SX, ...]:
    """Return amplitudes, rates and accelerations of an element's own modes; nothing where it has none."""
    return tuple(slot[k::DRIVE_SLOT] for k in range(3)) if slot.numel() else ()


def whole_force(m: beam.BeamMotion, force: beam.BeamForce) -> ca.SX:
    """Return a force on the nodes of an element and then on its own modes."""
    import casadi as ca

    nodal = beam.nodal_force(m, force)
    return ca.vertcat(nodal, ca.SX(m.modal[0].numel(), 1) + force.modal) if m.modal else nodal


def _beam_slope(effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], parameters: ca.SX, seeds: ca.SX) -> ca.SX:
    def force(m: beam.BeamMotion) -> beam.BeamForce:
        return sum((e.beam(m) for e in effects), beam_inertia.inertial_force(m))

    return beam_slope(nodes[0], nodes[1], parameters, seeds, force)


def _turning(effects: tuple[Effect, ...]) -> bool:
    """Tell whether some effect lets inertia feel another motion than that of the nodes."""
    return any(type(e).inertial is not Effect.inertial for e in effects)


def seen_outside(effects: tuple[Effect, ...], node: NodeMotion) -> NodeMotion:
    """Return the motion of a node as its inertia feels it: seen from an inertial frame."""
    for effect in effects:
        node = effect.inertial(node)
    return node


def _still(node: NodeMotion) -> NodeMotion:
    import casadi as ca

    return NodeMotion(node.x, node.R, *[ca.SX(3, 1)] * 4)


def _spring(effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], slot: ca.SX, parameters: ca.SX) -> Shares:
    import casadi as ca

    m = pieces.line_motion(nodes[0], nodes[1], parameters)
    return Shares(ca.SX(6, 1), pieces.line_force(m, spring_pull(effects, m)), ca.SX(1, 1), pieces.spring_energy(m))


def spring_pull(effects: tuple[Effect, ...], m: pieces.LineMotion) -> ca.SX:
    """Return the tension in a spring under some effects."""
    return sum((e.spring(m) for e in effects), pieces.spring_tension(m))


def _rope(effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], slot: ca.SX, parameters: ca.SX) -> Shares:
    import casadi as ca

    m = pieces.line_motion(nodes[0], nodes[1], parameters)
    stored = sum((e.rope_energy(m) for e in effects), ca.SX(1, 1))
    return Shares(ca.SX(6, 1), pieces.line_force(m, rope_pull(effects, m)), ca.SX(1, 1), stored)


def _heavy_rope(effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], slot: ca.SX, parameters: ca.SX) -> Shares:
    """A rope with mass, the last of its parameters."""
    import casadi as ca

    rope = _rope(effects, nodes, slot, parameters[:-1])
    half = ca.vertcat(0.5 * parameters[-1], ca.SX(6, 1))
    ends = [_body(effects, [node], slot, half) for node in nodes]
    first, second = nodes
    return Shares(
        pieces.rope_share(*(e.inertia for e in ends)),
        rope.force + pieces.rope_share(*(e.force for e in ends)),
        ends[0].kinetic + ends[1].kinetic - _apart(first, second, half),
        rope.stored + ends[0].stored + ends[1].stored + _carried_apart(effects, first, second, half),
    )


def _apart(first: NodeMotion, second: NodeMotion, half: ca.SX) -> ca.SX:
    """What m/12 [[5, 1], [1, 5]] lacks of the kinetic energy of half the mass at either end."""
    relative = replace(first, v=first.v - second.v)
    return pieces.body_energy(relative, pieces.named(pieces.BODY_PARAMETERS, half)) / 6.0


def _carried_apart(effects: tuple[Effect, ...], first: NodeMotion, second: NodeMotion, half: ca.SX) -> ca.SX:
    """The same of what a turning frame carries along: what the centrifugal potential at the ends has too much."""
    import casadi as ca

    if not _turning(effects):
        return ca.SX(1, 1)
    return _apart(seen_outside(effects, _still(first)), seen_outside(effects, _still(second)), half)


def rope_pull(effects: tuple[Effect, ...], m: pieces.LineMotion) -> ca.SX:
    """Return the tension in a rope under some effects."""
    import casadi as ca

    return pieces.unilateral(m, sum((e.rope(m) for e in effects), ca.SX(1, 1)))


def _body(effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], slot: ca.SX, parameters: ca.SX) -> Shares:
    import casadi as ca

    p = pieces.named(pieces.BODY_PARAMETERS, parameters)
    node = nodes[0]
    force = sum((e.body(node, p) for e in effects), ca.SX(6, 1))
    stored = sum((e.body_energy(node, p) for e in effects), ca.SX(1, 1))
    if _turning(effects):
        stored = stored - pieces.body_energy(seen_outside(effects, _still(node)), p)
    return Shares(pieces.body_inertia(seen_outside(effects, node), p), force, pieces.body_energy(node, p), stored)


def _rigid_beam(effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], slot: ca.SX, parameters: ca.SX) -> Shares:
    """A body at the middle of two nodes that turn together."""
    import casadi as ca

    first, second = nodes
    middle = replace(first, x=0.5 * (first.x + second.x), v=0.5 * (first.v + second.v), a=0.5 * (first.a + second.a))
    shares = _body(effects, [middle], slot, parameters)

    def spread(force: ca.SX) -> ca.SX:
        return ca.vertcat(0.5 * force[:3], 0.5 * force[3:], 0.5 * force[:3], 0.5 * force[3:])

    return replace(shares, inertia=spread(shares.inertia), force=spread(shares.force))


def _point(effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], slot: ca.SX, parameters: ca.SX) -> Shares:
    shares = _body(effects, nodes, slot, parameters)
    return Shares(shares.inertia[:3], shares.force[:3], shares.kinetic, shares.stored)


def _rotary(effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], slot: ca.SX, parameters: ca.SX) -> Shares:
    return drive_shares(effects, pieces.rotary_motion(nodes[0], nodes[1], slot[:3], slot[3], parameters))


def _linear(effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], slot: ca.SX, parameters: ca.SX) -> Shares:
    return drive_shares(effects, pieces.linear_motion(nodes[0], nodes[1], slot[:3], parameters))


def drive_shares(effects: tuple[Effect, ...], m: pieces.DriveMotion) -> Shares:
    """Return what acts on a drive."""
    import casadi as ca

    force = sum((e.drive(m) for e in effects), ca.SX(13, 1))
    stored = sum((e.drive_energy(m) for e in effects), ca.SX(1, 1))
    inertia = ca.vertcat(ca.SX(12, 1), -m.p["inertia"] * m.source_acceleration)
    return Shares(inertia, force, 0.5 * m.p["inertia"] * m.source_rate**2, stored)


def _winch(effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], slot: ca.SX, parameters: ca.SX) -> Shares:
    import casadi as ca

    m, motor = winch.paid_out(nodes[0], nodes[1], slot[:3], parameters), winch.motor(slot[:3], parameters)
    stored = sum((e.rope_energy(m) for e in effects), ca.SX(1, 1))
    force = winch.hoisting(m, rope_pull(effects, m), stored, motor.p["ratio"])
    drag = sum((e.drive(motor)[12] for e in effects), ca.SX(1, 1))
    inertia = ca.vertcat(ca.SX(6, 1), -motor.p["inertia"] * motor.source_acceleration)
    kinetic = 0.5 * motor.p["inertia"] * motor.source_rate**2
    return Shares(inertia, force + ca.vertcat(ca.SX(6, 1), drag), kinetic, stored)


BEAM = Kind("beam", 2, 6, 0, len(beam.PARAMETERS), _beam, _beam_slope)
SHEARING_BEAM = Kind("shearing_beam", 2, 6, 0, len(beam.PARAMETERS + beam.SHEARING), _beam, _beam_slope)


@cache
def modal_beam(count: int) -> Kind:
    """Return the kind of beam elements with some of their own modes in each plane."""
    return Kind(f"beam_with_{count}_modes", 2, 6, 2 * count, len(beam.PARAMETERS), _beam)


SPRING = Kind("spring", 2, 3, 0, len(pieces.LINE_PARAMETERS), _spring)
ROPE = Kind("rope", 2, 3, 0, len(pieces.LINE_PARAMETERS), _rope)
HEAVY_ROPE = Kind("heavy_rope", 2, 3, 0, len(pieces.LINE_PARAMETERS) + 1, _heavy_rope)
POINT = Kind("point", 1, 3, 0, len(pieces.BODY_PARAMETERS), _point)
RIGID_BEAM = Kind("rigid_beam", 2, 6, 0, len(pieces.BODY_PARAMETERS), _rigid_beam)
BODY = Kind("body", 1, 6, 0, len(pieces.BODY_PARAMETERS), _body)
ROTARY_DRIVE = Kind("rotary_drive", 2, 6, 1, len(pieces.DRIVE_PARAMETERS), _rotary)
LINEAR_DRIVE = Kind("linear_drive", 2, 6, 1, len(pieces.DRIVE_PARAMETERS), _linear)
WINCH = Kind("winch", 2, 3, 1, len(winch.WINCH_PARAMETERS), _winch)
