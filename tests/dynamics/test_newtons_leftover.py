"""What Newton's method leaves does not show, however stiff the machine and short or long the steps.

A mass on a stiff line swings as a rigid pendulum does. Where vibrations along the line are not resolved, accelerations
jump from step to step, and a tolerance that went by these jumps alone would feed on what it leaves.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc

L, G = 0.2, 9.81


def on_a_spring(k: float) -> fc.Model:
    line = fc.Spring("line", (0, 0, 0), (L, 0, 0), stiffness=k)
    mass = fc.PointMass("mass", line.end, 10.0)
    joints = [fc.Support(line.start, "u v w"), fc.Pin(line.end, mass.node), fc.Support(mass.node, "v")]
    outputs = [fc.Position(axis, mass.node, axis) for axis in "xz"]
    structure = fc.Structure([line, mass], joints, outputs=outputs)
    return fc.assemble(structure, [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])


def rigid(until: float) -> np.ndarray:
    swing = solve_ivp(lambda t, y: [y[1], G / L * np.cos(y[0])], (0, until), [0, 0], rtol=1e-11, atol=1e-12)
    return L * np.array([np.cos(swing.y[0, -1]), -np.sin(swing.y[0, -1])])


@pytest.mark.parametrize(
    ("k", "step", "rho", "until"),
    [(1e12, 2e-4, 0.9, 3.0), (1e12, 2e-4, 1.0, 3.0), (1e11, 5e-4, 0.9, 5.0), (1e10, 1e-3, 0.6, 5.0)],
)
def test_a_stiff_line_is_a_rod(k, step, rho, until):
    run = fc.simulate(on_a_spring(k), until=until, method=fc.GeneralizedAlpha(step, rho), every=until)
    assert np.abs(run.y[-1] - rigid(until)).max() < 2e-3
    assert run.report.energy_residual < 1e-3


@pytest.mark.parametrize(
    ("k", "step", "rho"),
    [(1e8, 1e-3, 0.9), (1e7, 5e-3, 0.6), (1e6, 1e-2, 0.6), (1e10, 1e-3, 0.3), (1e11, 5e-4, 0.6), (1e11, 5e-4, 0.3)],
)
def test_a_tighter_test_changes_nothing(k, step, rho):
    how = {"until": 3.0, "method": fc.GeneralizedAlpha(step, rho), "every": 0.5}
    usual, tight = (fc.simulate(on_a_spring(k), tolerance=t, **how) for t in (None, fc.Tolerance(absolute=1e-11)))
    assert np.abs(usual.y - tight.y).max() < 1e-4
    assert usual.report.newton_iterations < 1.1 * tight.report.newton_iterations


def test_a_steel_tube_that_falls():
    tube = fc.Section.tube(fc.STEEL, radius=0.1, thickness=0.01)
    beam = fc.Beam("beam", (0, 0, 0), (0.5, 0, 0), tube, elements=2)
    mass = fc.PointMass("mass", beam.end, 50.0)
    joints = [fc.Support(beam.start, "u v w rx rz"), fc.Pin(beam.end, mass.node)]
    structure = fc.planar(fc.Structure([beam, mass], joints), "y")
    model = fc.assemble(structure, [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])
    run = fc.simulate(model, until=5.0, method=fc.GeneralizedAlpha(5e-3), every=5.0)
    assert run.report.energy_residual < 1e-3


@pytest.mark.parametrize("EI", [1e4, 1e6, 1e8])
def test_a_stiff_bar_let_go_swings_as_a_rod_in_steps_that_are_chosen(EI):
    """The default method and tolerance; a rod of 2 m hung at its end and let go from the horizontal: E is kept."""
    section = fc.Section(EA=1e3 * EI, EI_y=EI, EI_z=EI, GJ=EI, rhoA=1.0, rhoJ=0.0)
    bar = fc.Beam("bar", (0, 0, 0), (2, 0, 0), section, elements=4)
    outputs = [fc.Position("z", bar.end, "z")]
    structure = fc.planar(fc.Structure([bar], [fc.Support(bar.start, "u v w rx rz")], outputs=outputs), "y")
    run = fc.simulate(fc.assemble(structure, [fc.LargeRotation(), fc.Flexible(), fc.Gravity()]), until=2.0)
    assert run.report.energy_residual < 3e-2
    rod = solve_ivp(lambda _, y: (y[1], -0.75 * 9.81 * np.sin(y[0])), (0, 2), (np.pi / 2, 0), rtol=1e-10, atol=1e-12)
    assert run["z"][-1] == pytest.approx(-2.0 * np.cos(rod.y[0, -1]), abs=2e-2)
