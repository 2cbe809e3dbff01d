"""Loads put on at once make stiff shafts and ropes ring: what steps see little of is named, with its closed form."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import Step

MOTOR, LOAD, TORQUE = 1e-4, 5.0, 5.0


def drive(stiffness: float) -> fc.Model:
    """A light motor that turns a heavy body by a shaft."""
    body = fc.RigidBody("body", (0.5, 0, 0), 1.0, (3.0, 3.0, LOAD - 0.25), {"hub": (0, 0, 0)})
    hub = body.point("hub")
    motor = fc.RotaryDrive("motor", hub, axis="z", stiffness=stiffness, ratio=1.0, inertia=MOTOR)
    outputs = [fc.DriveSpeed("speed", motor), fc.Rotation("angle", hub, "z")]
    inputs = [fc.MotorTorque("torque", motor)]
    plan = fc.Structure([body], [fc.Support(hub, "u v w rx ry")], [motor], inputs, outputs)
    return fc.assemble(plan, [fc.LargeRotation(), fc.ShaftElasticity()])


def ripple(stiffness: float) -> float:
    """Of two masses under a step of torque: T I/(J (I + J) ω), ω² = k (1/J + 1/I)."""
    omega = np.sqrt(stiffness * (1.0 / MOTOR + 1.0 / LOAD))
    return TORQUE * LOAD / (MOTOR * (LOAD + MOTOR) * omega)


def said(run: fc.Run) -> list[str]:
    return [note for note in run.report.notes if "from the start on" in note]


@pytest.mark.parametrize(
    ("stiffness", "method"),
    [(1e3, fc.GeneralizedAlpha(1e-2)), (1e6, fc.GeneralizedAlpha(1e-2)), (1e6, fc.ConservingMidpoint(1e-2))],
    ids=["alpha", "alpha, stiff", "midpoint, stiff"],
)
def test_motors_that_ring_behind_stiff_shafts(stiffness, method):
    """The largest speed was a sixteenth of what it is, with nothing said."""
    run = fc.simulate(drive(stiffness), until=1.0, inputs={"torque": TORQUE}, method=method)
    (note,) = said(run)
    assert run["speed"].max() < 0.9 * (1.0 + ripple(stiffness))
    assert note.startswith(f"speed rings by up to {ripple(stiffness):.2g} from the start on")


def test_what_steps_resolve_is_right_and_not_named():
    run = fc.simulate(drive(1e3), until=0.05, inputs={"torque": TORQUE}, method=fc.GeneralizedAlpha(2e-5))
    assert run["speed"].max() == pytest.approx(0.05 * TORQUE / LOAD + ripple(1e3), rel=0.01)
    assert not said(run)


def test_motors_at_rest_do_not_ring():
    assert not said(fc.simulate(drive(1e6), until=1.0, method=fc.GeneralizedAlpha(1e-2)))


def hanging(angle: float, stiffness: float = 1e8) -> fc.Model:
    """Two kilograms on a stiff rope drawn at an angle from the vertical, and a force along it."""
    rope = fc.Rope("rope", (0, 0, 0), (np.sin(angle), 0, -np.cos(angle)), EA=stiffness, length=1.0)
    load = fc.PointMass("load", rope.end, 2.0)
    joints = [fc.Support(rope.start), fc.Pin(rope.end, load.node)]
    inputs, outputs = [fc.Force("pull", load.node, "z")], [fc.Tension("tension", rope)]
    plan = fc.Structure([rope, load], joints, inputs=inputs, outputs=outputs)
    return fc.assemble(plan, [fc.LargeRotation(), fc.RopeStretch(), fc.Gravity()])


def test_a_taut_rope_under_a_load_put_on_at_once():
    """It swings about the tension that the load adds, by as much as that; at rest under its weight it does not."""
    model, method = hanging(0.0), fc.GeneralizedAlpha(2e-3)
    hung = fc.equilibrium(model)
    run = fc.simulate(model, until=0.2, start=hung.state, inputs={"pull": -100.0}, method=method)
    (note,) = said(run)
    assert note.startswith("tension rings by up to 1e+02 from the start on")
    assert not said(fc.simulate(model, until=0.2, start=hung, method=method))


def test_chosen_steps_that_see_the_first_peak_but_lose_the_ringing():
    """First twice m g cos a + F cos a; then steps grow, as what they err by in places is small."""
    run = fc.simulate(hanging(0.3), until=0.2, inputs={"pull": -100.0})
    assert run["tension"].max() == pytest.approx(2.0 * (2.0 * 9.81 + 100.0) * np.cos(0.3), rel=0.01)
    (note,) = said(run)
    assert note.startswith("tension rings by up to 1.1e+02 from the start on")


UNTOLD = "functions of time were looked at every"
"""Said of functions in Python in few steps: what they do between is not known."""
SWITCHED = {
    "a step": fc.OpenLoop({"torque": Step(TORQUE, at=0.3)}),
    "sampled": fc.OpenLoop({"torque": lambda t: TORQUE * (t >= 0.3)}, sample_time=0.05),
    "untold": fc.OpenLoop({"torque": lambda t: TORQUE * (t >= 0.3)}),
}


@pytest.mark.parametrize("every", [None, 0.05], ids=["all steps", "spaced rows"])
@pytest.mark.parametrize("law", SWITCHED.values(), ids=SWITCHED.keys())
def test_a_torque_switched_on_later(law, every):
    """The motor rings as from a start; no step sees it."""
    run = fc.simulate(drive(1e6), law, until=1.0, method=fc.GeneralizedAlpha(1e-2), every=every)
    (note,) = (note for note in run.report.notes if not note.startswith(UNTOLD))
    assert run["speed"].max() < 0.71
    assert note.startswith(f"speed rings by up to {ripple(1e6):.2g} from t = 0.3 s on")


def test_a_torque_that_rises_slowly():
    law = fc.OpenLoop({"torque": lambda t: min(t / 0.8, 1.0) * TORQUE})
    notes = fc.simulate(drive(1e6), law, until=1.0, method=fc.GeneralizedAlpha(1e-2)).report.notes
    assert [note for note in notes if not note.startswith(UNTOLD)] == []


def test_a_rope_pulled_later():
    """After 0.1 s the load has swung by a little: its rope rings by F cos a, as from the start."""
    law = fc.OpenLoop({"pull": Step(-100.0, at=0.1)})
    hung = fc.equilibrium(hanging(0.0))
    run = fc.simulate(hanging(0.0), law, until=0.4, start=hung, method=fc.GeneralizedAlpha(2e-3))
    assert run.report.notes[-1].startswith("tension rings by up to 1e+02 from t = 0.1 s on")


@pytest.mark.parametrize(("tolerance", "named"), [(1e-4, True), (1e-8, False)])
def test_runs_of_an_extrapolation_that_part_in_phase(tolerance, named):
    """Extrapolated out of phase the ringing was a quarter larger than it is, with nothing said."""
    run = fc.simulate(
        hanging(0.3, 1e6), until=0.2, inputs={"pull": -100.0},
        method=fc.Richardson(fc.AdaptiveAlpha()), tolerance=fc.Tolerance(tolerance, 1e-3 * tolerance),
    )  # fmt: skip
    assert any("part by" in note for note in run.report.notes) is named
    assert bool(run["tension"].max() > 300.0) is named


def swinging(EA: float, ratio: float, effects: tuple[fc.Effect, ...] = ()) -> fc.Model:
    """A load of 10 kg on a rope of 2 m, free to swing in a plane."""
    load = fc.PointMass("load", (0, 0, -2), 10.0)
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -2), EA=EA, damping=2.0 * ratio * np.sqrt(10.0 * EA / 2.0))
    joints = [fc.Support(rope.start), fc.Pin(rope.end, load.node), fc.Support(load.node, "v")]
    structure = fc.Structure([rope, load], joints, outputs=[fc.Tension("tension", rope)])
    return fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), fc.Flexible(), *effects])


def pushed(model: fc.Model, speed: float) -> fc.State:
    """It hangs, and is given a speed."""
    sideways = np.array([1.0 if name.endswith("_u") else 0.0 for name in model.coordinates])
    return fc.equilibrium(model).state.with_(v=speed * sideways)


@pytest.mark.parametrize("EA", [1e7, 1e9, 1e11])
def test_a_load_on_a_rope_that_is_sent_off_sideways(EA):
    """At once the rope has to bear m v²/l more: it swings about that."""
    model = swinging(EA, 0.003)
    run = fc.simulate(model, until=8.0, every=0.08, start=pushed(model, 4.43))
    assert any(note.startswith("tension rings by up to 98 from the start on") for note in run.report.notes)
    assert run.report.output_errors["tension"] > 0.5


def test_one_that_swings_already_goes_on_without_a_blow():
    """A run that goes on from the state of another has nothing put on at once: its damping has ended the ring."""
    model = swinging(1e9, 0.1)
    first = fc.simulate(model, until=1.0, start=pushed(model, 4.43), method=fc.GeneralizedAlpha(1e-4))
    rest = fc.simulate(model, until=2.0, start=first.final.with_(t=0.0))
    assert not any("rings by up to" in note for note in rest.report.notes)


@pytest.mark.parametrize("stiffness", [1e3, 1e5, 1e8])
def test_a_spring_within_its_open_play_does_not_ring(stiffness):
    """It never closes; the other mass is on a spring of its own, and this one slows down alone: 0.02 exp(−t/2) m/s."""
    one, two = fc.PointMass("one", (0, 0, 0), 2.0), fc.PointMass("two", (1, 0, 0), 3.0)
    between = fc.Spring("between", one.node, two.node, stiffness=stiffness)
    anchor = fc.Spring("anchor", (-1, 0, 0), one.node, stiffness=200.0)
    joints = [fc.Support(one.node, "v w"), fc.Support(two.node, "v w"), fc.Support(anchor.start)]
    joints += [fc.Pin(one.node, between.start), fc.Pin(two.node, between.end), fc.Pin(anchor.end, one.node)]
    structure = fc.Structure([one, two, between, anchor], joints, outputs=[fc.Velocity("speed", two.node, "x")])
    effects = [fc.LargeRotation(), fc.Backlash({"between": 0.5}), fc.ViscousFriction({"one.u": 1.0, "two.u": 1.5})]
    model = fc.assemble(structure, effects)
    v = np.array([0.5 if name.startswith("one") else 0.02 for name in model.coordinates])
    run = fc.simulate(model, until=2.0, every=0.01, start=model.rest.with_(v=v))
    assert run["speed"] == pytest.approx(0.02 * np.exp(-0.5 * run.t), rel=1e-4)
    assert run.report.output_errors["speed"] < 1e-3
    assert not any("rings" in note for note in run.report.notes)
