"""D16: inconsistent starts: refused by name, projected on request, and what that changes is told.

A pendulum asked for 1 mm off its circle with a radial velocity of 0.1 m/s.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc
from flexctrl.errors import StructureError

sys.path.insert(0, str(Path(__file__).parents[1] / "laws"))
from machines import machine

PAGE = "hard"
ANGLE, SPEED = 0.7, 0.3
OUT = np.array([np.sin(ANGLE), 0.0, -np.cos(ANGLE)])
ALONG = np.array([np.cos(ANGLE), 0.0, np.sin(ANGLE)])
ROD = fc.Section(EA=1.0, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=0.0)


def pendulum() -> tuple[fc.Model, fc.Node]:
    rod = fc.Rope("rod", (0, 0, 0), (1, 0, 0), EA=1.0)
    load = fc.PointMass("load", rod.end, 1.0)
    structure = fc.Structure([rod, load], [fc.Support(rod.start), fc.Pin(rod.end, load.node)])
    return fc.assemble(fc.planar(structure, "y"), [fc.LargeRotation(), fc.Gravity()]), load.node


def projected() -> tuple[fc.Model, fc.Projection]:
    model, load = pendulum()
    return model, fc.project(model, {load: 1.001 * OUT}, {load: SPEED * ALONG + 0.1 * OUT})


def test_places_and_velocities_are_projected(record):
    model, found = projected()
    x, v = found.state.x[1], model.rates(found.state).reshape(-1, 6)[1, :3]
    source = "conditions of the rod"
    record(
        "D16 pendulum projected: length of the rod less 1",
        ours=np.linalg.norm(x) - 1,
        reference=0,
        source=source,
        tolerance=Absolute(1e-12),
    )
    record("D16 pendulum projected: radial velocity", ours=v @ x, reference=0, source=source, tolerance=Absolute(1e-12))
    record(
        "D16 pendulum projected: tangential velocity", ours=v @ ALONG, reference=SPEED, source="kept", tolerance=1e-9
    )


def test_the_change_is_told(record):
    _, found = projected()
    moved, changed = (np.linalg.norm(a, axis=1).max() for a in (found.moved, found.changed))
    record(
        "D16 pendulum projected: change told [m], [m/s]",
        ours=[moved, changed],
        reference=[1e-3, 0.1],
        source="what was wished too much",
        tolerance=1e-9,
    )
    assert "moved by at most 0.001 m (node 0 of load)" in str(found)
    assert "velocity changed by at most 0.1 m/s" in str(found)


def test_accelerations_do_not_jump_in_the_first_step(record):
    model, found = projected()
    run = fc.simulate(model, start=found.state, until=1e-6, method=fc.GeneralizedAlpha(2e-7))
    still, u = np.zeros(1), np.zeros(0)

    def acceleration(state: fc.State) -> float:
        mass = -model.slope(state, state.v, still, (0.0, 0.0, 1.0), u)
        return float(model.balance(state, state.v, still)[0] / mass.toarray()[0, 0])

    first = [acceleration(state) for state in (found.state, run.at(2e-7).state)]
    record(
        "D16 pendulum projected: jump of the acceleration in the first step",
        ours=first[1] / first[0] - 1,
        reference=0,
        source="it is continuous",
        tolerance=Absolute(1e-6),
    )
    assert abs(first[0]) == pytest.approx(9.81 * np.sin(ANGLE), rel=1e-9)


VERBS = {
    "simulate": lambda model, start: fc.simulate(model, start=start, until=1.0),
    "equilibrium": lambda model, start: fc.equilibrium(model, start=start),
    "linearize": fc.linearize,
}


@pytest.mark.parametrize("verb", VERBS)
def test_without_projection_there_is_an_error(verb):
    model, found = projected()
    bad = replace(found.state, x=1.001 * found.state.x)
    with pytest.raises(StructureError, match=r"flexctrl\.project") as error:
        VERBS[verb](model, bad)
    assert "node 1 of rod" in str(error.value)
    again = fc.project(model, bad)
    assert np.abs(again.state.x - found.state.x).max() < 1e-12
    assert fc.simulate(model, start=again.state, until=0.01).status.value == "finished"


def tampered(kind: str, state: fc.State) -> fc.State:
    x, R = state.x.copy(), state.R.copy()
    if kind == "support":
        x[0] += 1e-4
    elif kind == "no rotation":
        R[-2] *= 1.001
    elif kind == "nan":
        x[-2, 0] = np.nan
    elif kind == "sums":
        return replace(state, q=state.q + 1e-3)
    elif kind == "speeds":
        return replace(state, v=np.append(state.v, 0.0))
    return replace(state, x=x, R=R)


@pytest.mark.parametrize("kind", ["support", "no rotation", "nan", "sums", "speeds"])
def test_whatever_is_wrong_with_a_start_is_found(kind):
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), ROD, elements=2)
    load = fc.PointMass("load", beam.end, 1.0)
    structure = fc.Structure([beam, load], [fc.Support(beam.start), fc.Pin(beam.end, load.node)])
    model = fc.assemble(structure, [fc.Flexible(), fc.LargeRotation()])
    state = model.displace(0.01 * np.cos(np.arange(model.n)))
    with pytest.raises(StructureError, match="simulate: start"):
        fc.simulate(model, start=tampered(kind, state), until=1.0)


def test_an_open_loop_is_closed():
    """A four-bar linkage whose coupler has been shifted by a tenth of a millimetre."""
    at = [(0, 0, 0), (0, 1, 0), (1.5, 1.2, 0), (1.5, 0, 0)]
    rods = [fc.Beam(f"rod{i}", at[i], at[i + 1], ROD) for i in range(3)]
    joints = [fc.Pin(a.end, b.start) for a, b in ((rods[0], rods[1]), (rods[1], rods[2]))]
    joints += [fc.Support(rods[0].start, "u v w"), fc.Support(rods[2].end, "u v w")]
    model = fc.assemble(fc.planar(fc.Structure(rods, joints), "z"), [fc.LargeRotation()])
    state = model.displace({model.coordinates[0]: 0.3})
    x = state.x.copy()
    x[2:4] += (1e-4, 0.0, 0.0)
    with pytest.raises(StructureError, match=r"flexctrl\.project"):
        fc.simulate(model, start=replace(state, x=x), until=0.1)
    found = fc.project(model, replace(state, x=x))
    assert model.motion.closure_error(found.state) < 1e-13
    assert 1e-5 < np.abs(found.moved).max() < 2e-4


@pytest.mark.parametrize("seed", range(6))
def test_a_possible_state_is_its_own_projection(seed):
    """Random machines of beams, bodies, ropes, hinges, slides and drives, far from their drawn shape."""
    rng = np.random.default_rng(seed)
    model = fc.assemble(machine(seed), [fc.LargeRotation(), fc.Flexible()], fc.CasadiVM())
    state = model.displace(0.5 * rng.normal(size=model.n)).with_(v=rng.normal(size=model.n))
    found = fc.project(model, state)
    assert np.abs(found.moved).max() < 1e-12
    assert np.abs(found.turned).max() < 1e-12
    assert np.array_equal(found.state.v, state.v)
