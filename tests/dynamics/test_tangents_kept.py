"""Tangents are kept as long as they are worth it."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

pytest.importorskip("llvmlite")

CHAIN = fc.Section(EA=6.28e5, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=1e-4)


def test_no_tangent_is_made_for_tension_that_the_first_correction_calls_forth():
    """A quarter of it comes back as tension, gone with the next one: 0.035 tangents a step were made for that."""
    beam = fc.Beam("chain", (0, 0, 0), (10.0 * np.sin(0.05), 0, -10.0 * np.cos(0.05)), CHAIN, elements=100)
    structure = fc.Structure([beam], [fc.Support(beam.start, held="u v w")], outputs=[fc.Position("x", beam.end, "x")])
    model = fc.assemble(structure, [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])
    report = fc.simulate(model, until=1.5, method=fc.Unchecked(fc.GeneralizedAlpha(1e-3))).report
    assert report.factorisations <= 0.02 * report.steps
    assert report.newton_iterations <= 2.8 * report.steps
