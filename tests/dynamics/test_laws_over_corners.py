"""What a law remembers goes on from sample to sample, whatever corners and switches the machine meets meanwhile.

Commands that stay as they are for many samples, while states behind them go on: nothing else tells that they do.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import control
import numpy as np
import pytest

import flexctrl as fc

SAMPLE, UNTIL = 0.01, 0.4
METHODS = {
    "alpha": fc.GeneralizedAlpha(2e-3),
    "chosen": fc.AdaptiveAlpha(),
    "conserving": fc.ConservingMidpoint(2e-3),
    "explicit": fc.ExplicitRungeKutta(),
    "extrapolated alpha": fc.Richardson(fc.GeneralizedAlpha(2e-3)),
    "extrapolated, chosen": fc.Richardson(fc.AdaptiveAlpha()),
    "extrapolated conserving": fc.Richardson(fc.ConservingMidpoint(2e-3)),
}
EFFECTS = {
    "play": lambda: [fc.Backlash({"left": 0.02})],
    "slack rope": list,
    "dry friction": lambda: [fc.CoulombFriction({"cart.u": 3.0})],
    "bristles": lambda: [fc.LuGreFriction({"cart.u": fc.LuGre(2e3, kinetic=2.0, static=3.0)})],
    "motor lag": lambda: [fc.MotorLag({"drive": 0.02}), fc.Backlash({"left": 0.02})],
}
RATES = {"bristles", "motor lag"}
REFUSED = {
    "conserving": {"dry friction", *RATES},
    "extrapolated conserving": {"dry friction", *RATES},
    "explicit": RATES,
}
LONG = "extrapolated, chosen"
CASES = [
    pytest.param(method, kind, marks=[pytest.mark.long] if method == LONG and kind != "play" else [])
    for method in METHODS
    for kind in EFFECTS
    if kind not in REFUSED.get(method, ())
]


@cache
def rattling(kind: str) -> fc.Model:
    """A cart on a motor's shaft that swings at 63 rad/s between springs, or between ropes that go slack in turn."""
    cart = fc.PointMass("cart", (0, 0, 0), 1.0)
    ends = {"left": (-1, 0, 0), "right": (1, 0, 0)}
    if kind == "slack rope":
        lines = [fc.Rope(name, at, cart.node, EA=4e3) for name, at in ends.items()]
    else:
        lines = [fc.Spring("left", ends["left"], cart.node, stiffness=4e3)]
    drive = fc.LinearDrive(
        "drive", cart.node, direction="x", radius=0.1, ratio=1.0, stiffness=10.0, inertia=1e-3, damping=0.01
    )
    joints = [j for line in lines for j in (fc.Support(line.start), fc.Pin(line.end, cart.node))]
    outputs = [fc.Position("x", cart.node, "x"), fc.Velocity("v", cart.node, "x")]
    structure = fc.Structure(
        [cart, *lines], [*joints, fc.Support(cart.node, "v w")], [drive], [fc.MotorTorque("torque", drive)], outputs
    )
    return fc.assemble(structure, [fc.LargeRotation(), fc.ShaftElasticity(), fc.RopeStretch(), *EFFECTS[kind]()])


class Count:
    """A torque from the thirtieth sample on."""

    inputs, outputs, sample_time = ("x",), ("torque",), SAMPLE

    def initial(self) -> np.ndarray:
        return np.zeros(1)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([0.2 if x[0] >= 30.0 else 0.0])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x + 1.0


def integral(gain: float) -> Any:
    law = control.ss([[1.0]], [[SAMPLE]], [[gain]], [[0.0]], SAMPLE, inputs=["x"], outputs=["torque"])
    return fc.Tracking(law, {"x": lambda t: 1.0 if t < 0.2 else -1.0})


def proportional() -> Any:
    law = control.ss([], [], [], [[0.1]], SAMPLE, inputs=["x"], outputs=["torque"])
    return fc.Tracking(law, {"x": lambda t: 0.0 if t < 0.2 else 1.0})


LAWS = {
    "count": Count,
    "delayed": lambda: fc.Delayed(fc.Quantised(proportional(), {"x": 0.1}), 3),
    "integral at its limit": lambda: fc.Saturated(integral(5.0), {"torque": 0.1}),
    "integral in few steps": lambda: fc.Quantised(integral(1.0), {"torque": 0.1}),
}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("method", "kind"), CASES)
def test_states_at_samples_are_those_of_the_law_by_itself(method, kind, law):
    """Asked again for what it has read at each sample, once and in order, it says the same."""
    model, asked = rattling(kind), LAWS[law]()
    start = model.rest.with_(v=model.rest.v + np.eye(model.n)[0])
    run = fc.simulate(model, asked, until=UNTIL, method=METHODS[method], every=SAMPLE, start=start)
    assert run.status is fc.Status.FINISHED
    assert kind == "bristles" or len(run.events) > 4
    x, said = asked.initial(), []
    for t, y in zip(run.t[:-1], run["x"][:-1, None], strict=True):
        said.append(asked.command(t, x, y)[0])
        x = asked.update(t, x, y)
    assert np.ptp(said) > 0.0
    assert np.array_equal(run.u[:-1, 0], said)
    assert np.array_equal(run.checkpoint.point.supply.x, x)
