"""Controllers, moves and hardware in scene files."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import TROLLEY

import flexctrl as fc
from flexctrl.design import AntiWindup, MinimumJerk, Sampled, Saturated, Shaped, TrapezoidalVelocity, zvd
from flexctrl.errors import SceneError
from flexctrl.scene import PID, Controlled, Gains, Hardware, Move, Reference, StateFeedback, Transfer, load_scene
from flexctrl.scene.laws import move
from flexctrl.scene.reading import Place


def test_a_reference_through_a_drive_is_in_motor_radians(written):
    scene = load_scene(written(TROLLEY))
    law = scene.law
    assert isinstance(law, Saturated)
    assert isinstance(law.controller, Sampled)
    # Far ahead of a machine at rest, u = kp R/r d: 0.2 N m/rad · 100 rad/m · 0.5 m, cut to its limit.
    command = law.controller.command(10.0, law.initial(), np.zeros(2))
    assert command == pytest.approx([0.2 * 100.0 * 0.5])
    assert law.command(10.0, law.initial(), np.zeros(2)) == pytest.approx([2.0])


def test_a_shaped_move_scales_with_its_shaper():
    path, shaper = TrapezoidalVelocity(2.0, 1.0, 0.5), zvd(3.0, 0.1)
    scaled, exact = Move(path, shaper).times(7.0), Shaped(path, shaper)
    for t in (0.3, 1.7, 2.9, 5.0, 9.0):
        assert scaled(t) == pytest.approx(7.0 * exact(t), rel=1e-12)
        assert scaled.derivative(t) == pytest.approx(7.0 * exact.derivative(t), rel=1e-12)


def test_there_wait_and_back_is_a_sum_of_moves():
    out = {"kind": "trapezoidal_velocity", "distance": 2.0, "speed": 1.0, "acceleration": 0.5, "at": 1.0}
    back = {"kind": "minimum_jerk", "distance": -2.0, "duration": 3.0, "at": 8.0}
    held = {"kind": "constant", "value": 0.5}
    shaped = {"kind": "zvd", "omega": 9.0, "zeta": 0.1}
    found = move({"kind": "sum", "terms": [out, back, held], "shaper": shaped}, Place("x"))
    there, home = TrapezoidalVelocity(2.0, 1.0, 0.5, 1.0), MinimumJerk(-2.0, 3.0, 8.0)
    command = found.times(7.0)
    for t in np.linspace(-1.0, 13.0, 57):
        expected = 0.5 + Shaped(there, zvd(9.0, 0.1))(t) + Shaped(home, zvd(9.0, 0.1))(t)
        assert command(t) == pytest.approx(7.0 * expected, abs=1e-11)
        rate = Shaped(there, zvd(9.0, 0.1)).derivative(t) + Shaped(home, zvd(9.0, 0.1)).derivative(t)
        assert command.derivative(t) == pytest.approx(7.0 * rate, abs=1e-11)


@pytest.mark.parametrize(
    ("terms", "message"),
    [([], "at least one"), ([{"kind": "stp", "size": 1.0}], "step"), ([{"kind": "step"}], "size"), (3.0, "a list")],
)
def test_a_sum_says_what_is_wrong_with_its_terms(terms, message):
    with pytest.raises(SceneError, match=message):
        move({"kind": "sum", "terms": terms}, Place("x"))


def test_a_shaper_for_two_modes():
    kinds = [{"kind": "zv", "omega": 2.0}, {"kind": "zv", "omega": 5.0}]
    found = move({"kind": "step", "size": 1.0, "shaper": kinds}, Place("x"))
    assert found.shaper.residual(2.0) < 1e-12
    assert found.shaper.residual(5.0) < 1e-12


def test_state_feedback_moves_the_rigid_twins_poles_where_lqr_puts_them(trolley):
    import control as ct

    reads = ("angle", "speed", "sway", "sway_rate")
    crane = trolley.structure
    rate = fc.Velocity("sway_rate", crane.part("load").node, "x", minus=crane.part("trolley").node)
    scene = fc.Scene(crane.with_(outputs=[*crane.outputs, rate]), trolley.effects)
    law = StateFeedback({"angle": 1.0, "sway": 0.1}, {"torque": 3.0}, reads).build(scene).controller
    plant = scene.twin_linear.select(("torque",), reads).to_ss()
    closed = np.linalg.eigvals(plant.A + plant.B @ law.D @ plant.C)
    Q = plant.C.T @ np.diag([1.0, 0.0, 100.0, 0.0]) @ plant.C
    poles = ct.lqr(plant.A, plant.B, Q, np.array([[1 / 9.0]]))[2]
    assert np.sort_complex(closed) == pytest.approx(np.sort_complex(poles), rel=1e-6)


def test_transfer_function_and_gains_are_the_same_law(trolley):
    one = Transfer("angle", "torque", (3.0,), (1.0,), Reference(Move(TrapezoidalVelocity(1.0, 1.0, 1.0)))).build(
        trolley
    )
    two = Gains({"torque": {"angle": -3.0}}, {"angle": Reference(Move(TrapezoidalVelocity(1.0, 1.0, 1.0)))}).build(
        trolley
    )
    for t in (0.0, 0.7, 5.0):
        y = np.array([0.2])
        assert one.command(t, one.initial(), y) == pytest.approx(two.command(t, two.initial(), y))


def test_an_integral_stops_at_its_limit(trolley):
    law = PID("angle", "torque", kp=1.0, ki=5.0, kd=0.1, rate="speed", limit=2.0).build(trolley)
    assert isinstance(law, AntiWindup)
    for angle, stopped in ((-0.5, False), (-5.0, True)):  # u = 0.5, and 5 cut to 2
        slope = law.rate(0.0, np.zeros(1), np.array([angle, 0.0]))
        assert slope == pytest.approx([0.0 if stopped else angle])


def test_hardware_from_the_inside_out(trolley):
    law = PID("angle", "torque", kp=1.0, kd=0.1, rate="speed")
    box = Hardware(0.01, noise={"angle": 1e-3}, steps={"angle": 0.01}, limits={"torque": 1.0}, delay=1)
    found, kinds = Controlled((law,), box).build(trolley), []
    while hasattr(found, "controller"):
        kinds.append(type(found).__name__)
        found = found.controller
    assert kinds[:5] == ["Delayed", "Saturated", "Quantised", "Noisy", "Sampled"]
