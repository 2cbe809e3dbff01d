"""B16, geared drives.

Motors behind reductions from either side of the gears; hoist and trolley of a quay crane.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from geared import linear, turntable
from recorder import Absolute

import flexctrl as fc

PAGE = "linear"


@pytest.mark.parametrize(("inertia", "ratio"), [(1e-4, 100.0), (1e-6, 1e3), (1e-8, 1e4)])
def test_geared_drive_from_either_side(record, inertia, ratio):
    """5 kg m² on 1000 N m/rad, the motor behind a reduction or reflected by hand."""
    behind = {"stiffness": 1000.0 / ratio**2, "ratio": ratio, "inertia": inertia}
    reflected = {"stiffness": 1000.0, "inertia": ratio**2 * inertia}
    rates = []
    for drive in (behind, reflected):
        free, locked = turntable(5.0, drive).modes(), turntable(5.0, drive, motor_source=0.0).modes()
        rates.append([locked.omega[0], free.omega[1], free.omega[1] / locked.omega[0]])
    exact = [math.sqrt(200), math.sqrt(1200), math.sqrt(6)]
    record(
        f"drive with R = {ratio:g}, J = {inertia:g}: antiresonance, resonance, ratio",
        ours=rates[0],
        reference=exact,
        source="√(k/J_L), √(k(1/J_L + 1/(R²J_m)))",
        tolerance=1e-12,
    )
    worst = np.abs(np.array(rates[0]) / rates[1] - 1).max()
    record(
        f"drive with R = {ratio:g}: behind the reduction against reflected",
        ours=worst,
        reference=0,
        source="the same machine",
        tolerance=Absolute(1e-9),
    )


def hoist(**hold: float) -> fc.Modes:
    """STS crane: 65 t on a rope of 1.8e6 N/m, drum 0.75 m and 8 kg m², gear 30, motor 30 kg m²."""
    load = fc.PointMass("load", (0, 0, 0), 65000.0)
    winch = fc.LinearDrive(
        "winch",
        load.node,
        direction="z",
        radius=0.75,
        stiffness=1.8e6 * (0.75 / 30) ** 2,
        ratio=30.0,
        inertia=30.0 + 8.0 / 30**2,
    )
    return linear(
        fc.Structure([load], [fc.Support(load.node, "u v")], [winch]), [fc.LargeRotation(), fc.Flexible()], **hold
    ).modes()


def test_hoist_of_a_quay_crane(record):
    record(
        "quay crane's hoist, drum locked: ω [rad/s]",
        ours=hoist(winch_source=0.0).omega[0],
        reference=math.sqrt(1.8e6 / 65000.0),
        source="√(k/m)",
        tolerance=1e-12,
    )
    record(
        "quay crane's hoist, drum free: ω [rad/s]",
        ours=hoist().omega[1],
        reference=math.sqrt(1.8e6 * (1.0 / 65000.0 + 0.75**2 / (30.0 * 30.0**2 + 8.0))),
        source="√(k(1/m + r²/(30·30² + 8)))",
        tolerance=1e-12,
    )


def test_trolley_of_a_quay_crane(record):
    """The motor behind a rigid shaft is reflected: 50 t, wheel 0.5 m and 2 kg m², gear 15, motor 10 kg m²."""
    cart = fc.PointMass("trolley", (0, 0, 0), 50000.0)
    travel = fc.LinearDrive(
        "travel", cart.node, direction="x", radius=0.5, stiffness=1e6, ratio=15.0, inertia=10.0 + 2.0 / 15**2
    )
    model = linear(fc.Structure([cart], [fc.Support(cart.node, "v w")], [travel]), [fc.LargeRotation()])
    record(
        "quay crane's trolley with its drive: mass [kg]",
        ours=model.M[0, 0],
        reference=59008.0,
        source="m + (J_w + R²J)/r²",
        tolerance=1e-12,
    )
