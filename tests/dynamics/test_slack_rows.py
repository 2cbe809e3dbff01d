"""Rows of many pieces that go slack and taut: steps do not end at each of their corners."""

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.swift.stiff_lines import _lines, frequencies, pulls_of
from flexctrl.model.laws import kinks
from flexctrl.model.model import Model


def slack_rope(pieces: int) -> Model:
    """A rope of 10.5 m in two halves, drawn over 10 m: slack all along, it falls until it is taut from its ends on."""
    how = {"EA": 1e5, "length": 5.25, "rhoA": 1.0, "elements": pieces // 2}
    left, right = fc.Rope("left", (0, 0, 0), (5, 0, 0), **how), fc.Rope("right", (5, 0, 0), (10, 0, 0), **how)
    joints = [fc.Support(left.start, held="u v w"), fc.Support(right.end, held="u v w"), fc.Pin(left.end, right.start)]
    machine = fc.Structure([left, right], joints, outputs=[fc.Position("sag", left.end, "z")])
    return fc.assemble(machine, [fc.Gravity(), fc.RopeMass(), fc.RopeStretch(), fc.LargeRotation()])


def test_steps_end_at_the_corners_of_a_few_ropes_not_of_many():
    few, many = slack_rope(kinks.MANY), slack_rope(kinks.MANY + 2)
    assert len(few.kinks.met.names) == kinks.MANY
    assert many.kinks.met.names == ()
    assert len(many.kinks.names) == kinks.MANY + 2  # an equilibrium still tells what stands on its corner


def test_books_of_a_row_are_the_better_for_it(monkeypatch):
    """The ends are caught piece by piece, while the middle falls freely."""
    passed = fc.simulate(slack_rope(60), until=0.4, every=0.01)
    monkeypatch.setattr(kinks, "MANY", 10**6)
    located = fc.simulate(slack_rope(60), until=0.4, every=0.01)
    np.testing.assert_allclose(passed["sag"], -0.5 * 9.81 * passed.t**2, atol=1e-6)
    assert passed.report.energy_residual < located.report.energy_residual
    assert passed.report.steps < 0.5 * located.report.steps


def test_steps_of_a_row_grow_as_the_number_of_its_pieces():
    """Waves take 1/n as long over each piece: that many steps are needed, and no more."""
    steps = [fc.simulate(slack_rope(n), until=0.3).report.steps for n in (40, 80, 160)]
    assert (np.log2(np.array(steps[1:]) / np.array(steps[:-1])) < 1.2).all(), steps


def test_pieces_pull_at_six_places_each():
    model = slack_rope(200)
    pulls = pulls_of(model, _lines(model), model.rest)
    assert pulls.shape[0] == 200
    assert pulls.nnz <= 6 * 200
    piece = 10.5 / 200
    np.testing.assert_allclose(frequencies(model)[5], np.sqrt(1e5 / piece * 2.0 / (10.0 / 12.0 * piece)))


@pytest.mark.slow
def test_ten_thousand_slack_pieces_begin_to_fall():
    run = fc.simulate(slack_rope(10_000), until=0.005)
    assert run.status is fc.Status.FINISHED
    np.testing.assert_allclose(run["sag"][-1], -0.5 * 9.81 * 0.005**2, rtol=1e-6)
