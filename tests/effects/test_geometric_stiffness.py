"""Small motion about a loaded equilibrium equals the linearised large motion."""

from dataclasses import replace

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.cranes import bridge_crane

BASE = [fc.Gravity(), fc.Flexible(), fc.RayleighDamping(0.01, 1e-3)]


@pytest.fixture(scope="module")
def models():
    crane = bridge_crane()
    return fc.assemble(crane, [*BASE, fc.LargeRotation()]), fc.assemble(crane, [*BASE, fc.GeometricStiffness()])


def test_matrices_are_those_of_the_linearised_machine(models):
    large, small = models
    linear = fc.linearize(large)
    for ours, theirs in ((small.stiffness(), linear.K), (small.mass(), linear.M)):
        assert abs(ours - theirs).max() <= 1e-12 * abs(theirs).max()
    again = fc.linearize(small)
    np.testing.assert_allclose(again.modes().omega, linear.modes().omega, rtol=1e-9, atol=1e-9)


def test_it_rests_at_the_equilibrium_of_the_large_motion(models):
    large, small = models
    found = fc.equilibrium(large).state
    np.testing.assert_allclose(small.rest.x, found.x, atol=1e-12)
    np.testing.assert_array_equal(fc.equilibrium(small).state.q, found.q)


def test_a_small_push_moves_both_alike(models):
    until = 4.0
    runs = [
        fc.simulate(
            m,
            until=until,
            start=fc.equilibrium(m),
            inputs={"left_torque": 1e-3},
            every=0.1,
            tolerance=fc.Tolerance(1e-7, 1e-12),
        )
        for m in models
    ]
    for name in ("sway", "travel", "left_angle"):
        first, second = (r[name] - r[name][0] for r in runs)
        np.testing.assert_allclose(second, first, atol=2e-4 * np.abs(first).max())


def test_modal_damping_is_counted_once():
    effects = [fc.Gravity(), fc.Flexible(), fc.ModalDamping(0.02)]
    crane = bridge_crane()
    ratios = [
        fc.linearize(fc.assemble(crane, [*effects, e])).modes().damping
        for e in (fc.LargeRotation(), fc.GeometricStiffness())
    ]
    np.testing.assert_allclose(ratios[0], ratios[1], rtol=1e-6, atol=1e-9)


def test_beside_large_rotation_it_is_refused():
    with pytest.raises(fc.errors.StructureError, match="part of LargeRotation"):
        fc.assemble(bridge_crane(), [*BASE, fc.LargeRotation(), fc.GeometricStiffness()])


HOLD = {"left_drive_source": 30.0, "right_drive_source": 30.1}


@pytest.fixture(scope="module")
def pulled():
    """A crane whose load a force draws aside, and the motor torques that hold it there with its motors turned."""
    crane = bridge_crane()
    crane = crane.with_(inputs=[*crane.inputs, fc.Force("draught", at=crane.part("rope").end, direction="x")])
    large = fc.assemble(crane, [*BASE, fc.LargeRotation()])
    rest = fc.equilibrium(large, hold=HOLD, inputs={"draught": 300.0})
    still = np.zeros(large.n)
    missing = large.balance(rest.state, still, still) + large.loads(rest.state, rest.inputs)
    left, right = (missing[large.coordinate(name)] for name in HOLD)
    assert min(abs(left), abs(right)) > 1.0
    return crane, {"draught": 300.0, "left_torque": -left, "right_torque": -right}


def scenes(crane, rest_inputs, loads, until, methods):
    """The machine as it is, and in small motion by some methods."""
    plan = fc.Simulation(until, fc.GeneralizedAlpha(5e-4), every=0.1, start=fc.Start.EQUILIBRIUM)
    full = fc.Scene(
        crane, [*BASE, fc.LargeRotation()], hold=HOLD, rest_inputs=rest_inputs, loads=loads, simulation=plan
    )
    effects = [*BASE, fc.GeometricStiffness()]
    return full, [full.with_(effects=effects, simulation=replace(plan, method=method)) for method in methods]


WAYS = [fc.GeneralizedAlpha(5e-4), fc.Exact(0.02)]


def test_about_an_equilibrium_that_is_held_under_inputs_small_motion_is_that_of_the_machine(pulled):
    crane, rest_inputs = pulled
    loads = rest_inputs | {"left_torque": rest_inputs["left_torque"] + 1e-2}
    full, small = scenes(crane, rest_inputs, loads, 2.0, WAYS)
    linear, run = full.linear, full.run()
    assert run["left_angle"][0] == pytest.approx(30.0)
    for scene in small:
        for name in ("M", "C", "K", "B", "Cq", "Cv"):
            ours, theirs = getattr(scene.linear, name), getattr(linear, name)
            assert abs(ours - theirs).max() <= 1e-12 * abs(theirs).max()
        other = scene.run()
        for name in ("travel", "sway", "load_z", "left_angle", "right_angle", "left_speed"):
            moved = np.abs(run[name] - run[name][0]).max()
            np.testing.assert_allclose(other[name], run[name], rtol=1e-11, atol=1e-2 * moved)


def test_it_starts_in_balance(pulled):
    crane, rest_inputs = pulled
    _, small = scenes(crane, rest_inputs, rest_inputs, 1.0, [*WAYS, fc.AdaptiveAlpha()])
    for scene in small:
        run = scene.run()
        for name, size in (("travel", 1.0), ("sway", 1.0), ("left_angle", 30.0), ("left_speed", 1.0)):
            assert np.ptp(run[name]) <= 1e-11 * size


def test_what_held_it_lets_go(pulled):
    crane, _ = pulled
    full, small = scenes(crane, {"draught": 300.0}, {"draught": 300.0}, 0.3, WAYS)
    run = full.run()
    assert np.ptp(run["left_angle"]) > 1e-2
    for scene in small:
        other = scene.run()
        for name in ("travel", "left_angle", "right_angle"):
            np.testing.assert_allclose(other[name], run[name], rtol=1e-11, atol=2e-3 * np.ptp(run[name]))


def test_compiled_loops_and_plain_steps_agree_about_it(pulled):
    crane, rest_inputs = pulled
    effects = [*BASE, fc.GeometricStiffness(HOLD, rest_inputs)]
    models = [fc.assemble(crane, effects), fc.assemble(crane, effects, backend=fc.CasadiVM())]
    loads = rest_inputs | {"left_torque": 0.0}
    for method in (fc.GeneralizedAlpha(2e-3), fc.Exact(0.02)):
        first, second = (fc.simulate(m, until=0.5, inputs=loads, method=method, every=0.05) for m in models)
        for name in first.outputs:
            scale = np.ptp(second[name]) + 1e-9
            np.testing.assert_allclose(first[name], second[name], rtol=1e-12, atol=1e-7 * scale)
        assert first.report.energy_residual < 1e-4


def test_its_rigid_twin_holds_what_it_has():
    crane = bridge_crane()
    for hold in ({"left_drive_source": 1.0}, {"girder.start.u": 0.2}):
        twin = fc.rigid(fc.assemble(crane, [*BASE, fc.GeometricStiffness(hold)]))
        assert set(twin.motion.names).isdisjoint(HOLD)
    np.testing.assert_allclose(twin.rest.x[0, 0], 0.2)


def test_names_it_does_not_know_are_refused():
    with pytest.raises(fc.errors.StructureError, match="no free coordinate 'girdle'"):
        fc.assemble(bridge_crane(), [*BASE, fc.GeometricStiffness({"girdle": 0.0})])
    with pytest.raises(fc.errors.StructureError, match="no input 'torque'"):
        fc.assemble(bridge_crane(), [*BASE, fc.GeometricStiffness(inputs={"torque": 0.0})])
    with pytest.raises(fc.errors.StructureError, match="hold"):
        fc.GeometricStiffness({"left_drive_source": "30"})
