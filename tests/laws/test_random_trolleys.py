"""Trolleys on the beams of random structures: power is accounted for, slopes are the linear limit, backends agree."""

from __future__ import annotations

import numpy as np
import pytest
from random_structures import whole

import flexctrl as fc
from flexctrl.model.flows import flowing

SEEDS = [pytest.param(seed, marks=pytest.mark.slow) if seed > 2 else seed for seed in range(36)]


def ridden(seed: int) -> fc.Model:
    """A random structure with a trolley on its longest beam, rigid or not, and a mass that hangs from it."""
    case, rng = whole(seed), np.random.default_rng(seed)
    beams = [p for p in case.structure.elements if isinstance(p, fc.Beam)]
    if not beams:
        pytest.skip("no beam to ride on")
    beam = max(beams, key=lambda b: b.length)
    trolley = fc.Trolley("trolley", beam, at=rng.uniform(0.2, 0.8) * beam.length, mass=rng.uniform(0.5, 2.0))
    load = fc.PointMass("hung", np.add(trolley.node.position, rng.normal(size=3)), rng.uniform(0.5, 2.0))
    line = fc.Spring("line", trolley.node, load.node, stiffness=30.0, damping=0.2)
    drive = fc.LinearDrive("wheels", trolley.travel, direction="x", radius=0.2, stiffness=8.0, inertia=0.1, damping=0.3)
    pins = [fc.Pin(trolley.node, line.start), fc.Pin(line.end, load.node)]
    machine = case.structure.with_(
        elements=[*case.structure.elements, trolley, load, line],
        joints=[*case.structure.joints, *pins],
        drives=[*case.structure.drives, drive],
    )
    effects = [fc.BeamFlexibility() if isinstance(e, fc.ComponentModes) else e for e in case.effects]
    return fc.assemble(machine, effects, fc.CasadiVM())


def somewhere(model: fc.Model, seed: int) -> tuple[fc.State, np.ndarray, np.ndarray]:
    """A state off the drawn one, with rates and accelerations; the trolley about where it was drawn."""
    step, v, a = np.random.default_rng(seed).normal(size=(3, model.n))
    state = model.displace(0.05 * step).with_(v=v)
    state = flowing(model, state, np.zeros(len(model.inputs)))
    return state, state.v, a


@pytest.mark.parametrize("seed", SEEDS)
def test_laws(seed):
    model = ridden(seed)
    if any("left free to second order" in note for note in model.notes):
        pytest.skip("rigid parts with play of second order, as the model says")
    state, v, a = somewhere(model, seed)

    def energy(h: float) -> float:
        moved = model.advance(state, h * v + 0.5 * h * h * a, v + h * a, h)
        return sum(model.energy(moved)[:2])

    h = 1e-5
    change = (8.0 * (energy(h) - energy(-h)) - energy(2 * h) + energy(-2 * h)) / (12.0 * h)
    lost, work = model.energy(state)[2], float(model.balance(state, v, a) @ v)
    assert abs(change + lost + work) < 1e-5 * (1.0 + abs(change) + abs(lost) + abs(work))

    u, h = np.zeros(len(model.inputs)), 1e-6
    dq, dv, da = np.random.default_rng(seed + 1).normal(size=(3, model.n))
    slopes = zip(((1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0)), (dq, dv, da), strict=True)
    first = sum(model.slope(state, v, a, seeds, u) @ d for seeds, d in slopes)
    ahead, behind = (model.balance(model.advance(state, s * dq, v, 0.0), v + s * dv, a + s * da) for s in (h, -h))
    assert np.abs((ahead - behind) / (2 * h) - first).max() < 1e-5 * (1.0 + np.abs(first).max())


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 8])
def test_marches_are_plain_steps(seed):
    """The same run by the casadi machine and in compiled loops."""
    pytest.importorskip("llvmlite")
    model = ridden(seed)
    method, accurate = fc.GeneralizedAlpha(2e-3), fc.Tolerance(1e-7, 1e-10)
    runs = [
        fc.simulate(m, until=0.05, method=method, tolerance=accurate)
        for m in (model, model.with_(backend=fc.Compiled()))
    ]
    assert runs[0].status is runs[1].status
    assert np.abs(runs[0].final.x - runs[1].final.x).max() < 1e-8
