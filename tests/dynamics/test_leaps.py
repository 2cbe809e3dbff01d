"""Exact steps in compiled loops are the exact steps: states, commands, rows and books."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import FilteredRate, MinimumJerk, OpenLoop, Ramp, Together, pid

pytest.importorskip("llvmlite")

H = 4e-3


def crane(*more: fc.effects.effect.Effect) -> fc.Model:
    return fc.assemble(fc.cranes.ceiling_crane(), [fc.Gravity(), fc.Flexible(), fc.GeometricStiffness(), *more])


def law() -> fc.Saturated:
    inner = pid(900.0, 200.0, 30.0, measured="travel", rate=FilteredRate(0.01), command="push")
    follow = fc.Tracking(inner, {"travel": MinimumJerk(0.3, 0.2, at=0.02)})
    return fc.Saturated(fc.Sampled(follow, H), {"push": 120.0})


def both(model: fc.Model, monkeypatch: pytest.MonkeyPatch, **how) -> tuple[fc.dynamics.run.Run, fc.dynamics.run.Run]:
    leapt = fc.simulate(model, **how)
    with monkeypatch.context() as patch:
        patch.setattr("flexctrl.dynamics.march.marching.can_march", lambda model: False)
        return leapt, fc.simulate(model, **how)


@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.parametrize("every", [None, 2 * H, 3.1e-3])
def test_leaps_are_exact_steps(every, damped, monkeypatch):
    model = crane(*([fc.RayleighDamping(0.1, 1e-3)] if damped else []))
    how = {"controller": law(), "until": 0.1, "method": fc.Exact(H / 2), "every": every}
    a, b = both(model, monkeypatch, **how)
    assert a.report.steps == b.report.steps
    assert np.allclose(a.t, b.t, rtol=1e-12)
    assert np.allclose(a.y, b.y, rtol=1e-9, atol=1e-10)
    assert np.allclose(a.u, b.u, rtol=1e-8, atol=1e-8)
    assert a.report.energy.work == pytest.approx(b.report.energy.work, rel=1e-7)
    assert a.report.energy.dissipated == pytest.approx(b.report.energy.dissipated, rel=1e-6, abs=1e-12)
    for t in (0.0, 0.0123, 0.05, 0.1):
        assert np.allclose(a.at(t).state.x, b.at(t).state.x, rtol=0.0, atol=1e-9)


def test_the_books_balance():
    run = fc.simulate(crane(fc.RayleighDamping(0.1, 1e-3)), law(), until=0.2, method=fc.Exact(H))
    assert run.report.energy.dissipated > 0.1
    assert run.report.energy_residual < 1e-6


def test_the_length_of_steps_makes_no_difference():
    runs = [fc.simulate(crane(), inputs={"push": 300.0}, until=0.1, method=fc.Exact(h)) for h in (1e-3, 2.5e-2)]
    assert np.allclose(runs[0].final.q, runs[1].final.q, rtol=0.0, atol=1e-9)


def test_leaps_go_on_bit_for_bit():
    how = {"method": fc.Exact(H / 2), "controller": OpenLoop({"push": Ramp(300.0)}, H)}
    whole = fc.simulate(crane(), until=0.1, **how)
    half = fc.simulate(crane(), until=0.05, **how)
    rest = fc.simulate(crane(), until=0.1, start=half.checkpoint, **how)
    assert np.allclose(rest.final.q, whole.final.q, rtol=0.0, atol=1e-13)
    assert rest.report.steps == whole.report.steps


def test_few_modes_are_a_reduced_linear_model():
    """Exact steps of some modes against modal truncation of the linear model; what is left out keeps its place."""
    model = crane(fc.RayleighDamping(0.1, 1e-3))
    rest = fc.equilibrium(model)
    linear = fc.linearize(model, at=rest)
    for count in (0, 5, 11):
        few = fc.simulate(model, until=0.1, start=rest, inputs={"push": 300.0}, method=fc.Exact(H, modes=count))
        reduced = linear.reduce(fc.ModalTruncation(linear.modes().rigid + count)).linear
        told = fc.simulate(reduced, until=0.1, inputs={"push": 300.0}, method=fc.Exact(H))
        moved = few.y - np.array([rest.outputs[name] for name in few.outputs])
        # links that turn about themselves at 2.5e-4 Hz are told from free motion to a ten-millionth
        assert np.allclose(moved, told.y, rtol=0.0, atol=1e-7 if count == 0 else 1e-9)
        assert few.report.energy_residual < 1e-6
        slowest = linear.modes().frequencies[linear.modes().rigid + count]
        [said] = [note for note in few.report.notes if "no error told counts" in note]
        assert f"from {slowest:.2g}" in said.replace(f"{slowest:.3g}", f"{slowest:.2g}")


def test_all_modes_are_the_whole_model_and_few_march_as_they_step(monkeypatch):
    model, how = crane(fc.RayleighDamping(0.1, 1e-3)), {"inputs": {"push": 300.0}, "until": 0.05}
    whole = fc.simulate(model, method=fc.Exact(H), **how)
    assert not any("no error told counts" in note for note in whole.report.notes)
    assert np.array_equal(fc.simulate(model, method=fc.Exact(H, modes=1000), **how).y, whole.y)
    a, b = both(model, monkeypatch, method=fc.Exact(H, modes=4), controller=law(), until=0.05)
    assert np.allclose(a.y, b.y, rtol=1e-9, atol=1e-10)
    for wrong in (-1, 2.5):
        with pytest.raises(fc.errors.StructureError, match="modes"):
            fc.Exact(H, modes=wrong)


def swinging() -> tuple[fc.Model, fc.Saturated]:
    """A load on a rope below a trolley on an elastic shaft: what is small of it, with outputs of every plain kind."""
    rope = fc.Rope("rope", start=(0, 0, 0), end=(0, 0, -2), EA=1e5)
    trolley, load = fc.PointMass("trolley", at=rope.start, mass=40.0), fc.PointMass("load", at=rope.end, mass=20.0)
    drive = fc.LinearDrive(
        "drive", node=rope.start, direction="x", radius=0.1, ratio=10.0, stiffness=50.0, inertia=0.01
    )
    structure = fc.Structure(
        elements=[rope, trolley, load],
        joints=[fc.Support(rope.start, held="v w"), fc.Pin(rope.start, trolley.node), fc.Pin(rope.end, load.node)],
        drives=[drive],
        inputs=[fc.MotorTorque("torque", drive="drive"), fc.Force("lift", at=rope.end, direction="z")],
        outputs=[
            fc.DriveAngle("angle", drive="drive"),
            fc.DriveSpeed("speed", drive="drive"),
            fc.SwayAngle("sway", top=rope.start, load=rope.end, direction="x"),
            fc.Velocity("rate", at=rope.end, minus=rope.start, direction="x"),
        ],
    )
    effects = [fc.Gravity(), fc.Flexible(), fc.GeometricStiffness(), fc.RayleighDamping(0.05, 1e-3)]
    return fc.assemble(structure, effects), pid(4.0, 0.0, 1.0, measured="angle", rate="speed", command="torque")


def test_leaps_on_modal_states_alone_see_ropes_and_drives(monkeypatch):
    model, inner = swinging()
    follow = fc.Tracking(fc.Sampled(inner, H), {"angle": MinimumJerk(20.0, 0.3, at=0.02)})
    how = {"controller": follow, "until": 0.6, "method": fc.Exact(H), "every": H, "start": fc.equilibrium(model)}
    a, b = both(model, monkeypatch, **how)
    assert np.abs(b["sway"]).max() > 1e-3
    assert np.allclose(a.y, b.y, rtol=1e-8, atol=1e-10)
    assert a.report.energy.dissipated == pytest.approx(b.report.energy.dissipated, rel=1e-6)
    assert np.allclose(a.final.q, b.final.q, rtol=1e-9, atol=1e-11)


def test_leaps_end_where_a_rope_goes_slack(monkeypatch):
    model, _ = swinging()
    how = {"inputs": {"lift": 300.0}, "until": 0.2, "method": fc.Exact(H), "every": H}
    a, b = both(model, monkeypatch, start=fc.equilibrium(model).state, **how)
    assert [e.name for e in a.events] == [e.name for e in b.events] != []
    assert [e.t for e in a.events] == pytest.approx([e.t for e in b.events], rel=1e-9)
    assert np.allclose(a.y, b.y, rtol=1e-8, atol=1e-10)


def test_leaps_turn_what_shows_its_rotation(monkeypatch):
    effects = [fc.Gravity(), fc.Flexible(), fc.GeometricStiffness(), fc.RayleighDamping(0.0, 1e-3)]
    model = fc.assemble(fc.cranes.flexible_arm(), effects)
    how = {"inputs": {"shoulder_torque": 0.1, "elbow_torque": -0.05}, "until": 0.3, "method": fc.Exact(H), "every": H}
    a, b = both(model, monkeypatch, **how)
    assert np.abs(b["elbow"]).max() > 0.01
    assert np.allclose(a.y, b.y, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize(
    "lags", [{"left_drive": 0.05, "right_drive": 0.05}, {"left_drive": 0.03}, {"left_drive": 1e-5}]
)
def test_leaps_hold_motor_lags(lags, monkeypatch):
    """A lag is linear: its torque is a modal state beside the others, coupled with all that the motor moves."""
    model = fc.assemble(
        fc.cranes.bridge_crane(),
        [fc.Gravity(), fc.Flexible(), fc.GeometricStiffness(), fc.RayleighDamping(0.01, 1e-3), fc.MotorLag(lags)],
    )
    loops = [
        pid(40.0, 0.0, 8.0, measured=f"{side}_angle", rate=FilteredRate(0.02), command=f"{side}_torque")
        for side in ("left", "right")
    ]
    law = fc.Saturated(
        fc.Sampled(
            Together(
                *(
                    fc.Tracking(p, {f"{s}_angle": MinimumJerk(2.0, 0.4)})
                    for p, s in zip(loops, ("left", "right"), strict=True)
                )
            ),
            0.02,
        ),
        {"left_torque": 30.0, "right_torque": 30.0},
    )
    how = {"controller": law, "until": 0.6, "method": fc.Exact(0.01), "every": 0.02, "start": fc.equilibrium(model)}
    a, b = both(model, monkeypatch, **how)
    for name in a.outputs:
        assert np.allclose(a[name], b[name], rtol=1e-9, atol=1e-9 * (1.0 + np.abs(b[name]).max()))
    assert np.allclose(a.final.q, b.final.q, rtol=1e-9, atol=1e-10)
    assert a.report.energy.work == pytest.approx(b.report.energy.work, rel=1e-9)
    assert a.report.energy.dissipated == pytest.approx(b.report.energy.dissipated, rel=1e-9)
    assert max(a.report.energy_residual, b.report.energy_residual) < 1e-6
