"""The audit of a machine: planted mechanisms are found, and nothing else is called one."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.model.audit import Freedom, audit

FLEXIBLE = (fc.Flexible(), fc.LargeRotation())


def machine(seed: int) -> tuple[fc.Structure, set[str]]:
    """A random chain of beams and bodies with one mechanism planted in it; the freedoms that can be blamed."""
    rng = np.random.default_rng(seed)
    parts, joints, at, last = [], [], np.zeros(3), None
    for k in range(int(rng.integers(1, 4))):
        part, start, end, at = _part(rng, k, at)
        parts.append(part)
        joints.append(fc.Support(start) if last is None else _joint(rng, last, start))
        last = end
    added, ties, blamed = _mechanism(rng, last, at)
    return fc.Structure([*parts, *added], [*joints, *ties]), blamed


def _direction(rng: np.random.Generator) -> np.ndarray:
    d = rng.normal(size=3)
    return d / np.linalg.norm(d)


def _section(rng: np.random.Generator, rhoJ: float) -> fc.Section:
    draw = rng.uniform
    return fc.Section(
        EA=draw(1e2, 1e6), EI_y=draw(1, 1e3), EI_z=draw(1, 1e3), GJ=draw(1, 1e3), rhoA=draw(0.1, 5), rhoJ=rhoJ
    )


def _part(rng: np.random.Generator, k: int, at: np.ndarray):
    end = at + rng.uniform(0.4, 2.0) * _direction(rng)
    if rng.random() < 0.6:
        beam = fc.Beam(f"part{k}", at, end, _section(rng, rng.uniform(1e-4, 1e-2)), elements=int(rng.integers(1, 3)))
        return beam, beam.start, beam.end, end
    body = fc.RigidBody(f"part{k}", 0.5 * (at + end), rng.uniform(0.5, 5), rng.uniform(0.6, 1, 3), {"a": at, "b": end})
    return body, body.point("a"), body.point("b"), end


def _joint(rng: np.random.Generator, a: fc.Node, b: fc.Node):
    axis = tuple(_direction(rng))
    kinds = (fc.Weld(a, b), fc.Pin(a, b), fc.Hinge(a, b, axis), fc.Slide(a, b, axis))
    return kinds[int(rng.integers(4))]


def _mechanism(rng: np.random.Generator, last: fc.Node, at: np.ndarray):
    """A motion that nothing holds and nothing weighs."""
    kind, axis = int(rng.integers(5)), tuple(_direction(rng))
    end = at + _direction(rng)
    if kind == 0:  # a rope without a load
        rope = fc.Rope("loose", at, end, EA=1e4, length=1.2)
        return [rope], [fc.Pin(last, rope.start)], {"loose_1_u", "loose_1_v", "loose_1_w"}
    if kind == 1:  # a spinning beam without inertia about its axis, on ball joints
        beam = fc.Beam("loose", at, end, _section(rng, 0.0))
        mass = fc.PointMass("end", end, 1.0)
        spins = {f"loose_{i}_r{axis}" for i in (0, 1) for axis in "xyz"}
        return [beam, mass], [fc.Pin(last, beam.start), fc.Pin(beam.end, mass.node)], spins
    if kind == 2:  # a weightless link
        body = fc.RigidBody("loose", at, 0.0, (0.0, 0.0, 0.0))
        return [body], [fc.Pin(last, body.node)], {"loose_0_rx", "loose_0_ry", "loose_0_rz"}
    if kind == 3:  # a weightless flap
        body = fc.RigidBody("loose", at, 0.0, (0.0, 0.0, 0.0))
        return [body], [fc.Hinge(last, body.node, axis)], {"loose_0_turn"}
    body = fc.RigidBody("loose", at, 0.0, (0.0, 0.0, 0.0))  # a weightless slider
    return [body], [fc.Slide(last, body.node, axis)], {"loose_0_slide"}


@pytest.mark.parametrize("block", range(10))
def test_planted_mechanism_is_found_and_nothing_else(block):
    for seed in range(20 * block, 20 * block + 20):
        structure, blamed = machine(seed)
        found = audit(fc.assemble(structure, FLEXIBLE))
        loose = set(found.named(Freedom.MECHANISM))
        assert loose, f"seed {seed}: the planted mechanism was not found"
        assert loose <= blamed, f"seed {seed}: {loose - blamed} are no mechanism"
        assert all(blamed & set(names) for names in found.mechanisms)
        light = set(found.named(Freedom.STATIC)) | set(found.named(Freedom.RELAXING))
        assert light <= blamed, f"seed {seed}: {light - blamed} have mass"


@pytest.mark.parametrize("block", range(4))
def test_sound_machine_is_all_dynamic(block):
    """The same machines with mass where there was none."""
    for seed in range(20 * block, 20 * block + 20):
        structure, _ = machine(seed)
        sound = [_weighed(part) for part in structure.elements]
        ends = [fc.PointMass("weight", p.end, 1.0) for p in sound if isinstance(p, fc.Rope)]
        ties = [fc.Pin(p.end, ends[0].node) for p in sound if isinstance(p, fc.Rope)]
        whole = fc.Structure([*sound, *ends], [*structure.joints, *ties])
        assert set(audit(fc.assemble(whole, FLEXIBLE)).labels) == {Freedom.DYNAMIC}


def _weighed(part):
    if isinstance(part, fc.RigidBody) and part.mass == 0.0:
        return fc.RigidBody(part.name, part.node, 1.0, (0.5, 0.6, 0.7), part.points)
    if isinstance(part, fc.Beam) and part.section.rhoJ == 0.0:
        return fc.Beam(part.name, part.start, part.end, _section(np.random.default_rng(0), 1e-3))
    return part


def test_labels_of_a_drive():
    """θ_d without motor inertia is stiff, with a damper it creeps, with inertia it is dynamic (case D2)."""
    for inertia, damping, kind in (
        (0.0, 0.0, Freedom.STATIC),
        (0.0, 0.1, Freedom.RELAXING),
        (0.1, 0.0, Freedom.DYNAMIC),
    ):
        beam = fc.Beam("arm", (0, 0, 0), (1, 0, 0), _section(np.random.default_rng(1), 1e-3))
        drive = fc.RotaryDrive("slew", beam.start, axis="z", stiffness=3.0, inertia=inertia, damping=damping)
        structure = fc.Structure([beam], [fc.Support(beam.start, "u v w rx ry")], [drive])
        found = audit(fc.assemble(structure, FLEXIBLE))
        assert found.labels[found.coordinates.index("slew_source")] is kind
        assert found.labels.count(Freedom.DYNAMIC) == len(found.labels) - (kind is not Freedom.DYNAMIC)


def test_prestress_counts_where_it_is():
    """A massless knot in a rope that hangs a load is a mechanism while slack and stiff under the load."""
    upper, lower = fc.Rope("upper", (0, 0, 0), (0, 0, -1), EA=1e4), fc.Rope("lower", (0, 0, -1), (0, 0, -2), EA=1e4)
    load = fc.PointMass("load", lower.end, 5.0)
    joints = [fc.Support(upper.start), fc.Pin(upper.end, lower.start), fc.Pin(lower.end, load.node)]
    model = fc.assemble(fc.Structure([upper, lower, load], joints), (fc.Gravity(), *FLEXIBLE))
    assert {"upper_1_u", "upper_1_v"} <= set(audit(model).named(Freedom.MECHANISM))
    hung = audit(model, fc.equilibrium(model))
    assert hung.named(Freedom.STATIC) == ("upper_1_u", "upper_1_v", "upper_1_w")
    assert not hung.mechanisms
