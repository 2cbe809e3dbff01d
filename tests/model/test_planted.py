"""Mechanisms planted in frames at random angles are refused by name; the same frames with them held go through."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import MechanismError

FLEXIBLE = (fc.Flexible(), fc.LargeRotation())
Said = tuple[str, np.ndarray | None]
STEEL = fc.Section.circular(fc.STEEL, 0.02)
THIN = replace(STEEL, rhoJ=0.0, rhoI_y=0.0, rhoI_z=0.0)


def frame(rng: np.random.Generator) -> tuple[list, list]:
    """Two welded beams at any angle and of any size, clamped at one end."""
    size = 10.0 ** rng.uniform(-1, 2)
    section = fc.Section.circular(fc.STEEL, size * 10.0 ** rng.uniform(-2.5, -1))
    ends = np.cumsum([np.zeros(3), size * rng.normal(size=3), size * rng.normal(size=3)], axis=0)
    beams = [fc.Beam(f"b{k}", ends[k], ends[k + 1], section, elements=1, up=rng.normal(size=3)) for k in range(2)]
    return beams, [fc.Support(beams[0].start), fc.Weld(beams[0].end, beams[1].start)]


def series(rng: np.random.Generator, sound: bool) -> tuple[fc.Structure, Said]:
    """Two unloaded springs in one line, a massless node between them."""
    beams, joints = frame(rng)
    a, b = beams[0].end, beams[1].end
    share, stiffness = rng.uniform(0.2, 0.8), 10.0 ** rng.uniform(1, 8)
    between = (1 - share) * np.array(a.position) + share * np.array(b.position)
    first, second = fc.Spring("one", a, between, stiffness), fc.Spring("two", between, b, 3.0 * stiffness)
    parts = [*beams, first, second]
    joints += [fc.Pin(a, first.start), fc.Pin(first.end, second.start), fc.Pin(second.end, b)]
    if sound:
        mass = fc.PointMass("mass", between, 1.0)
        parts, joints = [*parts, mass], [*joints, fc.Pin(first.end, mass.node)]
    return fc.Structure(parts, joints), ("one 1: translation along", None)


def tripod(rng: np.random.Generator, sound: bool) -> tuple[fc.Structure, Said]:
    """A massless node on two springs, free across their plane; a third one holds it."""
    beams, joints = frame(rng)
    a, b = beams[0].end, beams[1].end
    between = np.array(a.position) + rng.normal(size=3)
    springs = [fc.Spring("one", a, between, 1e4), fc.Spring("two", between, b, 3e4)]
    joints += [fc.Pin(a, springs[0].start), fc.Pin(springs[0].end, springs[1].start), fc.Pin(springs[1].end, b)]
    if sound:
        springs.append(fc.Spring("three", between, between + rng.normal(size=3), 1e4))
        joints += [fc.Pin(springs[0].end, springs[2].start), fc.Support(springs[2].end, "u v w")]
    across = np.cross(between - np.array(a.position), between - np.array(b.position))
    return fc.Structure([*beams, *springs], joints), ("one 1: translation along", across)


def strut(rng: np.random.Generator, sound: bool) -> tuple[fc.Structure, Said]:
    """A strut between two ball joints, without inertia about its own line."""
    beams, joints = frame(rng)
    a, b = beams[0].end, beams[1].end
    rod = fc.Beam("rod", a, b, STEEL if sound else THIN, elements=1, up=rng.normal(size=3))
    return fc.Structure([*beams, rod], [*joints, fc.Pin(a, rod.start), fc.Pin(b, rod.end)]), _about("rod 1", rod)


def spun(rng: np.random.Generator, sound: bool) -> tuple[fc.Structure, Said]:
    """A rod without inertia about its line, turned about that line by a drive: sound if the motor weighs something."""
    beams, joints = frame(rng)
    foot, line = beams[1].end, rng.normal(size=3)
    line /= np.linalg.norm(line)
    rod = fc.Beam("rod", foot, np.array(foot.position) + line, THIN, elements=1, up=rng.normal(size=3))
    motor = fc.RotaryDrive("motor", rod.start, foot, axis=line, stiffness=1e3, ratio=10.0, inertia=1e-3 * sound)
    return fc.Structure([*beams, rod], [*joints, fc.Hinge(foot, rod.start, axis=line)], [motor]), _about("rod 1", rod)


def hinged(rng: np.random.Generator, sound: bool) -> tuple[fc.Structure, Said]:
    """The same on a hinge alone, nearly along x but not quite."""
    beams, joints = frame(rng)
    foot, line = beams[1].end, np.array([1.0, 10.0 ** rng.uniform(-14, 0), 10.0 ** rng.uniform(-14, 0)])
    line /= np.linalg.norm(line)
    rod = fc.Beam("rod", foot, np.array(foot.position) + line, STEEL if sound else THIN, elements=1)
    return fc.Structure([*beams, rod], [*joints, fc.Hinge(foot, rod.start, axis=line)]), _about("rod 1", rod)


def _about(node: str, rod: fc.Beam) -> Said:
    return f"{node}: rotation about", np.subtract(rod.end.position, rod.start.position)


KINDS = (series, tripod, strut, spun, hinged)


def check(kind, seed: int) -> None:
    broken, (said, line) = kind(np.random.default_rng(seed), False)
    model = fc.assemble(broken, FLEXIBLE)
    with pytest.raises(MechanismError, match=said) as refusal:
        fc.linearize(model)
    if line is not None:
        axis = re.search(said + r" \((.*?)\)", str(refusal.value))[1]
        named = np.array([float(x) for x in axis.split(",")])
        assert abs(named @ line) == pytest.approx(np.linalg.norm(line), rel=5e-3)
    assert len(fc.audit(model).mechanisms) == (2 if kind is series else 1)
    sound, _ = kind(np.random.default_rng(seed), True)
    linear = fc.linearize(fc.assemble(sound, FLEXIBLE))
    assert np.isfinite(linear.modes(4).omega_squared).all()


@pytest.mark.parametrize("kind", KINDS)
def test_a_planted_mechanism_is_refused_by_node_and_direction(kind):
    for seed in range(3):
        check(kind, seed)


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_in_every_one_of_200_random_frames(kind):
    for seed in range(3, 43):
        check(kind, seed)


@pytest.mark.parametrize("line", [(1, 0, 0), (0, 0, 1), (0.6, 0.8, 0), (1, 2, 2), (1, 1e-7, 0), (1, 1e-11, 1e-3)])
def test_a_spin_without_inertia_of_its_own_is_condensed_whatever_its_axis(line):
    """Behind a shaft the motor alone gives it inertia: as a limit of vanishing inertia, and the same turned with y."""
    line = np.array(line, float) / np.linalg.norm(line)

    def poles(section: fc.Section) -> np.ndarray:
        post = fc.Beam("post", (0, 0, 0), (0, 0, 1), STEEL, elements=1)
        rod = fc.Beam("rod", post.end, np.array([0, 0, 1.0]) + line, section, elements=2)
        load = fc.RigidBody("wheel", rod.end, 0.1, (1e-3, 1e-3, 1e-3))
        motor = fc.RotaryDrive("motor", rod.start, post.end, axis=line, stiffness=1e3, ratio=2.0, inertia=1e-3)
        joints = [fc.Support(post.start), fc.Hinge(post.end, rod.start, axis=line), fc.Weld(rod.end, load.node)]
        model = fc.assemble(fc.Structure([post, rod, load], joints, [motor]), FLEXIBLE)
        return fc.linearize(model).modes(8).omega_squared

    massless = poles(THIN)
    errors = [
        np.abs(poles(replace(THIN, rhoJ=light)) / np.where(massless, massless, 1.0) - 1)[1:] for light in (1e-7, 2e-7)
    ]
    assert np.abs(2.0 * errors[0] - errors[1]).max() < 1e-6
    assert errors[0].max() < 1e-3
