"""Results do not depend on the units that a machine is written in: lengths, masses and times from 1e-9 to 1e9.

Changed by powers of two hardly anything is rounded otherwise, so what depends on units at all shows at once.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from units import SI, Units

import flexctrl as fc

POWERS = [
    *[(a, 0, 0) for a in (-30, -20, 30)],
    *[(0, a, 0) for a in (-30, 30)],
    *[(0, 0, a) for a in (-30, -20, 30)],
    *[(-30, -30, -30), (-30, 30, 30), (30, -30, 30)],
]
Machine = tuple[fc.Model, dict[str, float], dict[str, float]]


def arm(u: Units) -> Machine:
    """Two slender links on geared motors, one of them held, under their weight."""
    section = u.section(1e7, 4e3, 3e3, 0.8, 1e-3)
    upper = fc.Beam("upper", (0, 0, 0), (u.length, 0, 0.1 * u.length), section, elements=2)
    fore = fc.Beam("fore", upper.end, (1.7 * u.length, 0.2 * u.length, 0.3 * u.length), section, elements=2)
    load = fc.PointMass("load", fore.end, 4 * u.mass)
    joints = [fc.Support(upper.start, "u v w rx ry"), fc.Hinge(upper.end, fore.start, "y"), fc.Pin(fore.end, load.node)]
    drives = [
        fc.RotaryDrive("shoulder", upper.start, axis="z", **shaft(u, 2.0, 1.2e-4), ratio=100.0),
        fc.RotaryDrive("elbow", fore.start, upper.end, axis="y", **shaft(u, 2.0, 1.2e-4), ratio=-100.0),
    ]
    machine = built(u, [upper, fore, load], joints, drives, load.node)
    return machine, {"elbow_source": 0.0}, {"shoulder_torque": 0.5 * u.force * u.length}


def crane(u: Units) -> Machine:
    """A girder on two travelling drives, a trolley with a winch, and a load that carries another on a rope."""
    girder = fc.Beam("girder", (0, -5 * u.length, 0), (0, 5 * u.length, 0), u.section(1e9, 2e8, 1e8, 1e3, 1e2), 2)
    trolley = fc.PointMass("trolley", girder.node(1), 5e3 * u.mass)
    hook = fc.PointMass("hook", (0, 0, -8 * u.length), 1e4 * u.mass)
    sling = fc.Rope("sling", hook.node, (0, 0, -10 * u.length), EA=1e7 * u.force)
    load = fc.PointMass("load", sling.end, 2e3 * u.mass)
    joints = [
        fc.Support(girder.start, held="v w ry"),
        fc.Support(girder.end, held="w ry"),
        fc.Pin(girder.node(1), trolley.node),
        fc.Pin(hook.node, sling.start),
        fc.Pin(sling.end, load.node),
    ]
    wheel = shaft(u, 500.0, 0.3) | {"radius": 0.3 * u.length, "ratio": 30.0, "direction": "x"}
    drum = {"radius": 0.4 * u.length, "ratio": 20.0, "inertia": 3.0 * u.mass * u.length**2}
    drives = [
        fc.LinearDrive("left", girder.start, **wheel),
        fc.LinearDrive("right", girder.end, **wheel),
        fc.Winch("hoist", hook.node, trolley.node, EA=5e7 * u.force, **drum),
    ]
    machine = built(u, [girder, trolley, hook, sling, load], joints, drives, load.node)
    pull = 50 * u.force * u.length
    return machine, {"hoist_source": 2.0}, {"left_torque": pull, "right_torque": 2 * pull, "hoist_torque": -45 * pull}


def frame(u: Units) -> Machine:
    """A portal with a hinge in its corner and a body on its beam, pushed out of its plane."""
    section = u.section(1e6, 1e3, 8e2, 2.0, 1e-2)
    left = fc.Beam("left", (0, 0, 0), (0, 0, 2 * u.length), section, elements=2)
    top = fc.Beam("top", left.end, (3 * u.length, 0, 2 * u.length), section, elements=2)
    right = fc.Beam("right", top.end, (3 * u.length, 0, 0), section, elements=2)
    inertia = tuple(a * u.mass * u.length**2 for a in (0.1, 0.2, 0.3))
    foot = {"foot": top.node(1).position}
    body = fc.RigidBody("body", (1.5 * u.length, 0, 2.2 * u.length), 5 * u.mass, inertia, foot)
    joints = [
        fc.Support(left.start),
        fc.Weld(left.end, top.start),
        fc.Hinge(top.end, right.start, "y"),
        fc.Support(right.end, "u v w rx rz"),
        fc.Weld(top.node(1), body.point("foot")),
    ]
    return built(u, [left, top, right, body], joints, [], top.node(1)), {}, {"push": 20 * u.force}


def linkage(u: Units) -> Machine:
    """A rigid four-bar linkage on a spring: loops of rigid parts are closed by degrees of freedom that follow."""
    ends = [(0, 0, 0), (0.2, 0, 0.5), (1.3, 0, 0.9), (1.0, 0, 0)]
    places = [tuple(c * u.length for c in place) for place in ends]
    section = u.section(900.0, 40.0, 30.0, 0.8, 0.02)
    bars = [fc.Beam(f"bar{i}", places[i], places[i + 1], section) for i in range(3)]
    spring = fc.Spring("spring", bars[1].start, places[3], stiffness=300 * u.force / u.length)
    joints = [
        *(fc.Support(node, "u v w rx rz") for node in (bars[0].start, bars[2].end)),
        *(fc.Hinge(a.end, b.start, "y") for a, b in pairwise(bars)),
        fc.Pin(bars[1].start, spring.start),
        fc.Support(spring.end, "u v w"),
    ]
    motor = fc.RotaryDrive("crank", bars[0].start, axis="y", **shaft(u, 9.0, 0.1), ratio=2.0)
    machine = built(u, [*bars, spring], joints, [motor], bars[1].end, rigid=True)
    return machine, {}, {"crank_torque": 3.0 * u.force * u.length}


def shaft(u: Units, stiffness: float, inertia: float) -> dict[str, float]:
    stiff = u.force * u.length
    return {"stiffness": stiffness * stiff, "inertia": inertia * u.mass * u.length**2, "damping": 1e-3 * stiff * u.time}


def built(u: Units, elements, joints, drives, at: fc.Node, rigid: bool = False) -> fc.Model:
    inputs = [fc.Force("push", at, "y"), *(fc.MotorTorque(f"{d.name}_torque", d) for d in drives)]
    outputs = [fc.Position(axis, at, axis) for axis in "xyz"]
    structure = fc.Structure(elements, joints, drives, inputs, outputs)
    flexible = [] if rigid else [fc.Flexible(), fc.RayleighDamping(beta=1e-3 * u.time)]
    return fc.assemble(structure, [u.gravity(), fc.LargeRotation(), *flexible])


def found(machine: Callable[[Units], Machine], u: Units) -> dict[str, np.ndarray]:
    """Equilibrium, modes, poles and a run, without units."""
    model, hold, inputs = machine(u)
    rest = fc.equilibrium(model, hold=hold)
    linear = fc.linearize(model, at=rest)
    run = fc.simulate(model, until=0.1 * u.time, inputs=inputs, start=rest)
    poles = linear.damped_poles() * u.time
    return {
        "equilibrium": np.array([rest.outputs[axis] for axis in "xyz"]) / u.length,
        "frequencies": np.sort(linear.modes().frequencies) * u.time,
        "poles": np.sort(np.abs(poles)) + 1j * np.sort(poles.real),
        "run": np.array([run[axis][-1] for axis in "xyz"]) / u.length,
        "steps": np.array([run.report.steps, run.report.rejected_steps, run.report.newton_iterations]),
    }


@pytest.fixture(scope="module")
def in_si() -> dict[str, dict[str, np.ndarray]]:
    return {machine.__name__: found(machine, SI) for machine in (arm, crane, frame, linkage)}


@pytest.mark.parametrize("powers", POWERS, ids=str)
@pytest.mark.parametrize("machine", [arm, crane, frame, linkage], ids=lambda f: f.__name__)
def test_any_units_give_the_same(in_si, machine, powers):
    ours, reference = found(machine, Units(*(2.0**p for p in powers))), in_si[machine.__name__]
    allowed = {"equilibrium": 1e-10, "frequencies": 1e-11, "poles": 1e-11, "run": 1e-10, "steps": 0.0}
    for name, value in reference.items():
        assert np.abs(ours[name] - value).max() <= allowed[name] * np.abs(value).max(), name
