"""How far two answers are apart: what is real counts, what rounding leaves does not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import block_diag

import flexctrl as fc
from flexctrl.study.answers import Curves, _growing, _moving, answer_of, outputs_apart

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def sideways(push: float, *, linear: bool = False) -> fc.Run:
    """A frame in the plane of y and z under a load in it, and a push out of it: displacement, rate, angle, tension."""
    section = fc.Section.box(fc.STEEL, width=0.2, height=0.3, web=0.005, flange=0.008)
    beam = fc.Beam("beam", (0, -2, 0), (0, 2, 0), section, elements=2)
    rope = fc.Rope("rope", beam.nodes[1], (0, 0, -2), EA=1e6)
    load = fc.PointMass("load", rope.end, 80.0)
    outputs = [
        fc.Position("z", beam.nodes[1], "z"),
        fc.Position("x", beam.nodes[1], "x"),
        fc.Velocity("rate", beam.nodes[1], "x"),
        fc.Rotation("tilt", beam.nodes[1], "z"),
        fc.SwayAngle("sway", beam.nodes[1], load.node, "x"),
        fc.Tension("pull", rope),
    ]
    structure = fc.Structure(
        [beam, rope, load],
        [fc.Support(beam.start), fc.Support(beam.end), fc.Pin(beam.nodes[1], rope.start), fc.Pin(rope.end, load.node)],
        inputs=[fc.Force("f", beam.nodes[1], "z"), fc.Force("p", beam.nodes[1], "x")],
        outputs=outputs,
    )
    way = fc.GeometricStiffness() if linear else fc.LargeRotation()
    model = fc.assemble(structure, [fc.Gravity(), fc.Flexible(), way, fc.RayleighDamping(0.1, 1e-4)])
    method = fc.Exact(0.005) if linear else fc.GeneralizedAlpha(1e-3)
    rest = fc.equilibrium(model)
    return fc.simulate(model, until=0.1, start=rest, inputs={"f": -300.0, "p": push}, method=method, every=0.005)


def test_what_symmetry_makes_zero_is_no_change_whatever_rounding_leaves_of_it():
    full, linear = sideways(0.0), sideways(0.0, linear=True)
    apart = outputs_apart(full, linear)
    for name in ("x", "rate", "tilt", "sway"):
        assert np.abs(full[name]).max() < 1e-12
        assert apart[name] == 0.0
        disturbed = replace(linear, y=linear.y + 1e-16)
        assert outputs_apart(disturbed, full)[name] == 0.0  # whichever of both is not quite zero
    assert 0.0 < apart["z"] < 0.1


def test_what_is_small_but_real_counts():
    """A millionth of the other load: a thousandth of a micrometre, and its loss is all of it."""
    pushed, not_pushed = sideways(3e-3), sideways(0.0)
    assert np.abs(pushed["x"]).max() < 1e-8
    apart = outputs_apart(pushed, not_pushed)
    assert apart["x"] == apart["rate"] == apart["sway"] == pytest.approx(1.0, rel=1e-3)
    assert outputs_apart(not_pushed, pushed)["x"] > 1.0


def test_rounding_is_measured_by_the_machine():
    """Of places by its size, of angles by a radian, of pulls by what stretches it by its size."""
    noise = dict(zip(("z", "x", "rate", "tilt", "sway", "pull"), Curves.of(sideways(0.0)).noise, strict=True))
    size = 4.0
    assert noise["x"] == noise["z"] == pytest.approx(1e-12 * size)
    assert noise["rate"] == pytest.approx(1e-12 * size / 1e-3, rel=0.02)
    assert noise["tilt"] == pytest.approx(1e-12)
    assert noise["sway"] == pytest.approx(2e-12 * size / 2.0, rel=1e-6)
    assert noise["pull"] == pytest.approx(2e-12 * size * 1e6 / 2.0 * (1.0 + 1e-4 / 1e-3), rel=1e-3)  # and its damping


@pytest.mark.parametrize("fastest", [1e2, 1e5, 1e7])
def test_slow_poles_of_stiff_machines_are_seen_and_poles_at_rest_are_not(fastest):
    """Two integrators beside a creep of 0.01 1/s and vibrations up to the fastest: rounding parts the integrators."""
    A = block_diag(
        [[0.0, 1.0], [0.0, 0.0]], [[-0.01]], [[0.0, 10.0], [-10.0, -1.0]], [[0.0, fastest], [-fastest, -1.0]]
    )
    turned = np.linalg.qr(np.random.default_rng(5).normal(size=A.shape))[0]
    poles = _moving(np.linalg.eigvals(turned @ A @ turned.T))
    assert len(poles) == 3
    assert np.abs(poles[0] + 0.01) < 1e-3


def test_poles_that_a_run_cannot_tell_from_free_motion_are_at_the_origin():
    """A run of an hour sees what swings in ten minutes, one of 0.05 s does not; a round girder spins freely."""
    slow, fast = np.array([0.01j, -0.01j]), np.array([-0.1 + 2.2j, -0.1 - 2.2j])
    poles = np.concatenate([slow, fast])
    assert np.abs(_moving(poles, 3600.0)).min() == pytest.approx(0.01)
    assert np.abs(_moving(poles, 0.05)).min() == pytest.approx(2.2, rel=0.01)
    scene = fc.load_scene(str(EXAMPLES / "ceiling_crane.toml"))
    poles = scene.linear.damped_poles()
    assert np.abs(poles[np.abs(poles) > 1e-4]).min() > 2.0
    answer = answer_of(scene, scene.with_(simulation=replace(scene.simulation, rigid_twin=False)).run())
    assert np.abs(answer.poles[0]) == pytest.approx(2.18, rel=0.01)  # the links sway


def test_the_pole_that_grows_is_told():
    assert _growing(np.array([-1 + 3j, 0.2 + 5j, 0.1 + 0j])) == 0.2 + 5j
    assert _growing(np.array([1e-12 + 3j, -1.0 + 0j])) == 0.0
