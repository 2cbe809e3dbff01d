"""Angles that outputs show: the integral of the spin over many turns, whatever carries it; and no jumps in tumbling."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

import flexctrl as fc
from flexctrl.model.state import State

E = fc.Section(EA=1e6, EI_y=1e4, EI_z=1e4, GJ=1e4, rhoA=2.0, rhoJ=1e-2)
METHODS = [fc.GeneralizedAlpha(0.01, 1.0), fc.ConservingMidpoint(0.01), fc.ExplicitRungeKutta(0.01)]
EFFECTS = [fc.Gravity((0.0, -9.81, 0.0)), fc.LargeRotation()]


def in_plane(name: str, at: tuple[float, float]) -> fc.RigidBody:
    x, y = at
    return fc.RigidBody(name, (x, y, 0), 1.0, (0.1, 0.1, 0.1), {"pin": (x - 0.3, y, 0), "end": (x + 0.3, y, 0)})


def tumbler() -> fc.Structure:
    """A double pendulum on hinges and a wheel that a drive turns at its end, all in one plane."""
    first, second, wheel = in_plane("first", (0.3, 0)), in_plane("second", (0.9, 0)), in_plane("wheel", (1.5, 0))
    joints = [fc.Support(first.point("pin"), "u v w rx ry")]
    joints += [fc.Hinge(first.point("end"), second.point("pin"), "z")]
    joints += [fc.Hinge(second.point("end"), wheel.point("pin"), "z")]
    drive = fc.RotaryDrive("motor", wheel.point("pin"), second.point("end"), axis="z", stiffness=1.0, inertia=0.1)
    pairs = {"first": (first, None), "second": (second, None), "joint": (second, first), "wheel": (wheel, second)}
    return fc.Structure([first, second, wheel], joints, [drive], outputs=shown(pairs))


def shown(pairs: dict) -> list:
    """The angle and the spin of each body against another."""
    outputs = []
    for name, (body, against) in pairs.items():
        minus = None if against is None else against.nodes[0]
        outputs += [
            fc.Rotation(name, body.nodes[0], "z", minus),
            fc.AngularVelocity(f"d_{name}", body.nodes[0], "z", minus),
        ]
    return outputs


def slider_crank() -> fc.Structure:
    crank = fc.Beam("crank", (0, 0, 0), (0.3, 0, 0), E)
    rod = fc.Beam("rod", crank.end, (1.1, 0, 0), E)
    joints = [fc.Support(crank.start, "u v w rx ry"), fc.Hinge(crank.end, rod.start, "z"), fc.Support(rod.end, "v w")]
    pairs = {"crank": (crank, None), "rod": (rod, None), "between": (rod, crank)}
    return fc.Structure([crank, rod], joints, outputs=shown(pairs))


def spun(structure: fc.Structure, method, until: float) -> fc.Run:
    model = fc.assemble(structure, EFFECTS)
    v = np.full(model.n, 12.0) if model.n == 1 else np.linspace(12.0, -17.0, model.n)
    return fc.simulate(model, until=until, start=model.rest.with_(v=v), method=method)


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS, ids=lambda m: type(m).__name__)
@pytest.mark.parametrize("machine", [tumbler, slider_crank])
def test_angles_are_integrals_of_spins(machine, method):
    """Nodes, hinges, drives, and parts that depend on others through a loop of rigid ones."""
    run = spun(machine(), method, 2.5)
    names = [name for name in run.outputs if f"d_{name}" in run.outputs]
    turns = {}
    for name in names:
        integral = cumulative_simpson(run[f"d_{name}"], x=run.t, initial=0.0)
        assert run[name] - run[name][0] == pytest.approx(integral, abs=0.1), name
        turns[name] = np.ptp(run[name]) / (2.0 * np.pi)
    assert max(turns.values()) > 2.0


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS, ids=lambda m: type(m).__name__)
def test_a_thousand_turns(method):
    """At a constant rate, with steps of three turns."""
    body = fc.RigidBody("body", (0, 0, 0), 1.0, (1.0, 2.0, 2.5))
    model = fc.assemble(fc.Structure([body], outputs=[fc.Rotation("angle", body.node, "z")]), [fc.LargeRotation()])
    start = model.rest.with_(v=np.array([0, 0, 0, 0, 0, 20.0 * np.pi]))
    run = fc.simulate(model, until=100.0, start=start, method=replace(method, step=0.3), every=0.5)
    assert run["angle"] == pytest.approx(20.0 * np.pi * run.t, abs=1e-6)


@pytest.mark.long
def test_a_body_that_tumbles_shows_no_jumps():
    """Turned over and over about all axes: the angle changes as the twist does, ½(a + b)/(½ + ½ a·b) · ω."""
    body = fc.RigidBody("body", (0, 0, 0), 1.0, (1.0, 2.0, 2.5))
    model = fc.assemble(fc.Structure([body], outputs=[fc.Rotation("angle", body.node, "z")]), [fc.LargeRotation()])
    start = model.rest.with_(v=np.array([0, 0, 0, 2.0, 3.0, 4.0]))
    run = fc.simulate(model, until=20.0, start=start, method=fc.ExplicitRungeKutta(0.05), every=0.02)
    assert np.abs(np.diff(run["angle"])).max() < np.pi

    def rate(state: State) -> float:
        a, b = np.array([0, 0, 1.0]), state.R[0][:, 2]
        return (a + b) @ state.v[3:] / (1.0 + a @ b)

    clear = [s for s in (run.at(t).state for t in np.linspace(0.5, 19.5, 60)) if s.R[0][2, 2] > -0.5]
    assert len(clear) > 10
    for state in clear:
        ahead, behind = (run.at(state.t + s)["angle"] for s in (1e-3, -1e-3))
        assert (ahead - behind) / 2e-3 == pytest.approx(rate(state), rel=1e-3, abs=1e-3)
