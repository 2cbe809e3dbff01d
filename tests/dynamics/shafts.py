"""A motor that drives a disc through an elastic shaft, and what it does exactly from sample to sample."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from scipy.linalg import expm

import flexctrl as fc

LOAD, ROTOR = 1.0, 0.3


def shaft(frequency: float, damping_ratio: float) -> tuple[float, float]:
    """Stiffness and damping of a shaft between the rotor and its load, by their frequency [rad/s]."""
    stiffness = frequency**2 * LOAD * ROTOR / (LOAD + ROTOR)
    return stiffness, 2.0 * damping_ratio * stiffness / frequency


@cache
def machine(frequency: float, damping_ratio: float) -> fc.Model:
    stiffness, damping = shaft(frequency, damping_ratio)
    disc = fc.RigidBody("disc", (0, 0, 0), 1.0, (LOAD,) * 3)
    motor = fc.RotaryDrive("motor", disc.node, axis="z", stiffness=stiffness, inertia=ROTOR, damping=damping)
    structure = fc.Structure(
        [disc],
        [fc.Support(disc.node, "u v w rx ry")],
        [motor],
        [fc.MotorTorque("torque", motor)],
        [fc.DriveAngle("angle", motor), fc.DriveSpeed("speed", motor)],
    )
    return fc.assemble(structure, [fc.Flexible(), fc.LargeRotation()])


def speeds(
    frequency: float, damping_ratio: float, torque: Callable[[np.ndarray], np.ndarray], sample: float, until: float
) -> np.ndarray:
    """The motor's speed at all samples, by the exact map between them; the torque is that of its angle and speed."""
    k, d = shaft(frequency, damping_ratio)
    A = np.zeros((5, 5))
    A[:2, 2:4] = np.eye(2)
    A[2, :4] = np.array([-k, k, -d, d]) / LOAD
    A[3] = np.array([k, -k, d, -d, 1.0]) / ROTOR
    E, s, found = expm(A * sample), np.zeros(4), [0.0]
    for _ in range(round(until / sample)):
        s = E[:4, :4] @ s + E[:4, 4] * torque(s[[1, 3]])
        found.append(s[3])
    return np.array(found)
