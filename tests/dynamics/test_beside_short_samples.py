"""Where samples keep steps short coarser runs take nearly the same ones, and err alike: a finer one has the word."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

FINE = {"method": fc.Unchecked(fc.AdaptiveAlpha()), "tolerance": fc.Tolerance(1e-7, 1e-10)}


def arm(stiffness: float, load: float, elements: int) -> fc.Model:
    """A soft arm of 1 m and 1 kg on a geared motor, a load at its end."""
    section = fc.Section(EA=2000 * stiffness, EI_y=stiffness, EI_z=stiffness, GJ=stiffness, rhoA=1.0, rhoJ=1e-3)
    beam = fc.Beam("arm", (0, 0, 0), (1, 0, 0), section, elements=elements)
    tip = fc.PointMass("tip", beam.end, load)
    motor = fc.RotaryDrive("motor", beam.start, axis="y", stiffness=0.1, ratio=100.0, inertia=1e-4, damping=1e-4)
    joints = [fc.Support(beam.start, "u v w rx rz"), fc.Pin(beam.end, tip.node)]
    outputs = [fc.DriveAngle("angle", motor), fc.DriveSpeed("speed", motor)]
    outputs += [fc.Velocity("middle", beam.node(elements // 2), "z"), fc.AngularVelocity("nod", beam.end, "y")]
    plan = fc.Structure([beam, tip], joints, [motor], [fc.MotorTorque("torque", motor)], outputs)
    return fc.assemble(plan, [fc.Flexible(), fc.LargeRotation(), fc.Gravity()])


class Lower:
    """Turns the motor by 100 rad in a second, with no more than 0.3 N m."""

    inputs = ("angle", "speed")
    outputs = ("torque",)

    def __init__(self, sample_time):
        self.sample_time = sample_time

    def initial(self):
        return np.zeros(0)

    def command(self, t, x, y):
        return np.clip([0.01 * (-100.0 * min(t, 1.0) - y[0]) - 0.002 * y[1] - 0.1], -0.3, 0.3)


@pytest.mark.parametrize(
    ("stiffness", "load", "elements", "sample_time", "until"),
    [(30.0, 5.0, 2, 3e-3, 1.0), (30.0, 10.0, 3, 2.5e-3, 1.5), (20.0, 5.0, 2, 3e-3, 1.5)],
)
def test_rates_that_lag_alike_in_all_steps_between_samples_are_told(stiffness, load, elements, sample_time, until):
    """6 to 11 % off, told as 1 to 3 % by coarser runs that took four fifths of the steps."""
    model, law = arm(stiffness, load, elements), Lower(sample_time)
    run, fine = (fc.simulate(model, law, until=until, every=until / 300, **how) for how in ({}, FINE))
    for name in ("nod", "middle"):
        off = np.abs(run[name] - fine[name]).max() / np.ptp(fine[name])
        assert 0.9 * off < run.report.output_errors[name] < 2.0 * off, name
    assert run.report.output_errors["nod"] > 0.05
