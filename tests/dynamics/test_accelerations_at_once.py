"""Accelerations by one kernel of a machine of few freedoms are those by its mass matrix."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics.methods.masses import Masses
from flexctrl.dynamics.steps import Counts
from flexctrl.model.momenta import inertia


def top() -> fc.Model:
    body = fc.RigidBody("top", (0, 0, 0.3), 1.0, (0.01, 0.01, 0.02), {"foot": (0, 0, 0)})
    return fc.assemble(
        fc.Structure([body], [fc.Support(body.point("foot"), "u v w")]), [fc.Gravity(), fc.LargeRotation()]
    )


def crane() -> fc.Model:
    return fc.assemble(fc.cranes.bridge_crane(), [fc.Gravity(), fc.LargeRotation()])


def pendulum() -> fc.Model:
    """Two rods, a driven hinge between them."""
    rods = [
        fc.RigidBody(name, (0, 0, -z), 2.0, (0.1, 0.1, 0.01), {"top": (0, 0, 0.5 - z), "end": (0, 0, -0.5 - z)})
        for name, z in (("upper", 0.5), ("lower", 1.5))
    ]
    hinge = fc.Pin(rods[0].point("end"), rods[1].point("top"))
    plan = fc.Structure(
        rods, [fc.Support(rods[0].point("top"), "u v w rx rz"), hinge, fc.Support(rods[1].node, "rx rz")]
    )
    return fc.assemble(plan, [fc.Gravity(), fc.LargeRotation()])


@pytest.mark.parametrize("make", [top, crane, pendulum])
def test_they_are_those_by_the_mass_matrix(make):
    model, rng = make(), np.random.default_rng(1)
    masses = Masses(model, Counts())
    assert masses._entire is not None
    for _ in range(5):
        state = model.displace(0.3 * rng.standard_normal(model.n)).with_(v=rng.standard_normal(model.n))
        u = rng.standard_normal(len(model.inputs))
        told, still = masses.accelerations(state, u, np.zeros(model.n)), np.zeros(model.n)
        loads = model.loads(state, u)
        found = masses.solve(
            lambda a, s=state, f=loads: -model.balance(s, s.v, a) - f,
            lambda a, s=state: inertia(model, s, a),
            state,
            still,
        )
        np.testing.assert_allclose(told, found, rtol=1e-9, atol=1e-9 * np.abs(found).max())


def test_no_mass_matrix_is_made_for_it():
    run = fc.simulate(
        top(), until=0.1, method=fc.ExplicitRungeKutta(), start=top().rest.with_(v=np.array([0.3, 0.0, 60.0]))
    )
    assert run.report.factorisations == 0
    assert run.report.energy_residual < 1e-6
