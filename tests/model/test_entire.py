"""Kernels of a whole machine: the accelerations, places, forces and energies that its pieces give one by one."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.model.flat.flat import accelerate, arrive, dissipate, drive, energy, load, place, press_entire, pull, push
from flexctrl.model.flat.flattening import Flattened, flatten
from flexctrl.model.laws.kinds import DRIVE_SLOT, NODE_SLOT

sys.path.insert(0, str(Path(__file__).parents[1] / "laws"))
from machines import double_girder, four_bar, machine

pytest.importorskip("llvmlite")

EFFECTS = [fc.Gravity(), fc.LargeRotation(), fc.RayleighDamping(0.1, 0.002)]
MACHINES = {
    "tree": machine(7, 4),
    "four_bar": four_bar(),
    "double_girder": double_girder(),
    "ceiling_crane": fc.cranes.ceiling_crane(),
    "shafts": fc.cranes.flexible_arm(),
}


def cantilever() -> fc.Structure:
    section = fc.Section(EA=1e5, EI_y=30.0, EI_z=20.0, GJ=10.0, rhoA=1.5, rhoJ=0.01)
    bar = fc.Beam("bar", (0, 0, 0), (2.0, 0.3, 0.1), section, elements=2)
    tip = fc.PointMass("tip", bar.end, 2.0)
    held, pinned = fc.Support(bar.start), fc.Pin(bar.end, tip.node)
    return fc.Structure([bar, tip], [held, pinned], inputs=[fc.Force("push", bar.node(1), "y")])


MODAL = {"levers": fc.coarsen(fc.cranes.flexible_arm())}


def moved(model: fc.Model, seed: int = 0) -> tuple[Flattened, fc.State]:
    """A model about to end a step from a place off its rest, with inputs."""
    rng = np.random.default_rng(seed)
    state = model.advance(model.rest, *rng.uniform(-0.2, 0.2, (2, model.n)), 0.0)
    F = flatten(model)
    F.enter(state)
    f = F.flat
    f.step[: f.n], f.v[: f.n] = rng.uniform(-0.05, 0.05, (2, f.n))
    f.u[:] = rng.uniform(-2.0, 2.0, len(f.u))
    load(f)
    return F, state


@cache
def assembled(name: str) -> fc.Model:
    effects = [*EFFECTS, fc.ShaftElasticity()] if name == "shafts" else EFFECTS
    return fc.assemble(MACHINES[name], effects)


@cache
def modal(name: str) -> fc.Model:
    """Machines of beams in a few modes."""
    return bending(MODAL[name])


def bending(structure: fc.Structure) -> fc.Model:
    return fc.assemble(structure, [*EFFECTS, fc.ComponentModes(1), fc.ShaftElasticity()])


def made(name: str) -> fc.Model:
    return assembled(name) if name in MACHINES else modal(name)


@pytest.fixture(params=MACHINES)
def small(request) -> Flattened:
    F, _ = moved(assembled(request.param))
    assert F.flat.quick
    return F


def test_machines_that_bend_have_none():
    assert not flatten(fc.assemble(machine(7, 4), [*EFFECTS, fc.Flexible()])).flat.quick


def test_accelerations_balance_all_forces(small):
    """Inertia, weight, damping, drives and inputs, summed up piece by piece."""
    f = small.flat
    accelerate(f)
    rates = f.answer[: f.n].copy()
    place(f)
    f.rate[: f.n] = 0.0
    drive(f)
    push(f)
    acting = np.abs(f.force[: f.n]).max()
    f.rate[: f.n] = rates
    drive(f)
    push(f)
    assert np.abs(rates).max() > 0.0
    assert np.abs(f.force[: f.n]).max() < 1e-11 * max(1.0, acting)


@pytest.mark.parametrize("name", MODAL)
def test_forces_on_beams_in_modes_are_those_of_the_pieces(name):
    """Nodes need not be placed."""
    f = moved(modal(name))[0].flat
    assert f.pressing
    f.rate[: f.n] = np.random.default_rng(1).uniform(-1.0, 1.0, f.n)
    press_entire(f)
    found = f.force[: f.n].copy()
    place(f)
    drive(f)
    push(f)
    assert np.abs(found).max() > 1.0
    assert np.allclose(found, f.force[: f.n], rtol=0.0, atol=1e-11 * np.abs(found).max())


def test_elements_that_no_node_follows_are_computed_side_by_side():
    assert not flatten(bending(cantilever())).flat.quick


@pytest.mark.parametrize("name", [*MACHINES, *MODAL])
def test_nodes_and_drives_arrive_where_they_are_placed(name):
    small, _ = moved(made(name))
    f = small.flat
    place(f)
    drive(f)
    wanted, found = f.z.copy(), f.found.copy()
    F, _ = moved(small.model)
    arrive(F.flat)
    slots = np.arange(f.drive_base).reshape(-1, NODE_SLOT)[:, :18].ravel()
    shafts = f.drive_base + np.arange((f.drives + f.inner) * DRIVE_SLOT).reshape(-1, DRIVE_SLOT)[:, [0, 1, 3]].ravel()
    for cells in (slots, shafts):
        assert np.allclose(F.flat.z[cells], wanted[cells], rtol=0.0, atol=1e-13 * max(1.0, np.abs(wanted).max()))
    assert np.allclose(F.flat.found, found, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("name", [*MACHINES, *MODAL])
def test_forces_of_inputs_and_energies_are_those_of_the_pieces(name):
    small, _ = moved(made(name))
    f = small.flat
    place(f)
    drive(f)
    f.force[:] = f.books[:] = 0.0
    pull(f)
    energy(f)
    mine = f.force[: f.n].copy(), f.books.copy()
    f.books[2] = 0.0
    dissipate(f)
    assert f.books[2] == pytest.approx(mine[1][2], rel=1e-12)
    state = small.state(f.v, 0.0, small.model.rest.dry)
    model = small.model
    found = model.advance(state, small.own(f.step), small.own(f.v), 0.0)
    loads = model.loads(found, f.u)
    assert np.allclose(small.own(mine[0]), loads, rtol=0.0, atol=1e-12 * max(1.0, np.abs(loads).max()))
    assert np.allclose(mine[1], model.energy(found), rtol=1e-12, atol=1e-12)


def test_turns_of_drives_are_counted():
    """Where a step turns a shaft by more than half a turn too."""
    model = assembled("shafts")
    F, _ = moved(model)
    f = F.flat
    for turned in (0.3, 2.9, -3.3, 6.0):
        f.step[: f.n] = turned
        place(f)
        wanted = f.found.copy()
        f.found[:] = 0.0
        arrive(f)
        assert np.allclose(f.found, wanted, rtol=0.0, atol=1e-12)


def test_a_pose_that_a_machine_cannot_have_by_itself_is_noticed():
    """A girder that only yaws and is told to start tilted."""
    model = assembled("ceiling_crane")
    F = flatten(model)
    F.enter(model.rest)
    assert F.keeps_shape
    F.flat.z[F.entire.cells[0]] += 1e-6
    assert not F.keeps_shape
