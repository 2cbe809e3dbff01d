"""What an equilibrium holds, linear models hold: which inputs then do nothing, and how it is let go of."""

from __future__ import annotations

import control
import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import lqr
from flexctrl.errors import DesignError, StructureError

MASS, RADIUS, RATIO, INERTIA, STIFF = 30e3, 0.75, 30.0, 30.0, 5e7


def crane(*effects: fc.Effect) -> fc.Model:
    trolley, load = fc.PointMass("trolley", (0, 0, 40), 50e3), fc.PointMass("load", (0, 0, 10), MASS)
    hoist = fc.Winch("hoist", load.node, trolley.node, EA=STIFF, radius=RADIUS, ratio=RATIO, inertia=INERTIA)
    plan = fc.Structure(
        [trolley, load],
        [fc.Support(trolley.node, "v w"), fc.Support(load.node, "v")],
        drives=[hoist],
        inputs=[fc.Force("push", trolley.node, "x"), fc.MotorTorque("torque", hoist), fc.Force("lift", load.node, "z")],
        outputs=[fc.Position("height", load.node, "z")],
    )
    return fc.assemble(plan, [fc.LargeRotation(), fc.Gravity(), *effects])


def test_what_the_rigid_twin_cannot_hold_is_told_with_what_it_can():
    twin = fc.rigid(crane(fc.RopeStretch()))
    with pytest.raises(StructureError, match=r"follows from others .* held here: trolley_0_u, load_0_u, load_0_w"):
        fc.equilibrium(twin, hold={"hoist_source": 0.0})
    with pytest.raises(StructureError, match="follows from others"):
        fc.equilibrium_path(twin, {"lift": 1.0}, 1.0, hold={"hoist_source": 0.0})
    with pytest.raises(StructureError, match="name it as this model does, 'load_0_w'"):
        fc.equilibrium(twin, hold={"load.w": 0.0})
    with pytest.raises(StructureError, match="no coordinate 'hoist_sorce'"):
        fc.equilibrium(twin, hold={"hoist_sorce": 0.0})


def held() -> tuple[fc.Model, fc.Rest]:
    model = crane(fc.RopeStretch())
    return model, fc.equilibrium(model, hold={"hoist_source": 0.0})


def bears(stretched: bool) -> float:
    """The torque that holds the load, r/R ∂/∂L of EA (l − L)²/(2 L) where the rope stretches."""
    weight = MASS * 9.81
    return -RADIUS / RATIO * weight * (1.0 + weight / (2.0 * STIFF) * stretched)


def test_a_motor_that_is_held_feels_no_torque_and_the_certificate_says_so():
    model, rest = held()
    linear = fc.linearize(model, at=rest)
    assert np.flatnonzero(np.abs(linear.B).max(axis=0) == 0.0).tolist() == [1]
    assert linear.certificate.idle == ("torque",)
    assert "all that they act on is held: torque; linearize(model, at=rest.state" in str(linear)
    assert linear.select(inputs=["lift", "torque"]).certificate.idle == ("torque",)
    assert "without effect" not in str(linear.select(inputs=["push"]))


def test_what_holds_is_told_and_lets_go_as_an_input():
    """Far below the rope's own frequency the load goes as one on a drum: θ'' = u / (J + m r²/R²)."""
    model, rest = held()
    assert rest.holding == {"hoist_source": pytest.approx(bears(True), rel=1e-12)}
    linear = fc.linearize(model, at=rest.state, inputs={"torque": rest.holding["hoist_source"]})
    assert linear.certificate.idle == ()
    omega, arm = 1.0, RADIUS / RATIO
    gain = abs(linear.to_ss()(1j * omega)[0, 1])
    assert gain == pytest.approx(arm / (INERTIA + MASS * arm**2) / omega**2, rel=2e-2)
    scene = fc.Scene(model.structure, model.effects, hold={"hoist_source": 0.0})
    for mine, its in ((linear.K, scene.linear.K), (linear.M, scene.linear.M)):
        assert abs(mine - its).max() == 0.0


def test_behind_a_rope_that_does_not_stretch_what_is_held_is_no_coordinate():
    """Neither torque nor lift move a load whose distance is held; the pendulum is pushed by the trolley alone."""
    scene = fc.Scene(crane().structure, (fc.Gravity(), fc.LargeRotation()), hold={"hoist_source": 0.0})
    rest = scene.rest
    assert rest.holding == {"hoist_source": pytest.approx(bears(False), rel=1e-12)}
    assert fc.linearize(scene.model, at=rest).certificate.idle == ("torque", "lift")
    free = fc.linearize(scene.model, at=rest.state, inputs={"torque": rest.holding["hoist_source"]})
    assert free.certificate.idle == scene.linear.certificate.idle == ()
    assert scene.linear.certificate.held == ("hoist_source",)


def test_a_torque_that_lags_does_nothing_to_a_motor_that_is_held_either():
    model = crane(fc.RopeStretch(), fc.MotorLag({"hoist": 0.1}))
    assert fc.linearize(model, at=fc.equilibrium(model, hold={"hoist_source": 0.0})).certificate.idle == ("torque",)


def test_runs_and_regulators_of_linear_models_say_it_where_the_input_is_used():
    model, rest = held()
    linear = fc.linearize(model, at=rest)
    run = fc.simulate(linear, until=0.1, inputs={"torque": 100.0})
    assert not run["height"].any()
    assert any("without effect" in note and "torque" in note for note in run.report.notes)
    law = control.ss([], [], [], [[-1.0]], inputs=["height"], outputs=["torque"])
    assert any("torque" in note for note in fc.simulate(linear, law, until=0.1).report.notes)
    assert not any("effect" in n for n in fc.simulate(linear, until=0.1, inputs={"lift": 1.0}).report.notes)
    plant = linear.select(inputs=["torque"]).to_ss()
    with pytest.raises(DesignError, match="no state feels torque: was all that it acts on held"):
        lqr(plant, np.eye(plant.nstates), np.eye(1))
