"""Tangents from differences of the forces, in groups of columns, against the assembled ones with turning levers."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.alpha.point import Coefficients
from flexctrl.dynamics.march.making import Method
from flexctrl.dynamics.march.marching import Marcher
from flexctrl.dynamics.march.probing import probe
from flexctrl.dynamics.scales import turning, yardsticks

pytest.importorskip("llvmlite")


def marcher(model: fc.Model) -> Marcher:
    return Marcher(model, Method(Coefficients.of(0.8), 1e-10, 1.0 / yardsticks(model), turning(model)))


@pytest.mark.parametrize(
    ("structure", "effects", "whole"),
    [
        (fc.cranes.flexible_arm(), [fc.Flexible(), fc.RayleighDamping(0.0, 1e-3)], 0),
        (fc.cranes.flexible_arm(), [], 0),
        (fc.cranes.ceiling_crane(), [], 0),
        (fc.coarsen(fc.cranes.flexible_arm()), [fc.ComponentModes(1), fc.ShaftElasticity()], 0),
        (fc.coarsen(fc.cranes.flexible_arm()), [fc.ComponentModes(1), fc.ShaftElasticity()], 1),
    ],
)
@pytest.mark.parametrize(
    ("seeds", "least"), [((1.0, 2e2, 4e4), 1.0), ((0.0, 0.0, 1.0), 1.0), ((1.0, 2e8, 4e16), 1e-12)]
)
def test_probed_tangents_are_the_assembled_ones(structure, effects, whole, seeds, least):
    model = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation(), *effects])
    found, rng = marcher(model), np.random.default_rng(1)
    F, m = found.flattened, found.march
    assert m.whole >= whole
    state = model.advance(model.rest, 1e-2 * rng.standard_normal(model.n) * yardsticks(model), np.zeros(model.n), 0.0)
    v, a = (scale * rng.standard_normal(model.n) * yardsticks(model) for scale in (0.2, 1.0))
    u = rng.uniform(0.5, 1.0, len(model.inputs))
    F.enter(state.with_(v=v))
    found.supply(u)
    found.open(state.q, np.zeros(model.n), False)
    F.flat.v[:], F.flat.rate[:] = F.ordered(v), F.ordered(a)
    probe(m.probes, F.flat, whole, *seeds, least, m.entries)
    wanted = model.slope(state.with_(v=v), v, a, seeds, u).toarray()
    rows, columns = (cells.ravel() for cells in np.indices(wanted.shape))
    inside = np.zeros(wanted.shape, dtype=bool)
    inside[F.pattern] = True
    rows, columns = np.nonzero(inside)
    got = m.entries[F.plan.places(rows, columns)]
    scale = np.sqrt(np.outer(*(np.abs(wanted).max(axis=k) for k in (1, 0))))[rows, columns]
    assert not wanted[~inside].any()
    assert np.all(np.abs(got - wanted[rows, columns]) <= 1e-4 * scale + 1e-12 * np.abs(wanted).max())
    assert m.probes.groups <= model.n
