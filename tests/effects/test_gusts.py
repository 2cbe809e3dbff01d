"""Gusts: the speed of the wind as an input, against the mean wind, closed forms and the plain steps."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.effects.effect import Effect
from flexctrl.errors import StructureError
from flexctrl.scene.files import scene_from
from flexctrl.scene.reading import Place

sys.path.insert(0, str(Path(__file__).parents[1] / "laws"))
from machines import four_bar

LARGE, MASS, LENGTH, AREA = fc.LargeRotation(), 1000.0, 10.0, 8.0
K = 0.5 * 1.25 * AREA
SKEW = fc.WindSpeed("gust", (0.6, 0.8, 0.0))


def load(*gusts: fc.WindSpeed) -> fc.Structure:
    """A load of 1 t on a rope."""
    mass = fc.PointMass("load", (0, 0, -LENGTH), MASS)
    rope = fc.Rope("rope", (0, 0, 0), mass.node, EA=1e6)
    joints = [fc.Support(rope.start), fc.Pin(rope.end, mass.node)]
    inputs = [*gusts, fc.Force("push", mass.node, "x")]
    return fc.Structure([rope, mass], joints, inputs=inputs, outputs=[fc.Position(c, mass.node, c) for c in "xyz"])


def free(*gusts: fc.WindSpeed) -> fc.Structure:
    mass = fc.PointMass("load", (0, 0, 0), MASS)
    return fc.Structure([mass], [], inputs=gusts, outputs=[fc.Velocity("vx", mass.node, "x")])


def model(
    structure: fc.Structure,
    *more: Effect,
    wind: tuple[float, float, float] = (12.0, 0.0, 0.0),
    backend: fc.Backend | None = None,
) -> fc.Model:
    return fc.assemble(structure, [fc.Gravity(), fc.Wind({"load": AREA}, wind), *more], backend)


ELASTIC, RIGID = (LARGE, fc.RopeStretch()), (LARGE,)


@pytest.mark.parametrize("effects", [ELASTIC, RIGID])
@pytest.mark.parametrize("method", [fc.GeneralizedAlpha(0.01), fc.ExplicitRungeKutta(), fc.ConservingMidpoint(0.01)])
def test_a_steady_gust_is_more_mean_wind(effects, method):
    """Runs under w = 12 m/s with a gust of 5 m/s along (0.6, 0.8, 0), and under their sum."""
    summed = model(load(), *effects, wind=(15.0, 4.0, 0.0))
    gusty = model(load(SKEW), *effects)
    runs = [
        fc.simulate(m, until=1.0, every=0.1, inputs=u, method=method) for m, u in ((summed, {}), (gusty, {"gust": 5}))
    ]
    assert runs[1].y == pytest.approx(runs[0].y, abs=1e-9)
    assert runs[1].report.energy_residual < 2e-4


@pytest.mark.parametrize("effects", [ELASTIC, RIGID])
def test_equilibrium_and_linear_model_are_those_of_the_wind_there_is(effects):
    summed, gusty = model(load(), *effects, wind=(15.0, 4.0, 0.0)), model(load(SKEW), *effects)
    rests = [fc.equilibrium(summed), fc.equilibrium(gusty, inputs={"gust": 5.0})]
    assert rests[1].state.x == pytest.approx(rests[0].state.x, abs=1e-9)
    first, second = (fc.linearize(m, at=r) for m, r in zip((summed, gusty), rests, strict=True))
    for name in "MCK":
        a, b = (getattr(m, name).toarray() for m in (first, second))
        assert np.abs(a - b).max() < 1e-8 * np.abs(a).max()


def test_the_channel_of_a_gust_is_the_aerodynamic_damping():
    """∂F/∂g = k (|w| I + w wᵀ/|w|) e: 2 k w along the wind, k w across it; about still air nothing."""
    three = [fc.WindSpeed(f"gust_{c}", c) for c in "xyz"]
    for speed in (20.0, 0.0):
        found = fc.assemble(free(*three), [LARGE, fc.Wind({"load": AREA}, (speed, 0, 0))])
        reach = found.reach(found.rest, np.zeros(3)).toarray()[:3]
        assert reach == pytest.approx(np.diag([2.0, 1.0, 1.0]) * K * speed, abs=1e-12)
    about = found.reach(found.rest, np.array([0.0, 7.0, 0.0])).toarray()[:3]
    assert about == pytest.approx(np.diag([1.0, 2.0, 1.0]) * K * 7.0)


@pytest.mark.parametrize("effects", [ELASTIC, RIGID, (fc.RopeStretch(), fc.GeometricStiffness())])
def test_small_gusts_act_as_the_linear_model_says(effects):
    """The change of equilibrium over the gust is K⁻¹ B to first order."""
    gusty = model(load(SKEW), *effects)
    rest = fc.equilibrium(gusty)
    linear = fc.linearize(gusty, at=rest)
    expected = linear.Cq @ np.linalg.solve(linear.K.toarray(), linear.B[:, 0])
    errors = []
    for gust in (0.2, 0.1):
        moved = fc.equilibrium(gusty, inputs={"gust": gust})
        change = (gusty.measure(moved.state) - gusty.measure(rest.state)) / gust
        errors.append(np.abs(change - expected).max())
    assert errors[1] < max(0.6 * errors[0], 1e-9)
    assert errors[1] < 0.02 * np.abs(expected).max()


def test_no_gust_is_none():
    """A gust at zero, a gust without wind, and wind without area: the motion without, to round-off."""
    plain, gusty = model(load(), *ELASTIC), model(load(SKEW), *ELASTIC)
    runs = [fc.simulate(m, until=0.5, method=fc.GeneralizedAlpha(0.01)) for m in (plain, gusty)]
    assert np.abs(runs[0].y - runs[1].y).max() < 1e-13
    calm = fc.assemble(load(SKEW), [fc.Gravity(), *ELASTIC])
    assert not calm.gusts
    assert [f.kernels for f in calm.forces.families] == [
        f.kernels for f in fc.assemble(load(), [fc.Gravity(), *ELASTIC]).forces.families
    ]
    for nothing in ([], [fc.Wind({})], [fc.Wind({"load": 0.0})], [fc.Wind({"load": AREA}, density=0.0)]):
        told = [note for note in fc.assemble(load(SKEW), [LARGE, *nothing]).notes if "gust" in note]
        assert len(told) == 1
        assert "input gust does nothing" in told[0]
    assert not any("gust" in note for note in gusty.notes)
    blown = fc.simulate(calm, until=0.5, inputs={"gust": 9.0}, method=fc.GeneralizedAlpha(0.01))
    still = fc.simulate(calm, until=0.5, method=fc.GeneralizedAlpha(0.01))
    assert np.abs(blown.y - still.y).max() == 0.0


@pytest.mark.parametrize("effects", [ELASTIC, RIGID, (fc.RopeStretch(),)])
def test_compiled_marches_and_plain_steps_agree(effects):
    """A gust that changes from sample to sample."""
    gusty = model(load(SKEW), *effects)
    blows = fc.OpenLoop({"gust": lambda t: 6.0 * np.sin(3.0 * t)}, sample_time=0.02)

    def run(backend: fc.Backend) -> fc.Run:
        return fc.simulate(gusty.with_(backend=backend), blows, until=0.4, method=fc.GeneralizedAlpha(0.01))

    marched, plain = run(fc.Compiled()), run(fc.CasadiVM())
    assert np.abs(plain["x"]).max() > 1e-3
    assert marched.y == pytest.approx(plain.y, abs=1e-7)
    assert marched.report.energy.work == pytest.approx(plain.report.energy.work, rel=1e-5)


def test_a_free_load_is_carried_along():
    """m v̇ = k (g − v)²: v = g − g/(1 + k g t/m), in still air with a gust of 10 m/s."""
    gusty = fc.assemble(free(fc.WindSpeed("gust", "x")), [LARGE, fc.Wind({"load": AREA})])
    run = fc.simulate(gusty, until=20.0, inputs={"gust": 10.0}, method=fc.GeneralizedAlpha(0.01, rho=1.0), every=1.0)
    assert run["vx"] == pytest.approx(10.0 - 10.0 / (1.0 + K * 10.0 * run.t / MASS), abs=1e-5)


def test_a_scene_has_gusts_that_move():
    text = """
    [elements]
    load = { kind = "point_mass", at = [0, 0, 0], mass = 1000.0 }
    [inputs]
    gust = { kind = "wind_speed", direction = "x" }
    [outputs]
    vx = { kind = "velocity", at = "load", direction = "x" }
    [effects]
    large_rotation = true
    wind = { areas = { load = 8.0 } }
    [loads]
    gust = { kind = "ramp", slope = 5.0, duration = 2.0 }
    [simulation]
    until = 4.0
    """
    scene = scene_from(tomllib.loads(text), Place("gust.toml"), "gust")
    run = scene.run()
    assert run["gust"][-1] == pytest.approx(10.0)
    assert 0.0 < run["vx"][-1] < 10.0


def crab(*gusts: fc.WindSpeed) -> tuple[fc.Structure, dict[str, float]]:
    """A trolley on a girder that bends, a load of 1 t hung from it."""
    section = fc.Section(EA=2e9, EI_y=3e7, EI_z=2e7, GJ=2e7, rhoA=80.0, rhoJ=2.0)
    girder = fc.Beam("girder", (0, -5, 0), (0, 5, 0), section, elements=2)
    trolley = fc.Trolley("crab", girder, at=4.0, mass=200.0)
    mass = fc.PointMass("load", (0, -1, -6), MASS)
    rope = fc.Rope("rope", trolley.node, mass.node, EA=1e7)
    joints = [fc.Support(girder.start), fc.Support(girder.end), fc.Pin(trolley.node, rope.start)]
    outputs = [*(fc.Position(c, mass.node, c) for c in "xyz"), fc.Position("rolled", trolley.travel, "x")]
    parts = [girder, trolley, rope, mass]
    machine = fc.Structure(parts, [*joints, fc.Pin(rope.end, mass.node)], inputs=gusts, outputs=outputs)
    return machine, {"load": AREA, "crab": 2.0, "girder": 5.0}


def loop(*gusts: fc.WindSpeed) -> tuple[fc.Structure, dict[str, float]]:
    """A crank, a coupler and a rocker: a rigid loop."""
    machine = four_bar()
    return machine.with_(inputs=gusts), {"load": 0.02, "coupler": 0.1}


@pytest.mark.parametrize("machine", [crab, loop])
@pytest.mark.parametrize("method", [fc.GeneralizedAlpha(5e-3), fc.ConservingMidpoint(5e-3)])
def test_gusts_on_trolleys_and_loops(machine, method):
    """A steady gust is more mean wind on nodes that others place, for steps in momenta too."""
    gust = fc.WindSpeed("gust", (0.6, 0.8, 0.0))
    effects = [fc.Gravity(), LARGE, *([fc.Flexible()] if machine is crab else [])]
    runs = []
    for gusts, wind in (((), (12.0, 3.0, 0.0)), ((gust,), (9.0, -1.0, 0.0))):
        structure, areas = machine(*gusts)
        found = fc.assemble(structure, [*effects, fc.Wind(areas, wind)])
        runs.append(fc.simulate(found, until=0.3, every=0.05, inputs={"gust": 5.0} if gusts else {}, method=method))
    still = fc.simulate(found, until=0.3, every=0.05, method=method)
    assert np.abs(still.y - runs[0].y).max() > 1e-5
    assert runs[1].y == pytest.approx(runs[0].y, abs=1e-8)


def test_gusts_across_a_turning_frame_are_refused():
    frame = fc.RotatingFrame((0, 0, 1.0))
    with pytest.raises(StructureError, match=r"WindSpeed 'gust'.*along the axis"):
        fc.assemble(free(SKEW), [LARGE, fc.Wind({"load": AREA}), frame])
    fc.assemble(free(fc.WindSpeed("gust", "z")), [LARGE, fc.Wind({"load": AREA}), frame])
