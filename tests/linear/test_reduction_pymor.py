"""The same reductions by pyMOR, an independent code."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fixtures import structures as s

from flexctrl.linear.reduction import BalancedTruncation, ModalTruncation, MomentMatching, hankel_singular_values

pytest.importorskip("pymor", reason="pyMOR is not installed (development extra)")


@pytest.fixture(scope="module", autouse=True)
def _quiet():
    from pymor.core.logger import set_log_levels

    set_log_levels({"pymor": "ERROR"})


def pymor_model(linear):
    from pymor.models.iosys import SecondOrderModel

    M, C, K = (A.toarray() for A in (linear.M, linear.C, linear.K))
    return SecondOrderModel.from_matrices(M, C, K, linear.B, linear.Cq)


def values(rom, omega):
    return np.stack([rom.transfer_function.eval_tf(1j * w) for w in omega], axis=-1)


def beam():
    """Six elements, 5e-4 s of stiffness-proportional damping; force and position at the tip."""
    return s.cantilever(6, alpha=0.2, beta=5e-4)


OMEGA = np.unique(np.concatenate([np.geomspace(0.3, 400.0, 200), beam().modes().omega[:5]]))


def test_balanced_truncation_and_its_error():
    from pymor.reductors.bt import BTReductor

    full = s.six_mass_chain()
    theirs = pymor_model(full).to_lti()
    np.testing.assert_allclose(hankel_singular_values(full), theirs.hsv(), rtol=1e-7)
    ours = full.reduce(BalancedTruncation(6))
    rom = BTReductor(theirs).reduce(6)
    w = np.geomspace(0.05, 3.0, 300)
    np.testing.assert_allclose(ours.transfer(3.0)(1j * w), values(rom, w), rtol=1e-6)
    pytest.importorskip("slycot", reason="pyMOR's H-infinity norm needs slycot")
    np.testing.assert_allclose(ours.error.absolute[0, 0], (theirs - rom).hinf_norm(), rtol=1e-6)


def test_modal_truncation_and_its_error():
    from pymor.reductors.mt import MTReductor

    full = beam()
    rom = MTReductor(pymor_model(full).to_lti()).reduce(8, decomposition="eig", which="SM")
    ours = full.reduce(ModalTruncation(4))
    np.testing.assert_allclose(ours.linear.frequency_response(OMEGA).values, values(rom, OMEGA), rtol=1e-6)
    exact = values(pymor_model(full), OMEGA)
    gap = abs(exact - values(rom, OMEGA)).max()
    mine = abs(full.frequency_response(OMEGA).values - ours.frequency_response(OMEGA).values).max()
    np.testing.assert_allclose(mine, gap, rtol=1e-6)


@pytest.mark.parametrize("points", [(5.0, 80.0), (20j, 150j), (10.0, 60j)])
def test_moment_matching_and_its_error(points):
    """Force and position at one point: both sides span one space, so the two projections are one."""
    from pymor.reductors.interpolation import SOBHIReductor

    full = beam()
    sigma = np.array([q for p in points for q in ([p] if np.isreal(p) else [p, np.conj(p)])], complex)
    one = np.ones((len(sigma), 1))
    rom = SOBHIReductor(pymor_model(full)).reduce(sigma, one, one)
    ours = full.reduce(MomentMatching(points, len(sigma)))
    assert ours.order == len(sigma)
    np.testing.assert_allclose(ours.frequency_response(OMEGA).values, values(rom, OMEGA), rtol=1e-6)


def test_balanced_truncation_of_a_beam_with_two_ports():
    from pymor.reductors.bt import BTReductor

    full = beam()
    at = np.eye(len(full.coordinates))[:, [4, -2]]
    full = replace(full, B=at, Cq=at.T, Cv=0 * at.T, D=np.zeros((2, 2)), inputs=("a", "b"), outputs=("c", "d"))
    rom = BTReductor(pymor_model(full).to_lti()).reduce(6)
    ours = full.reduce(BalancedTruncation(6))
    scale = abs(values(rom, OMEGA)).max()
    np.testing.assert_allclose(ours.transfer(400.0)(1j * OMEGA), values(rom, OMEGA), atol=1e-6 * scale)
