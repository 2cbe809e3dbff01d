"""D11: tiny and huge units: the same steps, rejections and Newton iterations, the same motion.

Metre, kilogram, second; millimetre, tonne, second; micrometre, microgram, millisecond. Statics and frequencies are in
tests/validation; here is the right-angled frame in motion, and a load on a rope that goes slack.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute
from units import OTHERS, SI, Units

import flexctrl as fc

PAGE = "hard"
TOLERANCE = fc.Tolerance(1e-4, 1e-9)
TIMES = np.linspace(0.0, 1.0, 21)


def method(name: str, u: Units) -> fc.GeneralizedAlpha | fc.AdaptiveAlpha | fc.ConservingMidpoint:
    if name == "adaptive alpha":
        return fc.AdaptiveAlpha(first_step=1e-4 * u.time)
    return (fc.GeneralizedAlpha if name == "alpha" else fc.ConservingMidpoint)(0.02 * u.time)


def elbow(u: Units, name: str) -> tuple[np.ndarray, tuple[int, ...]]:
    """B4's frame pushed out of its plane: path of its tip, in metres, and what it cost."""
    bent, heavy = u.force * u.length**2, u.mass / u.length
    section = fc.Section(1e6 * u.force, 1e3 * bent, 1e3 * bent, 1e3 * bent, heavy, 20.0 * u.mass * u.length)
    first = fc.Beam("first", (0, 0, 0), (10 * u.length, 0, 0), section, elements=2)
    second = fc.Beam("second", first.end, (10 * u.length, 10 * u.length, 0), section, elements=2)
    structure = fc.Structure(
        [first, second],
        [fc.Support(first.start), fc.Weld(first.end, second.start)],
        inputs=[fc.Force("push", first.end, "z")],
        outputs=[fc.Position(axis, second.end, axis) for axis in "xyz"],
    )
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Flexible()])
    return _ran(model, u, name, {"push": 50.0 * u.force}, "xyz")


def hoist(u: Units, name: str) -> tuple[np.ndarray, tuple[int, ...]]:
    """A load that falls into its rope and swings on it."""
    rope = fc.Rope("rope", (0, 0, 0), (0.3 * u.length, 0, -0.9 * u.length), EA=1e4 * u.force, length=u.length)
    load = fc.PointMass("load", rope.end, 2.0 * u.mass)
    outputs = [fc.Position(axis, load.node, axis) for axis in "xz"]
    structure = fc.Structure([rope, load], [fc.Support(rope.start), fc.Pin(rope.end, load.node)], outputs=outputs)
    gravity = fc.Gravity((0, 0, -9.81 * u.length / u.time**2))
    return _ran(fc.assemble(structure, [fc.LargeRotation(), fc.RopeStretch(), gravity]), u, name, {}, "xz")


def _ran(model: fc.Model, u: Units, name: str, inputs: dict[str, float], axes: str):
    run = fc.simulate(model, until=u.time, inputs=inputs, method=method(name, u), tolerance=TOLERANCE)
    path = np.array([[run.at(t * u.time)[axis] for axis in axes] for t in TIMES])
    return path / u.length, (run.report.steps, run.report.rejected_steps, run.report.newton_iterations)


@pytest.mark.parametrize("units", OTHERS)
@pytest.mark.parametrize("name", ["alpha", "adaptive alpha", "midpoint"])
@pytest.mark.parametrize("machine", [elbow, hoist], ids=lambda f: f.__name__)
def test_the_same_run(record, machine, name, units):
    (path, counts), (other, same) = machine(SI, name), machine(OTHERS[units], name)
    case = f"D11 {machine.__name__}, {name}, {units}"
    record(
        f"{case}: path over 1 s less that in SI [m]",
        ours=np.abs(other - path).max(),
        reference=0,
        source="the same in m, kg, s",
        tolerance=Absolute(1e-8),
    )
    record(
        f"{case}: steps, rejections, Newton iterations more than in SI",
        ours=np.subtract(same, counts),
        reference=[0, 0, 0],
        source="the same in m, kg, s",
        tolerance=Absolute(0),
    )
