"""What a run turns over counts what goes from kinetic to stored energy, however the clock cuts it into rides."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc


def thrown(across: float, **how: object) -> fc.Run:
    """A mass thrown past the fixed end of a spring, whose potential takes nearly all it has in the end."""
    spring, mass = (
        fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=10.0, length=0.5),
        fc.PointMass("m", (1, 0, 0), 1.0),
    )
    structure = fc.Structure([spring, mass], [fc.Support(spring.start), fc.Pin(spring.end, mass.node)])
    model = fc.assemble(structure, [fc.LargeRotation()])
    return fc.simulate(model, until=2.0, start=model.rest.with_(v=np.array([-5.0, across, 0.0])), **how)


@pytest.mark.parametrize("across", [0.3, 0.05])
def test_a_run_that_is_right_finishes(across):
    run = thrown(across)
    assert run.status is fc.Status.FINISHED
    assert run.report.energy.kinetic < 0.2
    assert run.report.energy_residual < 0.02


def test_the_turnover_of_a_pendulum_back_at_its_start():
    bob = fc.PointMass("bob", (0.1, 0, -np.sqrt(0.99)), 1.0)
    link = fc.Rope("link", (0, 0, 0), (0.1, 0, -np.sqrt(0.99)), EA=1e6, length=1.0)
    structure = fc.Structure([link, bob], [fc.Support(link.start), fc.Pin(link.end, bob.node)])
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Gravity()])
    period = 2.0 * np.pi / np.sqrt(9.81) * (1.0 + 0.1**2 / 16.0)
    run = fc.simulate(model, until=period, method=fc.GeneralizedAlpha(period / 2000))
    swing = 9.81 * (1.0 - np.sqrt(0.99))
    gap = abs(run.report.energy.gap)
    assert gap <= 1e-3 * swing
    assert run.report.energy_residual <= 1e-3
    assert run.status is fc.Status.FINISHED
