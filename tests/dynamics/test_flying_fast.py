"""Who flies along with a machine sees it move as one that stands, and who falls with it, as one without weight."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

L, SPIN = 2.0, 3.0
AXIS = np.array([1.0, 2.0, 2.0]) / 3.0
TURNING = np.cross(AXIS, [0.0, 0.0, 1.0]) / np.linalg.norm(np.cross(AXIS, [0.0, 0.0, 1.0]))
MESHES = {"2 elements": (2, []), "5 elements": (5, []), "one with modes": (1, [fc.ComponentModes(2, along=1)])}


def thrown(elements: int, modes: list, speed: np.ndarray, shaken: float, weight: bool) -> np.ndarray:
    """Where the nodes of a free beam are from its first one, spun about an axis across it; shape (rows, nodes, 3)."""
    section = fc.Section(EA=1e6, EI_y=500.0, EI_z=300.0, GJ=400.0, rhoA=1.0, rhoJ=1e-3)
    beam = fc.Beam("beam", tuple(-0.5 * L * AXIS), tuple(0.5 * L * AXIS), section, elements=elements)
    nodes = [beam.node(i) for i in range(elements + 1)]
    outputs = [fc.Position(f"p{i}{k}", node, k) for i, node in enumerate(nodes) for k in "xyz"]
    gravity = [fc.Gravity()] if weight else []
    structure = fc.Structure([beam], [], outputs=outputs)
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Flexible(), *modes, *gravity])
    v, rng = np.zeros(model.n), np.random.default_rng(1)
    for i, node in enumerate(nodes):
        turn = SPIN * TURNING
        v[6 * i : 6 * i + 6] = [*(speed + np.cross(turn, node.position)), *turn] + shaken * rng.normal(size=6)
    method = fc.Unchecked(fc.GeneralizedAlpha(1e-3))
    run = fc.simulate(model, until=1.0, every=0.1, start=model.rest.with_(v=v), method=method)
    assert run.status is fc.Status.FINISHED
    places = run.y.reshape(len(run.t), elements + 1, 3)
    return places - places[:, :1]


@pytest.mark.parametrize("mesh", MESHES)
def test_who_flies_along_sees_the_same(mesh):
    """Galilei: 0.5 rad behind in 4 s at 300 m/s where inertia is taken on the chord, and bent by a centimetre."""
    standing, flying = (thrown(*MESHES[mesh], v * np.array([0.6, 0.0, 0.8]), 0.3, False) for v in (0.0, 200.0))
    assert np.abs(flying - standing).max() < 1e-7


@pytest.mark.parametrize("mesh", MESHES)
def test_who_falls_along_sees_no_weight(mesh):
    light, falling = (thrown(*MESHES[mesh], np.zeros(3), 0.3, weight) for weight in (False, True))
    assert np.abs(falling - light).max() < 1e-7


def test_a_beam_spun_and_thrown_spins_on():
    """It stretches by 4e-6 and turns at its rate, but for what the steps leave."""
    run = thrown(4, [], np.array([20.0, -10.0, 80.0]), 0.0, True)
    angle = SPIN * 0.1 * np.arange(len(run))
    across = np.cross(TURNING, AXIS)
    expected = L * (np.outer(np.cos(angle), AXIS) + np.outer(np.sin(angle), across))
    assert np.abs(run[:, -1] - expected).max() < 1e-4
