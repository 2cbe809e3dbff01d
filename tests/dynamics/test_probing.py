"""Tangents from differences of the forces, in groups of columns, against the assembled ones with turning levers."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.alpha.point import Coefficients
from flexctrl.dynamics.march.making import Method
from flexctrl.dynamics.march.marching import Marcher
from flexctrl.dynamics.march.probing import probe
from flexctrl.dynamics.scales import turning, yardsticks

pytest.importorskip("llvmlite")


def marcher(model: fc.Model) -> Marcher:
    return Marcher(model, Method(Coefficients.of(0.8), 1e-10, 1.0 / yardsticks(model), turning(model)))


@pytest.mark.parametrize(
    ("structure", "effects", "whole"),
    [
        (fc.cranes.flexible_arm(), [fc.Flexible(), fc.RayleighDamping(0.0, 1e-3)], 0),
        (fc.cranes.flexible_arm(), [], 0),
        (fc.cranes.ceiling_crane(), [], 0),
        (fc.coarsen(fc.cranes.flexible_arm()), [fc.ComponentModes(1), fc.ShaftElasticity()], 0),
        (fc.coarsen(fc.cranes.flexible_arm()), [fc.ComponentModes(1), fc.ShaftElasticity()], 1),
    ],
)
@pytest.mark.parametrize(
    ("seeds", "least"), [((1.0, 2e2, 4e4), 1.0), ((0.0, 0.0, 1.0), 1.0), ((1.0, 2e8, 4e16), 1e-12)]
)
def test_probed_tangents_are_the_assembled_ones(structure, effects, whole, seeds, least):
    model = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), *effects])
    found, rng = marcher(model), np.random.default_rng(1)
    F, m = found.flattened, found.march
    assert m.whole >= whole
    state = model.advance(model.rest, 1e-2 * rng.standard_normal(model.n) * yardsticks(model), np.zeros(model.n), 0.0)
    v, a = (scale * rng.standard_normal(model.n) * yardsticks(model) for scale in (0.2, 1.0))
    u = rng.uniform(0.5, 1.0, len(model.inputs))
    F.enter(state.with_(v=v))
    found.supply(u)
    found.open(state.q, np.zeros(model.n), False)
    F.flat.v[:], F.flat.rate[:] = F.ordered(v), F.ordered(a)
    probe(m.probes, F.flat, m.corners, whole, *seeds, least, m.entries)
    wanted = model.slope(state.with_(v=v), v, a, seeds, u).toarray()
    rows, columns = (cells.ravel() for cells in np.indices(wanted.shape))
    inside = np.zeros(wanted.shape, dtype=bool)
    inside[F.pattern] = True
    rows, columns = np.nonzero(inside)
    got = m.entries[F.plan.places(rows, columns)]
    scale = np.sqrt(np.outer(*(np.abs(wanted).max(axis=k) for k in (1, 0))))[rows, columns]
    assert not wanted[~inside].any()
    assert np.all(np.abs(got - wanted[rows, columns]) <= 1e-4 * scale + 1e-12 * np.abs(wanted).max())
    assert m.probes.groups <= model.n


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("flank", [-0.01, 0.01])
def test_probes_do_not_reach_over_a_corner(flank, side):
    """A hair beside a flank of its play, a trolley's drive pulls as on that side of it."""
    rail = fc.Beam("rail", (0, 0, 0), (4, 0, 0), fc.Section.tube(fc.STEEL, 0.03, 0.002))
    trolley = fc.Trolley("trolley", rail, at=2.0, mass=5.0)
    drive = fc.LinearDrive("wheels", trolley.travel, direction="x", radius=0.2, stiffness=400.0, inertia=0.1)
    machine = fc.Structure([rail, trolley], [fc.Support(rail.start), fc.Support(rail.end)], [drive])
    model = fc.assemble(machine, [fc.LargeRotation(), fc.ShaftElasticity(), fc.Backlash({"wheels": 0.02})])
    found, seeds = marcher(model), (1.0, 2e2, 4e4)
    state = model.displace({"wheels_source": flank + side * 1e-11})
    assert found.march.probes.groups > 1
    wanted = model.slope(state, state.v, np.zeros(model.n), seeds, np.zeros(0)).toarray()
    F, m = found.flattened, found.march
    F.enter(state)
    found.open(state.q, np.zeros(model.n), False)
    probe(m.probes, F.flat, m.corners, 0, *seeds, 1.0, m.entries)
    rows, columns = np.nonzero(wanted)
    got = m.entries[F.plan.places(rows, columns)]
    assert np.allclose(got, wanted[rows, columns], rtol=1e-6)
    assert (wanted[0, 1] != 0.0) == (flank * side > 0.0)


@pytest.mark.parametrize("inertia", [0.0, 1e-6])
def test_steps_of_whole_turns_are_the_same_about_any_axis(inertia):
    """A wheel on a hinge and its geared motor turn evenly, 1000 times in 27 steps, about z and about a tilted axis."""
    runs = [turned_evenly(axis, inertia) for axis in ((0.0, 0.0, 1.0), (-0.61, 0.12, 0.783))]
    for run in runs:
        assert run.status is fc.Status.FINISHED
        assert run.report.rejected_steps == 0
        assert run["angle"][-1] == pytest.approx(63.0 * 100.0, abs=1e-8)
        assert run["motor"][-1] == pytest.approx(63.0 * 1e5, abs=1e-5)
    assert runs[0].report.steps == runs[1].report.steps


def turned_evenly(axis: tuple[float, float, float], inertia: float) -> fc.Run:
    wheel, base = (fc.RigidBody(name, (0, 0, 0), 1.0, (1.0, 1.0, 1.0)) for name in ("wheel", "base"))
    (hub,), (foot,) = wheel.nodes, base.nodes
    drive = fc.RotaryDrive("motor", hub, foot, axis=axis, stiffness=1e6, ratio=1e3, inertia=inertia)
    outputs = [fc.Rotation("angle", hub, axis, minus=foot), fc.DriveAngle("motor", drive)]
    joints = [fc.Support(foot), fc.Hinge(foot, hub, axis=axis)]
    structure = fc.Structure([wheel, base], joints, drives=[drive], outputs=outputs)
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Flexible()])
    v = np.array([63e3 if name == "motor_source" else 63.0 for name in model.coordinates])
    return fc.simulate(model, until=100.0, start=model.rest.with_(v=v))
