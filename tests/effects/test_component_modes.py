"""Beams in a few modes on a moving frame: closed forms, laws, and the mesh that they save."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.optimize as so
from scipy.spatial.transform import Rotation

import flexctrl as fc
from flexctrl.errors import StructureError
from flexctrl.mechanics.clamped_modes import clamped_shapes

SECTION = fc.Section(EA=1e7, EI_y=2e3, EI_z=1e3, GJ=8e2, rhoA=3.0, rhoJ=0.01, rhoI_y=4e-4, rhoI_z=2e-4)
PLAIN = fc.Section(EA=1e9, EI_y=1e3, EI_z=1e3, GJ=8e2, rhoA=3.0, rhoJ=0.01)
LENGTH = 3.0


def beam(elements=1, section=SECTION, end=(3.0, 0.5, 0.2), held="u v w rx ry rz"):
    b = fc.Beam("b", (0, 0, 0), end, section, elements=elements)
    tip = fc.PointMass("tip", b.end, 2.0)
    return fc.Structure(
        [b, tip],
        [fc.Support(b.start, held), fc.Pin(b.end, tip.node)],
        inputs=[fc.Force("push", b.end, "y")],
        outputs=[fc.Position("y", b.end, "y"), fc.Position("z", b.end, "z")],
    )


def model(structure, *effects, backend=None):
    return fc.assemble(structure, [fc.LargeRotation(), *effects], backend or fc.CasadiVM())


def test_no_modes_equal_plain_flexibility():
    plain, without = (model(beam(2), e, fc.Gravity()) for e in (fc.BeamFlexibility(), fc.ComponentModes(0)))
    assert plain.coordinates == without.coordinates
    assert np.array_equal(fc.equilibrium(plain).state.q, fc.equilibrium(without).state.q)


def test_tangent_at_rest_is_the_assembled_matrices():
    m = model(beam(2), fc.ComponentModes(3, along=2))
    still, u = np.zeros(m.n), np.zeros(1)
    for seed, matrix in (((1.0, 0.0, 0.0), m.stiffness()), ((0.0, 0.0, 1.0), m.mass())):
        found = -m.slope(m.rest, still, still, seed, u)
        assert abs(found - matrix).max() < 1e-12 * abs(matrix).max()


def test_one_element_converges_to_the_frequencies_of_a_cantilever():
    """cos β cosh β = −1. Craig–Bampton converges with the modes: the lower half is a thousandth off at most."""
    bar = fc.Beam("b", (0, 0, 0), (LENGTH, 0, 0), PLAIN)
    s = fc.Structure([bar], [fc.Support(bar.start)])
    places = [((i + 0.2) * math.pi, (i + 0.8) * math.pi) for i in range(4)]
    roots = np.array([so.brentq(lambda b: math.cos(b) + 1 / math.cosh(b), *place) for place in places])
    exact = roots**2 / LENGTH**2 * math.sqrt(1e3 / 3.0) / (2 * math.pi)

    def off(count):
        found = fc.linearize(model(s, fc.ComponentModes(count))).modes().frequencies
        return np.abs(found[:, None] / exact - 1).min(axis=0)

    few, some, many = off(2), off(4), off(8)
    assert few[0] < 1e-4
    assert some[:2].max() < 2e-4
    assert many.max() < 2e-4
    assert (many < 0.3 * some).all()


def test_clamped_beam_has_its_own_modes_exactly():
    bar = fc.Beam("b", (0, 0, 0), (LENGTH, 0, 0), PLAIN)
    s = fc.Structure([bar], [fc.Support(bar.start), fc.Support(bar.end)])
    found = fc.linearize(model(s, fc.ComponentModes(3))).modes().frequencies
    roots = np.array([4.730040744862704, 7.853204624095838, 10.995607838001671])  # Blevins 1979, table 8-1
    exact = np.sort(np.repeat(roots**2 / LENGTH**2 * math.sqrt(1e3 / 3.0) / (2 * math.pi), 2))
    assert found == pytest.approx(exact, rel=1e-12)


def test_a_pull_stiffens_the_modes():
    """Clamped beam under tension against a fine mesh: geometric stiffness acts on the modes."""

    def lowest(structure, effect):
        m = model(structure, effect)
        return fc.linearize(m, at=fc.equilibrium(m, inputs={"pull": 4e3})).modes().frequencies[:4]

    def pulled(elements):
        bar = fc.Beam("b", (0, 0, 0), (LENGTH, 0, 0), PLAIN, elements=elements)
        return fc.Structure(
            [bar], [fc.Support(bar.start), fc.Support(bar.end, "v w rx ry rz")], inputs=[fc.Force("pull", bar.end, "x")]
        )

    fine, few = lowest(pulled(40), fc.BeamFlexibility()), lowest(pulled(1), fc.ComponentModes(6))
    assert few == pytest.approx(fine, rel=3e-4)
    loose = lowest(pulled(1), fc.BeamFlexibility())
    assert loose[:2] != pytest.approx(fine[:2], rel=0.1)


def test_weight_bends_the_modes():
    """A clamped–clamped beam sags by q L⁴/(384 EI) in its middle, which one element without modes cannot."""
    bar = fc.Beam("b", (0, 0, 0), (LENGTH, 0, 0), PLAIN)
    s = fc.Structure([bar], [fc.Support(bar.start), fc.Support(bar.end, "v w rx ry rz")])
    m = model(s, fc.ComponentModes(9), fc.Gravity())
    amplitudes = [fc.equilibrium(m).state.q[m.coordinate(f"b_0_z{i}")] for i in range(1, 10)]
    middle = amplitudes @ clamped_shapes(9, np.array([0.5]))[:, 0]
    assert middle == pytest.approx(-3.0 * 9.81 * LENGTH**4 / (384 * 1e3), rel=1e-3)


def test_energy_is_kept_and_backends_agree():
    m = model(beam(2), fc.ComponentModes(2, along=1), fc.Gravity())
    runs = [
        fc.simulate(machine, until=0.2, method=fc.GeneralizedAlpha(5e-4, 1.0), every=0.01)
        for machine in (m, m.with_(backend=fc.Compiled()))
    ]
    assert all(run.report.energy_residual < 1e-4 for run in runs)
    assert runs[0]["z"] == pytest.approx(runs[1]["z"], abs=1e-8)


def test_turning_the_machine_turns_its_motion():
    """Frame invariance: the same cantilever with its axes and gravity turned together."""
    turn = Rotation.from_rotvec([0.4, -0.7, 1.1]).as_matrix()

    def hung(R):
        b = fc.Beam("b", (0, 0, 0), R @ (3.0, 0.0, 0.0), SECTION, up=R @ (0.0, 0.0, 1.0))
        tip = fc.PointMass("tip", b.end, 2.0)
        s = fc.Structure([b, tip], [fc.Support(b.start), fc.Pin(b.end, tip.node)])
        m = model(s, fc.ComponentModes(2, along=1), fc.Gravity(R @ (0.0, -3.0, -9.0)))
        rest = fc.equilibrium(m)
        return rest.state.x[1], rest.state.q[-6:], fc.linearize(m, at=rest).modes().frequencies

    (x, amplitudes, frequencies), (turned, same, also) = hung(np.eye(3)), hung(turn)
    assert turn @ x == pytest.approx(turned, abs=1e-9)
    assert amplitudes == pytest.approx(same, abs=1e-9)
    assert frequencies == pytest.approx(also, rel=1e-7)


def test_few_modes_follow_a_fine_mesh_through_large_motion():
    def swing(elements, effect):
        m = model(beam(elements, held="u v w rx rz"), effect, fc.Gravity(), backend=fc.Compiled())
        return fc.simulate(m, until=1.0, method=fc.GeneralizedAlpha(1e-3, 0.9), every=0.01)["z"]

    fine, few = swing(16, fc.BeamFlexibility()), swing(2, fc.ComponentModes(2))
    assert np.ptp(fine) > 2.0
    assert np.abs(few - fine).max() < 1e-4 * np.ptp(fine)


def test_coarsening_keeps_the_nodes_in_use():
    b = fc.Beam("b", (0, 0, 0), (8, 0, 0), SECTION, elements=8)
    load = fc.PointMass("load", b.node(6), 1.0)
    s = fc.Structure(
        [b, load], [fc.Support(b.start), fc.Pin(b.node(6), load.node)], outputs=[fc.Position("x", b.node(2), "x")]
    )
    coarse = fc.coarsen(s)
    assert coarse.elements[0].elements == 4
    assert coarse.outputs[0].at.position == (2.0, 0.0, 0.0)
    assert str(fc.refine(coarse, 2).join_table) == str(s.join_table)


def test_what_cannot_be_is_refused():
    shearing = fc.Section(EA=1e7, EI_y=2e3, EI_z=1e3, GJ=8e2, rhoA=3.0, rhoJ=0.01, GA_y=1e5, GA_z=1e5)
    with pytest.raises(StructureError, match="section of beam 'b' shears"):
        model(beam(1, shearing), fc.ComponentModes(2))
    with pytest.raises(StructureError, match=r"count = 2\.5; expected a whole number from 0 to 10"):
        fc.ComponentModes(2.5)
    with pytest.raises(StructureError, match="along = 11; expected a whole number from 0 to 10"):
        fc.ComponentModes(along=11)
    with pytest.raises(StructureError, match="did you mean 'b'"):
        fc.coarsen(beam(2), of=["bb"])


METHODS = {
    "AdaptiveAlpha": (fc.AdaptiveAlpha(), fc.Tolerance(1e-6, 1e-8)),
    "GeneralizedAlpha": (fc.GeneralizedAlpha(5e-4), None),
    "ConservingMidpoint": (fc.ConservingMidpoint(5e-4), None),
    "Richardson of alpha": (fc.Richardson(fc.GeneralizedAlpha(1e-3, rho=1.0)), None),
    "Richardson of midpoint": (fc.Richardson(fc.ConservingMidpoint(1e-3)), None),
}


@pytest.mark.parametrize("along", [1, 2])
@pytest.mark.parametrize("freedom", ["u", "rx"])
def test_rods_and_shafts_converge_by_two_orders_more_with_each_shape(freedom, along):
    """A load at the end: β tan β = ρAL/m, or ρJ L/J; the second of ratio 10 with 3 and 6 elements."""
    root, ratio = 4.3058014131, 10.0
    section = fc.Section(EA=1.0, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=1.0)

    def off(elements):
        rod = fc.Beam("rod", (0, 0, 0), (1, 0, 0), section, elements=elements)
        load = fc.RigidBody("load", rod.end.position, 1.0 / ratio, (1.0 / ratio, 1.0, 1.0))
        others = [f for f in ("u", "v", "w", "rx", "ry", "rz") if f != freedom]
        held = [fc.Support(node, others) for node in rod.nodes[1:]]
        s = fc.Structure([rod, load], [fc.Support(rod.start), fc.Weld(rod.end, load.node), *held])
        omega = fc.linearize(model(s, fc.ComponentModes(0, along=along))).modes().omega
        return np.abs(omega / root - 1.0).min()

    assert off(6) < (6e-4, 3e-6)[along - 1]
    assert np.log2(off(3) / off(6)) == pytest.approx(2.0 * along + 2.0, abs=0.5)


def test_weight_draws_a_hanging_rod_into_a_parabola():
    """Beside the mean strain, ρA g L²/8 EA in the middle; χ₁(½) = √3/4."""
    rod = fc.Beam("rod", (0, 0, 0), (0, 0, -LENGTH), PLAIN)
    m = model(fc.Structure([rod], [fc.Support(rod.start)]), fc.ComponentModes(0, along=2), fc.Gravity())
    q = fc.equilibrium(m).state.q
    middle = q[m.coordinate("rod_0_x1")] * math.sqrt(3.0) / 4.0
    assert middle == pytest.approx(3.0 * 9.81 * LENGTH**2 / 8e9, rel=1e-6)
    assert abs(q[m.coordinate("rod_0_x2")]) < 1e-6 * middle
    assert abs(q[m.coordinate("rod_0_t1")]) < 1e-12


def test_a_plane_keeps_stretch_and_holds_twist():
    m = model(fc.planar(fc.coarsen(arm()), "y"), fc.ComponentModes(1, along=1))
    assert m.coordinates[-2:] == ("rod_0_z1", "rod_0_x1")


@pytest.mark.parametrize("name", METHODS)
def test_every_method_of_integration_takes_modes(name):
    """A soft pendulum of one element with two modes, let go from the horizontal, against the explicit method."""
    section = fc.Section(EA=1e4, EI_y=2.0, EI_z=2.0, GJ=2.0, rhoA=1.0, rhoJ=1e-3)
    rod = fc.Beam("rod", (0, 0, 0), (1, 0, 0), section)
    outputs = [fc.Position(axis, rod.end, axis) for axis in "xz"]
    structure = fc.planar(fc.Structure([rod], [fc.Support(rod.start, "u v w")], outputs=outputs), "y")
    machine = fc.assemble(structure, [fc.LargeRotation(), fc.Gravity(), fc.Flexible(), fc.ComponentModes(2, along=1)])
    exact = fc.simulate(machine, until=0.5, method=fc.ExplicitRungeKutta(), tolerance=fc.Tolerance(1e-9, 1e-9))
    method, tolerance = METHODS[name]
    run = fc.simulate(machine, until=0.5, method=method, tolerance=tolerance)
    assert run.status is fc.Status.FINISHED
    assert run.y[-1] == pytest.approx(exact.y[-1], abs=3e-4)
    assert run.report.energy_residual < 1e-3


def arm(elements=8, up=None):
    """A soft arm that hangs from a hinge, pushed within the plane across y."""
    rod = fc.Beam("rod", (0, 0, 0), (1, 0, 0), SOFT, elements=elements, up=up)
    mass = fc.PointMass("mass", rod.end, 0.2)
    return fc.Structure(
        [rod, mass],
        [fc.Support(rod.start, "u v w rx rz"), fc.Pin(rod.end, mass.node)],
        inputs=[fc.Force("push", rod.end, "z")],
        outputs=[fc.Position(axis, rod.end, axis) for axis in "xz"],
    )


SOFT = fc.Section(EA=1e4, EI_y=2.0, EI_z=3.0, GJ=2.0, rhoA=1.0, rhoJ=1e-3)


def test_a_plane_stays_on_every_mesh():
    flat = fc.planar(arm(), "y")
    for mesh, elements in (
        (fc.coarsen(flat), 1),
        (flat, 8),
        (fc.refine(flat, 2), 16),
        (fc.coarsen(fc.refine(flat, 2)), 1),
    ):
        assert mesh.elements[0].elements == elements
        assert all(name.endswith(("_u", "_w", "_ry")) for name in model(mesh, fc.Flexible()).coordinates)
        assert model(mesh, fc.Flexible()).n == 3 * elements + 1


def test_supports_of_single_nodes_are_in_use_within_a_plane_too():
    """What holds a node beside the plane takes it into use, and so does what holds every node one by one."""
    s = fc.planar(arm(), "y")
    rod = s.elements[0]
    assert fc.coarsen(s.with_(joints=[*s.joints, fc.Support(rod.node(2), "w")])).elements[0].elements == 4
    sleepers = arm().with_(joints=[*arm().joints, *(fc.Support(n, "v") for n in rod.nodes)])
    assert fc.coarsen(sleepers).elements[0].elements == 8


@pytest.mark.parametrize("backend", [fc.CasadiVM(), None])
def test_a_plane_keeps_only_the_modes_in_it(backend):
    """It swings as in space, where nothing pushes it out of the plane."""
    space = fc.coarsen(arm())
    machines = [model(s, fc.Gravity(), fc.ComponentModes(2), backend=backend) for s in (space, fc.planar(space, "y"))]
    assert machines[1].coordinates == ("rod_0_ry", "rod_1_u", "rod_1_w", "rod_1_ry", "rod_0_z1", "rod_0_z2")
    runs = [fc.simulate(m, until=0.3, inputs={"push": 2.0}, method=fc.GeneralizedAlpha(2e-3)) for m in machines]
    assert runs[1].y == pytest.approx(runs[0].y, abs=1e-6)
    own = [machines[0].coordinates.index(name) for name in machines[1].coordinates]
    for matrix in ("mass", "stiffness"):
        whole, flat = (getattr(m, matrix)().toarray() for m in machines)
        assert np.array_equal(whole[np.ix_(own, own)], flat)


def test_modes_askew_to_the_plane_are_refused():
    with pytest.raises(StructureError, match="'rod' is held in a plane to which its section lies askew"):
        model(fc.planar(arm(1, up=(0, 1, 1)), "y"), fc.ComponentModes(1))


def test_driven_arms_move_alike_in_more_modes():
    """Links on hinges, compiled as one piece of nodes that turn freely: such a machine could not be run."""
    arm = fc.cranes.flexible_arm(elements=1)
    common = [fc.Gravity(), fc.ShaftElasticity(), fc.LargeRotation(), fc.RayleighDamping(beta=1e-3)]
    runs = [
        fc.simulate(fc.assemble(arm, [*common, effect]), until=0.1, method=fc.GeneralizedAlpha(1e-3))
        for effect in (fc.ComponentModes(2), fc.ComponentModes(3))
    ]
    assert {run.status for run in runs} == {fc.Status.FINISHED}
    few, more = (run["tip_z"] for run in runs)
    assert np.ptp(more) > 1e-3
    assert np.abs(few - more).max() < 0.05 * np.ptp(more)
