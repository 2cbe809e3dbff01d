"""The order of the mesh: frequencies, large deflections at rest, large motion."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

SLENDER = fc.Section(EA=1e6, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=1e-3)


def beam(elements: int, held: str, effects: list, until: float = 0.0) -> np.ndarray:
    """Where the end of a beam of 1 m is, in equilibrium under 5 N across or after a fall."""
    bar = fc.Beam("bar", (0, 0, 0), (1, 0, 0), SLENDER, elements)
    outputs = [fc.Position(axis, bar.end, axis) for axis in "xz"]
    structure = fc.Structure(
        [bar], [fc.Support(bar.start, held)], inputs=[fc.Force("load", bar.end, "-z")], outputs=outputs
    )
    model = fc.assemble(fc.planar(structure, "y"), effects)
    if until:
        return fc.simulate(model, until=until, method=fc.GeneralizedAlpha(1e-3, 0.9)).y[-1]
    return np.array(list(fc.equilibrium(model, inputs={"load": 5.0}).outputs.values()))


def order(errors: list[float]) -> float:
    return float(np.polyfit(np.arange(len(errors)), -np.log2(errors), 1)[0])


def test_large_deflections():
    """P L²/EI = 5, Mattiasson's elliptic integrals: order 2 (corotated elements bend along straight chords)."""
    exact = np.array([1.0 - 0.38762836, -0.71379152])
    errors = [np.abs(beam(n, "all", [fc.Flexible(), fc.LargeRotation()]) - exact).max() for n in (4, 8, 16)]
    assert order(errors) > 1.8
    assert errors[-1] < 1e-3


def test_frequencies():
    """Cubic elements: order 4."""

    def first(n: int) -> float:
        bar = fc.Beam("bar", (0, 0, 0), (1, 0, 0), SLENDER, n)
        structure = fc.planar(fc.Structure([bar], [fc.Support(bar.start)]), "y")
        return float(fc.linearize(fc.assemble(structure, [fc.Flexible()])).modes(2).omega[1])

    errors = [first(n) / 4.694091133**2 - 1.0 for n in (6, 12, 24)]
    assert order(errors) == pytest.approx(4.0, abs=0.2)


@pytest.mark.slow
def test_large_motion():
    """A beam of EI = 1 N m² that falls about a pin."""
    effects = [fc.Flexible(), fc.LargeRotation(), fc.Gravity()]
    ends = [beam(n, "u w", effects, 0.5) for n in (2, 4, 8, 32)]
    errors = [np.abs(end - ends[-1]).max() for end in ends[:-1]]
    assert order(errors) > 1.8
