"""The kinds of parts and drives: the sum of what all effects do to each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING

from flexctrl.effects.effect import Effect
from flexctrl.mechanics import beam, beam_inertia, corotation, pieces, winch
from flexctrl.mechanics.beam_tangent import beam_slope
from flexctrl.mechanics.corotation import NodeMotion
from flexctrl.model.laws.inertial import seen_outside, standing, turning
from flexctrl.model.laws.kinds import DRIVE_SLOT, Kind, Shares

if TYPE_CHECKING:
    import casadi as ca


def _beam(
    effects: tuple[Effect, ...], nodes: Sequence[NodeMotion], slot: ca.SX, parameters: ca.SX, along: int = 0
) -> Shares:
    import casadi as ca

    modal = modes_in(slot, along)
    m = corotation.beam_motion(nodes[0], nodes[1], parameters, modal)
    force, middle = beam.no_force(), 0.5 * (nodes[0].x + nodes[1].x)
    for effect in effects:
        force = force + effect.beam(m)
    stored = sum((e.beam_energy(m, middle) for e in effects), ca.SX(1, 1))
    felt, carried = m, ca.SX(1, 1)
    if turning(effects):
        first, second = nodes
        felt = corotation.beam_motion(seen_outside(effects, first), seen_outside(effects, second), parameters, modal)
        parked = (seen_outside(effects, standing(first)), seen_outside(effects, standing(second)))
        still = modal._replace(rates=0.0 * modal.rates, accelerations=0.0 * modal.accelerations) if modal else ()
        carried = beam_inertia.kinetic_energy(corotation.beam_motion(*parked, parameters, still))
    inertial = beam_inertia.inertial_force(felt)
    shares = (beam.whole_force(felt, inertial), beam.whole_force(m, force))
    together = beam.whole_force(m, force + inertial)
    return Shares(*shares, beam_inertia.kinetic_energy(m), stored - carried, together=together)


def modes_in(slot: ca.SX, along: int = 0) -> corotation.OwnMotion | tuple[()]:
    """Return the motion of an element's own modes; nothing where it has none."""
    values, rates, accelerations = (slot[k::DRIVE_SLOT] for k in range(3))
    return corotation.OwnMotion(values, rates, accelerations, along) if slot.numel() else ()


def _beam_slope(
    effects: tuple[Effect, ...],
    nodes: Sequence[NodeMotion],
    slot: ca.SX,
    parameters: ca.SX,
    seeds: ca.SX,
    along: int = 0,
) -> ca.SX:
    def force(m: corotation.BeamMotion) -> beam.BeamForce:
        return sum((e.beam(m) for e in effects), beam_inertia.inertial_force(m))

    return beam_slope(nodes[0], nodes[1], parameters, seeds, force, modes_in(slot, along))


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
    """A rope with mass: the entries 11, 12 and 22 of its mass matrix are the last of its parameters."""
    import casadi as ca

    mass = parameters[-3:]
    rope = _rope(effects, nodes, slot, parameters[:-3])
    first, second = nodes
    ends = [_body(effects, [node], slot, ca.vertcat(1.0, ca.SX(6, 1))) for node in nodes]
    a, b = mass[0] + mass[1], mass[1] + mass[2]
    return Shares(
        pieces.rope_share(ends[0].inertia, ends[1].inertia, mass),
        rope.force + pieces.rope_share(ends[0].force, ends[1].force, mass),
        a * ends[0].kinetic + b * ends[1].kinetic - _apart(first, second, mass[1]),
        rope.stored + a * ends[0].stored + b * ends[1].stored + _carried_apart(effects, first, second, mass[1]),
    )


def _apart(first: NodeMotion, second: NodeMotion, shared: ca.SX) -> ca.SX:
    """What the entry 12 of a mass matrix takes from the kinetic energy of its rows' sums at the ends."""
    relative = first.v - second.v
    return 0.5 * shared * relative.T @ relative


def _carried_apart(effects: tuple[Effect, ...], first: NodeMotion, second: NodeMotion, shared: ca.SX) -> ca.SX:
    """The same of what a turning frame carries along: what the centrifugal potential at the ends has too much."""
    import casadi as ca

    if not turning(effects):
        return ca.SX(1, 1)
    return _apart(seen_outside(effects, standing(first)), seen_outside(effects, standing(second)), shared)


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
    if turning(effects):
        stored = stored - pieces.body_energy(seen_outside(effects, standing(node)), p)
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


BEAM = Kind("beam", 2, 6, 0, len(corotation.PARAMETERS), _beam, _beam_slope)
SHEARING_BEAM = Kind("shearing_beam", 2, 6, 0, len(corotation.PARAMETERS + corotation.SHEARING), _beam, _beam_slope)


@cache
def modal_beam(count: int, along: int) -> Kind:
    """Return the kind of beam elements with some of their own modes in each plane, and along them."""
    name = f"beam_with_{count}_modes" + (f"_and_{along}_along" if along else "")
    physics, slope = partial(_beam, along=along), partial(_beam_slope, along=along)
    return Kind(name, 2, 6, 2 * (count + along), len(corotation.PARAMETERS), physics, slope)


def along_of(kind: Kind) -> int:
    """Return how many of their own modes of stretch, and as many of twist, elements of a kind have."""
    return kind.physics.keywords["along"] if isinstance(kind.physics, partial) else 0


SPRING = Kind("spring", 2, 3, 0, len(pieces.LINE_PARAMETERS), _spring)
ROPE = Kind("rope", 2, 3, 0, len(pieces.LINE_PARAMETERS), _rope)
HEAVY_ROPE = Kind("heavy_rope", 2, 3, 0, len(pieces.LINE_PARAMETERS) + 3, _heavy_rope)
POINT = Kind("point", 1, 3, 0, len(pieces.BODY_PARAMETERS), _point)
RIGID_BEAM = Kind("rigid_beam", 2, 6, 0, len(pieces.BODY_PARAMETERS), _rigid_beam)
BODY = Kind("body", 1, 6, 0, len(pieces.BODY_PARAMETERS), _body)
ROTARY_DRIVE = Kind("rotary_drive", 2, 6, 1, len(pieces.DRIVE_PARAMETERS), _rotary)
LINEAR_DRIVE = Kind("linear_drive", 2, 6, 1, len(pieces.DRIVE_PARAMETERS), _linear)
WINCH = Kind("winch", 2, 3, 1, len(winch.WINCH_PARAMETERS), _winch)
