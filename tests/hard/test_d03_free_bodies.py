"""D3: machines that float: the rigid motions are kept, reported, and nothing is invented about them.

A beam without any support, in space and in a plane. Loads on it that do not balance are refused by the direction in
which it would go; loads that do bend it as a supported one.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc
from flexctrl.errors import EquilibriumError

PAGE = "hard"
SECTION = fc.Section(EA=1e6, EI_y=1e3, EI_z=1e3, GJ=1e3, rhoA=5.0, rhoJ=0.01)


def floating(inputs: list) -> fc.Model:
    beam = fc.Beam("beam", (0, 0, 0), (4, 0, 0), SECTION, elements=8)
    outputs = [fc.Position("middle", beam.node(4), "z", minus=beam.start)]
    structure = fc.Structure([beam], [], inputs=[make(beam) for make in inputs], outputs=outputs)
    return fc.assemble(structure, [fc.Flexible(), fc.LargeRotation()])


PINCH = [
    lambda beam: fc.Force("ends", [beam.start, beam.end], "z"),
    lambda beam: fc.Force("middle_force", beam.node(4), "-z"),
]


@pytest.mark.parametrize(("plane", "rigid"), [("", 6), ("y", 3)], ids=["in space", "in a plane"])
def test_rigid_motions_and_the_first_of_bending(record, plane, rigid):
    beam = fc.Beam("beam", (0, 0, 0), (4, 0, 0), SECTION, elements=20)
    structure = fc.Structure([beam], [], outputs=[fc.Position("end", beam.end, "z")])
    model = fc.assemble(fc.planar(structure, plane) if plane else structure, [fc.Flexible()])
    omega = fc.linearize(model).modes().omega
    where = "in a plane" if plane else "in space"
    record(
        f"D3 free beam {where}: rigid motions",
        ours=float(np.count_nonzero(omega**2 < 1e-8 * omega[rigid] ** 2)),
        reference=float(rigid),
        source="a free body",
        tolerance=1e-12,
    )
    record(
        f"D3 free beam {where}: largest ω² of them over that of the first of bending",
        ours=float(np.abs(omega[:rigid]).max() ** 2 / omega[rigid] ** 2),
        reference=0.0,
        source="a free body",
        tolerance=Absolute(1e-8),
    )
    record(
        f"D3 free beam {where}, 20 elements: first of bending, ω √(ρA L⁴/EI)",
        ours=omega[rigid] * np.sqrt(5.0 * 4.0**4 / 1e3),
        reference=22.3733,
        source="cos β cosh β = 1",
        tolerance=1e-4,
    )


def test_loads_in_balance_bend_a_free_beam_as_a_supported_one(record):
    rest = fc.equilibrium(floating(PINCH), inputs={"ends": 0.5, "middle_force": 1.0})
    record(
        "D3 free beam pinched: its middle to its ends [m]",
        ours=rest.outputs["middle"],
        reference=-1.0 * 4.0**3 / (48.0 * 1e3),
        source="F L³/48 EI",
        tolerance=1e-5,
    )
    assert rest.unstable == 0


def test_the_linear_model_keeps_six_rigid_motions():
    rest = fc.equilibrium(floating(PINCH), inputs={"ends": 0.5, "middle_force": 1.0})
    linear = fc.linearize(floating(PINCH))
    assert linear.modes().rigid == 6
    assert len(linear.certificate.rigid_modes) == 6
    assert rest.residual < 1e-9


def test_loads_out_of_balance_are_refused_by_name():
    with pytest.raises(EquilibriumError, match="free in translation along z") as error:
        fc.equilibrium(floating(PINCH), inputs={"ends": 0.5, "middle_force": 0.9})
    assert np.isfinite(error.value.residual)
