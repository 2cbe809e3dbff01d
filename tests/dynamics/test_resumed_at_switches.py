"""Runs over corners and switches stopped anywhere go on with the same bits, and tell each event once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from long_running import Damper, Leaning, small

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
    compare(MODELS[name](), None, tmp_path, method=method, events=events, every=0.02)


def compare(model: fc.Model, law: Any, folder: Path, end: float = END, **how: Any) -> fc.Run:
    """Stop a run near what happens in it, and go on; return it as it is without stopping."""
    whole = fc.simulate(model, law, until=end, **how)
    at = [event.t for event in whole.events]
    cuts = [*(t + d for t in at[1:4:2] for d in (-1e-4, 1e-4)), 0.777 * end]
    for cut in cuts:
        half = fc.simulate(model, law, until=cut, **how)
        half.checkpoint.save(folder / "stopped")
        rest = fc.simulate(model, law, until=end, start=fc.load_checkpoint(folder / "stopped"), **how)
        for part in ("q", "v", "x"):
            assert np.array_equal(getattr(rest.final, part), getattr(whole.final, part))
        for number in ("energy", "energy_residual", "steps", "rejected_steps", "newton_iterations", "factorisations"):
            assert getattr(rest.report, number) == getattr(whole.report, number), (cut, number)
        assert told(half, rest) == told(whole)
        assert all(event.t <= cut for event in half.events)
    return whole


class Swinging:
    """A sampled controller with a state, towards a reference that swings."""

    inputs, outputs, sample_time = ("angle", "speed"), ("torque",), 0.004

    def initial(self) -> np.ndarray:
        return np.zeros(1)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([4.0 * np.sin(40.0 * t) - 3.0 * y[0] - 0.5 * y[1] + x[0]])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x + 0.01 * y[:1]


PASSES = (fc.Event("passes", "angle", at=0.1), fc.Event("quick", "speed", at=0.5))
OTHERS = {
    "explicit": fc.ExplicitRungeKutta(),
    "explicit, fixed": fc.ExplicitRungeKutta(2e-3),
    "extrapolated": fc.Richardson(fc.GeneralizedAlpha(4e-3)),
    "extrapolated, chosen": fc.Richardson(fc.AdaptiveAlpha()),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_so_do_other_methods_under_a_sampled_controller(name, tmp_path):
    model = arm(fc.Backlash({"motor": 0.02}), fc.CoulombFriction({"motor": 0.7}))
    whole = compare(model, Swinging(), tmp_path, 0.03, method=OTHERS[name], events=PASSES, every=0.01)
    assert len(whole.events) > 2


@pytest.mark.parametrize("law", [None, Damper(), Leaning()], ids=["open", "sampled", "continuous"])
@pytest.mark.parametrize("step", [1e-3, 7e-3])
def test_so_do_exact_steps(law, step, tmp_path):
    events = (fc.Event("sinks", "tip", at=-1e-2), fc.Event("leans", "lean", at=0.03))
    whole = compare(small(), law, tmp_path, method=fc.Exact(step), events=events, every=0.01)
    assert len(whole.events) == 2
