"""D3 (statics): machines that float: the rigid motions are kept, reported, and nothing is invented about them."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import EquilibriumError

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


def test_loads_in_balance_bend_a_free_beam_as_a_supported_one():
    """The middle comes down by F L³/48 EI."""
    rest = fc.equilibrium(floating(PINCH), inputs={"ends": 0.5, "middle_force": 1.0})
    assert rest.outputs["middle"] == pytest.approx(-1.0 * 4.0**3 / (48.0 * 1e3), rel=1e-5)
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
