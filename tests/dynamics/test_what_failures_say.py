"""What a run that fails says of it: when the law was asked, what is left of the balance, which steps are too long."""

from __future__ import annotations

import re

import numpy as np
import pytest

import flexctrl as fc

BACKENDS = {"compiled": None, "plain": fc.CasadiVM()}


def arm(backend: str = "compiled") -> fc.Model:
    """A flexible arm with a load, turned by a geared motor."""
    tube = fc.Section.tube(fc.STEEL, radius=0.03, thickness=0.002)
    beam = fc.Beam("arm", (0, 0, 0), (2, 0, 0), tube, elements=2)
    load = fc.PointMass("load", beam.end, 5.0)
    motor = fc.RotaryDrive("motor", beam.start, axis="z", stiffness=2.0, ratio=100, inertia=4e-3)
    structure = fc.Structure(
        [beam, load],
        [fc.Support(beam.start, "u v w rx ry"), fc.Pin(beam.end, load.node)],
        [motor],
        [fc.MotorTorque("torque", motor)],
        [fc.DriveAngle("angle", motor)],
    )
    effects = [fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(beta=1e-3)]
    return fc.assemble(structure, effects, BACKENDS[backend])


class Ending:
    """A law that answers zero up to an instant, and no number after it."""

    inputs, outputs = ("angle",), ("torque",)

    def __init__(self, sample_time: float, last: float) -> None:
        self.sample_time, self.last = sample_time, last

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([np.nan if t > self.last else 0.0])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("sample_time", [0.0, 1e-3], ids=["continuous", "sampled"])
def test_the_instant_is_that_at_which_the_law_was_asked(sample_time, backend):
    run = fc.simulate(arm(backend), Ending(sample_time, 0.05), until=0.1)
    assert run.status is fc.Status.FAILED
    told = re.search(
        r"commands nan for 'torque'.* \(t = ([\d.]+) s(?:; the run had come to t = ([\d.]+) s)?\)", run.report.message
    )
    asked, come = told.groups()
    assert float(asked) > 0.05
    assert float(come or asked) == pytest.approx(run.t[-1], rel=1e-5)
    assert (come is not None) == (sample_time == 0.0)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    ("method", "torque"),
    [(fc.GeneralizedAlpha(0.1), 1e12), (fc.ConservingMidpoint(0.5), 1e6), (fc.AdaptiveAlpha(), 1e49)],
    ids=lambda m: type(m).__name__,
)
def test_steps_that_do_not_converge_say_what_is_left(method, torque, backend):
    """Under torques like these the motor goes beyond all bounds within any step."""
    run = fc.simulate(arm(backend), until=5.0, inputs={"torque": torque}, method=method)
    assert run.status is fc.Status.FAILED
    told = re.search(r"forces on (\w+) are out of balance by ([\d.e+-]+) (N m|N)[;:]", run.report.message)
    assert told, run.report.message
    name, left, unit = told.groups()
    assert float(left) > 0.0
    assert unit == ("N" if name.endswith(("_u", "_v", "_w")) else "N m")
    assert f"worst freedom: {name}" in run.report.message


@pytest.mark.parametrize("step", [1e-2, 3e-3, 1e-3, 1e-4])
def test_explicit_steps_that_are_too_long_are_called_so(step):
    """The masses of a shape that such steps have torn were said to be singular."""
    run = fc.simulate(arm(), until=0.1, method=fc.ExplicitRungeKutta(step))
    assert run.status is fc.Status.FAILED
    assert "AdaptiveAlpha" in run.report.message
    assert "singular" not in run.report.message
    assert "too long for what is stiff" in run.report.message or "stiff parts are for" in run.report.message


class Overdriven(Ending):
    """A law whose command is a number, after an instant, of which no energy is one."""

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([-1e250 if t > self.last else 0.0])


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("sample_time", [0.0, 1e-3], ids=["continuous", "sampled"])
def test_a_command_of_which_no_energy_is_a_number_is_named(sample_time, backend):
    run = fc.simulate(arm(backend), Overdriven(sample_time, 0.05), until=0.1)
    assert run.status is fc.Status.FAILED
    assert "commands -1e+250 for 'torque'; look at its gains" in run.report.message
    assert np.isfinite(run.y).all()


def test_the_steps_that_a_run_by_tolerance_is_told_to_take_instead_are_fine_enough():
    """A load that swings below a motor of 250 million times its mass: the rope does not give way by chosen steps."""
    load, top = fc.PointMass("load", (1.0, 0, -8.0), 100.0), fc.PointMass("top", (0, 0, 0), 1.0)
    hoist = fc.Winch("hoist", load.node, top.node, EA=1e7, radius=0.2, ratio=10.0, inertia=1e7)
    motor, where = fc.MotorTorque("motor", hoist), fc.Position("x", load.node, "x")
    structure = fc.Structure([load, top], [fc.Support(top.node)], [hoist], [motor], [where])
    model = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation()])
    run = fc.simulate(model, until=4.6)
    assert run.status is fc.Status.FAILED
    told = re.search(r"or steps of one length: GeneralizedAlpha\(([\d.e+-]+)\)", run.report.message)
    assert told, run.report.message
    other = fc.simulate(model, until=4.6, method=fc.GeneralizedAlpha(float(told[1])))
    assert other.status is fc.Status.FINISHED
    period = 2 * np.pi * np.sqrt(np.hypot(1, 8) / 9.81) * (1 + np.arctan2(1, 8) ** 2 / 16)
    assert other.at(period / 2)["x"] == pytest.approx(-1.0, abs=1e-3)
