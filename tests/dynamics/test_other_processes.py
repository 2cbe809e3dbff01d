"""Models, linear models and runs go to other processes and come back; copies give the same bits."""

from __future__ import annotations

import copy
import gc
import multiprocessing
import pickle
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import StructureError

EFFECTS = {
    "bending": [fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.ModalDamping(0.02)],
    "rigid": [fc.Gravity(), fc.LargeRotation()],
    "small": [fc.Gravity(), fc.Flexible()],
    "about a rest": [fc.Gravity(), fc.Flexible(), fc.GeometricStiffness()],
    "lagging": [fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.MotorLag({"belt": 0.01})],
}
WAYS = {"pickled": lambda value: pickle.loads(pickle.dumps(value)), "deep": copy.deepcopy, "shallow": copy.copy}


def _gantry():
    bridge = fc.PointMass("bridge", (0, 0, 0), 8.0)
    ram = fc.Beam("ram", (0, 0, 0), (0, 0, -0.5), fc.Section.tube(fc.STEEL, 0.01, 0.001), elements=2)
    load = fc.PointMass("load", ram.end, 1.0)
    belt = fc.LinearDrive(
        "belt", bridge.node, direction="x", radius=0.02, ratio=3.0, stiffness=1.5, inertia=5e-5, damping=3e-4
    )
    joints = [
        fc.Support(bridge.node, "v w"),
        fc.Pin(bridge.node, ram.start),
        fc.Support(ram.start, "rx ry rz"),
        fc.Pin(ram.end, load.node),
    ]
    outputs = [fc.DriveAngle("angle", belt), fc.Position("x", load.node, "x")]
    return fc.Structure([bridge, ram, load], joints, [belt], [fc.MotorTorque("torque", belt)], outputs)


def _chain(links):
    """Rigid links, each pinned to the one before: enough of them are worked off lever by lever."""
    parts = [fc.RigidBody(f"link{i}", (i + 0.5, 0, 0), 1.0, (0.1, 0.1, 0.1), _ends(i)) for i in range(links)]
    pins = [fc.Pin(a.point("end"), b.point("start")) for a, b in pairwise(parts)]
    first, last = parts[0].point("start"), parts[-1].point("end")
    return fc.Structure(parts, [fc.Support(first, "u v w"), *pins], outputs=[fc.Position("x", last, "z")])


def _ends(i):
    return {"start": (float(i), 0, 0), "end": (i + 1.0, 0, 0)}


def _same(a, b):
    mine, others = ((run.t, run.y, run.u, run.final.x, run.final.v, run.frames[-1].q) for run in (a, b))
    return all(map(np.array_equal, mine, others))


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
@pytest.mark.parametrize("effects", EFFECTS.values(), ids=EFFECTS)
def test_a_copy_of_a_model_gives_the_same_bits(effects, way):
    model = fc.assemble(_gantry(), effects)
    push = {"torque": 0.01}
    run = fc.simulate(model, until=0.2, inputs=push)
    linear = fc.linearize(model)
    linear.modes()
    other = way(model)
    assert other.coordinates == model.coordinates
    assert _same(run, way(run))
    assert _same(run, fc.simulate(other, until=0.2, inputs=push))
    on = [fc.simulate(m, until=0.3, start=r.checkpoint) for m, r in ((model, run), (other, way(run)))]
    assert _same(*on)
    assert np.array_equal(way(linear).to_ss().A, linear.to_ss().A)
    assert np.array_equal(fc.linearize(other, way(fc.equilibrium(model))).K.toarray(), linear.K.toarray())


def test_a_copy_of_many_links_gives_the_same_bits():
    model = fc.assemble(_chain(20), [fc.Gravity(), fc.LargeRotation()])
    run = fc.simulate(model, until=0.05)
    assert _same(run, fc.simulate(WAYS["pickled"](model), until=0.05))
    assert _same(run, WAYS["pickled"](run))


def test_a_run_that_was_pickled_says_what_did_not_come_along():
    run = fc.simulate(fc.assemble(_gantry(), EFFECTS["bending"]), until=0.1)
    assert copy.deepcopy(run).at(0.05)["x"] == run.at(0.05)["x"]
    sent = WAYS["pickled"](WAYS["pickled"](run))
    with pytest.raises(StructureError, match=r"has its rows, not its steps; ask it where it was made, or give every"):
        sent.at(0.05)


def test_copies_leave_nothing_that_cannot_be_cleared_away(recwarn, capfd):
    run = fc.simulate(model := fc.assemble(_gantry(), EFFECTS["bending"]), until=0.05)
    copies = [copy.deepcopy(value) for value in (run, model, fc.linearize(model))]
    del copies
    gc.collect()
    assert not recwarn.list
    assert not capfd.readouterr().err


def _dropped(mass):
    spring = fc.Spring("spring", (0, 0, 0), (0, 0, -1), stiffness=100.0)
    load = fc.PointMass("load", spring.end, mass)
    joints = [fc.Support(spring.start), fc.Pin(spring.end, load.node), fc.Support(load.node, "u v")]
    machine = fc.Structure([spring, load], joints, outputs=[fc.Position("z", load.node, "z")])
    model = fc.assemble(machine, [fc.Gravity(), fc.LargeRotation()])
    return model, fc.simulate(model, until=1.0, tolerance=fc.Tolerance(1e-7, 1e-10))


def test_a_sweep_over_processes_returns_runs():
    masses = [1.0, 2.0]
    with ProcessPoolExecutor(2, multiprocessing.get_context("fork")) as pool:
        found = list(pool.map(_dropped, masses))
    for mass, (model, run) in zip(masses, found, strict=True):
        z = -1.0 - 9.81 * mass / 100.0 * (1.0 - np.cos(np.sqrt(100.0 / mass) * run.t))
        assert run["z"] == pytest.approx(z, abs=1e-4)
        assert run.status is fc.Status.FINISHED
        on = fc.simulate(model, until=1.1, start=run.checkpoint, tolerance=fc.Tolerance(1e-7, 1e-10))
        assert run.checkpoint.point.state.t < on.t[0] < 1.01
