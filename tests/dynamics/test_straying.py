"""A machine that leaves is told as one that leaves; one that stays, or hurries round, is not."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import pd


def crane() -> fc.Model:
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -2.0), EA=1e6)
    cart, load = fc.PointMass("cart", rope.start, 5.0), fc.PointMass("load", rope.end, 20.0)
    structure = fc.Structure(
        [rope, cart, load],
        [fc.Support(cart.node, "v w"), fc.Pin(cart.node, rope.start), fc.Pin(rope.end, load.node)],
        inputs=[fc.Force("force", cart.node, "x")],
        outputs=[fc.Position("x", cart.node, "x"), fc.Velocity("rate", cart.node, "x")],
    )
    return fc.assemble(structure, [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])


@pytest.mark.parametrize(("kp", "told"), [(-4000.0, True), (100.0, False)])
@pytest.mark.parametrize("linear", [False, True])
def test_a_loop_that_is_not_stable_is_named(kp, told, linear):
    model = crane()
    plant = fc.linearize(model) if linear else model
    law = fc.Sampled(pd(kp=kp, kd=40.0, measured="x", rate="rate", command="force"), 0.01)
    run = fc.simulate(plant, law, until=3.0, inputs={"force": 1.0}, every=0.5)
    gone = bool(abs(run["x"]).max() > 2e6)
    assert gone is told
    assert any("as if the loop is not stable" in note for note in run.report.notes) is told


def test_what_nothing_holds_is_told_so_and_many_turns_are_none():
    ball = fc.RigidBody("ball", (0, 0, 0), 1.0, (0.1, 0.1, 0.1))
    structure = fc.Structure([ball], outputs=[fc.Position("z", ball.node, "z")])
    model = fc.assemble(structure, [fc.LargeRotation()])
    rates = np.zeros(model.n)
    rates[model.coordinate("ball_0_w")] = 1e8
    away = fc.simulate(model, until=1.0, start=model.rest.with_(v=rates))
    assert any("as if nothing holds it" in note for note in away.report.notes)
    rates[:] = 0.0
    rates[model.coordinate("ball_0_rz")] = 1e7
    around = fc.simulate(model, until=1.0, start=model.rest.with_(v=rates), method=fc.GeneralizedAlpha(0.1, 1.0))
    assert not any("as if nothing holds it" in note for note in around.report.notes)


@pytest.mark.parametrize("sampled", [False, True])
def test_chosen_steps_end_where_a_loop_has_thrown_the_machine_away(sampled):
    """x'' = 1.2e3 x: chosen steps would be ever shorter; what was computed up to there is right, and kept."""
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=100.0)
    mass = fc.PointMass("mass", spring.end, 1.0)
    structure = fc.Structure(
        [spring, mass],
        [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")],
        inputs=[fc.Force("force", mass.node, "x")],
        outputs=[fc.Position("x", mass.node, "x"), fc.Velocity("rate", mass.node, "x")],
    )
    law = pd(kp=-1300.0, kd=0.0, measured="x", rate="rate", command="force")
    law = fc.Sampled(law, 1e-4) if sampled else law
    run = fc.simulate(fc.assemble(structure, [fc.LargeRotation()]), law, until=3.0, inputs={"force": 1.0}, every=0.05)
    assert run.status is fc.Status.FAILED
    assert "the loop is not stable" in run.report.message
    assert run.t[-1] < 2.9
    grown = run["x"][8] - 1.0, run["x"][6] - 1.0
    assert grown[0] / grown[1] == pytest.approx(np.exp(0.1 * np.sqrt(1200.0)), rel=0.01)


def satellite(radius: float, thrust: float) -> tuple[fc.Model, fc.Controller]:
    """A body in free flight with a stable loop of its attitude, pushed by a force beside; its mass is one."""
    points = {"antenna": (radius, 0, 0)} if radius else {}
    body = fc.RigidBody("body", (0, 0, 0), 1.0, (0.1, 0.12, 0.05), points)
    structure = fc.Structure(
        [body],
        inputs=[fc.Torque("torque", body.node, "z"), fc.Force("thrust", body.node, "x")],
        outputs=[
            fc.Position("x", body.node, "x"),
            fc.Rotation("turn", body.node, "z"),
            fc.AngularVelocity("rate", body.node, "z"),
        ],
    )

    class Attitude:
        inputs, outputs, sample_time = ("turn", "rate"), ("torque", "thrust"), 0.1

        def initial(self):
            return np.zeros(0)

        def command(self, t, x, y):
            return np.array([-0.005 * (y[0] - 1.0) - 0.02 * y[1], thrust])

    return fc.assemble(structure, [fc.LargeRotation()]), Attitude()


METHODS = [None, fc.GeneralizedAlpha(0.1), fc.ExplicitRungeKutta(), fc.Richardson(fc.AdaptiveAlpha())]


@pytest.mark.parametrize("method", METHODS, ids=lambda m: type(m).__name__)
@pytest.mark.parametrize(("radius", "speed", "thrust"), [(0.5, 1e6, 0.0), (0.0, 1e6, 0.0), (0.5, 0.0, 1e6)])
def test_what_flies_far_under_a_stable_loop_has_not_failed(method, radius, speed, thrust):
    model, law = satellite(radius, thrust)
    rates = np.zeros(model.n)
    rates[model.coordinate("body_0_u")] = speed
    run = fc.simulate(model, law, until=3.0, start=model.rest.with_(v=rates), method=method, every=0.5)
    assert run.status is fc.Status.FINISHED
    assert run["x"][-1] == pytest.approx(speed * 3.0 + 0.5 * thrust * 9.0, rel=1e-9)
    assert any("as if nothing holds it" in note for note in run.report.notes)


LAWS = {
    "away": (lambda x, v: 100.0 * (x + 1.0), 0.2, 6.0),
    "to and fro": (lambda x, v: 1.0 - 60.0 * v, 0.1, 5.0),
    "in ever wider swings": (lambda x, v: -400.0 * (x - 1.0) + 25.0 * v, 0.01, 3.0),
}


@pytest.mark.parametrize("method", METHODS, ids=lambda m: type(m).__name__)
@pytest.mark.parametrize("name", LAWS)
def test_loops_that_grow_in_whatever_way_are_named(name, method):
    force, sample, until = LAWS[name]
    mass = fc.RigidBody("mass", (0, 0, 0), 1.0, (0.1, 0.1, 0.1))
    structure = fc.Structure(
        [mass],
        [fc.Support(mass.node, "v w rx ry rz")],
        inputs=[fc.Force("force", mass.node, "x")],
        outputs=[fc.Position("x", mass.node, "x"), fc.Velocity("v", mass.node, "x")],
    )

    class Law:
        inputs, outputs, sample_time = ("x", "v"), ("force",), sample

        def initial(self):
            return np.zeros(0)

        def command(self, t, x, y):
            return np.array([force(*y)])

    run = fc.simulate(fc.assemble(structure, [fc.LargeRotation()]), Law(), until=until, method=method, every=0.1)
    assert run.status is fc.Status.FAILED
    assert "the loop is not stable" in run.report.message
    assert any("as if the loop is not stable" in note for note in run.report.notes)


@pytest.mark.parametrize(
    "method", [fc.GeneralizedAlpha(1e-3), fc.ExplicitRungeKutta(1e-3)], ids=lambda m: type(m).__name__
)
def test_a_loop_whose_numbers_no_longer_tell_its_machine_has_failed(method):
    model, law = crane(), fc.Sampled(pd(kp=-4000.0, kd=40.0, measured="x", rate="rate", command="force"), 0.01)
    run = fc.simulate(model, law, until=20.0, inputs={"force": 1.0}, method=method, every=0.5)
    assert run.status is fc.Status.FAILED
    said = "no number tells the shape of the machine any more", "a million times the size of the machine, ever faster"
    assert any(each in run.report.message for each in said)  # whichever comes first: steps go in legs
    assert 1e5 < abs(run["x"]).max() < 1e22
    assert np.isfinite(run.y).all()


def test_numbers_of_a_linear_loop_may_be_as_large_as_they_like():
    law = fc.Sampled(pd(kp=-4000.0, kd=40.0, measured="x", rate="rate", command="force"), 0.01)
    run = fc.simulate(fc.linearize(crane()), law, until=5.0, inputs={"force": 1.0}, every=0.5)
    assert run.status is fc.Status.FINISHED
    assert abs(run["x"]).max() > 1e15
    assert any("as if the loop is not stable" in note for note in run.report.notes)
