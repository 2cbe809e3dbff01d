"""Tangles: parts between five places, tied at random wherever their nodes meet, loops and all."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise

import numpy as np
import pytest
from machines import SECTION
from scipy.spatial.transform import Rotation

import flexctrl as fc
from flexctrl.errors import StructureError

PLACES = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 1.0, 0.5), (0.0, 0.0, 1.0))
AXES = ("x", "y", "z", "-y", (1, 1, 0), (1, 2, 3))
HELD = ("u", "u v w", "all", "w rx", "v w rx ry rz")
EFFECTS = {
    "flexible": [fc.Gravity((1.0, -2.0, -9.0)), fc.LargeRotation(), fc.Flexible()],
    "beams": [fc.Gravity((1.0, -2.0, -9.0)), fc.LargeRotation(), fc.BeamFlexibility()],
    "rigid": [fc.Gravity((1.0, -2.0, -9.0)), fc.LargeRotation()],
}


def part(kind: str, name: str, a, b, rng) -> tuple[object, list[fc.Node]]:
    """A part from place to place, and its nodes there."""
    if kind == "beam":
        beam = fc.Beam(name, a, b, SECTION, int(rng.integers(1, 3)), up=rng.normal(size=3))
        return beam, [beam.start, beam.end]
    if kind == "body":
        body = fc.RigidBody(name, a, 1.0, (1, 1, 1), {"here": a, "there": b})
        return body, [body.point("here"), body.point("there")]
    line = fc.Rope(name, a, b, EA=100.0) if kind == "rope" else fc.Spring(name, a, b, stiffness=10.0)
    return line, [line.start, line.end]


def tie(rng, a: fc.Node, b: fc.Node, drives: list) -> object:
    """Some joint of two nodes that meet, now and then with its motor."""
    kind, axis = rng.choice(["weld", "pin", "hinge", "slide"]), AXES[rng.integers(len(AXES))]
    if kind == "pin" or min(len(a.freedoms), len(b.freedoms)) < 6:
        return fc.Pin(a, b)
    if kind == "weld":
        return fc.Weld(a, b)
    motor = {"stiffness": 5.0, "ratio": 2.0, "inertia": 0.1}
    name = f"drive{len(drives)}"
    if rng.random() < 0.5:
        made = fc.RotaryDrive(name, b, a, axis=axis, **motor)
        drives.append(made if kind == "hinge" else fc.LinearDrive(name, b, a, direction=axis, radius=0.5, **motor))
    return fc.Hinge(a, b, axis) if kind == "hinge" else fc.Slide(a, b, axis)


def tangle(seed: int) -> fc.Structure:
    rng = np.random.default_rng(seed)
    elements, joints, drives, met = [], [], [], defaultdict(list)
    for i in range(rng.integers(2, 6)):
        known = [p for p in range(len(PLACES)) if met[p]] or [0]
        a = int(rng.choice(known))
        b = int(rng.choice([p for p in range(len(PLACES)) if p != a]))
        a, b = (a, b) if rng.random() < 0.5 else (b, a)
        made, ends = part(rng.choice(["beam", "beam", "body", "rope", "spring"]), f"part{i}", PLACES[a], PLACES[b], rng)
        elements.append(made)
        met[a].append(ends[0])
        met[b].append(ends[1])
    for place, nodes in met.items():
        if nodes:
            load = fc.PointMass(f"mass{place}", PLACES[place], 0.5)
            elements.append(load)
            nodes.append(load.node)
        joints += [tie(rng, x, y, drives) for x, y in pairwise(nodes)]
        full = [n for n in nodes if len(n.freedoms) == 6 and rng.random() < 0.2]
        joints += [fc.Support(n, HELD[rng.integers(len(HELD))]) for n in full]
    return fc.Structure(elements, joints, drives)


def whole(seed: int) -> fc.Structure:
    """The next seed from here on whose drives are not held by supports."""
    while True:
        try:
            return tangle(seed)
        except StructureError:
            seed += 1000


CASES = [(kind, seed) for kind in EFFECTS for seed in range(8)]
CASES += [pytest.param((kind, seed), marks=pytest.mark.slow) for kind in EFFECTS for seed in range(8, 80)]


@pytest.fixture(scope="module", params=CASES, ids=lambda c: f"{c[0]}-{c[1]}")
def model(request):
    kind, seed = request.param
    return fc.assemble(whole(seed), EFFECTS[kind], fc.CasadiVM())


@pytest.fixture(scope="module")
def state(model):
    return model.displace(0.05 * np.random.default_rng(0).normal(size=model.n))


def close(found, expected, tolerance=1e-5):
    found, expected = np.asarray(found), np.asarray(expected)
    assert np.abs(found - expected).max(initial=0.0) < tolerance * (1.0 + np.abs(expected).max(initial=0.0))


def quotient(f, n: int, h: float = 1e-6) -> np.ndarray:
    still = f(np.zeros(n))
    return np.array([(f(h * e) - f(-h * e)) / (2 * h) for e in np.eye(n)]).reshape(n, still.size).T


def test_joints_hold_and_loops_stay_closed(model, state):
    """Pinned nodes meet, wherever the machine went, unless it says that it leaves them some play."""
    motion = model.motion
    assert np.abs(motion.linkage.gaps(motion.pose(state))).max(initial=0.0) < 1e-10
    if any("left free to second order" in note for note in model.notes):
        assert motion.closure_error(state) > 1e-7  # what opens to second order has done so
        return
    assert motion.closure_error(state) < 1e-10
    number = model.structure.number
    for joint in model.structure.joints:
        if isinstance(joint, fc.Pin | fc.Weld | fc.Hinge):
            a, b = (number(n) for n in joint.nodes)
            close(state.x[a], state.x[b], 1e-10)
        if isinstance(joint, fc.Weld) and min(len(n.freedoms) for n in joint.nodes) == 6:
            close(state.R[a], state.R[b], 1e-9)
        if isinstance(joint, fc.Hinge):
            axis = np.array(joint.axis)
            close(state.R[a] @ axis, state.R[b] @ axis, 1e-9)
        if isinstance(joint, fc.Slide):
            a, b = (number(n) for n in joint.nodes)
            off = state.R[a].T @ (state.x[b] - state.x[a])
            close(np.cross(off, joint.along), np.zeros(3), 1e-9)


def test_motion_is_the_slope_of_the_places(model, state):
    def places(d):
        moved = model.advance(state, d, state.v, 0.0)
        turn = Rotation.from_matrix(moved.R @ np.swapaxes(state.R, 1, 2)).as_rotvec()
        return np.hstack([moved.x, turn]).ravel()

    nodes = 6 * len(state.x)
    close(model.motion.jacobian(state).toarray()[:nodes], quotient(places, model.n))


def test_stiffness_is_the_slope_of_the_balance(model, state):
    still = np.zeros(model.n)
    K = model.slope(state, still, still, (1.0, 0.0, 0.0), np.zeros(0)).toarray()
    close(K, quotient(lambda d: model.balance(model.advance(state, d, still, 0.0), still, still), model.n))


def test_mass_is_symmetric_and_the_assembled_one_at_rest(model, state):
    still = np.zeros(model.n)
    M = -model.slope(state, still, still, (0.0, 0.0, 1.0), np.zeros(0)).toarray()
    close(M, M.T, 1e-12)
    assert np.linalg.eigvalsh(M).min(initial=0.0) > -1e-10
    at_rest = -model.slope(model.rest, still, still, (0.0, 0.0, 1.0), np.zeros(0)).toarray()
    close(at_rest, model.mass().toarray(), 1e-10)
