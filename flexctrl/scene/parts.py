"""The machine in a scene file: sections, elements, joints, drives and signals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from flexctrl.cranes import bridge_crane, ceiling_crane, flexible_arm
from flexctrl.errors import did_you_mean
from flexctrl.scene.reading import (
    Kind,
    Place,
    Reader,
    checked,
    direction,
    mapping,
    named,
    number,
    of_kind,
    one_of,
    one_or_several,
    several,
    table,
    text,
    vector,
    whole,
)
from flexctrl.structure.beams import Beam
from flexctrl.structure.bodies import PointMass, RigidBody
from flexctrl.structure.drives import LinearDrive, RotaryDrive, Winch
from flexctrl.structure.elements import Part
from flexctrl.structure.inputs import FollowerForce, FollowerTorque, Force, MotorTorque, Torque, WindSpeed
from flexctrl.structure.joints import Hinge, Pin, Slide, Support, Weld
from flexctrl.structure.lines import Rope, Spring
from flexctrl.structure.naming import node_of
from flexctrl.structure.nodes import Node
from flexctrl.structure.outputs import (
    AngularVelocity,
    DriveAngle,
    DriveSpeed,
    Position,
    Rotation,
    SwayAngle,
    Tension,
    Velocity,
)
from flexctrl.structure.sections import STEEL, Material, Section
from flexctrl.structure.structure import Structure, planar
from flexctrl.structure.trolleys import Trolley

MACHINES = {
    "bridge_crane": Kind(bridge_crane, {"load": number, "rope": number, "elements": whole}),
    "ceiling_crane": Kind(ceiling_crane, {"elements": whole}),
    "flexible_arm": Kind(flexible_arm, {"payload": number, "elements": whole}),
}
"""Ready-made machines a scene may name."""

MATERIAL = Kind(Material, {"E": number, "rho": number, "nu": number})
_PROPERTIES = ("EA", "EI_y", "EI_z", "GJ", "rhoA", "rhoJ", "rhoI_y", "rhoI_z", "GA_y", "GA_z")

TABLES = ("materials", "sections", "elements", "joints", "drives", "inputs", "outputs", "planar")
"""Top-level keys that describe the machine."""


def machine(value: Any, place: Place) -> Structure:
    """Read the name of a ready-made machine, or a table of its name (``kind``) and parameters."""
    if isinstance(value, str):
        return MACHINES[one_of(MACHINES)(value, place)].read({}, place)
    return of_kind(value, place, MACHINES)


def structure(content: Mapping[str, Any], place: Place, name: str, base: Structure | None) -> Structure:
    """Read a machine from the tables of a scene file.

    Parameters
    ----------
    content : mapping of str to object
        Those of the file's tables that are in `TABLES`.
    place : Place
        The file.
    name : str
        For the machine.
    base : Structure or None
        A ready-made machine that the tables add to.

    Returns
    -------
    Structure

    Raises
    ------
    SceneError
        Naming table, key and what was expected.
    """
    if base is None and "elements" not in content:
        raise place.refuse(f"describes no machine; give [elements], or machine = one of {', '.join(MACHINES)}")
    sections = _sections(content, place)
    elements = _elements(content.get("elements", {}), place.at("elements"), sections, base)
    node = node_reader(elements)
    joints = _listed(content, "joints", place, _joint_kinds(node))
    drives = _named(content, "drives", place, _drive_kinds(node))
    inputs = _named(content, "inputs", place, _input_kinds(node))
    outputs = _named(content, "outputs", place, _output_kinds(node))
    made = checked(lambda: _join(base, name, elements, joints, drives, inputs, outputs), place)
    if "planar" not in content:
        return made
    return checked(lambda: planar(made, text(content["planar"], place.at("planar"))), place.at("planar"))


def _join(
    base: Structure | None,
    name: str,
    elements: Sequence[Part],
    joints: Sequence[Any],
    drives: Sequence[Any],
    inputs: Sequence[Any],
    outputs: Sequence[Any],
) -> Structure:
    if base is None:
        return Structure(elements, joints, drives, inputs, outputs, name)
    return base.with_(
        elements=elements,
        joints=(*base.joints, *joints),  # type: ignore[misc]  # ready-made machines have joints, not a table
        drives=(*base.drives, *drives),
        inputs=(*base.inputs, *inputs),
        outputs=(*base.outputs, *outputs),
        name=name,
    )


def _named(content: Mapping[str, Any], key: str, place: Place, kinds: Mapping[str, Kind]) -> tuple[Any, ...]:
    return named(content.get(key, {}), place.at(key), kinds)


def _listed(content: Mapping[str, Any], key: str, place: Place, kinds: Mapping[str, Kind]) -> tuple[Any, ...]:
    read = several(lambda item, where: of_kind(item, where, kinds))
    return read(content.get(key, []), place.at(key))


# -- sections


def _sections(content: Mapping[str, Any], place: Place) -> dict[str, Section]:
    materials = {"steel": STEEL}
    materials |= mapping(MATERIAL.read)(content.get("materials", {}), place.at("materials"))
    shapes = _shapes(materials)
    plain = Kind(Section, dict.fromkeys(_PROPERTIES, number))

    def read(value: Any, where: Place) -> Section:
        given = dict(table(value, where))
        if "shape" not in given:
            return plain.read(given, where)
        shape = one_of(shapes)(given.pop("shape"), where.at("shape"))
        override = {key: number(given.pop(key), where.at(key)) for key in ("rhoA", "rhoJ") if key in given}
        return checked(lambda: replace(shapes[shape].read(given, where), **override), where)

    return mapping(read)(content.get("sections", {}), place.at("sections"))


def _shapes(materials: Mapping[str, Material]) -> dict[str, Kind]:
    made: dict[str, tuple[Callable[..., Section], tuple[str, ...]]] = {
        "circular": (Section.circular, ("radius",)),
        "tube": (Section.tube, ("radius", "thickness")),
        "rectangle": (Section.rectangle, ("width", "height")),
        "box": (Section.box, ("width", "height", "web", "flange")),
    }
    material = _chosen(materials, "material")
    return {
        name: Kind(make, {"material": material, **dict.fromkeys(sizes, number)}) for name, (make, sizes) in made.items()
    }


def _chosen(known: Mapping[str, Any], what: str) -> Reader:
    """Return the reader of a name that was given before in the file."""

    def read(value: Any, place: Place) -> Any:
        if text(value, place) not in known:
            raise place.refuse(f"there is no {what} {value!r}{did_you_mean(value, known)}")
        return known[value]

    return read


# -- elements and nodes


def _elements(value: Any, place: Place, sections: Mapping[str, Section], base: Structure | None) -> tuple[Part, ...]:
    """Read the parts in order; the place of one may be a node of an earlier one."""
    made: list[Part] = list(base.elements) if base else []
    for name, item in table(value, place).items():
        made.append(of_kind(item, place.at(name), _element_kinds(sections, tuple(made)), name=name))
    return tuple(made)


def _element_kinds(sections: Mapping[str, Section], earlier: Sequence[Part]) -> dict[str, Kind]:
    node = node_reader(earlier)

    def point(value: Any, place: Place) -> Any:
        return node(value, place) if isinstance(value, str) else vector(value, place)

    ends = {"start": point, "end": point}
    section = _chosen(sections, "section")
    beam = _chosen({part.name: part for part in earlier if isinstance(part, Beam)}, "beam")
    return {
        "beam": Kind(Beam, {**ends, "section": section, "elements": whole, "up": direction}),
        "rope": Kind(Rope, {**ends, **dict.fromkeys(("EA", "length", "damping", "rhoA"), number), "elements": whole}),
        "spring": Kind(Spring, {**ends, "stiffness": number, "length": number, "damping": number}),
        "point_mass": Kind(PointMass, {"at": point, "mass": number}),
        "trolley": Kind(Trolley, {"along": one_or_several(beam), "at": number, "mass": number}),
        "rigid_body": Kind(RigidBody, {"at": point, "mass": number, "inertia": _inertia, "points": mapping(point)}),
    }


def _inertia(value: Any, place: Place) -> Any:
    if isinstance(value, list) and value and isinstance(value[0], list):
        return several(vector)(value, place)
    return vector(value, place)


def node_reader(elements: Sequence[Part]) -> Callable[[Any, Place], Node]:
    """Return the reader of nodes by name, see `node_of`."""
    return lambda value, place: checked(lambda: node_of(elements, text(value, place)), place)


# -- joints, drives, signals


def _freedoms(value: Any, place: Place) -> Any:
    return several(text)(value, place) if isinstance(value, list) else text(value, place)


def _joint_kinds(node: Reader) -> dict[str, Kind]:
    both = {"first": node, "second": node}
    return {
        "support": Kind(Support, {"node": node, "held": _freedoms}),
        "weld": Kind(Weld, both),
        "pin": Kind(Pin, both),
        "hinge": Kind(Hinge, {**both, "axis": direction}),
        "slide": Kind(Slide, {**both, "along": direction}),
    }


def _drive_kinds(node: Reader) -> dict[str, Kind]:
    sides = {"node": node, "against": node}
    shaft = dict.fromkeys(("stiffness", "ratio", "inertia", "damping"), number)
    winch = ("EA", "radius", "ratio", "inertia", "damping", "shortest")
    return {
        "rotary": Kind(RotaryDrive, {**sides, "axis": direction, **shaft}),
        "linear": Kind(LinearDrive, {**sides, "direction": direction, "radius": number, **shaft}),
        "winch": Kind(Winch, {**sides, **dict.fromkeys(winch, number)}),
    }


def _input_kinds(node: Reader) -> dict[str, Kind]:
    nodes = one_or_several(node)
    return {
        "force": Kind(Force, {"at": nodes, "direction": direction}),
        "torque": Kind(Torque, {"at": nodes, "axis": direction}),
        "follower_force": Kind(FollowerForce, {"at": nodes, "direction": direction}),
        "follower_torque": Kind(FollowerTorque, {"at": nodes, "axis": direction}),
        "motor_torque": Kind(MotorTorque, {"drive": text}),
        "wind_speed": Kind(WindSpeed, {"direction": direction}),
    }


def _output_kinds(node: Reader) -> dict[str, Kind]:
    straight = {"at": node, "direction": direction, "minus": node}
    turning = {"at": node, "axis": direction, "minus": node}
    return {
        "position": Kind(Position, straight),
        "velocity": Kind(Velocity, straight),
        "rotation": Kind(Rotation, turning),
        "angular_velocity": Kind(AngularVelocity, turning),
        "drive_angle": Kind(DriveAngle, {"drive": text}),
        "drive_speed": Kind(DriveSpeed, {"drive": text}),
        "sway_angle": Kind(SwayAngle, {"top": node, "load": node, "direction": direction, "down": direction}),
        "tension": Kind(Tension, {"line": text}),
    }


__all__ = ["MACHINES", "TABLES", "machine", "node_reader", "structure"]
