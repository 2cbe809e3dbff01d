"""Where knots of a command cut all steps, runs in longer ones are the same run again, and tell nothing.

Steps of 0.1 s between knots of 0.1 s were told 0.0 of rates that are 8 % off: the runs beside them in steps of 0.2 s
and 0.14 s took the same hundred steps. So were some of runs of few steps, and of those that do not converge but in
halves.
"""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import OpenLoop, Spline, Table

KNOTS, UNTIL = 0.1, 10.0


def double_pendulum() -> fc.Model:
    upper = fc.RigidBody("upper", (0, 0, -1), 10.0, (1.0,) * 3, {"hook": (0, 0, 0), "end": (0, 0, -1)})
    lower = fc.RigidBody("lower", (0, 0, -1.7), 5.0, (0.5,) * 3, {"hook": (0, 0, -1)})
    joints = [fc.Support(upper.point("hook"), "u v w rx rz"), fc.Hinge(upper.point("end"), lower.point("hook"), "y")]
    outputs = [
        fc.Rotation("a", upper.node, "y"),
        fc.AngularVelocity("w", upper.node, "y"),
        fc.Rotation("b", lower.node, "y"),
        fc.Velocity("v", lower.node, "x"),
    ]
    machine = fc.Structure([upper, lower], joints, [], [fc.Torque("torque", upper.node, "y")], outputs)
    return fc.assemble(machine, [fc.Gravity(), fc.LargeRotation()])


def recorded(knots: np.ndarray) -> OpenLoop:
    torque = 30.0 * np.sin(2.1 * knots) * np.sin(0.5 * knots) + 25.0 * np.sin(5.3 * knots)
    return OpenLoop({"torque": Table(tuple(knots), tuple(torque))})


def held_against(model: fc.Model, law: OpenLoop, method: fc.Integrator, exact: fc.Integrator, until: float) -> fc.Run:
    """Of whatever is a hundredth of its range off, half at least is told."""
    run, right = (
        fc.simulate(model, law, until=until, every=until / 200, method=m) for m in (method, fc.Unchecked(exact))
    )
    assert run.status is fc.Status.FINISHED
    off = np.abs(run.y - right.y).max(axis=0) / np.ptp(right.y, axis=0)
    assert off.max() > 0.01
    for name, share in zip(run.outputs, off, strict=True):
        assert share < 0.01 or run.report.output_errors[name] > 0.5 * share, name
    return run


@pytest.mark.parametrize("share", [2.5, 1.0, 0.7, 0.6, 0.4])
def test_steps_that_knots_cut_are_told_by_a_finer_run(share):
    law = recorded(np.arange(0.0, UNTIL + 0.5 * KNOTS, KNOTS))
    exact = fc.GeneralizedAlpha(0.005 * KNOTS)
    held_against(double_pendulum(), law, fc.GeneralizedAlpha(share * KNOTS), exact, UNTIL)


@pytest.mark.parametrize("seed", [1, 2])
def test_knots_may_lie_anywhere(seed):
    rng = np.random.default_rng(seed)
    knots = np.append(np.cumsum(rng.uniform(0.02, 0.2, 120)), UNTIL + 5.0)
    law = recorded(np.append(0.0, knots[(np.arange(len(knots)) % 40 > 3) | (knots > UNTIL)]))
    held_against(double_pendulum(), law, fc.GeneralizedAlpha(0.12), fc.GeneralizedAlpha(5e-4), UNTIL)


def test_the_same_of_a_method_without_damping():
    law = recorded(np.arange(0.0, UNTIL + 0.5 * KNOTS, KNOTS))
    exact = fc.GeneralizedAlpha(0.005 * KNOTS)
    held_against(double_pendulum(), law, fc.ConservingMidpoint(0.8 * KNOTS), exact, UNTIL)


def test_runs_of_one_step_are_told_by_two():
    pushed = OpenLoop({"torque": Table((0.0, 1.0), (10.0, 20.0))})
    run = held_against(double_pendulum(), pushed, fc.GeneralizedAlpha(0.3), fc.GeneralizedAlpha(1e-4), 0.3)
    assert run.report.steps <= 2


def slider_crank() -> fc.Model:
    """A rigid crank that goes round, and a rod that bends."""
    crank = fc.RigidBody("crank", (0, 0, 0.088), 0.173, (0.0018,) * 3, {"o": (0, 0, 0), "e": (0, 0, 0.1766)})
    section = fc.Section.tube(fc.STEEL, radius=6.07e-3, thickness=1.214e-3)
    rod = fc.Beam("rod", (0, 0, 0.1766), (0.5647, 0, 0), section, elements=3)
    piston = fc.PointMass("piston", rod.end, 0.2756)
    joints = [
        fc.Support(crank.point("o"), "u v w rx rz"),
        fc.Hinge(crank.point("e"), rod.start, "y"),
        fc.Pin(rod.end, piston.node),
        fc.Support(piston.node, "v w"),
    ]
    inputs = [fc.Torque("torque", crank.node, "y"), fc.Force("push", piston.node, "x")]
    outputs = [
        fc.AngularVelocity("speed", crank.node, "y"),
        fc.Position("place", piston.node, "x"),
        fc.Velocity("rate", piston.node, "x"),
    ]
    machine = fc.planar(fc.Structure([crank, rod, piston], joints, [], inputs, outputs), "y")
    return fc.assemble(machine, [fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(beta=1e-4)])


def test_chosen_steps_that_knots_keep_short_are_told_by_a_finer_run():
    """Under 27 and 243 times the tolerance a run took a step for each of 240 knots, alike: 6 % was told as 0.9."""
    until = 2.303
    t = np.linspace(0.0, until, 240)
    torque = Table((0.0, 0.5757, 1.1515, until), (0.09135, 0.04722, 0.08623, 0.04118))
    law = OpenLoop({"torque": torque, "push": Spline(tuple(t), tuple(0.12315 * np.sin(8.247 * t)))})
    held_against(slider_crank(), law, fc.AdaptiveAlpha(), fc.GeneralizedAlpha(until / 24000), until)
