"""A refined structure is the same machine."""

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.cranes import bridge_crane, ceiling_crane, flexible_arm
from flexctrl.errors import StructureError
from flexctrl.structure.refine import refine


@pytest.mark.parametrize("crane", [ceiling_crane, bridge_crane, flexible_arm])
@pytest.mark.parametrize("factor", [2, 3])
def test_the_rigid_twin_does_not_change(crane, factor):
    effects = [fc.Gravity(), fc.LargeRotation()]
    coarse, fine = (fc.assemble(s, effects) for s in (crane(), refine(crane(), factor)))
    assert coarse.n == fine.n
    M = [m.mass().toarray() for m in (coarse, fine)]
    np.testing.assert_allclose(M[1], M[0], rtol=1e-9, atol=1e-9 * np.abs(M[0]).max())
    np.testing.assert_allclose(coarse.measure(coarse.rest), fine.measure(fine.rest), atol=1e-12)


def test_it_is_the_crane_built_with_that_mesh():
    ours = refine(ceiling_crane(), 4)
    theirs = ceiling_crane(4)
    omega = [
        fc.linearize(fc.assemble(s, [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])).modes(8).omega
        for s in (ours, theirs)
    ]
    np.testing.assert_allclose(omega[0], omega[1], rtol=1e-7, atol=1e-6)


def test_once_is_the_same():
    assert refine(bridge_crane(), 1) == bridge_crane()


def test_wrong_factors_and_tables_are_refused():
    with pytest.raises(StructureError, match="whole number"):
        refine(ceiling_crane(), 0)
    crane = ceiling_crane()
    tabled = crane.with_(joints=fc.JoinTable.from_rows(crane.join_table.rows))
    with pytest.raises(StructureError, match="join table of numbers"):
        refine(tabled, 2)
