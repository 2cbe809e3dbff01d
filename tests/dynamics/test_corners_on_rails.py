"""A trolley that is driven through play and a lag, on a girder that bends: compiled runs are plain ones, events too."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import Step, Tracking, pd
from flexctrl.dynamics.alpha import method as alpha

PLAY, LAG = fc.Backlash({"wheels": 0.02}), fc.MotorLag({"wheels": 0.01})
EFFECTS = {"neither": (), "play": (PLAY,), "lag": (LAG,), "both": (PLAY, LAG)}
PD = pd(20.0, 0.5, measured="angle", rate="speed", command="torque")
LAWS = {"none": None, "sampled": fc.Sampled(Tracking(PD, {"angle": Step(0.2)}), 0.02)}
METHODS = {"fixed": fc.GeneralizedAlpha(2.3e-3), "adaptive": fc.AdaptiveAlpha()}
EXACT = fc.Tolerance(1e-5, 1e-12)


def crab(*effects: fc.Effect, flexible: bool = True) -> fc.Model:
    """A trolley on a girder of two elements, or on a rigid one; its shaft damps where it is in touch."""
    girder = fc.Beam("girder", (0, 0, 0), (4, 0, 0), fc.Section.tube(fc.STEEL, 0.03, 0.002), elements=2)
    trolley = fc.Trolley("trolley", girder, at=1.3, mass=5.0)
    drive = fc.LinearDrive(
        "wheels", trolley.travel, direction="x", radius=0.2, stiffness=400.0, inertia=0.1, damping=0.3
    )
    machine = fc.Structure(
        [girder, trolley],
        [fc.Support(girder.start, "u v w rx rz"), fc.Support(girder.end, "v w rx rz")],
        [drive],
        [fc.MotorTorque("torque", drive)],
        [fc.Position("x", trolley.travel, "x"), fc.DriveAngle("angle", drive), fc.DriveSpeed("speed", drive)],
    )
    bends = (fc.BeamFlexibility(),) if flexible else ()
    return fc.assemble(machine, [fc.Gravity(), fc.LargeRotation(), fc.ShaftElasticity(), *bends, *effects])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("effects", EFFECTS)
@pytest.mark.parametrize("flexible", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["rigid", "flexible"])
def test_compiled_runs_are_plain_ones(flexible, effects, law, method, monkeypatch):
    pytest.importorskip("llvmlite")
    model = crab(*EFFECTS[effects], flexible=flexible)
    # fixed steps solved as exactly as can be; chosen ones are, at their default tolerance
    asked = {"until": 0.25, "method": METHODS[method], "tolerance": EXACT if method == "fixed" else fc.Tolerance()}
    asked |= {"inputs": {"torque": 1.0}} if law == "none" else {"controller": LAWS[law]}
    run = fc.simulate(model, **asked)
    monkeypatch.setattr(alpha, "_quickest", lambda plain: plain)
    plain = fc.simulate(model, **asked)
    assert run.status is plain.status is fc.Status.FINISHED
    assert [(e.name, e.rising) for e in run.events] == [(e.name, e.rising) for e in plain.events]
    assert (len(run.events) > 1) == ("play" in effects or effects == "both")
    # where a force jumps, a step ends up to 1e-4 of its length before the corner, as rounding has it
    assert [e.t for e in run.events] == pytest.approx([e.t for e in plain.events], abs=1e-6)
    assert (run.report.steps, run.report.rejected_steps) == (plain.report.steps, plain.report.rejected_steps)
    for name in run.outputs:
        scale = np.abs(plain[name]).max()
        assert np.interp(run.t, plain.t, plain[name]) == pytest.approx(run[name], abs=1e-5 * scale)
