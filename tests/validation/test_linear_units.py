"""The same machines in other units.

Metre, kilogram, second; millimetre, tonne, second; micrometre, microgram, millisecond: nothing without a dimension
may change, nor how the search for an equilibrium runs.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute
from units import OTHERS, SI, Units

import flexctrl as fc

PAGE = "linear"
SOURCE = "the same in m, kg, s"
MOVING = [fc.LargeRotation(), fc.Flexible()]


def rope(u: Units) -> tuple[np.ndarray, int]:
    """ω [rad/s] of a rope of 2 m with a load ten times its mass, and the iterations of its equilibrium."""
    beam = fc.Beam("rope", (0, 0, 0), (0, 0, -2.0 * u.length), u.section(1e8, 1e-6, 1e-6, 0.5, 1e-6), elements=12)
    load = fc.PointMass("load", beam.end, 10.0 * u.mass)
    structure = fc.planar(
        fc.Structure([beam, load], [fc.Support(beam.start, "u v w"), fc.Pin(beam.end, load.node)]), "x"
    )
    model = fc.assemble(structure, [*MOVING, u.gravity()], fc.CasadiVM())
    rest = fc.equilibrium(model)
    return fc.linearize(model, rest).modes(8).omega * u.time, rest.iterations


def strip(u: Units, load: float) -> tuple[np.ndarray, int]:
    """Tip of a cantilever of 1 m under PL²/EI = ``load``, over its length, and the iterations."""
    beam = fc.Beam("strip", (0, 0, 0), (u.length, 0, 0), u.section(1e7, 2.0, 1.0, 1.0, 1e-4), elements=8)
    structure = fc.Structure(
        [beam],
        [fc.Support(beam.start)],
        inputs=[fc.Force("load", beam.end, "z")],
        outputs=[fc.Position("along", beam.end, "x"), fc.Position("up", beam.end, "z")],
    )
    model = fc.assemble(fc.planar(structure, "y"), MOVING, fc.CasadiVM())
    rest = fc.equilibrium(model, inputs={"load": -2.0 * load * u.force})
    return np.array(list(rest.outputs.values())) / u.length, rest.iterations


def elbow(u: Units) -> np.ndarray:
    """Path of the tip of a right-angled frame, over a metre, for 0.5 s after a push out of its plane."""
    section = u.section(1e6, 1e3, 1e3, 1.0, 20.0)
    first = fc.Beam("first", (0, 0, 0), (10 * u.length, 0, 0), section, elements=2)
    second = fc.Beam("second", first.end, (10 * u.length, 10 * u.length, 0), section, elements=2)
    structure = fc.Structure(
        [first, second],
        [fc.Support(first.start), fc.Weld(first.end, second.start)],
        inputs=[fc.Force("push", first.end, "z")],
        outputs=[fc.Position(axis, second.end, axis) for axis in "xyz"],
    )
    model = fc.assemble(structure, MOVING, fc.CasadiVM())
    method = fc.GeneralizedAlpha(step=0.02 * u.time, rho=0.9)
    run = fc.simulate(model, until=0.5 * u.time, inputs={"push": 50.0 * u.force}, method=method)
    return run.y / u.length


@pytest.mark.parametrize("units", OTHERS)
def test_hanging_rope(record, units):
    (expected, steps), (found, same) = rope(SI), rope(OTHERS[units])
    record(
        f"hanging rope with a load, ω₁…ω₈, in {units}", ours=found, reference=expected, source=SOURCE, tolerance=1e-8
    )
    record(
        f"hanging rope with a load, iterations, in {units}",
        ours=same,
        reference=steps,
        source=SOURCE,
        tolerance=Absolute(0),
    )


@pytest.mark.parametrize("units", OTHERS)
def test_cantilever_bent_far(record, units):
    (expected, steps), (found, same) = strip(SI, 5.0), strip(OTHERS[units], 5.0)
    record(
        f"cantilever under PL²/EI = 5, tip, in {units}", ours=found, reference=expected, source=SOURCE, tolerance=1e-8
    )
    record(
        f"cantilever under PL²/EI = 5, iterations, in {units}",
        ours=same,
        reference=steps,
        source=SOURCE,
        tolerance=Absolute(0),
    )


@pytest.mark.parametrize("units", OTHERS)
def test_frame_in_motion(record, units):
    worst = np.abs(elbow(OTHERS[units]) - elbow(SI)).max()
    record(
        f"right-angled frame in motion, tip over 0.5 s [m], in {units}",
        ours=worst,
        reference=0,
        source=SOURCE,
        tolerance=Absolute(1e-8),
    )
