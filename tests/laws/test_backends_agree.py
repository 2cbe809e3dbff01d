"""The compiled path gives the same numbers as casadi's virtual machine."""

from __future__ import annotations

import numpy as np
import pytest
from machines import machine

import flexctrl as fc

pytest.importorskip("llvmlite")


@pytest.mark.parametrize(("seed", "effects"), [(4, [fc.Flexible()]), (10, []), (16, [fc.Flexible()])])
def test_compiled_models_agree_with_the_virtual_machine(seed, effects):
    common = [fc.Gravity(), fc.LargeRotation(), fc.RayleighDamping(0.1, 0.02)]
    plain = fc.assemble(machine(seed, 6), [*common, *effects], fc.CasadiVM())
    compiled = plain.with_(backend=fc.Compiled())
    rng = np.random.default_rng(seed)
    v, a = rng.normal(size=(2, plain.n))
    state = plain.displace(0.3 * rng.normal(size=plain.n)).with_(v=v)
    u = rng.normal(size=len(plain.inputs))
    for f in (
        lambda m: m.balance(state, v, a),
        lambda m: m.slope(state, v, a, (1.0, 20.0, 400.0), u).toarray(),
        lambda m: np.array(m.energy(state)),
    ):
        expected = f(plain)
        assert np.allclose(f(compiled), expected, rtol=0, atol=1e-12 * np.abs(expected).max())
