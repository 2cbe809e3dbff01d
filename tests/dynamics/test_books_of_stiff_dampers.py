"""Books of a damped shaft: rates of a mode that no step sees take no energy, those that are seen take theirs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc

RATIO, WEIGHT, INERTIA, SAMPLE, UNTIL = 1000.0, 5.0 * 9.81, 6.0, 1e-3, 0.4
ROTOR = INERTIA / RATIO**2


class Law:
    """A PD law that turns the motor by half a radian of the load and back, on an encoder of coarse steps."""

    inputs, outputs, sample_time = ("angle", "speed"), ("torque",), SAMPLE

    def __init__(self, encoder: float) -> None:
        self.encoder = encoder

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        angle = np.round(y[0] / self.encoder) * self.encoder
        off, rate = angle - RATIO * 0.5 * (1.0 - np.cos(4.0 * t)), y[1] - RATIO * 2.0 * np.sin(4.0 * t)
        return np.array([-2.0 * ROTOR * (4e3 * off + 140.0 * rate)])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x


def arm(stiffness: float, damping: float, backend: fc.CasadiVM | None = None) -> fc.Model:
    """A link under its weight, level at rest, behind a geared motor."""
    link = fc.RigidBody("link", (1, 0, 0), 5.0, (1, 1, 1), {"hinge": (0, 0, 0)})
    hinge = link.point("hinge")
    motor = fc.RotaryDrive("motor", hinge, axis="-y", stiffness=stiffness, ratio=RATIO, inertia=ROTOR, damping=damping)
    structure = fc.Structure(
        [link],
        [fc.Support(hinge, "u v w rx rz")],
        [motor],
        [fc.MotorTorque("torque", motor)],
        [fc.DriveAngle("angle", motor), fc.DriveSpeed("speed", motor), fc.Rotation("turn", hinge, "-y")],
    )
    return fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), fc.ShaftElasticity()], backend)


def rigid(law: Law) -> tuple[float, float]:
    """The link's angle at last and the motor's work, by equations of a shaft that does not give way."""
    turn, work = np.zeros(2), 0.0
    for i in range(round(UNTIL / SAMPLE)):
        [u] = law.command(i * SAMPLE, np.zeros(0), RATIO * turn)
        seen = solve_ivp(
            lambda t, s, u=u: [s[1], (RATIO * u - WEIGHT * np.cos(s[0])) / (2.0 * INERTIA)],
            (0.0, SAMPLE),
            turn,
            rtol=1e-8,
            atol=1e-10,
        )
        work += u * RATIO * (seen.y[0, -1] - turn[0])
        turn = seen.y[:, -1]
    return float(turn[0]), work


def damper(stiffness: float, share: float) -> float:
    """A share of the damping that ends the swing of a motor against its load within a period."""
    return 2.0 * share * np.sqrt(stiffness * ROTOR / 2.0)


@pytest.mark.parametrize("backend", ["compiled", "plain"])
@pytest.mark.parametrize(("stiffness", "encoder"), [(1e12, 5.0), (1e11, 20.0)])
def test_a_damper_takes_nothing_of_a_twist_that_is_not_there(stiffness, encoder, backend):
    """At 600 Mrad/s, with 3 % of damping, the twist's rate is noise: 17 J of 48 J were booked as lost for it."""
    law = Law(encoder)
    model = arm(stiffness, damper(stiffness, 0.03), {"compiled": None, "plain": fc.CasadiVM()}[backend])
    run = fc.simulate(model, law, until=UNTIL, every=0.1)
    turn, work = rigid(law)
    assert run.status is fc.Status.FINISHED
    assert run["turn"][-1] == pytest.approx(turn, abs=1e-4)
    assert run.report.energy.work == pytest.approx(work, rel=1e-3)
    assert run.report.energy.dissipated < 0.01 * work
    assert run.report.energy_residual < 0.01
    assert not any("the energy books" in note for note in run.report.notes)


@pytest.mark.parametrize("share", [0.02, 0.5])
def test_a_damper_takes_what_a_twist_that_is_seen_had(share):
    """A motor set spinning against its load at 60 rad/s; both ways of stepping book the same."""
    stiffness, spin, until = 60.0**2 * ROTOR / 2.0, 2000.0, 0.3
    damping = damper(stiffness, share)

    def rates(t: float, s: np.ndarray) -> list[float]:
        turn, angle, v, w, _ = s
        torque = stiffness * (RATIO * turn - angle) + damping * (RATIO * v - w)
        pull = -RATIO * torque - WEIGHT * np.cos(turn)
        return [v, w, pull / INERTIA, torque / ROTOR, damping * (RATIO * v - w) ** 2]

    known = solve_ivp(rates, (0.0, until), [0, 0, 0, spin, 0], rtol=1e-9, atol=1e-9).y[:, -1]
    runs = []
    for backend in (None, fc.CasadiVM()):
        model = arm(stiffness, damping, backend)
        start = model.rest.with_(v=np.where([name == "motor_source" for name in model.coordinates], spin, 0.0))
        runs.append(fc.simulate(model, until=until, start=start, method=fc.GeneralizedAlpha(5e-4)))
        assert runs[-1]["angle"][-1] == pytest.approx(known[1], rel=1e-3)
        assert runs[-1].report.energy.dissipated == pytest.approx(known[4], rel=1e-3)
        assert runs[-1].report.energy_residual < 1e-3
    assert runs[0].report.energy.dissipated == pytest.approx(runs[1].report.energy.dissipated, rel=1e-6)


class Relay:
    """Half a newton metre one way or the other, every millisecond."""

    inputs, outputs, sample_time = ("angle", "speed"), ("torque",), SAMPLE

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return -0.5 * np.sign(y[:1] - 0.3 + 0.05 * y[1:])


@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(SAMPLE)])
def test_a_torque_that_chatters_on_a_stiff_shaft_is_no_loss(method):
    """What motor and load gain together in a step has no part in their twist: of 10 mJ 5 were booked as lost."""
    inertia, load, ratio, stiffness = 1e-4, 5.0, 100.0, 1e9
    damping = 0.1 * np.sqrt(stiffness / (ratio**2 / load + 1.0 / inertia))
    disc = fc.RigidBody("disc", (0, 0, 0), 1.0, (load,) * 3)
    motor = fc.RotaryDrive(
        "motor", disc.nodes[0], axis="z", stiffness=stiffness, ratio=ratio, inertia=inertia, damping=damping
    )
    plan = fc.Structure(
        [disc],
        [fc.Support(disc.nodes[0], "u v w rx ry")],
        [motor],
        [fc.MotorTorque("torque", motor)],
        [fc.DriveAngle("angle", motor), fc.DriveSpeed("speed", motor)],
    )
    model = fc.assemble(plan, [fc.ShaftElasticity(), fc.LargeRotation()])
    run = fc.simulate(model, Relay(), until=2.0, method=method)
    assert run.status is fc.Status.FINISHED
    assert run.report.energy.dissipated < 5e-4
    assert run.report.energy_residual < 0.07
