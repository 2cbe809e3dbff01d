"""Beams a hundred million times as stiff along as across that fall, with damping that goes by stiffness.

In steps of any length speeds are ahead of the true ones a little, along what turns too. Damping of so stiff an axis
would take more of that than there is energy, and the method gives it back: nothing is lost of either.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc

UNTIL, ROWS = 2.0, 0.02
CHOSEN, GIVEN = None, fc.GeneralizedAlpha(0.005)


def falling(ratio: float, beta: float, backend: fc.CasadiVM | None = None) -> fc.Model:
    """A cantilever of 1 m and 1 kg, let go from the horizontal; EA is the ratio times EI/L²."""
    section = fc.Section(EA=ratio, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=1e-6)
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), section, elements=12)
    outputs = [fc.Position(axis, beam.end, axis) for axis in "xz"]
    structure = fc.planar(fc.Structure([beam], [fc.Support(beam.start)], outputs=outputs), "y")
    effects = [fc.LargeRotation(), fc.Gravity((0, 0, -15)), fc.Flexible(), fc.RayleighDamping(beta=beta)]
    return fc.assemble(structure, effects, backend)


def chained(links: int, beta: float, times: np.ndarray) -> np.ndarray:
    """The end of as many rigid rods in a row, hinged by springs of EI over their length, by Radau's method."""
    h, beyond = 1.0 / links, links - 1.0 - np.arange(links)
    springs = np.full(links, links)
    springs[0] *= 2  # half a rod from the clamp
    between = np.eye(links) - np.eye(links, k=-1)
    stiffness = between.T @ np.diag(springs) @ between
    inertia = h**3 * (np.minimum.outer(beyond, beyond) + 0.5)
    inertia[np.diag_indices(links)] = h**3 * (beyond + 1.0 / 3.0)
    weight = 15.0 * h**2 * (beyond + 0.5)

    def slope(_: float, y: np.ndarray) -> np.ndarray:
        angle, rate = y[:links], y[links:]
        apart = np.subtract.outer(angle, angle)
        force = -(inertia * np.sin(apart)) @ rate**2 - weight * np.cos(angle) - stiffness @ (angle + beta * rate)
        return np.concatenate([rate, np.linalg.solve(inertia * np.cos(apart), force)])

    found = solve_ivp(slope, (0.0, times[-1]), np.zeros(2 * links), "Radau", t_eval=times, rtol=1e-6, atol=1e-7)
    angles = found.y[:links]
    return h * np.array([np.cos(angles).sum(axis=0), np.sin(angles).sum(axis=0)]).T


@pytest.fixture(scope="module", params=[0.002, 0.01], ids=lambda beta: f"beta={beta}")
def resolved(request: pytest.FixtureRequest) -> tuple[float, np.ndarray]:
    """The damping, and the path, which is that of rods in a row, at a ratio at which steps of 0.2 ms see it all."""
    model = falling(1e6, request.param)
    run = fc.simulate(model, until=UNTIL, every=ROWS, method=fc.Unchecked(fc.GeneralizedAlpha(2e-4)))
    assert run.report.energy_residual < 1e-5
    coarse, fine = (chained(links, request.param, run.t) for links in (10, 20))
    assert run.y == pytest.approx((4.0 * fine - coarse) / 3.0, abs=4e-3)
    return request.param, run.y


@pytest.mark.parametrize("method", [CHOSEN, GIVEN], ids=["chosen", "given"])
@pytest.mark.parametrize("ratio", [1e6, 1e7, 1e8])
def test_it_falls_as_one_that_hardly_stretches(resolved, ratio, method):
    """Its stretch is 7.5 m s⁻² ρA L²/EA, a millionth and less."""
    beta, path = resolved
    run = fc.simulate(falling(ratio, beta), until=UNTIL, every=ROWS, method=method)
    assert run.status is fc.Status.FINISHED
    off = np.abs(run.y - path).max() / np.ptp(path, axis=0).max()
    assert off < 0.006
    assert 0.5 * off < run.report.error < 0.03
    assert run.report.energy_residual < 0.01


@pytest.mark.parametrize("backend", [None, fc.CasadiVM()], ids=["compiled", "plain"])
def test_what_is_booked_as_lost_is_about_what_damping_takes(resolved, backend):
    """Quadrature of the powers at the ends of steps says 2.5 and 1.9 times as much."""
    beta, _ = resolved
    run = fc.simulate(falling(1e8, beta, backend), until=1.0, method=fc.Unchecked(GIVEN))
    same = fc.simulate(falling(1e6, beta), until=1.0, method=fc.Unchecked(fc.GeneralizedAlpha(2e-4)))
    assert run.report.energy.dissipated == pytest.approx(same.report.energy.dissipated, rel=0.1)
