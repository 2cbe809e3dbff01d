"""Polygons along curves: their chords neither inside nor outside the bend."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import StructureError


@pytest.mark.parametrize("elements", [4, 8, 16])
def test_inner_chords_are_on_the_arc_in_the_mean(elements):
    """To fourth order; chords between points of the arc are off by φ²/12."""
    points, phi = fc.arc((0, 0, 0), (1, 0, 0), "z", 1.5, elements), 1.5 / elements

    def off(corners: np.ndarray) -> float:
        s, weights = np.polynomial.legendre.leggauss(8)
        along = 0.5 * ((1.0 - s)[:, None] * corners[1] + (1.0 + s)[:, None] * corners[2])
        return float(0.5 * weights @ np.linalg.norm(along, axis=1) - 1.0)

    assert off(points) == pytest.approx(-(phi**2) / 12.0, rel=0.02)
    assert abs(off(fc.polygon(points))) < 0.02 * phi**4


def test_ends_and_straight_lines_stay():
    points = fc.arc((0, 0, 0), (1, 0, 0), "z", 1.5, 5)
    assert fc.polygon(points)[[0, -1]] == pytest.approx(points[[0, -1]], abs=0.0)
    line = np.outer(np.arange(4.0), (1.0, 2.0, 3.0))
    assert fc.polygon(line) == pytest.approx(line)


def test_one_point_is_no_polygon():
    with pytest.raises(StructureError, match="1 points; give two"):
        fc.polygon([(0, 0, 0)])
