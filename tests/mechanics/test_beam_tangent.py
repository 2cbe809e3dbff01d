"""The tangent of a beam derived in its frame is the derivative of the force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from moving_nodes import random_slots
from test_beam import ENDS, parameters

import flexctrl as fc
from flexctrl.model.laws.kinds import Kernels
from flexctrl.model.laws.part_kinds import BEAM, modal_beam

EFFECTS = {
    "inertia": (),
    "flexible": (fc.BeamFlexibility(), fc.Gravity((1.0, -2.0, -9.0))),
    "damped": (fc.BeamFlexibility(), fc.RayleighDamping(0.3, 0.02)),
}
PLAIN = replace(BEAM, slope=None)


@pytest.mark.parametrize("effects", EFFECTS)
def test_tangent_in_the_frame_is_the_derivative_by_differentiation(effects):
    ours, plain = (Kernels(kind, EFFECTS[effects]).tangent for kind in (BEAM, PLAIN))
    p = np.array(parameters()).ravel()
    for seed, (turn, push) in enumerate([(0.0, 0.0), (1e-6, 1e-6), (0.3, 0.1), (0.9, 0.4)]):
        slots = random_slots(seed, ENDS, turn, push, 2.0)
        for seeds in [*np.eye(3).tolist(), [1.0, 20.0, 400.0]]:
            found, expected = (np.array(k.function()(np.concatenate([slots, seeds]), p)) for k in (ours, plain))
            assert np.abs(found - expected).max() < 1e-13 * np.abs(expected).max(initial=1e-3)
    assert ours.instructions < 0.65 * plain.instructions


@pytest.mark.parametrize("along", [0, 2])
@pytest.mark.parametrize("effects", EFFECTS)
def test_tangent_of_an_element_with_modes_too(effects, along):
    kind = modal_beam(2, along)
    ours, plain = (Kernels(k, EFFECTS[effects]).tangent for k in (kind, replace(kind, slope=None)))
    p, rng = np.array(parameters()).ravel(), np.random.default_rng(4)
    slots = np.concatenate([random_slots(2, ENDS, 0.3, 0.1, 2.0), 0.02 * rng.standard_normal(4 * kind.drives)])
    for seeds in [*np.eye(3).tolist(), [1.0, 20.0, 400.0]]:
        found, expected = (np.array(k.function()(np.concatenate([slots, seeds]), p)) for k in (ours, plain))
        assert np.abs(found - expected).max() < 1e-13 * np.abs(expected).max(initial=1e-3)
    assert ours.instructions < 0.8 * plain.instructions


def test_in_a_turning_frame_the_whole_force_is_differentiated():
    effects = (fc.BeamFlexibility(), fc.RotatingFrame((0.0, 0.0, 2.0)))
    p, slots = np.array(parameters()).ravel(), random_slots(3, ENDS, 0.2, 0.1, 2.0)
    z = np.concatenate([slots, [1.0, 20.0, 400.0]])
    found, expected = (np.array(Kernels(kind, effects).tangent.function()(z, p)) for kind in (BEAM, PLAIN))
    assert np.array_equal(found, expected)
