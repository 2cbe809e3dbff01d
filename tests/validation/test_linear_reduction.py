"""Reduced models.

Craig–Bampton and balanced truncation of assembled structures: errors as tabulated, bounds that hold.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc
from flexctrl.linear.reduction.balanced import hankel_singular_values

PAGE = "linear"
TABLE = {
    0: (2.6e-2, 3.4e-1),
    1: (6.8e-5, 6.4e-3),
    2: (2.8e-6, 3.4e-4, 5.7e-4, 1.4e-2),
    3: (4.0e-7, 5.6e-5, 4.1e-5, 1.8e-3, 1.9e-3),
    5: (3.3e-8, 5.1e-6, 1.4e-6, 1.6e-4, 5.7e-5, 9.9e-4),
}
INTERFACE = ("beam_10_w", "beam_10_ry")
HANKEL = (
    *(130.752757, 130.123880, 13.471721, 13.282598, 4.091557, 4.002665),
    *(1.532207, 1.493448, 0.521619, 0.510110, 0.096013, 0.094616),
)
ERRORS = {
    2: (26.733943, 78.193),
    4: (8.046380, 24.684),
    6: (2.963834, 8.496),
    8: (0.991065, 2.4447),
    10: (0.189387, 0.38126),
}


def beam(clamped: bool) -> fc.LinearModel:
    """Twenty elements that bend in one plane and do nothing else."""
    section = fc.Section(EA=1.0, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=1.0)
    part = fc.Beam("beam", (0, 0, 0), (1, 0, 0), section, elements=20)
    joints = [fc.Support(node, "u v rx rz") for node in part.nodes]
    middle = part.node(10)
    structure = fc.Structure(
        [part],
        [*joints, *([fc.Support(part.start)] if clamped else [])],
        inputs=[fc.Force("push", middle, "z"), fc.Torque("turn", middle, "y")],
        outputs=[fc.Position("height", middle, "z"), fc.Rotation("slope", middle, "y")],
    )
    return fc.linearize(fc.assemble(structure, [fc.Flexible(), fc.LargeRotation()], fc.CasadiVM()))


@pytest.mark.parametrize("kept", TABLE)
def test_craig_bampton_of_a_cantilever(record, kept):
    full = beam(clamped=True)
    reduced = full.reduce(fc.CraigBampton(INTERFACE, kept))
    omega = reduced.modes().omega
    errors = omega / full.modes().omega[: len(omega)] - 1.0
    case = f"Craig–Bampton, cantilever cut in the middle, {kept} modes a half: errors of ω"
    record(
        case,
        ours=errors[: len(TABLE[kept])],
        reference=TABLE[kept],
        source="independent finite elements, two digits",
        tolerance=0.03,
    )
    assert errors.min() > -1e-10


def test_craig_bampton_keeps_what_it_must(record):
    full = beam(clamped=True)
    reduced = full.reduce(fc.CraigBampton(INTERFACE, 2))
    slow = [m.frequency_response([1e-6]).values[:, :, 0].real for m in (full, reduced)]
    worst = np.abs(slow[1] / slow[0] - 1).max()
    record(
        "Craig–Bampton: static response at the interface",
        ours=worst,
        reference=0,
        source="exact",
        tolerance=Absolute(1e-9),
    )
    free = beam(clamped=False)
    modes = free.reduce(fc.CraigBampton(INTERFACE, 3)).modes()
    first = free.modes().omega_squared[2]
    worst = np.abs(modes.omega_squared[:2]).max() / first
    record(
        "Craig–Bampton of a free beam: rigid ω² over the first flexible",
        ours=worst,
        reference=0,
        source="exact",
        tolerance=Absolute(1e-12),
    )


def chain() -> fc.LinearModel:
    """Six unit masses on unit springs from a wall, C = 0.02 K; push on the first, place of the last."""
    masses = [fc.PointMass(f"mass_{i}", (i + 1.0, 0, 0), 1.0) for i in range(6)]
    springs = [fc.Spring(f"spring_{i}", (i, 0, 0), (i + 1.0, 0, 0), stiffness=1.0, damping=0.02) for i in range(6)]
    joints = [fc.Support(springs[0].start), *(fc.Support(m.node, "v w") for m in masses)]
    joints += [fc.Pin(s.end, m.node) for s, m in zip(springs, masses, strict=True)]
    joints += [fc.Pin(m.node, s.start) for m, s in zip(masses[:-1], springs[1:], strict=True)]
    structure = fc.Structure(
        [*masses, *springs],
        joints,
        inputs=[fc.Force("push", masses[0].node, "x")],
        outputs=[fc.Position("place", masses[5].node, "x")],
    )
    return fc.linearize(fc.assemble(structure, [fc.LargeRotation()], fc.CasadiVM()))


def test_hankel_values_of_six_masses(record):
    case = "six masses on springs: Hankel singular values"
    record(
        case, ours=hankel_singular_values(chain()), reference=HANKEL, source="SLICOT and pyMOR agree", tolerance=1e-5
    )


@pytest.mark.parametrize("order", ERRORS)
def test_balanced_truncation_of_six_masses(record, order):
    reduced = chain().reduce(fc.BalancedTruncation(order))
    error, bound = ERRORS[order]
    found = float(reduced.error.absolute[0, 0])
    record(
        f"six masses, {order} states kept: H∞ error", ours=found, reference=error, source="dense grid", tolerance=1e-5
    )
    record(
        f"six masses, {order} states kept: bound",
        ours=float(reduced.bound[0, 0]),
        reference=bound,
        source="twice the Hankel values left out",
        tolerance=1e-4,
    )
    assert HANKEL[order] * (1 - 1e-5) <= found <= bound * (1 + 1e-4)
