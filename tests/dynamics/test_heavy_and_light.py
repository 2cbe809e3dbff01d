"""A machine some of which has no mass, as one of first order: the same answer to every s as M s² + C s + K gives."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la

import flexctrl as fc
from flexctrl.design import pd
from flexctrl.dynamics.notes.heavy import without_light

HEAVY = np.array([True, False, True, True, False, False])


def machine(seed: int, damped: int, skew: float) -> tuple[np.ndarray, ...]:
    """Six freedoms, three without mass, of which some relax; K is symmetric, or not."""
    rng = np.random.default_rng(seed)
    M, C, K = np.zeros((6, 6)), np.zeros((6, 6)), rng.normal(size=(6, 6))
    K = K @ K.T + 3.0 * np.eye(6) + skew * rng.normal(size=(6, 6))
    root = rng.normal(size=(3, 3))
    M[np.ix_(HEAVY, HEAVY)] = root @ root.T + np.eye(3)
    for dashpot in [*rng.normal(size=(damped, 6)), *(rng.normal(size=(2, 6)) * HEAVY)]:
        C += np.outer(dashpot, dashpot)
    B = (
        rng.normal(size=(6, 2)) * (HEAVY | (damped == 3))[:, None]
    )  # rates of what follows at once would jump with inputs
    return M, C, K, B, rng.normal(size=(2, 6)), rng.normal(size=(2, 6))


@pytest.mark.parametrize("skew", [0.0, 0.3])
@pytest.mark.parametrize("damped", [0, 1, 3])
@pytest.mark.parametrize("seed", range(3))
def test_it_answers_as_the_whole_does(seed, damped, skew):
    M, C, K, B, on_place, on_rate = machine(seed, damped, skew)
    A, push, seen, direct = without_light(M, C, K, B, (on_place, on_rate), HEAVY, 0.1).in_modes()
    assert len(A) == 6 + damped
    for s in (0.0, 0.3 + 2.0j, -1.0 + 9.0j):
        whole = (on_place + s * on_rate) @ np.linalg.solve(s**2 * M + s * C + K, B)
        assert seen @ np.linalg.solve(s * np.eye(len(A)) - A, push) + direct == pytest.approx(whole, rel=1e-8)


def test_a_whole_without_light_parts_is_itself():
    M, C, K, B, on_place, on_rate = (part[..., HEAVY] if part.shape[-1] == 6 else part for part in machine(0, 0, 0.0))
    M, C, K, B = (part[HEAVY] for part in (M, C, K, B))
    found = without_light(M, C, K, B, (on_place, on_rate), np.ones(3, dtype=bool), 0.1)
    assert np.array_equal(found.K, K)
    assert found.pull.shape == (3, 0)


def test_growth_behind_a_motor_that_lags_is_told():
    """A law sampled every 20 ms shakes a link more and more; steps of 20 ms have it come to rest."""
    body = fc.RigidBody("link", (0.5, 0, 0), 1.0, (1, 1, 1.75), {"hinge": (0, 0, 0)})
    hinge = body.point("hinge")
    motor = fc.RotaryDrive("motor", hinge, axis="z", stiffness=25.0, ratio=10.0, inertia=1e-3, damping=1e-4)
    machine = fc.Structure(
        [body],
        [fc.Support(hinge, "u v w rx ry")],
        [motor],
        [fc.MotorTorque("torque", motor)],
        [fc.DriveAngle("angle", motor), fc.DriveSpeed("speed", motor)],
    )
    model = fc.assemble(machine, [fc.LargeRotation(), fc.ShaftElasticity(), fc.MotorLag({"motor": 2e-3})])
    law = fc.Sampled(pd(kp=2.0, kd=0.05, measured="angle", rate="speed", command="torque"), 0.02)
    start = model.displace({"motor_source": 1e-3})
    run = fc.simulate(model, law, until=2.0, start=start, method=fc.GeneralizedAlpha(0.02, rho=0.6))
    assert np.ptp(run["angle"][-5:]) < 1e-4
    assert run.status is fc.Status.FAILED
    shaft, A = np.array([250.0, 1e-3, -25.0, -1e-4, 0.0]), np.zeros((6, 6))  # (q, q', a, a', τ) and what is held
    A[0, 1] = A[2, 3] = 1.0
    A[1, :5], A[3, :5], A[4, 4:] = -10.0 * shaft / 2.0, shaft / 1e-3, [-500.0, 500.0]
    A[3, 4] = 1e3
    over = la.expm(0.02 * A)[:5]
    poles = np.linalg.eigvals(over[:, :5] + np.outer(over[:, 5], [0.0, 0.0, -2.0, -0.05, 0.0]))
    worst = max(poles, key=lambda z: (abs(z), z.imag))
    assert (
        f"the sampled loop is unstable, with a pole at z = {worst.real:.4g} ± {worst.imag:.4g}i" in run.report.message
    )
