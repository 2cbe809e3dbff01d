"""Elements shorter than their section is thick: their tangents serve as long as those of longer ones."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flexctrl as fc
from flexctrl.dynamics.march.swaying import sway_back, sway_on
from flexctrl.model.flat import axes
from flexctrl.model.flat.flattening import flatten

pytest.importorskip("llvmlite")

HOSE = fc.Section(EA=1e4, EI_y=2.0, EI_z=1.0, GJ=1.5, rhoA=1.0, rhoJ=1e-3)
"""Radius of gyration 14 mm: elements below 35 mm resist shear twice as much as stretching."""


def chain(elements: int) -> fc.Structure:
    """Let go from beside and pushed out of its plane."""
    beam = fc.Beam("hose", (0, 0, 0), (2, 0, -1), HOSE, elements=elements)
    outputs = [fc.Position(d, beam.end, d) for d in "xyz"]
    return fc.Structure([beam], [fc.Support(beam.start, held="u v w")], [], [fc.Force("push", beam.end, "y")], outputs)


def forked(elements: int) -> fc.Structure:
    """Two beams head to head, and one across: welded nodes share their freedoms."""
    one = fc.Beam("one", (0, 0, 0), (1, 0, 0), HOSE, elements=elements // 3)
    two = fc.Beam("two", (2.2, 0, 0.5), one.end.position, HOSE, elements=elements // 3)
    side = fc.Beam("side", one.node(elements // 6).position, (0.5, 1, 0), HOSE, elements=elements // 3)
    joints = [fc.Support(one.start), fc.Weld(one.end, two.end), fc.Weld(one.node(elements // 6), side.start)]
    outputs = [fc.Position(d, two.start, d) for d in "xyz"]
    return fc.Structure([one, two, side], joints, [], [fc.Force("push", side.end, "y")], outputs)


def run(structure: fc.Structure) -> fc.Run:
    model = fc.assemble(structure, [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])
    method = fc.Unchecked(fc.GeneralizedAlpha(2e-3))
    return fc.simulate(model, method=method, inputs={"push": 2.0}, until=0.8, every=0.02)


def test_a_finely_divided_chain_needs_no_more_tangents_than_a_coarse_one():
    coarse, fine = (run(chain(n)) for n in (40, 600))
    assert fine.report.factorisations <= 2 * coarse.report.factorisations
    assert np.ptp(fine["z"]) > 1.0
    assert np.ptp(fine["y"]) > 0.1
    np.testing.assert_allclose(fine.y, coarse.y, atol=0.02)


@pytest.mark.parametrize(("machine", "elements"), [(chain, 600), (forked, 999)])
def test_the_motion_is_that_of_tangents_made_more_often(monkeypatch, machine, elements):
    with_sway = run(machine(elements))
    monkeypatch.setattr(axes, "_fine", lambda model, of: [])
    without = run(machine(elements))
    assert with_sway.report.factorisations < 0.6 * without.report.factorisations
    assert with_sway.report.newton_iterations <= 1.02 * without.report.newton_iterations
    np.testing.assert_allclose(with_sway.y, without.y, rtol=0, atol=1e-3)


def test_what_forces_do_is_the_transposed_of_what_motions_do():
    rng = np.random.default_rng(0)
    R = Rotation.random(random_state=1).as_matrix()
    bent, motion, push = rng.normal(size=(3, 6))
    bent[3:] /= np.linalg.norm(bent[3:])
    moved, pushed = motion.copy(), push.copy()
    sway_on(R.ravel(), bent, moved[:3], moved[3:])
    sway_back(R.ravel(), bent, pushed[:3], pushed[3:])
    kappa, way = bent[:3], bent[3:]
    turned = motion[3:] + kappa * (way @ motion[:3]) - motion[:3] * (way @ kappa)
    np.testing.assert_allclose(moved, [*R @ motion[:3], *R @ turned], atol=1e-14)
    assert moved @ push == pytest.approx(motion @ pushed, rel=1e-13)


@pytest.mark.parametrize(("machine", "count"), [(chain(40), 0), (chain(100), 98), (forked(300), 295)])
def test_only_fine_beams_sway_but_where_they_fork_or_end(machine, count):
    """Longer elements resist stretching more; a node that two elements end at, or three meet in, leads no one way."""
    assert flatten(fc.assemble(machine, [fc.Flexible(), fc.LargeRotation()])).axes.swaying == count


@pytest.mark.parametrize("follows", [False, True])
def test_a_run_goes_on_with_the_same_bits(follows):
    """Under forces that turn with nodes a tangent is kept itself, and with it how it is seen."""
    drawn = forked(300)
    push = fc.FollowerForce("push", drawn.elements[2].end, "y") if follows else drawn.inputs[0]
    structure = fc.Structure(drawn.elements, drawn.joints, [], [push])
    model = fc.assemble(structure, [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])
    how = {"method": fc.Unchecked(fc.Richardson(fc.GeneralizedAlpha(4e-3))), "inputs": {"push": 2.0}}
    whole = fc.simulate(model, until=0.2, **how)
    rest = fc.simulate(model, until=0.2, start=fc.simulate(model, until=0.1, **how).checkpoint, **how)
    assert np.array_equal(rest.final.x, whole.final.x)
    assert np.array_equal(rest.final.v, whole.final.v)
