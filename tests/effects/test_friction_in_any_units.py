"""Dry friction sticks, breaks loose and slides alike in any consistent units: the same steps, events and motion (D11).

And a motor whose torque lags is not torn loose at a sample by a torque that it does not have yet, compiled or not.
"""

from __future__ import annotations

import numpy as np
import pytest
from units import OTHERS, SI, Units

import flexctrl as fc

METHODS = {
    "adaptive alpha": lambda u: fc.AdaptiveAlpha(),
    "alpha": lambda u: fc.GeneralizedAlpha(0.01 * u.time),
    "explicit": lambda u: fc.ExplicitRungeKutta(),
    "extrapolated": lambda u: fc.Richardson(fc.GeneralizedAlpha(0.01 * u.time)),
}
LAWS = {"even": (10.0, 10.0, 0.0), "static": (10.0, 15.0, 0.0), "stribeck": (10.0, 15.0, 0.1)}
MASSES = {f"{m:.0e} kg": Units(1.0, m, 1.0) for m in (1e-18, 1e-12, 1e12)}
TIMES = {f"{t:.0e} s": Units(1.0, 1.0, t) for t in (1e-9, 1e3, 1e9)}
LADDER = {**OTHERS, **TIMES, "nm, fg, ns": Units(1e9, 1e18, 1e9)}


class Sine:
    """A command that swings, at samples or continuously."""

    inputs = ()
    outputs = ("push",)

    def __init__(self, most: float, rate: float, sample_time: float = 0.0) -> None:
        self.most, self.rate, self.sample_time = most, rate, sample_time

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([self.most * np.sin(self.rate * t)])


def block(u: Units, law: tuple[float, float, float]) -> fc.Model:
    """A kilogram on a spring and on dry ground."""
    mass = fc.PointMass("block", (u.length, 0, 0), u.mass)
    spring = fc.Spring("spring", (0, 0, 0), mass.node, stiffness=100.0 * u.force / u.length, length=u.length)
    structure = fc.Structure(
        [mass, spring],
        [fc.Support(spring.start, "u v w"), fc.Support(mass.node, "v w"), fc.Pin(spring.end, mass.node)],
        outputs=[fc.Position("x", mass.node, "x")],
        inputs=[fc.Force("push", mass.node, "x")],
    )
    kinetic, static, stribeck = law
    dry = fc.Coulomb(kinetic * u.force, static * u.force, stribeck * u.length / u.time)
    return fc.assemble(structure, [fc.LargeRotation(), fc.CoulombFriction({"block.u": dry})])


def pushed(u: Units, law: str, method: str, sample_time: float = 0.0) -> fc.Run:
    sine = Sine(30.0 * u.force, 3.0 / u.time, sample_time * u.time)
    return fc.simulate(block(u, LAWS[law]), sine, until=2.0 * u.time, every=0.05 * u.time, method=METHODS[method](u))


def rotor(u: Units, friction: float, sample_time: float) -> fc.Run:
    """A small rotor on a soft shaft, whose motor sticks."""
    turned, torque = u.mass * u.length**2, u.force * u.length
    disc = fc.RigidBody("disc", (0, 0, 0), 1e-9 * u.mass, (1e-18 * turned, 1e-18 * turned, 1.5e-18 * turned))
    shaft = {"stiffness": 1e-10 * torque, "inertia": 2e-19 * turned, "damping": 1e-17 * torque * u.time}
    drive = fc.RotaryDrive("drive", disc.node, axis="z", **shaft)
    structure = fc.Structure(
        [disc],
        [fc.Support(disc.node, "u v w rx ry")],
        drives=[drive],
        outputs=[fc.DriveAngle("angle", drive), fc.Rotation("turn", disc.node, "z")],
        inputs=[fc.MotorTorque("push", drive)],
    )
    dry = fc.Coulomb(friction * torque, 1.5 * friction * torque)
    model = fc.assemble(structure, [fc.LargeRotation(), fc.ShaftElasticity(), fc.CoulombFriction({"drive": dry})])
    sine = Sine(3e-12 * torque, 2000.0 / u.time, sample_time * u.time)
    return fc.simulate(model, sine, until=5e-3 * u.time, every=1e-4 * u.time)


def alike(run: fc.Run, other: fc.Run, units: Units, lengths: float) -> None:
    assert other.status is run.status is fc.Status.FINISHED
    assert (other.report.steps, other.report.rejected_steps) == (run.report.steps, run.report.rejected_steps)
    assert [(e.name, e.rising) for e in other.events] == [(e.name, e.rising) for e in run.events]
    assert len(run.events) > 2
    assert np.allclose([e.t / units.time for e in other.events], [e.t for e in run.events], rtol=1e-8, atol=0.0)
    assert np.abs(other.y / lengths - run.y).max() < 1e-8 * np.abs(run.y).max()


@pytest.mark.parametrize(
    ("method", "law"), [*((m, "stribeck") for m in METHODS), ("alpha", "even"), ("alpha", "static")]
)
def test_a_block_slips_alike_in_any_units_of_mass(method, law):
    run = pushed(SI, law, method)
    for units in MASSES.values():
        alike(run, pushed(units, law, method), units, 1.0)


@pytest.mark.parametrize("method", ["adaptive alpha", "alpha"])
@pytest.mark.parametrize("sample_time", [0.0, 0.02])
def test_a_block_slips_alike_in_any_units(method, sample_time):
    run = pushed(SI, "static", method, sample_time)
    for units in LADDER.values():
        alike(run, pushed(units, "static", method, sample_time), units, units.length)


@pytest.mark.parametrize("sample_time", [0.0, 2e-5])
def test_what_is_as_small_as_it_gets_slips_as_in_units_of_its_own(sample_time):
    run, small = rotor(SI, 1e-12, sample_time), Units(1e6, 1e12, 1e6)
    alike(run, rotor(small, 1e-12, sample_time), small, 1.0)


@pytest.mark.parametrize("units", [SI, *TIMES.values(), Units(1e-9, 1.0, 1e9)], ids=str)
def test_what_slides_as_a_run_begins_slides_however_long_the_unit_of_time(units):
    mass = fc.PointMass("block", (units.length, 0, 0), 2.0 * units.mass)
    structure = fc.Structure([mass], [fc.Support(mass.node, "v w")], outputs=[fc.Position("x", mass.node, "x")])
    model = fc.assemble(structure, [fc.LargeRotation(), fc.CoulombFriction({"block.u": units.force})])
    start = model.rest.with_(v=np.array([0.1 * units.length / units.time]))
    run = fc.simulate(model, until=units.time, start=start)
    assert run["x"][-1] / units.length - 1.0 == pytest.approx(0.01, rel=1e-9)
    assert [e.t / units.time for e in run.events] == pytest.approx([0.2])


class Follow:
    """A sampled law, stiff enough to command more than what sticks bears at once."""

    inputs, outputs, sample_time = ("angle", "speed"), ("torque",), 0.013

    def initial(self) -> np.ndarray:
        return np.zeros(1)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([6.0 * np.sin(2.0 * t) - 0.3 * y[1] + x[0]])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 0.9 * x + 0.1 * (np.sin(t) - y[:1])


def lagging(backend: fc.CasadiVM | None) -> fc.Model:
    disc = fc.RigidBody("disc", (0, 0, 0), 1.0, (1.5, 1.5, 1.5))
    drive = fc.RotaryDrive("drive", disc.node, axis="z", stiffness=100.0, inertia=0.2, damping=0.01, ratio=3.0)
    structure = fc.Structure(
        [disc],
        [fc.Support(disc.node, "u v w rx ry")],
        drives=[drive],
        outputs=[fc.DriveAngle("angle", drive), fc.DriveSpeed("speed", drive)],
        inputs=[fc.MotorTorque("torque", drive)],
    )
    rubs = fc.CoulombFriction({"drive": fc.Coulomb(1.0, 1.5, 0.1)})
    effects = [fc.LargeRotation(), fc.ShaftElasticity(), rubs, fc.MotorLag({"drive": 0.02})]
    return fc.assemble(structure, effects, backend)


@pytest.mark.parametrize("method", [fc.GeneralizedAlpha(0.0037), fc.AdaptiveAlpha()], ids=["fixed", "chosen"])
def test_a_command_that_lags_tears_nothing_loose_at_its_sample(method):
    """Compiled and plain runs tell the same: it breaks loose when the torque is there, 6 ms after the sample."""
    runs = [fc.simulate(lagging(b), Follow(), until=2.0, method=method) for b in (None, fc.CasadiVM())]
    told = [[(e.name, e.rising) for e in run.events] for run in runs]
    assert told[0] == told[1] == [("drive", True)] * 2
    assert np.allclose(*([e.t for e in run.events] for run in runs), rtol=0.0, atol=1e-5)
    assert runs[1].events[0].t % 0.013 > 0.004


def test_a_start_under_a_command_that_lags_tears_nothing_loose():
    """At the start the motor has no torque yet, whatever is commanded."""
    run = fc.simulate(lagging(fc.CasadiVM()), inputs={"torque": 2.0}, until=0.1, method=fc.GeneralizedAlpha(1e-3))
    assert [(e.name, e.rising) for e in run.events] == [("drive", True)]
    assert run.events[0].t == pytest.approx(0.02 * np.log(4.0), rel=1e-3)  # 2 (1 − e^(−t/T)) = 1.5


def travelling(u: Units) -> tuple[fc.Model, float]:
    """A trolley with dry friction, moved through play by a motor whose torque lags; a body's lever hangs from it."""
    turned, torque = u.mass * u.length**2, u.force * u.length
    trolley = fc.PointMass("trolley", (0, 0, 0), 80.0 * u.mass)
    load = fc.PointMass("load", (0.3 * u.length, 0, -2.7 * u.length), 35.0 * u.mass)
    hook = fc.RigidBody(
        "hook", (1.5 * u.length, 0, 0), 6.0 * u.mass, (0.4 * turned,) * 3, {"eye": (1.2 * u.length, 0, 0)}
    )
    spring = fc.Spring(
        "spring",
        (0, 0, 0),
        (1.2 * u.length, 0, 0),
        stiffness=2000.0 * u.force / u.length,
        damping=20.0 * u.force * u.time / u.length,
        length=1.25 * u.length,
    )
    drive = fc.LinearDrive(
        "drive",
        trolley.node,
        direction="x",
        radius=0.09 * u.length,
        ratio=12.0,
        stiffness=30.0 * torque,
        inertia=2e-3 * turned,
        damping=0.02 * torque * u.time,
    )
    winch = fc.Winch(
        "winch",
        load.node,
        trolley.node,
        EA=4e5 * u.force,
        damping=300.0 * u.force * u.time / u.length,
        radius=0.1 * u.length,
        ratio=8.0,
        inertia=0.05 * turned,
    )
    structure = fc.Structure(
        [trolley, load, hook, spring],
        [
            fc.Support(trolley.node, "v w"),
            fc.Support(load.node, "v"),
            fc.Support(hook.nodes[0], "v w rx rz"),
            fc.Pin(trolley.node, spring.start),
            fc.Pin(spring.end, hook.point("eye")),
        ],
        drives=[drive, winch],
        inputs=[fc.MotorTorque("push", drive), fc.MotorTorque("lift", winch)],
        outputs=[fc.Position("x", trolley.node, "x"), fc.DriveAngle("angle", drive)],
    )
    dry = fc.Coulomb(20.0 * u.force, 30.0 * u.force, 0.05 * u.length / u.time)
    effects = [
        fc.Gravity((0, 0, -9.81 * u.length / u.time**2)),
        fc.LargeRotation(),
        fc.ShaftElasticity(),
        fc.RopeStretch(),
        fc.Backlash({"drive": 0.2}),
        fc.MotorLag({"drive": 0.01 * u.time}),
        fc.CoulombFriction({"trolley.u": dry, "drive": 0.05 * torque}),
    ]
    return fc.assemble(structure, effects), torque


def test_levers_beside_a_torque_that_lags_are_solved_alike_in_any_units() -> None:
    runs = []
    for u in (SI, Units(1e6, 1e9, 1.0)):
        model, torque = travelling(u)
        sine, inputs = Sine(1.5 * torque, 6.0 / u.time, 0.01 * u.time), {"lift": -4.3 * torque}
        run = fc.simulate(model, sine, until=0.5 * u.time, every=0.01 * u.time, inputs=inputs)
        runs.append((run.report.steps, run.report.newton_iterations, run.y / [u.length, 1.0]))
    (steps, iterations, y), (others, other_iterations, z) = runs
    assert (steps, iterations) == (others, other_iterations)
    assert np.abs(y - z).max() < 1e-8
