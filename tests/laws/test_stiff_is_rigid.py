"""Every way to give, ever stiffer, tends to the rigid machine, and its error falls as 1/k."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.effects.effect import Effect

WEIGHT = [fc.Gravity(), fc.LargeRotation()]
SECTION = {"EA": 2e5, "EI_y": 2e3, "EI_z": 2e3, "GJ": 2e3, "rhoA": 2.0, "rhoJ": 1e-2}


def bar(k: float) -> fc.Structure:
    """A heavy bar that swings about its upper end, with a load aside of its axis."""
    section = fc.Section(**{name: value * (1.0 if name.startswith("rho") else k) for name, value in SECTION.items()})
    bar = fc.Beam("bar", (0, 0, 0), (0, 0, -1), section, elements=2)
    load = fc.RigidBody("load", (0.3, 0, -1), 5.0, (0.1, 0.1, 0.1), points={"eye": (0, 0, -1)})
    joints = [fc.Support(bar.start, held="u v w rx rz"), fc.Weld(bar.end, load.point("eye"))]
    return fc.Structure([bar, load], joints)


def rope(k: float) -> fc.Structure:
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -1), EA=2e3 * k)
    load = fc.PointMass("load", rope.end, 5.0)
    trolley = fc.PointMass("trolley", rope.start, 10.0)
    held = [fc.Support(trolley.node, held="v w"), fc.Support(load.node, held="v")]
    post = fc.Spring("post", trolley.node, (1, 0, 0), stiffness=200.0)
    pins = [
        fc.Pin(trolley.node, rope.start),
        fc.Pin(rope.end, load.node),
        fc.Pin(trolley.node, post.start),
        fc.Support(post.end),
    ]
    return fc.Structure([rope, load, trolley, post], [*held, *pins])


def shaft(k: float) -> fc.Structure:
    """A pendulum whose bearing turns a rotor through an elastic shaft."""
    bob = fc.RigidBody("bob", (0, 0, -1), 5.0, (0.1, 0.1, 0.1), points={"top": (0, 0, 0)})
    motor = fc.RotaryDrive("motor", bob.point("top"), axis="y", stiffness=20.0 * k, ratio=5.0, inertia=0.1)
    return fc.Structure([bob], [fc.Support(bob.point("top"), held="u v w rx rz")], [motor])


def slowest(structure: fc.Structure, effects: list[Effect]) -> float:
    model = fc.assemble(structure, effects)
    modes = fc.linearize(model, at=fc.equilibrium(model)).modes()
    return float(modes.frequencies[modes.rigid])


@pytest.mark.parametrize(
    ("machine", "gives"),
    [
        (bar, fc.BeamFlexibility()),
        (bar, fc.ComponentModes(2, along=1)),
        (rope, fc.RopeStretch()),
        (shaft, fc.ShaftElasticity()),
    ],
    ids=["beam", "component modes", "rope", "shaft"],
)
def test_the_error_of_a_stiff_machine_against_the_rigid_one_is_of_first_order_in_its_softness(machine, gives):
    rigid = slowest(machine(1.0), WEIGHT)
    stiffness = np.array([10.0, 30.0, 100.0, 300.0])
    errors = np.array([abs(slowest(machine(k), [*WEIGHT, gives]) / rigid - 1.0) for k in stiffness])
    order = -np.polyfit(np.log(stiffness), np.log(errors), 1)[0]
    assert order == pytest.approx(1.0, abs=0.1)
    assert errors[-1] < 1e-2


@pytest.mark.parametrize("elements", [1, 2, 5])
def test_a_beam_that_hardly_shears_is_one_that_does_not(elements):
    """To round-off and at any mesh: bent and twisted by half its length, and in its frequencies there."""

    def bent(**shear: float) -> np.ndarray:
        section = fc.Section(EA=2e8, EI_y=4e4, EI_z=4e3, GJ=2e3, rhoA=6.0, rhoJ=0.02, **shear)
        beam = fc.Beam("beam", (0, 0, 0), (3, 0, 0), section, elements=elements)
        model = fc.assemble(
            fc.Structure(
                [beam],
                [fc.Support(beam.start)],
                inputs=[fc.Force(f"f{axis}", beam.end, axis) for axis in "yz"],
                outputs=[
                    *(fc.Position(axis, beam.end, axis) for axis in "xyz"),
                    *(fc.Rotation(f"r{axis}", beam.end, axis) for axis in "xyz"),
                ],
            ),
            [fc.Flexible(), fc.LargeRotation()],
        )
        rest = fc.equilibrium(model, inputs={"fy": 300.0, "fz": -3000.0})
        return np.array([*rest.outputs.values(), *fc.linearize(model, at=rest).modes(3).frequencies])

    assert bent(GA_y=1e20, GA_z=1e20) == pytest.approx(bent(), rel=1e-9, abs=1e-9)
