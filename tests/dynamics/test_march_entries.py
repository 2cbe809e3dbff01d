"""Marches of models in small motion and with modal damping: matrices entry by entry, against the plain steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.alpha.steps import Stepper
from flexctrl.model.flat.flattening import can_be_flat
from flexctrl.structure.refine import refine

TUBE = fc.Section.tube(fc.STEEL, radius=0.04, thickness=0.004)
GRAVITY, DAMPED, LARGE = fc.Gravity(), fc.RayleighDamping(0.05, 1e-4), fc.LargeRotation()


def crane() -> fc.Structure:
    """A boom on a slewing drive; a load on a rope; its tip pushed."""
    boom = fc.Beam("boom", (0, 0, 0), (2, 0, 0.5), TUBE, elements=3)
    rope = fc.Rope("rope", boom.end, (2, 0, -1), EA=1e5)
    load = fc.PointMass("load", rope.end, mass=20.0)
    motor = fc.RotaryDrive("motor", boom.start, axis="z", stiffness=20.0, ratio=10.0, inertia=0.01)
    return fc.Structure(
        [boom, rope, load],
        [fc.Support(boom.start, held="u v w rx ry"), fc.Pin(boom.end, rope.start), fc.Pin(rope.end, load.node)],
        drives=[motor],
        inputs=[fc.MotorTorque("torque", motor), fc.Force("push", load.node, (1, 1, 0))],
        outputs=[
            fc.Position("x", load.node, "x"),
            fc.Velocity("vy", load.node, "y"),
            fc.SwayAngle("sway", boom.end, load.node, "y"),
            fc.Rotation("slew", boom.end, "z"),
            fc.DriveAngle("angle", motor),
            fc.DriveSpeed("speed", motor),
        ],
    )


SETS = {
    "prestressed": [GRAVITY, fc.Flexible(), DAMPED, fc.GeometricStiffness()],
    "unloaded": [fc.Flexible(), DAMPED],
    "rigid rope": [GRAVITY, fc.BeamFlexibility(), fc.ShaftElasticity(), fc.GeometricStiffness()],
    "rigid shaft": [GRAVITY, fc.BeamFlexibility(), fc.RopeStretch(), fc.GeometricStiffness()],
    "rigid": [GRAVITY, fc.GeometricStiffness()],
    "small, modal damping": [GRAVITY, fc.Flexible(), fc.ModalDamping(0.02), fc.GeometricStiffness()],
    "large, modal damping": [GRAVITY, fc.Flexible(), fc.ModalDamping(0.02), LARGE],
    "large, rigid rope, modal damping": [GRAVITY, fc.BeamFlexibility(), fc.ModalDamping(0.02), LARGE],
    "component modes": [GRAVITY, fc.ComponentModes(2), fc.ShaftElasticity(), fc.RopeStretch(), DAMPED, LARGE],
}


@pytest.mark.parametrize("effects", SETS.values(), ids=SETS)
def test_marched_as_stepped(effects):
    model = fc.assemble(crane(), effects)
    assert can_be_flat(model)
    start = fc.equilibrium(model) if model.large else None
    runs = [
        fc.simulate(m, until=0.1, start=start, inputs={"torque": 0.4, "push": 3.0}, method=fc.GeneralizedAlpha(5e-4))
        for m in (model, model.with_(backend=fc.CasadiVM()))
    ]
    tight = 1e-5 if model.large else 1e-9  # marches of nonlinear models stop Newton at a share of the step's error
    for name in runs[0].outputs:
        scale = max(1e-3, float(np.abs(runs[1][name]).max()))
        assert runs[0][name] == pytest.approx(runs[1][name], abs=tight * scale)
    residuals, lost = zip(*((r.report.energy_residual, r.report.energy.dissipated) for r in runs), strict=True)
    assert max(residuals) < 1e-4
    assert lost[0] == pytest.approx(lost[1], rel=1e-4, abs=1e-9)
    assert np.ptp(runs[0]["x"]) > 1e-4


def test_a_march_is_as_good_as_new_for_the_next_run():
    model = fc.assemble(crane(), SETS["prestressed"])
    first, second = (
        fc.simulate(model, until=0.1, inputs={"push": 3.0}, method=fc.GeneralizedAlpha(2e-3))["x"] for _ in range(2)
    )
    assert np.array_equal(first, second)


def test_small_motion_under_a_sampled_controller_is_the_linear_models():
    """The march against `Exact` on the same equations."""
    model = fc.assemble(crane(), SETS["prestressed"])
    law = fc.Sampled(fc.design.pd(3.0, 0.4, measured="angle", rate="speed", command="torque"), 0.01)
    runs = [
        fc.simulate(model, law, until=0.5, inputs={"push": 3.0}, method=method, every=0.01)
        for method in (fc.GeneralizedAlpha(1e-4, 1.0), fc.Exact(0.01))
    ]
    for name in runs[0].outputs:
        scale = float(np.abs(runs[1][name]).max())
        assert runs[0][name] == pytest.approx(runs[1][name], abs=2e-4 * scale)


def test_jumps_of_fine_meshes_end_at_their_round_off(monkeypatch):
    """Stiff entries leave the accelerations of light freedoms few digits: no reason to leave the loops."""
    scene = fc.load_scene("examples/flexible_arm.toml")
    effects = [fc.GeometricStiffness() if isinstance(e, fc.LargeRotation) else e for e in scene.effects]
    plan = replace(scene.simulation, until=0.6)
    fine = scene.with_(structure=refine(scene.structure, 2), effects=effects, simulation=plan)
    asked, renew = [], Stepper.renew
    monkeypatch.setattr(Stepper, "renew", lambda self, *jump: asked.append(1) or renew(self, *jump))
    run = fine.run()
    assert run.report.steps > 300
    assert len(asked) < 5
    exact = fine.with_(simulation=replace(plan, method=fc.Exact(1e-3))).run()
    for name in run.outputs:
        np.testing.assert_allclose(run[name], exact[name], atol=2e-3 * np.abs(exact[name]).max())
