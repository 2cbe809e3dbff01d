"""Every tool on the same random models, against plain dense linear algebra."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la
from fixtures.random_models import anything, dense_response

from flexctrl.linear.discrete import ZeroOrderHold


@pytest.mark.parametrize("seed", range(120))
def test_all_tools_agree_with_dense_algebra(seed):
    linear, planted = anything(seed)
    s = 1j * np.geomspace(0.05, 20, 12)
    reference = dense_response(linear, s)
    top = np.abs(reference).max()
    # close to an undamped pole every method loses digits as the response grows
    small = 1e-10 * top * max(1.0, 1e-3 * top / np.median(np.abs(reference)))
    assert np.abs(linear.frequency_response(s.imag).values - reference).max() < small
    assert np.abs(linear.to_ss()(s) - reference).max() < small
    assert np.abs(dense_response(linear.condense(), s) - reference).max() < small
    assert linear.modes().rigid == planted
    assert np.isfinite(linear.frequency_response().values).all()


@pytest.mark.parametrize("seed", range(120))
def test_poles_make_the_pencil_singular_and_are_complete(seed):
    linear, planted = anything(seed)
    M, C, K = (A.toarray() for A in (linear.M, linear.C, linear.K))
    size = 1 / np.sqrt(np.abs(np.diag(K)) + np.abs(np.diag(M)) + np.abs(np.diag(C)))
    poles = linear.damped_poles()
    for pole in poles:
        pencil = size[:, None] * (K + pole * C + pole**2 * M) * size
        assert la.svdvals(pencil)[-1] < 1e-9 * max(1.0, abs(pole) ** 2)
    assert np.count_nonzero(poles == 0) >= planted
    rank = np.linalg.matrix_rank(size[:, None] * M * size, tol=1e-9)
    extra = np.linalg.matrix_rank(np.hstack([size[:, None] * M, size[:, None] * C]) * np.r_[size, size], tol=1e-9)
    assert poles.size == rank + extra


@pytest.mark.parametrize("seed", range(0, 120, 6))
def test_sampled_poles_are_the_exponentials(seed):
    linear, _ = anything(seed)
    dt = 0.05
    system = linear.discretize(dt, ZeroOrderHold())
    # traces of powers are symmetric functions of the poles: no pairing, no sensitivity of a defective zero
    expected = np.exp(linear.damped_poles() * dt)
    for power in (1, 2, 3):
        trace = np.trace(np.linalg.matrix_power(system.A, power))
        assert trace == pytest.approx((expected**power).sum().real, rel=1e-9)
