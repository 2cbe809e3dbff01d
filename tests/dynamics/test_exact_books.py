"""Energy books of exact motion are exact too, however many periods a step holds."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import Table, pd


def cantilever() -> fc.Model:
    beam = fc.Beam("beam", (0, 0, 0), (2, 0, 0), fc.Section.tube(fc.STEEL, 0.05, 0.005), elements=3)
    structure = fc.Structure(
        [beam],
        [fc.Support(beam.start)],
        inputs=[fc.Force("push", beam.end, "z")],
        outputs=[fc.Position("z", beam.end, "z"), fc.Velocity("speed", beam.end, "z")],
    )
    return fc.assemble(structure, [fc.Flexible(), fc.RayleighDamping(beta=1e-3)])


def kicked(model: fc.Model) -> fc.State:
    return model.rest.with_(v=np.array([0.0 if name.endswith("rx") else 0.1 for name in model.coordinates]))


@pytest.mark.parametrize("step", [1e-3, 5e-3, 0.033])
def test_a_sampled_loop(step):
    model = cantilever()
    law = fc.Sampled(pd(-500.0, -20.0, measured="z", rate="speed", command="push"), 0.013)
    run = fc.simulate(model, law, until=0.3, start=kicked(model), method=fc.Exact(step))
    assert run.report.energy.dissipated > 0.2
    assert run.report.energy_residual < 1e-12


@pytest.mark.parametrize("step", [1e-3, 0.033])
def test_a_load_that_is_held(step):
    model = cantilever()
    run = fc.simulate(model, until=0.3, start=kicked(model), inputs={"push": 100.0}, method=fc.Exact(step))
    moved = run["z"][-1] - run["z"][0]
    assert run.report.energy.work == pytest.approx(100.0 * moved, rel=1e-9)
    assert run.report.energy_residual < 1e-12


@pytest.mark.parametrize("step", [1e-3, 0.02])
def test_a_linear_law_in_continuous_time(step):
    linear = fc.linearize(cantilever())
    law = pd(-500.0, -20.0, measured="z", rate="speed", command="push")
    run = fc.simulate(linear, law, until=0.3, inputs={"push": 100.0}, method=fc.Exact(step))
    assert run.report.energy_residual < 1e-11


def test_losses_are_the_integral_of_their_power():
    """An oscillator let go: ½ k x₀² (1 − e^(−2 ζ ω t) …) against a fine sum of c v²."""
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=100.0, damping=0.5)
    mass = fc.PointMass("mass", spring.end, 1.0)
    joints = [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")]
    structure = fc.Structure([spring, mass], joints, outputs=[fc.Velocity("v", mass.node, "x")])
    model = fc.assemble(structure, [fc.Flexible()])
    start = model.displace([0.3])
    coarse = fc.simulate(model, until=3.0, start=start, method=fc.Exact(1.5))
    fine = fc.simulate(model, until=3.0, start=start, method=fc.Exact(1e-3))
    assert coarse.report.energy.dissipated == pytest.approx(0.5 * np.trapezoid(fine["v"] ** 2, fine.t), rel=1e-5)


@pytest.mark.parametrize("step", [0.02, 0.5, 1.0])
def test_ramps(step):
    """Nothing is damped, so the work is the energy at the end; a quadrature told 20 and −69 times that."""
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=2e3)
    mass = fc.PointMass("mass", spring.end, 1.0)
    joints = [fc.Support(spring.start), fc.Pin(spring.end, mass.node), fc.Support(mass.node, "v w")]
    structure = fc.Structure([spring, mass], joints, inputs=[fc.Force("push", mass.node, "x")])
    law = fc.OpenLoop({"push": Table(np.arange(0.0, 13.0, 0.7), 30.0 * np.random.default_rng(1).normal(size=19))})
    run = fc.simulate(fc.assemble(structure, []), law, until=12.0, method=fc.Exact(step))
    energy = run.report.energy
    assert energy.work == pytest.approx(energy.kinetic + energy.stored, rel=1e-9)
    assert run.report.energy_residual < 1e-11


def test_work_under_a_ramp_is_that_by_hand():
    """A force f t on m ẍ + c ẋ = f t from rest: ∫ f t v dt with v = f (t − τ (1 − e^(−t/τ))) τ / m, τ = m/c."""
    m, c, f, T = 2.0, 3.0, 5.0, 4.0
    mass, ground = (
        fc.PointMass("mass", (0, 0, 0), m),
        fc.Spring("drag", (-1, 0, 0), (0, 0, 0), stiffness=0.0, damping=c),
    )
    joints = [fc.Support(ground.start), fc.Pin(ground.end, mass.node), fc.Support(mass.node, "v w")]
    model = fc.assemble(fc.Structure([mass, ground], joints, inputs=[fc.Force("push", mass.node, "x")]), [])
    run = fc.simulate(model, fc.OpenLoop({"push": Table([0.0, T], [0.0, f * T])}), until=T, method=fc.Exact(T))
    tau = m / c
    decayed = tau**2 - (tau * T + tau**2) * np.exp(-T / tau)
    work = f**2 * tau / m * (T**3 / 3.0 - tau * (T**2 / 2.0 - decayed))
    assert run.report.energy.work == pytest.approx(work, rel=1e-9)
    assert run.report.energy_residual < 1e-11
