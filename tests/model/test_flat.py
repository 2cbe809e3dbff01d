"""A model on flat vectors does what the model does, compiled or not."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flexctrl as fc
from flexctrl.kernels.native import Packed, Reals
from flexctrl.model.flat.flat import drive, energy, keep, load, place, pull, push, tangent
from flexctrl.model.flat.flattening import Flattened, can_be_flat, flatten
from flexctrl.model.flat.workspace import Flat
from flexctrl.model.gauges import Gauges, read

sys.path.insert(0, str(Path(__file__).parents[1] / "laws"))
from machines import bridle, machine

pytest.importorskip("llvmlite")

EFFECTS = (fc.Gravity(), fc.LargeRotation(), fc.RayleighDamping(0.1, 0.02))


@dataclass
class Once:
    flat: Flat
    gauges: Gauges
    y: Reals
    entries: Reals
    pulled: Reals


def once(m: Once) -> int:
    """A step placed, its forces, and then its end measured as the start of the next."""
    f = m.flat
    load(f)
    place(f)
    drive(f)
    pull(f)
    for i in range(f.n):
        m.pulled[i] = f.force[i]
    push(f)
    energy(f)
    if f.linking == 0 and f.following == 0:
        tangent(f, 1.0, 20.0, 400.0, m.entries)
    keep(f)
    read(m.gauges, f.z, m.y)
    return 0


def driven_by_a_follower(structure: fc.Structure) -> fc.Structure:
    (torque,) = (i for i in structure.inputs if i.name == "torque")
    follower = fc.FollowerForce("follower", torque.at[0], (1.0, 0.5, 0.0))
    return replace(structure, inputs=(*structure.inputs, follower))


def crane() -> fc.Structure:
    return fc.cranes.ceiling_crane(2)


MACHINES = {
    **{f"tree{seed}": (lambda seed=seed: driven_by_a_follower(machine(seed, 6))) for seed in (1, 3, 7, 8, 11)},
    "crane": crane,
}


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("bending", ["flexible", "rigid"])
def test_flat_models_do_what_models_do(name, bending, compiled):
    if name == "crane" and bending == "rigid":
        return
    model = fc.assemble(MACHINES[name](), [*EFFECTS, *([fc.Flexible()] if bending == "flexible" else [])])
    rng = np.random.default_rng(4)
    v0, v, a, step = rng.normal(size=(4, model.n))
    share = 1.0 if bending == "rigid" else 0.3  # elements can be turned by less than half a turn
    step *= share
    start = model.displace(0.9 * share * rng.normal(size=model.n)).with_(v=v0, t=0.7)
    u = rng.normal(size=len(model.inputs))
    end = model.advance(start, 0.5 * step, v, 0.8)
    m, flattened = evaluated(model, start, 0.5 * step, v, a, u, compiled)
    loads = model.loads(end, u)
    close(flattened.own(m.flat.force), model.balance(end, v, a) + loads)
    close(flattened.own(m.pulled), loads)
    close(m.flat.books, model.energy(end))
    close(m.y, model.measure(end))
    reached = flattened.state(m.flat.v, 0.8, model.rest.dry)
    for part in ("x", "R", "q", "v", "driven"):
        close(getattr(reached, part), getattr(end, part))
    if model.motion.plain:
        slope = model.slope(end, v, a, (1.0, 20.0, 400.0), u).tocoo()
        close(m.entries[flattened.plan.places(slope.row, slope.col)], slope.data)


def lines() -> fc.Structure:
    """All that bears a tension, each from a place of its own to a load of its own."""
    made = [
        fc.Rope("light", (0, 0, 0), (0, 0, -1), EA=3000.0, damping=10.0),
        fc.Rope("heavy", (1, 0, 0), (1, 0, -1), EA=3000.0, damping=10.0, rhoA=2.0),
        fc.Rope("pieces", (2, 0, 0), (2, 0, -1), EA=3000.0, damping=10.0, rhoA=2.0, elements=4),
        fc.Spring("spring", (3, 0, 0), (3, 0, -1), stiffness=3000.0, damping=10.0),
        fc.Spring("loose", (4, 0, 0), (4, 0, -1), stiffness=3000.0, damping=10.0),
    ]
    loads = [fc.PointMass(f"load_of_{line.name}", line.end, 5.0) for line in made]
    hoisted, trolley = fc.PointMass("hoisted", (5, 0, -1), 5.0), fc.PointMass("trolley", (5, 0, 0), 5.0)
    winch = fc.Winch("winch", hoisted.node, trolley.node, EA=3000.0, damping=10.0, radius=0.2, ratio=10.0, inertia=0.1)
    tensions = [fc.Tension(f"{line.name}_tension", line) for line in [*made, winch]]
    joints = [
        *(fc.Support(node) for node in (*(line.start for line in made), trolley.node)),
        *(fc.Pin(line.end, load.node) for line, load in zip(made, loads, strict=True)),
    ]
    return fc.Structure([*made, *loads, hoisted, trolley], joints, [winch], outputs=tensions)


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("seed", range(6))
def test_tensions_of_slack_and_taut_lines(seed, compiled):
    """A heavy rope of several pieces was measured by compiled loops as a spring that pushes."""
    effects = [fc.Gravity(), fc.LargeRotation(), fc.Flexible(), fc.RopeMass(), fc.Backlash({"loose": 0.05})]
    model = fc.assemble(lines(), effects)
    rng = np.random.default_rng(seed)
    v0, v, a, step = 0.3 * rng.normal(size=(4, model.n))
    start = model.displace(0.05 * rng.normal(size=model.n)).with_(v=v0)
    m, _ = evaluated(model, start, 0.1 * step, v, a, np.zeros(0), compiled)
    end = model.advance(start, 0.1 * step, v, start.t)
    close(m.y, model.measure(end))
    assert m.y[[name not in ("spring_tension", "loose_tension") for name in model.outputs]].min() >= 0.0


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("turn", [1e-9, 0.3, 0.799, 0.801, 2.5, 9.0, 300.0])
def test_steps_turn_nodes_by_any_angle(turn, compiled):
    """By polynomials where they turn little, by sine and cosine elsewhere."""
    body = fc.RigidBody("body", (0, 0, 0), mass=2.0, inertia=(0.1, 0.2, 0.25))
    model = fc.assemble(fc.Structure([body]), [fc.LargeRotation()])
    step = turn * np.array([0.1, -0.2, 0.05, 0.6, -1.0, 0.8])
    start, still = model.displace(np.array([0.0, 0, 0, 1.0, -0.4, 0.7])), np.zeros(model.n)
    flattened = evaluated(model, start, step, still, still, np.zeros(0), compiled)[1]
    reached = flattened.state(still, 0.8, model.rest.dry)
    exact = Rotation.from_rotvec(step[3:]) * Rotation.from_matrix(start.R[0])
    assert np.abs(reached.R[0] - exact.as_matrix()).max() < 1e-15 * max(2.0, turn)


def evaluated(model, start, step, v, a, u, compiled) -> tuple[Once, Flattened]:
    flattened = flatten(model)
    f, plan = flattened.flat, flattened.plan
    flattened.enter(start)
    f.step[:], f.v[:], f.rate[:] = (flattened.ordered(x) for x in (step, v, a))
    f.u[:] = u
    record = Once(f, flattened.gauges, np.zeros(len(model.outputs)), np.zeros(plan.length + 1), np.zeros(f.padded))
    if compiled:
        Packed(record).bound(once)()
    else:
        once(record)
    return record, flattened


def close(found, expected):
    expected = np.asarray(expected)
    assert np.abs(np.asarray(found) - expected).max(initial=0.0) < 1e-11 * max(1.0, np.abs(expected).max(initial=0.0))


def test_what_flat_models_do_not_cover_is_told():
    plain = crane()
    assert can_be_flat(fc.assemble(plain, [fc.Flexible(), fc.LargeRotation()]))
    assert can_be_flat(fc.assemble(plain, [fc.Flexible()]))
    assert can_be_flat(fc.assemble(bridle(), [fc.LargeRotation()]))
    arm = fc.Beam("arm", (0, 0, 0), (1, 0, 0), plain.elements[0].section)
    motor = fc.RotaryDrive("motor", arm.start, axis="z", stiffness=1.0, ratio=10.0, inertia=0.1)
    lagging = fc.Structure([arm], [fc.Support(arm.start, "u v w rx ry")], drives=[motor])
    large = [fc.Flexible(), fc.LargeRotation()]
    assert can_be_flat(fc.assemble(lagging, [*large, fc.MotorLag({"motor": 0.1})]))
    assert can_be_flat(fc.assemble(lagging, [*large, fc.CoulombFriction({"motor": 0.1})]))
