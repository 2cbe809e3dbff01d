"""The midpoint rule in momenta: lines that turn by a large part of a radian a step keep their length and the energy."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import flexctrl as fc

SECTION = fc.Section(EA=1e8, EI_y=1e5, EI_z=1e5, GJ=1e5, rhoA=1.0, rhoJ=1e-3)


def hung(parts: list, masses: list) -> fc.Model:
    joints = [fc.Support(parts[0].start, "u v w"), *(fc.Pin(a.end, b.start) for a, b in pairwise(parts))]
    joints += [fc.Pin(part.end, mass.node) for part, mass in zip(parts, masses, strict=False)]
    outputs = [fc.Position(axis, parts[-1].end, axis) for axis in "xz"]
    structure = fc.planar(fc.Structure([*parts, *masses], joints, outputs=outputs), "y")
    return fc.assemble(structure, [fc.LargeRotation(), fc.Gravity(), fc.Flexible()])


def springs(count: int, stiffness: float) -> fc.Model:
    lines = [fc.Spring(f"s{i}", (i, 0, 0), (i + 1, 0, 0), stiffness=stiffness) for i in range(count)]
    return hung(lines, [fc.PointMass(f"m{i}", line.end, 1.0) for i, line in enumerate(lines)])


@pytest.mark.parametrize("stiffness", [1e3, 1e6, 1e9])
@pytest.mark.parametrize("step", [0.01, 0.05])
def test_springs_and_masses_keep_their_energy_whatever_the_step(stiffness, step):
    """V₁ − V₀ = −F·Δ exactly: what is left is Newton's tolerance."""
    run = fc.simulate(springs(2, stiffness), until=2.0, method=fc.ConservingMidpoint(step))
    assert run.status.value == "finished"
    assert run.report.energy_residual < 1e-7


def test_a_rope_that_stays_taut_keeps_its_energy_too():
    rope, mass = fc.Rope("rope", (0, 0, 0), (0.8, 0, -0.6), EA=1e6), fc.PointMass("mass", (0.8, 0, -0.6), 1.0)
    run = fc.simulate(hung([rope], [mass]), until=2.0, method=fc.ConservingMidpoint(0.02))
    assert run.report.energy_residual < 1e-9


def test_a_damped_spring_loses_what_its_damper_takes():
    """Energies at both ends against the power of the damper, which the books integrate by the trapezoidal rule."""
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=100.0, damping=2.0)
    model = hung([spring], [fc.PointMass("mass", spring.end, 1.0)])
    residuals = [
        fc.simulate(model, until=2.0, method=fc.ConservingMidpoint(h)).report.energy_residual for h in (0.02, 0.01)
    ]
    assert residuals[0] < 1e-3
    assert residuals[0] / residuals[1] == pytest.approx(4.0, rel=0.1)


def test_a_stiff_chain_moves_as_a_rigid_one():
    """Two links of 1e9 N/m at steps of hundreds of their periods, against rigid ropes: second order."""
    links = [fc.Rope(f"r{i}", (i, 0, 0), (i + 1, 0, 0), EA=1.0) for i in range(2)]
    masses = [fc.PointMass(f"m{i}", link.end, 1.0) for i, link in enumerate(links)]
    joints = [fc.Support(links[0].start, "u v w"), fc.Pin(links[0].end, links[1].start)]
    joints += [fc.Pin(link.end, mass.node) for link, mass in zip(links, masses, strict=True)]
    outputs = [fc.Position(axis, links[-1].end, axis) for axis in "xz"]
    structure = fc.planar(fc.Structure([*links, *masses], joints, outputs=outputs), "y")
    rigid = fc.assemble(structure, [fc.LargeRotation(), fc.Gravity()])
    exact = fc.simulate(rigid, until=1.0, method=fc.ExplicitRungeKutta(), tolerance=fc.Tolerance(1e-10, 1e-10))
    errors = []
    for step in (0.02, 0.01, 0.005):
        run = fc.simulate(springs(2, 1e9), until=1.0, method=fc.ConservingMidpoint(step))
        errors.append(np.hypot(run["x"][-1] - exact["x"][-1], run["z"][-1] - exact["z"][-1]))
    assert errors[-1] < 1e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.3)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.3)


def test_stiff_beams_keep_their_energy_at_steps_that_resolve_their_swing_only():
    links = [fc.Beam(f"b{i}", (i, 0, 0), (i + 1, 0, 0), SECTION) for i in range(3)]
    run = fc.simulate(hung(links, []), until=1.0, method=fc.ConservingMidpoint(0.01))
    assert run.status.value == "finished"
    assert run.report.energy_residual < 1e-4


def test_the_tangent_is_that_of_the_step():
    """Newton's method converges in a few iterations where lines turn by a tenth of a radian a step."""
    run = fc.simulate(springs(3, 1e8), until=1.0, method=fc.ConservingMidpoint(0.02))
    assert run.report.rejected_steps == 0
    assert run.report.newton_iterations < 7 * run.report.steps
