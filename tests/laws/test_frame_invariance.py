"""A machine that floats does not know which way it faces: turn it with its gravity, nothing changes in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from machines import machine
from scipy.spatial.transform import Rotation

import flexctrl as fc

G = np.array([1.0, -2.0, -9.0])


def model(seed: int, g: np.ndarray, flexible: bool) -> fc.Model:
    effects = [fc.Gravity(g), fc.LargeRotation(), fc.RayleighDamping(0.1, 0.02), *([fc.Flexible()] * flexible)]
    return fc.assemble(machine(seed, 5, supported=False), effects, fc.CasadiVM())


def turning(model: fc.Model, Q: np.ndarray) -> np.ndarray:
    """How rates of the freedoms turn: displacements and spins of a node by Q, those about body axes not at all."""
    place = model.motion.place[:-1]
    turn = np.eye(model.n)
    for node in place:
        for cells in (node[:3], node[3:]):
            if (cells < model.n).all():
                turn[np.ix_(cells, cells)] = Q
    return turn


@pytest.mark.parametrize(("seed", "flexible"), [(0, True), (4, True), (9, True), (5, False), (9, False), (11, False)])
def test_energies_and_forces_turn_with_the_machine(seed, flexible):
    Q = Rotation.from_rotvec([0.7, -1.2, 1.9]).as_matrix()
    here, there = model(seed, G, flexible), model(seed, Q @ G, flexible)
    rng = np.random.default_rng(seed)
    v, a = rng.normal(size=(2, here.n))
    state = here.displace(0.3 * rng.normal(size=here.n)).with_(v=v)
    turn = turning(here, Q)
    x, R = state.x.copy(), state.R.copy()
    x[:-1], R[:-1] = x[:-1] @ Q.T, Q @ R[:-1]
    turned = replace(state, x=x, R=R, v=turn @ v)
    assert np.allclose(here.energy(state), there.energy(turned), rtol=1e-11, atol=1e-11)
    force = here.balance(state, v, a)
    found = there.balance(turned, turn @ v, turn @ a)
    assert np.allclose(found, turn @ force, rtol=0, atol=1e-11 * (1.0 + np.abs(force).max()))
