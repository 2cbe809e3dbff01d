"""Dry friction in compiled loops: it slides, sticks, breaks loose and is held as plain steps have it."""

from __future__ import annotations

import numpy as np
import pytest
from test_march_first_order import PACES, TIGHT, Rocking, slewing
from test_sticking_under_control import model as geared

import flexctrl as fc
from flexctrl.design import FilteredRate, Step, Tracking, pd
from flexctrl.dynamics.march.stepper import MarchingStepper

pytest.importorskip("llvmlite")

LAWS = {"even": fc.Coulomb(0.15), "stribeck": fc.Coulomb(0.1, 0.15, 0.3)}
PD = Tracking(pd(20.0, 5.0, measured="angle", rate=FilteredRate(0.02), command="torque"), {"angle": Step(1.0)})


def slid(law: fc.Coulomb, rigid: bool = False) -> fc.Model:
    return slewing(rigid, fc.CoulombFriction({"motor": law, "winch": 1.0}))


def both(model: fc.Model, monkeypatch: pytest.MonkeyPatch, *controller, **how) -> tuple[fc.Run, fc.Run, int]:
    """A marched run and one by plain steps; how many steps the march took by themselves."""
    taken, step = [], MarchingStepper.step
    with monkeypatch.context() as patch:
        patch.setattr(MarchingStepper, "step", lambda *given: taken.append(None) or step(*given))
        marched = fc.simulate(model, *controller, **how)
    with monkeypatch.context() as patch:
        patch.setattr("flexctrl.dynamics.alpha.method._quickest", lambda plain: plain)
        return marched, fc.simulate(model, *controller, **how), len(taken)


def lasting(run: fc.Run) -> list[fc.Occurrence]:
    """Its events but slips that are over as they begin: whether a sample tears loose may hang on the last digit."""
    found: list[fc.Occurrence] = []
    for event in run.events:
        if (
            found
            and (found[-1].name, found[-1].t, found[-1].rising) == (event.name, event.t, True)
            and not event.rising
        ):
            found.pop()
        else:
            found.append(event)
    return found


def alike(a: fc.Run, b: fc.Run) -> None:
    assert a.status is b.status is fc.Status.FINISHED
    assert (a.report.steps, len(a.t)) == (b.report.steps, len(b.t))
    ours, theirs = lasting(a), lasting(b)
    assert [(e.name, e.rising) for e in ours] == [(e.name, e.rising) for e in theirs]
    assert np.allclose([e.t for e in ours], [e.t for e in theirs], rtol=0.0, atol=1e-7)
    scale = np.abs(b.y).max(axis=0, initial=1.0)
    assert (np.abs(a.y - b.y) < 1e-5 * scale).all()  # speeds just after a switch move with its time
    assert np.allclose(a.final.q, b.final.q, rtol=0.0, atol=1e-7)
    for name in ("work", "dissipated", "kinetic", "stored"):
        ours, theirs = (getattr(run.report.energy, name) for run in (a, b))
        assert ours == pytest.approx(theirs, rel=1e-6, abs=1e-9)
    assert (a.final.dry.phase == b.final.dry.phase).all()


@pytest.mark.parametrize("pace", PACES)
@pytest.mark.parametrize("rigid", [True, False])
@pytest.mark.parametrize("law", LAWS)
def test_marched_friction_is_plain_friction(law, rigid, pace, monkeypatch):
    """A constant torque, then one to and fro: contacts stop, stick, are torn loose by samples and by what swings."""
    how = {"until": 0.2, "method": PACES[pace], "tolerance": TIGHT}
    a, b, _ = both(slid(LAWS[law], rigid), monkeypatch, inputs={"torque": 0.3, "hoist": 20.0}, **how)
    alike(a, b)
    a, b, _ = both(slid(LAWS[law], rigid), monkeypatch, Rocking(), inputs={"hoist": 20.0}, **how)
    alike(a, b)
    assert len(a.events) > 3


@pytest.mark.parametrize("method", [fc.GeneralizedAlpha(2e-3), fc.AdaptiveAlpha()], ids=["fixed", "adaptive"])
def test_a_lowered_law_is_asked_while_the_motor_sticks(method, monkeypatch):
    """To its target and to rest there: some tens of switches, and few steps but those that end at one."""
    a, b, alone = both(geared(), monkeypatch, fc.Sampled(PD, 0.01), until=3.5, method=fc.Unchecked(method))
    alike(a, b)
    assert {e.rising for e in a.events} == {True, False}
    assert alone < 12 * len(a.events)


def test_what_sticks_all_along_takes_no_step_by_itself(monkeypatch):
    """And does not move at all."""
    model = slid(fc.Coulomb(5.0))
    how = {"until": 0.2, "inputs": {"hoist": 20.0}, "method": fc.GeneralizedAlpha(1e-3)}
    a, b, alone = both(model, monkeypatch, Rocking(), **how)
    alike(a, b)
    assert alone == 1  # the winch sets out
    assert (a["speed"] == 0.0).all()
    assert (a["angle"] == 0.0).all()


def test_contacts_that_depend_on_each_other(monkeypatch):
    """Motor and joint of a rigid drive slip as one: in loops the stronger holds both, plain steps share it out."""
    wheel = fc.RigidBody("wheel", (0, 0, 0), 1.0, (1.0, 1.0, 1.0))
    structure = fc.Structure(
        [wheel],
        [fc.Support(wheel.node, "u v w rx ry")],
        [fc.RotaryDrive("motor", wheel.node, axis="z", stiffness=30.0, ratio=2.0, inertia=0.05)],
        [fc.MotorTorque("torque", "motor")],
        [fc.DriveAngle("angle", "motor")],
    )
    model = fc.assemble(structure, [fc.LargeRotation(), fc.CoulombFriction({"motor": 0.2, "wheel.rz": 0.3})])
    start = model.rest.with_(v=np.ones(model.n))
    a, b, alone = both(model, monkeypatch, until=4.0, start=start, method=fc.GeneralizedAlpha(0.01))
    alike(a, b)
    assert (a.final.v == 0.0).all()
    assert alone < 10


@pytest.mark.parametrize("method", [fc.GeneralizedAlpha(2e-3), fc.AdaptiveAlpha()], ids=["fixed", "adaptive"])
def test_samples_and_switches_go_on_bit_for_bit(method):
    """Cut anywhere; every event is told once."""
    how = {"method": method, "every": 0.013}
    model, law = geared(), fc.Sampled(PD, 0.01)
    whole = fc.simulate(model, law, until=1.5, **how)
    for cut in np.random.default_rng(1).uniform(0.05, 1.45, 6):
        half = fc.simulate(model, law, until=float(cut), **how)
        rest = fc.simulate(model, law, until=1.5, start=half.checkpoint, **how)
        assert np.array_equal(rest.final.q, whole.final.q)
        assert np.array_equal(rest.final.v, whole.final.v)
        assert [e.t for run in (half, rest) for e in run.events] == [e.t for e in whole.events]


def test_states_on_the_way_stick_and_slide_as_they_did(monkeypatch):
    a, b, _ = both(geared(), monkeypatch, fc.Sampled(PD, 0.01), until=3.5, method=fc.GeneralizedAlpha(2e-3))
    phases = np.array([[run.at(t).state.dry.phase[0] for run in (a, b)] for t in np.linspace(0.0, 3.5, 301)])
    assert set(phases[:, 1]) == {-1.0, 1.0, 2.0}
    assert (phases[:, 0] == phases[:, 1]).all()
