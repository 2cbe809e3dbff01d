"""Energy of damped springs that steps of the midpoint rule do not see: what it takes of them is booked to round-off."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

STIFFNESS, MASS = 1e4, 1.0


@pytest.mark.parametrize("ratio", [0.0, 1e-3, 1e-2, 0.3])
@pytest.mark.parametrize("turned", [0.3, 3.0, 8.0], ids=lambda turned: f"turned={turned}")
def test_a_damped_spring_loses_what_the_rule_takes(ratio, turned):
    """The rule maps (x, v) by (1 − hA/2)⁻¹ (1 + hA/2): its energy after n steps is that of the n-th power."""
    omega = np.sqrt(STIFFNESS / MASS)
    damping, step = 2.0 * ratio * np.sqrt(STIFFNESS * MASS), turned / omega
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=STIFFNESS, damping=damping)
    mass = fc.PointMass("mass", spring.end, MASS)
    joints = [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")]
    model = fc.assemble(fc.Structure([spring, mass], joints), [fc.LargeRotation()])
    run = fc.simulate(
        model, until=60 * step, start=model.displace([0.01]), method=fc.Unchecked(fc.ConservingMidpoint(step))
    )
    A, I = np.array([[0.0, 1.0], [-STIFFNESS / MASS, -damping / MASS]]), np.eye(2)
    x, v = np.linalg.matrix_power(np.linalg.solve(I - step / 2 * A, I + step / 2 * A), 60) @ [0.01, 0.0]
    left = 0.5 * STIFFNESS * x**2 + 0.5 * MASS * v**2
    start = 0.5 * STIFFNESS * 0.01**2
    assert run.status is fc.Status.FINISHED
    assert run.report.steps == 60
    assert run.report.energy.dissipated == pytest.approx(start - left, abs=1e-9 * start)
    assert run.report.energy_residual < 1e-9
