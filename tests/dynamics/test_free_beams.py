"""Beams that nothing holds: what Newton's method leaves of a step is momentum, and adds up to a way.

Compiled steps are compared with plain ones, solved to 1e-12; momenta with the impulse of
forces, in the discrete mass of the motion at hand.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flexctrl as fc
from flexctrl.cranes import ceiling_crane
from flexctrl.dynamics.floating import floats

LARGE = [fc.Flexible(), fc.LargeRotation()]
AXES = np.eye(3)
PUSHED = {"every": 0.1, "inputs": {"f": 8.0, "m": 40.0}}
TO_THE_END = fc.Tolerance(absolute=1e-9)
"""Plain steps are solved to a thousandth of it."""


def structure(elements=40, EA=1e6, turn=AXES, joints=lambda beam: [], parts=lambda beam: []) -> fc.Structure:
    """A beam of 10 m, pushed and turned at its start; seen from axes that are turned."""
    section = fc.Section(EA, 500.0, 500.0, 500.0, 1.0, 20.0, 10.0, 10.0, EA, EA)
    beam = fc.Beam("b", tuple(turn @ [6.0, 0, 0]), tuple(turn @ [0, 8.0, 0]), section, elements=elements)
    inputs = [fc.Force("f", beam.start, tuple(turn[:, 0])), fc.Torque("m", beam.start, tuple(-turn[:, 2]))]
    ends = (("a", beam.start), ("b", beam.end))
    outputs = [fc.Position(name + k, end, tuple(turn[:, i])) for name, end in ends for i, k in enumerate("xy")]
    return fc.Structure([beam, *parts(beam)], joints(beam), inputs=inputs, outputs=outputs)


def thrown(model: fc.Model, step: float, until: float = 4.0, **how: object) -> fc.Run:
    method = fc.Unchecked(fc.GeneralizedAlpha(step, rho=0.8))
    return fc.simulate(model, until=until, method=method, **(PUSHED | how))


@pytest.mark.parametrize(("elements", "EA", "step"), [(40, 1e6, 0.02), (40, 1e6, 0.01), (24, 1e7, 0.02)])
def test_compiled_steps_of_a_thrown_beam_are_the_plain_ones(elements, EA, step):
    compiled = fc.assemble(structure(elements, EA), LARGE)
    plain = compiled.with_(backend=fc.CasadiVM())
    coarse, fine = (thrown(plain, h, tolerance=TO_THE_END).y for h in (step, 0.5 * step))
    own = 4.0 / 3.0 * np.abs(coarse - fine).max()
    assert np.abs(thrown(compiled, step).y - coarse).max() < 0.05 * own


def test_chosen_steps_of_a_thrown_beam_are_the_plain_ones():
    compiled = fc.assemble(structure(24, 1e7), LARGE)
    how = {"until": 2.0, "every": 0.1, "inputs": {"f": 8.0, "m": 40.0}}
    one, other = (fc.simulate(m, **how).y for m in (compiled, compiled.with_(backend=fc.CasadiVM())))
    assert np.abs(one - other).max() < 5e-6


@pytest.mark.parametrize("step", [0.04, 0.02, 0.01])
def test_momenta_are_impulses(step):
    """A constant force and torque: P = F t, but for what the method takes at the jump, and L what both have turned."""
    model = fc.assemble(structure(), LARGE)
    run = thrown(model, step, every=step)
    linear, angular = momenta(model, run.final)
    assert linear == pytest.approx([32.0, 0, 0], abs=1e-6 * 32.0)
    arm = np.trapezoid(run["ay"], run.t)
    assert angular == pytest.approx([0, 0, -160.0 - 8.0 * arm], abs=2e-4 * 149.0)


def momenta(model: fc.Model, state) -> tuple[np.ndarray, np.ndarray]:
    """Of a state: what the discrete mass says to the six motions that a rigid body has."""
    zero = np.zeros(model.n)
    M = -model.slope(state, zero, zero, (0.0, 0.0, 1.0), np.zeros(2))
    motions = np.zeros((6, model.n))
    for node, row in enumerate(model.motion.place):
        if (row < model.n).all():
            motions[:3, row[:3]] = motions[3:, row[3:]] = AXES
            motions[3:, row[:3]] = np.cross(AXES, state.x[node])
    found = motions @ (M @ state.v)
    return found[:3], found[3:]


def test_a_frame_makes_no_difference():
    how = {"until": 2.5, "inputs": {"f": 8.0, "m": 80.0}}
    ends = [thrown(fc.assemble(structure(30, 1e4, Q), LARGE), 0.04, **how).y[-1] for Q in (AXES, turned(1), turned(2))]
    assert np.ptp(ends, axis=0).max() < 1e-5


def turned(seed: int) -> np.ndarray:
    return Rotation.random(random_state=seed).as_matrix()


def test_freedoms_that_do_not_move_make_no_difference():
    free = structure(30, 1e4)
    one, other = (
        thrown(fc.assemble(s, LARGE), 0.04, 2.5, inputs={"f": 8.0, "m": 80.0}).y for s in (free, fc.planar(free, "z"))
    )
    assert np.abs(one - other).max() < 1e-4


def test_what_floats():
    free = structure()
    assert floats(fc.assemble(free, LARGE))
    assert floats(fc.assemble(fc.planar(free, "z"), LARGE))
    assert floats(tethered(1e2))
    assert not floats(tethered(1e6))
    for held in ("u v w", "u v w rx ry rz"):
        clamped = structure(joints=lambda beam, held=held: [fc.Support(beam.start, held)])
        assert not floats(fc.assemble(clamped, LARGE))
    assert not floats(fc.assemble(ceiling_crane(elements=2), LARGE))


def tethered(stiffness: float) -> fc.Model:
    """On three springs, each along one axis."""
    springs = [
        fc.Spring(f"s{i}", tuple(np.array([6.0, 0, 0]) + AXES[i]), (6.0, 0, 0), stiffness=stiffness) for i in range(3)
    ]
    return fc.assemble(
        structure(
            parts=lambda beam: springs,
            joints=lambda beam: [j for s in springs for j in (fc.Support(s.start, "u v w"), fc.Pin(s.end, beam.start))],
        ),
        LARGE,
    )
