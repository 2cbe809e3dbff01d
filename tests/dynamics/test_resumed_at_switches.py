"""Runs over corners and switches stopped anywhere go on with the same bits, and tell each event once."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

END = 0.1


def arm(*effects: fc.Effect) -> fc.Model:
    """A geared arm that falls."""
    link = fc.RigidBody("link", (0.5, 0, 0), 2.0, (0.01, 0.1, 0.1), {"hinge": (0, 0, 0)})
    hinge = link.point("hinge")
    motor = fc.RotaryDrive("motor", hinge, axis="y", stiffness=3e3, ratio=5.0, inertia=1e-2, damping=0.1)
    structure = fc.Structure(
        [link],
        [fc.Support(hinge, "u v w rx rz")],
        [motor],
        [fc.MotorTorque("torque", motor)],
        [fc.DriveAngle("angle", motor), fc.DriveSpeed("speed", motor)],
    )
    return fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), fc.ShaftElasticity(), *effects])


MODELS = {
    "play": lambda: arm(fc.Backlash({"motor": 0.02})),
    "friction": lambda: arm(fc.CoulombFriction({"motor": 1.5})),
    "bristles and play": lambda: arm(
        fc.Backlash({"motor": 0.02}), fc.LuGreFriction({"motor": fc.LuGre(1e3, kinetic=1.0, static=1.5)})
    ),
}
METHODS = [fc.AdaptiveAlpha(), fc.GeneralizedAlpha(5e-3)]


def told(*runs: fc.Run) -> list[tuple[str, float, bool]]:
    return [(event.name, event.t, event.rising) for run in runs for event in run.events]


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS, ids=["adaptive", "fixed"])
@pytest.mark.parametrize(
    "events",
    [pytest.param((), marks=pytest.mark.long), (fc.Event("passes", "angle", at=0.3),)],
    ids=["", "event"],
)
@pytest.mark.parametrize("name", MODELS)
def test_every_cut_gives_the_same_bits_and_tells_each_event_once(name, events, method, tmp_path):
    """Just before and after what happens, where the step that the end cuts short meets it, and anywhere."""
    model, how = MODELS[name](), {"method": method, "events": events, "every": 0.02}
    whole = fc.simulate(model, until=END, **how)
    at = [event.t for event in whole.events]
    cuts = [*(t + d for t in at[1:4:2] for d in (-1e-4, 1e-4)), 0.0777]
    for cut in cuts:
        half = fc.simulate(model, until=cut, **how)
        half.checkpoint.save(tmp_path / "stopped")
        rest = fc.simulate(model, until=END, start=fc.load_checkpoint(tmp_path / "stopped"), **how)
        for part in ("q", "v", "x"):
            assert np.array_equal(getattr(rest.final, part), getattr(whole.final, part))
        for number in ("energy", "energy_residual", "steps", "rejected_steps", "newton_iterations", "factorisations"):
            assert getattr(rest.report, number) == getattr(whole.report, number), (cut, number)
        assert told(half, rest) == told(whole)
        assert all(event.t <= cut for event in half.events)
