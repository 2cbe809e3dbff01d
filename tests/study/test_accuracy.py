"""A ledger judges changes by runs that are accurate enough, and says how well they are known."""

from dataclasses import replace

import numpy as np
import pytest
from test_omissions import cart
from units import OTHERS, SI, Units

import flexctrl as fc
from flexctrl.design import MinimumJerk, pd
from flexctrl.study.accuracy import accurate
from flexctrl.study.answers import outputs_apart
from flexctrl.study.omissions import omissions

_FURTHER = 1.3
"""Runs a tenth of whose tolerance leaves a fifth of their errors are off by 5/4 of how far they are from these."""
OMEGA = 2.0 * np.pi * 5.0


def oscillator(method=None, tolerance=None, damping=1.0) -> fc.Scene:
    """One kilogram on a spring, 5 Hz, under a step: closed form."""
    mass = fc.PointMass("mass", (1, 0, 0), 1.0)
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=OMEGA**2, damping=damping)
    structure = fc.Structure(
        [mass, spring],
        [fc.Support(spring.start), fc.Support(mass.node, "v w"), fc.Pin(spring.end, mass.node)],
        inputs=[fc.Force("push", mass.node, "x")],
        outputs=[fc.Position("x", mass.node, "x"), fc.Velocity("rate", mass.node, "x")],
    )
    plan = fc.Simulation(until=1.0, method=method, tolerance=tolerance or fc.Tolerance(), every=0.01)
    return fc.Scene(structure, [fc.Flexible()], loads={"push": 10.0}, simulation=plan)


def rate(t: np.ndarray, damping: float) -> np.ndarray:
    """Of the oscillator [m/s]: (F/m) e^(−ct/2) sin(ω_d t)/ω_d."""
    turning = np.sqrt(OMEGA**2 - 0.25 * damping**2)
    return 10.0 * np.exp(-0.5 * damping * t) * np.sin(turning * t) / turning


def error(run: fc.Run) -> float:
    """Of the rate, over its largest."""
    exact = rate(run.t, 1.0)
    return float(np.abs(run["rate"] - exact).max() / np.abs(exact).max())


COARSE = [
    (fc.GeneralizedAlpha(0.01), None),
    (fc.ConservingMidpoint(0.01), None),
    (fc.Richardson(fc.GeneralizedAlpha(0.04)), None),
    (None, fc.Tolerance(1e-2, 1e-4)),
]


@pytest.mark.parametrize(("method", "tolerance"), COARSE)
def test_a_coarse_scene_is_judged_by_finer_runs(method, tolerance):
    """Its own is off by 10 % and more and would tell that of the damping; times and counts stay its own."""
    scene = oscillator(method, tolerance)
    found = fc.ledger(scene, fc.Within(outputs=0.01))
    own = scene.run()
    assert error(own) > 0.1
    assert found.accuracy.own == pytest.approx(error(own), rel=0.6)
    assert error(found.full.run) < 0.005
    assert error(found.full.run) == pytest.approx(found.accuracy.known, rel=0.6)
    assert found.size.steps == own.report.steps < found.accuracy.steps
    t = own.t
    change = np.abs(rate(t, 1.0) - rate(t, 0.0)).max() / np.abs(rate(t, 1.0)).max()
    assert found["spring_damping"].change.outputs["rate"] == pytest.approx(change, abs=0.01)
    assert not found.notes
    assert f"the scene's own is {100.0 * found.accuracy.own:.2g} % off" in str(found)


def test_a_scene_that_is_accurate_is_judged_by_its_own_runs():
    scene = oscillator(fc.GeneralizedAlpha(2e-4))
    found = fc.ledger(scene, fc.Within(outputs=0.01))
    assert found.accuracy.refinements == 0
    assert found.accuracy.known == found.accuracy.own < 0.01 / 3.0
    assert outputs_apart(found.full.run, scene.run()) == {"x": 0.0, "rate": 0.0}
    assert "known to" in str(found)


def test_steps_that_samples_hold_are_shortened():
    """Steps end at samples: one of two samples' length and its half are the same run, which tells nothing."""
    scenes = [
        cart("sampled").with_(simulation=fc.Simulation(0.2, fc.GeneralizedAlpha(h), every=0.02)) for h in (0.02, 0.01)
    ]
    run, same = (scene.run() for scene in scenes)
    assert outputs_apart(run, same) == dict.fromkeys(run.outputs, 0.0)
    found, held = accurate(scenes[0], scenes[0].model, run, 1.0)
    assert held.run is run
    assert 1e-4 < found.own < 1.0 / 3.0


def servo(units: Units = SI, tolerance: fc.Tolerance | None = None) -> fc.Scene:
    """A cart on an elastic drive, sent to 30 rad of its motor by a servo that samples: sampling holds the steps."""
    u = units
    torque, inertia = u.force * u.length, u.mass * u.length**2
    cart = fc.PointMass("cart", (0, 0, 0), 20.0 * u.mass)
    rope = fc.Rope("rope", cart.node, (0, 0, -2 * u.length), EA=1e4 * u.force)
    load = fc.PointMass("load", rope.end, 10.0 * u.mass)
    shaft = {"ratio": 10.0, "stiffness": 50.0 * torque, "inertia": 1e-2 * inertia, "damping": 0.02 * torque * u.time}
    drive = fc.LinearDrive("travel", cart.node, direction="x", radius=0.1 * u.length, **shaft)
    structure = fc.Structure(
        [cart, rope, load],
        [fc.Support(cart.node, "v w"), fc.Support(load.node, "v"), *map(fc.Pin, rope.nodes, (cart.node, load.node))],
        [drive],
        [fc.MotorTorque("torque", drive)],
        [fc.DriveAngle("angle", drive), fc.DriveSpeed("speed", drive), fc.SwayAngle("sway", cart.node, load.node, "x")],
    )
    law = pd(0.2 * torque, 0.1 * torque * u.time, measured="angle", rate="speed", command="torque")
    law = fc.Sampled(fc.Tracking(law, {"angle": MinimumJerk(30.0, 1.5 * u.time)}), 0.01 * u.time)
    plan = fc.Simulation(3.0 * u.time, tolerance=tolerance or fc.Tolerance(), every=0.02 * u.time)
    effects = [u.gravity(), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(beta=1e-3 * u.time)]
    return fc.Scene(structure, effects, law, simulation=plan)


@pytest.fixture(scope="module")
def drawn_up():
    return fc.ledger(servo(), 0.01)


def test_changes_are_known_to_what_is_said(drawn_up):
    """Of each effect and of the minimal set: against runs at a ten-thousandth of the tolerance."""
    exact = fc.Tolerance(1e-8, 1e-11)
    scene = servo(tolerance=exact)
    scene = scene.with_(controller=scene.law)
    without = {o.name: o.without(scene).run() for o in omissions(scene)}
    full = scene.run()
    for entry in drawn_up.entries:
        truth = max(outputs_apart(full, without[entry.name]).values())
        assert abs(entry.change.outputs_worst - truth) <= _FURTHER * entry.change.outputs_known + 1e-6
        assert entry.change.outputs_known <= max(entry.change.outputs_worst, 0.01) / 3.0


@pytest.mark.parametrize("absolute", [1e-9, 1e-3])
def test_a_ledger_does_not_hang_on_the_tolerance(drawn_up, absolute):
    found = fc.ledger(servo(tolerance=fc.Tolerance(1e-4, absolute)), 0.01)
    assert found.minimal_set == drawn_up.minimal_set
    for one, other in zip(found.entries, drawn_up.entries, strict=True):
        known = one.change.outputs_known + other.change.outputs_known
        assert one.change.outputs_worst == pytest.approx(other.change.outputs_worst, abs=_FURTHER * known + 1e-9)


@pytest.mark.parametrize("units", OTHERS)
def test_a_ledger_does_not_hang_on_units(drawn_up, units):
    found = fc.ledger(servo(OTHERS[units]), 0.01)
    assert found.minimal_set == drawn_up.minimal_set
    assert found.accuracy.known == pytest.approx(drawn_up.accuracy.known, rel=1e-3)
    for one, other in zip(found.entries, drawn_up.entries, strict=True):
        assert one.change.outputs_worst == pytest.approx(other.change.outputs_worst, rel=1e-3, abs=1e-8)
        assert one.change.poles == pytest.approx(other.change.poles, rel=1e-3, abs=1e-6)


def test_what_a_run_without_an_effect_is_off_by_is_said(drawn_up):
    """Where no finer run comes to its end nothing is known of a change, and the words say so."""
    entry = drawn_up["sampled"]
    unsure = replace(entry, change=replace(entry.change, known=dict.fromkeys(entry.change.known, np.inf)))
    told = replace(drawn_up, entries=(unsure,))
    assert "unknown" in str(told).splitlines()[1]
    assert any("without sampled" in note for note in told.notes)
    assert not drawn_up.notes


def test_what_cannot_be_judged_is_said():
    found = fc.ledger(oscillator(fc.GeneralizedAlpha(0.01)), fc.Within(outputs=1e-9))
    assert found.accuracy.known > 1e-9 / 3.0
    assert len(found.notes) == 1
    assert f"note: the full run is known to {100.0 * found.accuracy.known:.2g} % only" in str(found)
