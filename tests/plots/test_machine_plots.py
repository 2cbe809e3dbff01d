"""Pictures of machines, modes and runs show what they should."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

import flexctrl as fc
from flexctrl.cranes import bridge_crane, ceiling_crane, flexible_arm
from flexctrl.errors import StructureError
from flexctrl.plots.machine import add_machine_axes, best_plane, draw_deformed, draw_machine
from flexctrl.plots.modes import mode_label, mode_pose, modes_figure
from flexctrl.plots.pose import pose_of
from flexctrl.plots.run import comparison_curves, panels, run_curves, units
from flexctrl.structure.drives import Drive
from flexctrl.structure.elements import Part
from flexctrl.structure.inputs import Input
from flexctrl.structure.joints import InPlane, Joint
from flexctrl.structure.lines import RopePiece
from flexctrl.structure.outputs import Output
from flexctrl.study.compare import Comparison

EFFECTS = (fc.Gravity(), fc.Flexible(), fc.LargeRotation())


def written(ax) -> set[str]:
    return {text.get_text() for text in ax.texts}


def test_nodes_at_one_place_share_their_numbers():
    ax = draw_machine(add_machine_axes(Figure(), ceiling_crane()), ceiling_crane())
    assert written(ax) == {"1", "2", "3", "4, 8", "5", "6", "7", "9, 10", "11, 12", "13"}
    assert [t.get_text() for t in ax.get_legend().get_texts()] == ["support", "pin"]


def kinds(union) -> set[type]:
    """Of a union of types, with all that are derived from them."""
    found = set(union.__args__) if hasattr(union, "__args__") else {union}
    return found | {kind for one in found for sub in one.__subclasses__() for kind in kinds(sub)}


BOX = fc.Section.box(fc.STEEL, width=0.1, height=0.1, web=0.004, flange=0.004)
POST, BAR = fc.Beam("post", (0, 0, 0), (0, 0, 1), BOX), fc.Beam("bar", (0, 0, 1), (1, 0, 1), BOX)
JOINTS = {
    "support": fc.Support(POST.start),
    "": InPlane(POST.start, "v rx rz"),
    "weld": fc.Weld(POST.end, BAR.start),
    "pin": fc.Pin(POST.end, BAR.start),
    "hinge": fc.Hinge(POST.end, BAR.start, "y"),
    "slide": fc.Slide(POST.end, BAR.start, "x"),
}


def test_every_kind_of_joint_is_drawn():
    """By its own symbol; what holds a machine in the plane of the picture by none."""
    assert {type(joint) for joint in JOINTS.values()} == kinds(Joint)
    for label, joint in JOINTS.items():
        machine = fc.Structure([POST, BAR] if len(joint.nodes) == 2 else [POST], [joint])
        legend = draw_machine(add_machine_axes(Figure(), machine), machine).get_legend()
        assert [t.get_text() for t in legend.get_texts()] == [label] if label else legend is None


def test_every_kind_of_part_and_drive_is_drawn():
    """Each adds lines or marks of its own to the picture."""
    load, body = fc.PointMass("load", BAR.end, 5.0), fc.RigidBody("body", BAR.end, 2.0, (0.1, 0.1, 0.1))
    rope, spring = fc.Rope("rope", BAR.end, (1, 0, 0), EA=1e5), fc.Spring("spring", BAR.end, (1, 0, 0), 1e3)
    trolley = fc.Trolley("trolley", BAR, at=0.5, mass=5.0)
    motor = fc.RotaryDrive("motor", BAR.start, axis="y", stiffness=50.0, ratio=2.0, inertia=1.0)
    travel = fc.LinearDrive("travel", BAR.start, direction="x", radius=0.1, ratio=2.0, stiffness=50.0, inertia=1.0)
    winch = fc.Winch("winch", BAR.end, BAR.start, EA=1e5, radius=0.1, ratio=2.0, inertia=0.02)
    parts, drives = (BAR, load, body, rope, spring, trolley), (motor, travel, winch)
    assert {type(part) for part in parts} == kinds(Part) - {RopePiece}  # of ropes with mass, once they are cut
    assert {type(drive) for drive in drives} == kinds(Drive)

    def drawn(*parts, drives=()):
        joints = [fc.Pin(BAR.end, part.nodes[0]) for part in parts if part is not trolley]
        machine = fc.Structure([BAR, *parts], joints, drives)
        axes = draw_machine(Figure().add_subplot(), machine, numbers=False, symbols=bool(drives))
        return len(axes.lines)

    assert all(drawn(part) > drawn() > 0 for part in parts[1:])
    assert all(drawn(drives=[drive]) > drawn() for drive in drives)


@pytest.mark.parametrize(("normal", "plane"), [("y", (0, 2)), ("z", (0, 1))])
def test_a_planar_machine_is_drawn_in_its_plane(normal, plane):
    """A straight beam lies in many planes; it moves in one."""
    bar = fc.Beam("bar", (0, 0, 0), (1, 0, 0), BOX)
    machine = fc.planar(fc.Structure([bar], [fc.Support(bar.start)]), normal)
    ax = draw_machine(add_machine_axes(Figure(), machine), machine)
    assert best_plane(machine) == plane
    assert (ax.get_xlabel(), ax.get_ylabel()) == tuple(f"{'xyz'[i]} (m)" for i in plane)
    assert [t.get_text() for t in ax.get_legend().get_texts()] == ["support"]


def test_every_kind_of_signal_is_drawn_with_its_unit():
    motor = fc.RotaryDrive("motor", BAR.start, axis="y", stiffness=50.0, ratio=2.0, inertia=1.0)
    rope = fc.Rope("rope", BAR.end, (1, 0, 0), EA=1e5)
    end = BAR.end
    outputs = {
        fc.Position("x", end, "x"): "m",
        fc.Velocity("v", end, "x"): "m/s",
        fc.Rotation("turn", end, "x"): "rad",
        fc.AngularVelocity("rate", end, "x"): "rad/s",
        fc.DriveAngle("angle", "motor"): "rad",
        fc.DriveSpeed("speed", "motor"): "rad/s",
        fc.SwayAngle("sway", end, rope.end, "x"): "rad",
        fc.Tension("pull", "rope"): "N",
    }
    inputs = {
        fc.Force("push", end, "x"): "N",
        fc.FollowerForce("thrust", end, "x"): "N",
        fc.Torque("moment", end, "x"): "N m",
        fc.FollowerTorque("twist", end, "x"): "N m",
        fc.MotorTorque("torque", "motor"): "N m",
        fc.WindSpeed("gust", "x"): "m/s",
    }
    both = outputs | inputs
    assert {type(signal) for signal in both} == kinds(Output) | kinds(Input)
    machine = fc.Structure([BAR, rope], [fc.Pin(end, rope.start)], [motor], inputs=inputs, outputs=outputs)
    assert units(machine) == {signal.name: unit for signal, unit in both.items()}
    said = {signal.name: unit.replace("m", "mm").replace("N", "mN") for signal, unit in both.items()}
    assert units(machine, fc.Units("mm", "kg", "s", "mN")) == said


def test_drives_are_named():
    ax = draw_machine(add_machine_axes(Figure(), flexible_arm()), flexible_arm(), numbers=False)
    assert written(ax) == {"shoulder_drive", "elbow_drive"}


def test_the_plane_of_a_machine():
    assert best_plane(ceiling_crane()) == (1, 2)
    assert best_plane(flexible_arm()) == (0, 1)  # a line, looked at along its joints' axes
    model = fc.assemble(bridge_crane(), EFFECTS)
    assert best_plane(bridge_crane(), [model.displace({"girder_0_u": 2.0})]) is None


def test_a_machine_that_moves_out_of_its_plane_is_drawn_in_space():
    model = fc.assemble(bridge_crane(), EFFECTS)
    moved = model.displace({"girder_0_u": 2.0})
    ax = add_machine_axes(Figure(), bridge_crane(), [moved])
    assert ax.name == "3d"
    draw_machine(ax, bridge_crane(), moved)
    sizes = np.diff([ax.get_xlim(), ax.get_ylim(), ax.get_zlim()], axis=1)[:, 0]
    np.testing.assert_allclose(ax._box_aspect / ax._box_aspect.max(), sizes / sizes.max())  # equal scales


def test_a_beam_is_drawn_along_its_turned_ends():
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), fc.Section(1e6, 10, 10, 8, 1, 1e-3))
    clamped = fc.Structure([beam], [fc.Support(beam.start)], inputs=[fc.Torque("bend", beam.end, "z")])
    model = fc.assemble(clamped, EFFECTS[1:])
    state = fc.equilibrium(model, inputs={"bend": 10 * 0.6}).state  # κ L = 0.6: a circular arc
    ax = Figure().add_subplot()
    draw_machine(ax, clamped.with_(name="arc"), state, numbers=False, symbols=False)
    x, z = ax.lines[0].get_xdata(), ax.lines[0].get_ydata()
    assert best_plane(clamped) == (0, 2)
    assert np.ptp(z) == 0.0  # the picture's plane is that of the machine as drawn
    assert x[-1] == pytest.approx(state.x[1, 0])


def test_mode_shapes_are_as_large_as_asked_and_small_turns():
    model = fc.assemble(ceiling_crane(), EFFECTS)
    rest = fc.equilibrium(model)
    linear = fc.linearize(model, at=rest)
    modes = linear.modes()
    for k in (0, 6, 12):
        pose = mode_pose(linear.place, modes.shapes[:, k], fraction=0.1)
        moved = np.abs(pose.x - rest.state.x).max()
        assert moved == pytest.approx(0.1 * 6.0, rel=1e-9) or moved < 1e-9  # a link spins about itself
    axes = modes_figure(Figure(), linear.place, modes, (5, 6))
    assert [ax.get_title() for ax in axes] == [mode_label(modes, 5), mode_label(modes, 6)]
    assert "Hz" in mode_label(modes, 6)


@pytest.fixture(scope="module")
def runs():
    models = fc.assemble(ceiling_crane(), EFFECTS), fc.assemble(ceiling_crane(), fc.rigid(EFFECTS))
    method = fc.GeneralizedAlpha(1e-3)
    return [fc.simulate(m, until=0.01, inputs={"push": 500.0}, method=method, every=1e-3) for m in models]


def test_curves_are_the_runs(runs):
    flexible, rigid = runs
    axes = panels(Figure(), 2)
    comparison_curves(axes, Comparison.between(flexible, rigid), ("travel", "push"), units(ceiling_crane()))
    solid, dashed = axes[0].lines
    np.testing.assert_array_equal(solid.get_ydata(), flexible["travel"])
    np.testing.assert_array_equal(dashed.get_ydata(), rigid["travel"])
    assert (solid.get_linestyle(), dashed.get_linestyle()) == ("-", "--")
    assert axes[0].get_ylabel() == "travel (m)"
    assert axes[1].get_ylabel() == "push (N)"
    assert [t.get_text() for t in axes[0].get_legend().get_texts()] == ["flexible", "rigid"]


@pytest.mark.parametrize("count", [1, 3, 4, 7])
def test_panels_are_as_many_as_asked(count):
    figure = Figure()
    axes = panels(figure, count)
    assert len(axes) == count
    assert sum(ax.get_visible() for ax in figure.axes) == count


def test_a_run_draws_itself(runs):
    import matplotlib

    matplotlib.use("Agg")
    axes = runs[0].plot().axes
    assert [ax.get_ylabel() for ax in axes] == ["x1_minus_x4", "load_z", "travel"]
    run_curves(axes[:1], runs[0], ("load_z",))
    figure = Comparison.between(*runs).plot(("load_z",))
    assert len(figure.axes) == 1


def test_one_signal_is_drawn_by_its_name_alone(runs):
    """Its letters were looked for."""
    assert len(Comparison.between(*runs).plot("load_z").axes) == 1
    assert len(runs[0].plot("load_z").axes) == len(runs[0].plot(("load_z",)).axes) == 1
    with pytest.raises(StructureError, match="no signal 'load_y'; did you mean 'load_z'"):
        runs[0].plot("load_y")
    with pytest.raises(StructureError, match="plot: signals = 3; expected a list"):
        runs[0].plot(3)


def test_how_far_a_trolley_has_travelled_is_drawn_nowhere():
    wire = fc.Section(EA=1e6, EI_y=9e2, EI_z=9e2, GJ=7e2, rhoA=2.0, rhoJ=0.05)
    girder = fc.Beam("girder", (0, 0, 5), (0, 4, 5), wire, 2)
    trolley = fc.Trolley("trolley", girder, at=1.0, mass=5.0)
    machine = fc.Structure([girder, trolley], [fc.Support(girder.start)])
    ax = draw_machine(add_machine_axes(Figure(), machine), machine)
    points = np.vstack([line.get_xydata() for line in ax.lines])
    assert best_plane(machine) == (1, 2)
    assert points[:, 0].min() >= 0.0
    assert np.allclose(points[:, 1], 5.0)
    assert "4, 5" in written(ax)


def test_a_beam_of_component_modes_is_drawn_bent():
    """One element, clamped at both ends: its nodes stand still, its first mode is φ₁ along the whole axis."""
    from flexctrl.mechanics.clamped_modes import clamped_shapes
    from flexctrl.plots.modes import mode_pose
    from flexctrl.plots.pose import axis_curve
    from flexctrl.report.modes import animation

    beam = fc.Beam("beam", (0, 0, 0), (2, 0, 0), fc.Section.tube(fc.STEEL, 0.05, 0.004))
    structure = fc.Structure([beam], [fc.Support(beam.start), fc.Support(beam.end)])
    model = fc.assemble(structure, [fc.ComponentModes(2), fc.LargeRotation()])
    modes = fc.linearize(model, at=fc.equilibrium(model)).modes()
    curve = axis_curve(beam, mode_pose(modes.place, modes.shapes[:, 0]), [0, 1], points=21)
    across = curve[:, 1:] @ np.linalg.svd(curve[:, 1:])[2][0]
    expected = clamped_shapes(1, np.linspace(0.0, 1.0, 21))[0]
    cosine = abs(across @ expected) / np.linalg.norm(across) / np.linalg.norm(expected)
    assert cosine > 0.9999
    assert np.abs(across).max() == pytest.approx(0.12 * structure.size * np.abs(expected).max(), rel=0.05)
    moved = np.array(animation(modes)["modes"][0]["moved"])
    assert np.abs(moved[:2]).max() == 0.0
    assert np.abs(moved[2:]).max() > 0.05


def test_frames_of_runs_and_equilibria_show_component_modes_bent():
    """A beam of one clamped–clamped element sags by modes alone: the drawn line has its sag w L⁴/(384 EI)."""
    section = fc.Section(EA=1e7, EI_y=1e6, EI_z=1e6, GJ=1e6, rhoA=100.0, rhoJ=1.0)
    beam = fc.Beam("beam", (0, 0, 0), (10, 0, 0), section, elements=1)
    structure = fc.Structure([beam], [fc.Support(beam.start), fc.Support(beam.end)])
    model = fc.assemble(structure, [fc.Gravity(), fc.ComponentModes(6), fc.LargeRotation()])
    rest = fc.equilibrium(model)
    sag = 100.0 * 9.81 * 10.0**4 / (384.0 * 1e6)
    run = fc.simulate(model, until=0.01, start=rest)
    pose = pose_of(structure, model.coordinates, run.frames[-1])
    for machine, shown in ((structure, pose), (model, run.frames[-1])):
        axes = add_machine_axes(Figure(), structure, [pose])
        draw_deformed(axes, machine, shown, "blue", plane=(0, 2))
        assert min(line.get_ydata().min() for line in axes.lines) == pytest.approx(-sag, rel=0.02)
    drawn = rest.plot().axes[0]
    scale = float(drawn.get_title().split("× ")[1]) if "×" in drawn.get_title() else 1.0
    assert min(line.get_ydata().min() for line in drawn.lines) == pytest.approx(-sag * scale, rel=0.02)


def test_parts_that_only_spin_stay_where_they_are():
    """Rods on pins spin about their own axes: what such a mode displaces is round-off, and not enlarged."""
    from flexctrl.plots.modes import mode_pose

    model = fc.assemble(ceiling_crane(), [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])
    modes = fc.linearize(model, at=fc.equilibrium(model)).modes(5)
    rest = modes.place.state.x
    moved = [np.abs(mode_pose(modes.place, modes.shapes[:, k]).x - rest).max() for k in range(5)]
    assert min(moved) < 1e-3
    assert max(moved) > 0.5
