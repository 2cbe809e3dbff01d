"""A ledger judges changes by runs that are accurate enough, and says how well they are known."""

import numpy as np
import pytest
from test_omissions import cart

import flexctrl as fc
from flexctrl.study.accuracy import accurate
from flexctrl.study.answers import outputs_apart

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
    found, judged = accurate(scenes[0], scenes[0].model, run, 1.0)
    assert judged is run
    assert 1e-4 < found.own < 1.0 / 3.0


def test_what_cannot_be_judged_is_said():
    found = fc.ledger(oscillator(fc.GeneralizedAlpha(0.01)), fc.Within(outputs=1e-9))
    assert found.accuracy.known > 1e-9 / 3.0
    assert len(found.notes) == 1
    assert f"note: the full run is known to {100.0 * found.accuracy.known:.2g} % only" in str(found)
