"""Just beside a critical load an equilibrium is told to last, or not to, as eigenvalues tell, however slender it is.

Stiffnesses are 1e2 to 1e8 times that of bending, and the last digits of places make pulls and pushes of them; what a
load has left of the stiffness of one motion is a few thousandths of bending.
"""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc

L, EI = 2.0, 9.0
EFFECTS = (fc.Flexible(), fc.LargeRotation())
SLENDERNESSES, MESHES, LOADS = (1e2, 1e4, 1e6, 1e8), (2, 8, 64), (0.99, 0.998, 1.002, 1.01)


def section(slenderness: float) -> fc.Section:
    """Of EA L²/EI."""
    return fc.Section(EA=slenderness * EI / L**2, EI_y=EI, EI_z=EI, GJ=EI, rhoA=1.0, rhoJ=1e-3)


class Loaded:
    """A machine under a share of about its critical load."""

    def rest(self, share: float) -> fc.Rest:
        return fc.equilibrium(self.model(share), inputs=self.inputs(share))

    def critical(self) -> float:
        """The share at which the lowest eigenvalue of the linear model is zero, by secants."""

        def lowest(share: float) -> float:
            rest = self.rest(share)
            return float(fc.linearize(rest.model, rest).modes(1).omega_squared[0])

        one, other = 0.97, 0.98
        values = lowest(one), lowest(other)
        for _ in range(4):
            one, other = other, other - values[1] * (other - one) / (values[1] - values[0])
            if abs(other - one) < 1e-7:
                break
            values = values[1], lowest(other)
        return other


class Mast(Loaded):
    """Clamped below, under its own weight: q L³/EI = 7.8373474; it buckles in a plane, or two ways at once."""

    def __init__(self, slenderness: float, elements: int, plane: bool = True) -> None:
        beam = fc.Beam("mast", (0, 0, 0), (0, 0, L), section(slenderness), elements=elements)
        structure = fc.Structure([beam], [fc.Support(beam.start)])
        self.structure, self.ways = (fc.planar(structure, "y"), 1) if plane else (structure, 2)

    def model(self, share: float) -> fc.Model:
        return fc.assemble(self.structure, [*EFFECTS, fc.Gravity((0.0, 0.0, -7.8373474 * share * EI / L**3))])

    def inputs(self, share: float) -> dict[str, float]:
        return {}


class Column(Loaded):
    """Clamped below and pressed along its line, whichever way that points: π² EI/4L²."""

    ways = 1

    def __init__(self, slenderness: float, elements: int, tilt: float = 0.0) -> None:
        self.along = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
        beam = fc.Beam("column", (0, 0, 0), tuple(L * self.along), section(slenderness), elements=elements)
        pushes = [fc.Force("x", beam.end, "x"), fc.Force("z", beam.end, "z")]
        self._model = fc.assemble(
            fc.planar(fc.Structure([beam], [fc.Support(beam.start)], inputs=pushes), "y"), EFFECTS
        )

    def model(self, share: float) -> fc.Model:
        return self._model

    def inputs(self, share: float) -> dict[str, float]:
        push = -share * np.pi**2 * EI / (4.0 * L**2) * self.along
        return {"x": push[0], "z": push[2]}


def agree(machine: Loaded) -> None:
    critical = machine.critical()
    for load in LOADS:
        rest = machine.rest(load * critical)
        assert rest.unstable == machine.ways * (load > 1.0), load
        assert rest.unstable == fc.linearize(rest.model, rest).modes(3).unstable
        assert rest.stable == (not rest.notes)


@pytest.mark.long
@pytest.mark.parametrize("slenderness", SLENDERNESSES)
@pytest.mark.parametrize("elements", MESHES)
def test_masts_under_their_weight(slenderness, elements):
    agree(Mast(slenderness, elements))


@pytest.mark.long
@pytest.mark.parametrize("slenderness", [1e4, 1e8])
def test_a_mast_that_may_fall_either_way_is_left_in_two_directions(slenderness):
    agree(Mast(slenderness, 16, plane=False))


@pytest.mark.long
@pytest.mark.parametrize("slenderness", SLENDERNESSES)
@pytest.mark.parametrize(("elements", "tilt"), [(2, 0.0), (8, 0.7), (32, 0.0), (32, 0.7)])
def test_columns_that_are_pressed(slenderness, elements, tilt):
    agree(Column(slenderness, elements, tilt))


@pytest.mark.parametrize("elements", [32, 64, 400])
def test_a_very_slender_mast_however_fine_its_mesh(elements):
    """Its own critical weight is within 1e-5 of 7.8373474 EI/L³; the entries of K are up to 1e11 times what is left."""
    machine = Mast(1e8, elements)
    assert [machine.rest(load).unstable for load in LOADS] == [0, 0, 1, 1]


@pytest.mark.parametrize("slenderness", [*SLENDERNESSES, 1e12])
@pytest.mark.parametrize("elements", [2, 16, 64])
def test_what_is_free_is_not_left_by_rounding(slenderness, elements):
    """A bar in space that nothing holds, one that turns about a pin, and one that turns with its motor."""
    end = (0.8, 0.5, -1.1)
    bar = fc.Beam("bar", (0, 0, 0), end, section(slenderness), elements=elements)
    turned = fc.Beam("bar", (0, 0, 0), (0.8, 0.5, 0.0), section(slenderness), elements=elements)
    motor = fc.RotaryDrive("motor", turned.start, axis="z", stiffness=1e3, ratio=50.0, inertia=1e-3)
    machines = (
        fc.Structure([bar]),
        fc.Structure([bar], [fc.Support(bar.start, "u v w")]),
        fc.Structure([turned], [fc.Support(turned.start, "u v w rx ry")], drives=[motor]),
    )
    for machine in machines:
        assert fc.equilibrium(fc.assemble(machine, EFFECTS)).unstable == 0
