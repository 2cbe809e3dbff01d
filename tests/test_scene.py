"""Scene files: what they mean, and what is said of those that mean nothing."""

from __future__ import annotations

import inspect
import math
import re

import numpy as np
import pytest
from scenes import EXAMPLES, TROLLEY

import flexctrl as fc
from flexctrl.cranes import bridge_crane, ceiling_crane
from flexctrl.design import AntiWindup, MinimumJerk, Sampled, Saturated, Shaped, TrapezoidalVelocity, zvd
from flexctrl.errors import EquilibriumError, SceneError
from flexctrl.scene import PID, Controlled, Gains, Hardware, Move, Reference, StateFeedback, Transfer, load_scene
from flexctrl.scene.laws import MOVES, SHAPERS, move
from flexctrl.scene.parts import MACHINES
from flexctrl.scene.physics import EFFECTS
from flexctrl.scene.reading import Place


@pytest.fixture
def written(tmp_path):
    def write(text: str, name: str = "scene.toml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


# -- what a file means


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.toml")), ids=lambda p: p.stem)
def test_shipped_scenes_load(path):
    scene = load_scene(path)
    assert scene.name == path.stem
    assert scene.simulation is not None
    assert scene.notes


def test_the_files_describe_the_same_machines_as_the_package():
    assert load_scene(EXAMPLES / "ceiling_crane.toml").structure == ceiling_crane()
    assert load_scene(EXAMPLES / "bridge_crane.toml").structure == bridge_crane()


def test_the_paper_is_run_as_the_paper_says():
    scene = load_scene(EXAMPLES / "ceiling_crane.toml")
    plan = scene.simulation
    assert plan.method == fc.GeneralizedAlpha(step=1e-4, rho=0.9)
    assert round(plan.until / plan.method.step) == 500
    assert scene.loads == {"push": 500.0}
    assert scene.effects[0] == fc.Gravity((0, 0, -9.81))
    assert plan.rigid_twin


def test_a_scene_in_python(written):
    path = written(
        "import flexctrl as fc\nfrom flexctrl import cranes\nscene = fc.Scene(cranes.ceiling_crane(), name='mine')",
        "mine.py",
    )
    assert load_scene(path).name == "mine"


def test_ready_made_machines_take_parameters_and_additions(written):
    scene = load_scene(
        written(
            'machine = { kind = "ceiling_crane", elements = 2 }\n'
            '[elements]\nload = { kind = "point_mass", at = "link3.end", mass = 3.0 }\n'
            '[[joints]]\nkind = "pin"\nfirst = "link3.end"\nsecond = "load"\n'
            '[outputs]\nload_x = { kind = "position", at = "load", direction = "x" }\n'
        )
    )
    assert scene.structure.part("girder").elements == 12
    assert scene.structure.part("load").mass == 3.0
    assert [o.name for o in scene.structure.outputs][-1] == "load_x"


def test_every_kind_of_part_reads_as_its_constructor(written):
    text = """
planar = "y"
[materials.brass]
E = 1e11
rho = 8500.0
nu = 0.35
[sections]
bar = { shape = "rectangle", material = "brass", width = 0.02, height = 0.03 }
pipe = { shape = "tube", material = "steel", radius = 0.05, thickness = 0.004, rhoA = 9.0 }
[elements]
mast = { kind = "beam", start = [0, 0, 0], end = [0, 0, 2], section = "bar", elements = 2, up = "y" }
jib = { kind = "beam", start = "mast.end", end = [1, 0, 2], section = "pipe", up = [0, 1, 0] }
hook = { kind = "rigid_body", at = [1, 0, 1], mass = 2.0, inertia = [1, 1, 1], points = { eye = [1, 0, 1.5] } }
line = { kind = "spring", start = "jib.end", end = "hook.eye", stiffness = 1e4, damping = 3.0 }
[[joints]]
kind = "support"
node = "mast.0"
held = "all"
[[joints]]
kind = "hinge"
first = "mast.-1"
second = "jib.start"
axis = "y"
[[joints]]
kind = "pin"
first = "jib.end"
second = "line.start"
[[joints]]
kind = "pin"
first = "line.end"
second = "hook.eye"
[drives]
luff = { kind = "rotary", node = "jib.start", against = "mast.end", axis = "y", stiffness = 10.0, ratio = 50.0 }
hoist = { kind = "winch", node = "hook", against = "jib.end", EA = 1e6, radius = 0.2, ratio = 9, shortest = 0.1 }
[outputs]
pull = { kind = "tension", line = "line" }
tilt = { kind = "rotation", at = "hook", axis = [0, 1, 0], minus = "mast.1" }
"""
    found = load_scene(written(text)).structure
    brass = fc.Material(1e11, 8500.0, 0.35)
    assert found.part("mast").section == fc.Section.rectangle(brass, 0.02, 0.03)
    assert found.part("jib").section.rhoA == 9.0
    assert found.part("jib").section.EA == fc.Section.tube(fc.STEEL, 0.05, 0.004).EA
    assert found.part("jib").start.position == (0, 0, 2)
    hook = fc.RigidBody("hook", (1, 0, 1), 2.0, (1, 1, 1), points={"eye": (1, 0, 1.5)})
    assert found.part("hook") == hook
    assert found.part("line") == fc.Spring("line", (1, 0, 2), (1, 0, 1.5), 1e4, damping=3.0)
    mast = found.part("mast")
    expected = fc.RotaryDrive("luff", found.part("jib").start, mast.end, axis="y", stiffness=10.0, ratio=50.0)
    assert found.part("luff") == expected
    drum = found.part("jib").end
    assert found.part("hoist") == fc.Winch("hoist", hook.node, drum, EA=1e6, radius=0.2, ratio=9, shortest=0.1)
    assert found.outputs[1] == fc.Rotation("tilt", hook.node, (0, 1, 0), minus=mast.node(1))
    assert found.join_table.columns("v rx rz") == ((0, 0, 0),) * len(found.nodes)


def test_a_trolley_on_a_girder_and_what_holds_it(written):
    text = """
[sections]
box = { EA = 1e6, EI_y = 900, EI_z = 900, GJ = 700, rhoA = 2, rhoJ = 0.05 }
[elements]
girder = { kind = "beam", start = [0, 0, 5], end = [0, 4, 5], section = "box", elements = 4 }
carriage = { kind = "trolley", along = "girder", at = 1.0, mass = 5.0 }
[[joints]]
kind = "support"
node = "girder.start"
[drives]
travel = { kind = "linear", node = "carriage.travel", direction = "x", radius = 0.1, stiffness = 100 }
[outputs]
s = { kind = "position", at = "carriage.travel", direction = "x" }
[effects]
large_rotation = true
[equilibrium]
hold = { "carriage.travel.u" = 0.5 }
"""
    scene = load_scene(written(text))
    girder = scene.structure.part("girder")
    assert scene.structure.part("carriage") == fc.Trolley("carriage", girder, at=1.0, mass=5.0)
    assert scene.rest.outputs == pytest.approx({"s": 1.5})
    with pytest.raises(SceneError, match=r"there is no beam 'grider'.*girder"):
        load_scene(written(text.replace('along = "girder"', 'along = "grider"')))


def test_effects_that_are_not_named_are_not_simulated(written):
    text = TROLLEY.replace("flexible = true", "flexible = false\nrope_stretch = true")
    assert {type(e).__name__ for e in load_scene(written(text)).effects} == {
        "Gravity",
        "RopeStretch",
        "LargeRotation",
        "RayleighDamping",
    }


def test_damping_through_two_frequencies(written):
    text = TROLLEY.replace("{ alpha = 0.0, beta = 1e-3 }", "{ zeta = 0.02, omega1 = 2.0, omega2 = 30.0 }")
    assert load_scene(written(text)).effects[-1] == fc.RayleighDamping.through(0.02, 2.0, 30.0)


def test_a_scene_in_a_rotating_frame(written):
    more = "large_rotation = true\nrotating_frame = { rate = [0, 0, 0.5], center = [1, 0, 0] }"
    scene = load_scene(written(TROLLEY.replace("large_rotation = true", more)))
    assert fc.RotatingFrame((0, 0, 0.5), (1, 0, 0)) in scene.effects
    with pytest.raises(SceneError, match="expected three numbers"):
        load_scene(written(TROLLEY.replace("large_rotation = true", "rotating_frame = { rate = 0.5 }")))


@pytest.mark.parametrize(
    ("group", "kinds"), [("effects", EFFECTS), ("moves", MOVES), ("shapers", SHAPERS), ("machines", MACHINES)]
)
def test_every_parameter_of_every_kind_can_be_given(group, kinds):
    for name, kind in kinds.items():
        parameters = set(inspect.signature(kind.make).parameters)
        assert set(kind.readers) == parameters, (group, name)


# -- controllers


def test_a_reference_through_a_drive_is_in_motor_radians(written):
    scene = load_scene(written(TROLLEY))
    law = scene.law
    assert isinstance(law, Saturated)
    assert isinstance(law.controller, Sampled)
    # Far ahead of a machine at rest, u = kp R/r d: 0.2 N m/rad · 100 rad/m · 0.5 m, cut to its limit.
    command = law.controller.command(10.0, law.initial(), np.zeros(2))
    assert command == pytest.approx([0.2 * 100.0 * 0.5])
    assert law.command(10.0, law.initial(), np.zeros(2)) == pytest.approx([2.0])


def test_a_shaped_move_scales_with_its_shaper():
    path, shaper = TrapezoidalVelocity(2.0, 1.0, 0.5), zvd(3.0, 0.1)
    scaled, exact = Move(path, shaper).times(7.0), Shaped(path, shaper)
    for t in (0.3, 1.7, 2.9, 5.0, 9.0):
        assert scaled(t) == pytest.approx(7.0 * exact(t), rel=1e-12)
        assert scaled.derivative(t) == pytest.approx(7.0 * exact.derivative(t), rel=1e-12)


def test_there_wait_and_back_is_a_sum_of_moves():
    out = {"kind": "trapezoidal_velocity", "distance": 2.0, "speed": 1.0, "acceleration": 0.5, "at": 1.0}
    back = {"kind": "minimum_jerk", "distance": -2.0, "duration": 3.0, "at": 8.0}
    held = {"kind": "constant", "value": 0.5}
    shaped = {"kind": "zvd", "omega": 9.0, "zeta": 0.1}
    found = move({"kind": "sum", "terms": [out, back, held], "shaper": shaped}, Place("x"))
    there, home = TrapezoidalVelocity(2.0, 1.0, 0.5, 1.0), MinimumJerk(-2.0, 3.0, 8.0)
    command = found.times(7.0)
    for t in np.linspace(-1.0, 13.0, 57):
        expected = 0.5 + Shaped(there, zvd(9.0, 0.1))(t) + Shaped(home, zvd(9.0, 0.1))(t)
        assert command(t) == pytest.approx(7.0 * expected, abs=1e-11)
        rate = Shaped(there, zvd(9.0, 0.1)).derivative(t) + Shaped(home, zvd(9.0, 0.1)).derivative(t)
        assert command.derivative(t) == pytest.approx(7.0 * rate, abs=1e-11)


@pytest.mark.parametrize(
    ("terms", "message"),
    [([], "at least one"), ([{"kind": "stp", "size": 1.0}], "step"), ([{"kind": "step"}], "size"), (3.0, "a list")],
)
def test_a_sum_says_what_is_wrong_with_its_terms(terms, message):
    with pytest.raises(SceneError, match=message):
        move({"kind": "sum", "terms": terms}, Place("x"))


def test_a_shaper_for_two_modes():
    kinds = [{"kind": "zv", "omega": 2.0}, {"kind": "zv", "omega": 5.0}]
    found = move({"kind": "step", "size": 1.0, "shaper": kinds}, Place("x"))
    assert found.shaper.residual(2.0) < 1e-12
    assert found.shaper.residual(5.0) < 1e-12


@pytest.fixture
def trolley(written):
    return load_scene(written(TROLLEY))


def test_state_feedback_moves_the_rigid_twins_poles_where_lqr_puts_them(trolley):
    import control as ct

    reads = ("angle", "speed", "sway", "sway_rate")
    crane = trolley.structure
    rate = fc.Velocity("sway_rate", crane.part("load").node, "x", minus=crane.part("trolley").node)
    scene = fc.Scene(crane.with_(outputs=[*crane.outputs, rate]), trolley.effects)
    law = StateFeedback({"angle": 1.0, "sway": 0.1}, {"torque": 3.0}, reads).build(scene).controller
    plant = scene.twin_linear.select(("torque",), reads).to_ss()
    closed = np.linalg.eigvals(plant.A + plant.B @ law.D @ plant.C)
    Q = plant.C.T @ np.diag([1.0, 0.0, 100.0, 0.0]) @ plant.C
    poles = ct.lqr(plant.A, plant.B, Q, np.array([[1 / 9.0]]))[2]
    assert np.sort_complex(closed) == pytest.approx(np.sort_complex(poles), rel=1e-6)


def test_transfer_function_and_gains_are_the_same_law(trolley):
    one = Transfer("angle", "torque", (3.0,), (1.0,), Reference(Move(TrapezoidalVelocity(1.0, 1.0, 1.0)))).build(
        trolley
    )
    two = Gains({"torque": {"angle": -3.0}}, {"angle": Reference(Move(TrapezoidalVelocity(1.0, 1.0, 1.0)))}).build(
        trolley
    )
    for t in (0.0, 0.7, 5.0):
        y = np.array([0.2])
        assert one.command(t, one.initial(), y) == pytest.approx(two.command(t, two.initial(), y))


def test_an_integral_stops_at_its_limit(trolley):
    law = PID("angle", "torque", kp=1.0, ki=5.0, kd=0.1, rate="speed", limit=2.0).build(trolley)
    assert isinstance(law, AntiWindup)
    for angle, stopped in ((-0.5, False), (-5.0, True)):  # u = 0.5, and 5 cut to 2
        slope = law.rate(0.0, np.zeros(1), np.array([angle, 0.0]))
        assert slope == pytest.approx([0.0 if stopped else angle])


def test_hardware_from_the_inside_out(trolley):
    law = PID("angle", "torque", kp=1.0, kd=0.1, rate="speed")
    box = Hardware(0.01, noise={"angle": 1e-3}, steps={"angle": 0.01}, limits={"torque": 1.0}, delay=1)
    found, kinds = Controlled((law,), box).build(trolley), []
    while hasattr(found, "controller"):
        kinds.append(type(found).__name__)
        found = found.controller
    assert kinds[:5] == ["Delayed", "Saturated", "Quantised", "Noisy", "Sampled"]


# -- runs


def test_loads_push_beside_the_controller(written):
    text = TROLLEY + '\n[loads]\npush = { kind = "step", size = 4.0, at = 0.1 }\n'
    run = load_scene(written(text)).run()
    assert run["push"][0] == 0.0
    assert run["push"][-1] == 4.0
    assert np.abs(run["torque"]).max() > 0.0


def test_a_run_that_starts_in_equilibrium_stays_there_without_a_move(written):
    text = TROLLEY.replace("distance = 0.5", "distance = 0.0")
    run = load_scene(written(text)).run()
    sink = 5.0 * 9.81 * 2.0 / 2e5
    assert run["load_z"] == pytest.approx(np.full(len(run.t), -2.0 - sink), abs=1e-9)


def test_freedoms_are_held_by_node_or_by_name(written):
    for name in ("trolley.u", "trolley_0_u"):
        scene = load_scene(
            written(TROLLEY + f'\n[equilibrium]\nhold = {{ "{name}" = 0.3 }}\ninputs = {{ push = 2.0 }}\n')
        )
        rest = scene.rest.outputs
        assert rest["travel"] == pytest.approx(0.3)
        assert np.tan(rest["sway"]) == pytest.approx(2.0 / (5.0 * 9.81), rel=1e-9)
        assert scene.twin_rest.outputs["travel"] == pytest.approx(0.3)


def test_an_equilibrium_that_cannot_be_is_told(written):
    scene = load_scene(written(TROLLEY + "\n[equilibrium]\ninputs = { push = 2.0 }\n"))
    with pytest.raises(EquilibriumError):
        _ = scene.rest


# -- what is said of files that mean nothing

BAD = [
    ("[elements]", "[elemens]", "elemens: unknown key; did you mean 'elements'?"),
    ('kind = "rope"', 'kind = "rop"', "[elements.rope] kind: there is no 'rop'; did you mean 'rope'?"),
    ('kind = "rope", ', "", "[elements] rope: the key 'kind' is missing"),
    ("mass = 5.0", "weight = 5.0", "[elements.load] weight: unknown key"),
    ("mass = 5.0", 'mass = "heavy"', "[elements.load] mass = 'heavy'; expected a number"),
    ("mass = 5.0", "mass = -5.0", "[elements] load: PointMass 'load': mass = -5.0; expected a number ≥ 0"),
    (", mass = 5.0", "", "[elements] load: the key 'mass' is missing"),
    ("EA = 2e5", "EA = true", "[elements.rope] EA = True; expected a number"),
    ("EA = 2e5", "EA = nan", "[elements.rope] EA = nan; expected a number"),
    ("EA = 2e5", "EA = inf", "[elements.rope] EA = inf; expected a number"),
    ("end = [0, 0, -2]", "end = [0, -2]", "[elements.rope] end = [0, -2]; expected three numbers [x, y, z]"),
    ("end = [0, 0, -2]", 'end = [0, 0, "deep"]', "[elements.rope] end = 'deep'; expected a number"),
    ("end = [0, 0, -2]", "end = [0, 0, 0]", "Rope 'rope': start (0.0, 0.0, 0.0) and end (0.0, 0.0, 0.0) coincide"),
    ('start = "trolley"', 'start = "troley"', "there is no element 'troley'; did you mean 'trolley'?"),
    (
        'second = "rope.start"',
        'second = "rope.strat"',
        "'rope.strat' names no node of 'rope'; it has rope.start, rope.end",
    ),
    ('node = "load"', 'node = "load.eye"', "'load.eye' names no node of 'load'; it has load"),
    ('node = "load"', "node = 7", "[joints.4] node = 7; expected a text in quotes"),
    ('held = "v w"', 'held = "v q"', "no freedom 'q'"),
    ('held = "v w"', 'hold = "v w"', "[joints.1] hold: unknown key; did you mean 'held'?"),
    ('kind = "pin"', 'kind = "nail"', "[joints.2] kind: there is no 'nail'"),
    ('second = "load"', 'second = "trolley"', "joined nodes coincide"),
    ("radius = 0.1", "radius = 0.0", "LinearDrive 'travel_drive': radius = 0.0; expected a number > 0"),
    ('direction = "x"\nradius', 'direction = "up"\nradius', "no direction 'up'"),
    ('kind = "linear"', 'kind = "line"', "[drives.travel_drive] kind: there is no 'line'; did you mean 'linear'?"),
    ("torque = { kind", "tor-que = { kind", "MotorTorque 'tor-que': a name is letters, digits and underscores"),
    ('drive = "travel_drive" }\nspeed', 'drive = "drive" }\nspeed', "DriveAngle 'angle': there is no 'drive'"),
    ('top = "trolley", ', "", "[outputs] sway: the key 'top' is missing"),
    ("gravity = true", "gravty = true", "there is no effect 'gravty'; did you mean 'gravity'?"),
    ("gravity = true", "gravity = 9.81", "[effects] gravity = 9.81; expected true, false or a table"),
    ("gravity = true", "gravity = { g = 9.81 }", "[effects.gravity] g = 9.81; expected three numbers"),
    ("beta = 1e-3", "gamma = 1e-3", "[effects.rayleigh_damping] gamma: unknown key; known: alpha, beta"),
    ('kind = "minimum_jerk"', 'kind = "minimum_jump"', "[moves.along] kind: there is no 'minimum_jump'"),
    ("duration = 0.6", "duration = 0", "[moves.along] duration = 0; expected a number > 0"),
    ('move = "along"', 'move = "across"', "[controllers.1.reference] move: there is no 'across'"),
    ('kind = "pid"', 'kind = "pdi"', "[controllers.1] kind: there is no 'pdi'; did you mean 'pid'?"),
    ("kp = 0.2", "kpp = 0.2", "[controllers.1] kpp: unknown key; did you mean 'kp'?"),
    ("sample_time = 0.01", "sample_time = 0", "[hardware] sample_time = 0; expected a number > 0"),
    ("until = 0.2", "until = -1", "[simulation] until = -1; expected a number > 0"),
    ("until = 0.2\n", "", "simulation: the key 'until' is missing"),
    ("step = 2e-3", "steps = 2e-3", "[simulation] steps: unknown key; did you mean 'step'?"),
    ("step = 2e-3", "step = 2e-3\ntolerance = { relative = 1e-3 }", "give step (fixed steps) or tolerance"),
    ("rho = 0.8", "rho = 1.8", "generalised alpha: rho = 1.8; expected 0 … 1"),
    ('start = "equilibrium"', 'start = "rest"', "[simulation] start: there is no 'rest'"),
    ("rigid_twin = true", "rigid_twin = 1", "[simulation] rigid_twin = 1; expected true or false"),
    ('name = "trolley"', 'name = "my crane"', "Structure 'my crane': a name is letters, digits and underscores"),
    ('name = "trolley"', "name = ", "is not TOML"),
    ('name = "trolley"', 'name = "trolley"\nmachine = "tower_crane"', "machine: there is no 'tower_crane'"),
    ('name = "trolley"', 'name = "trolley"\nloads = { pull = 1.0 }', "loads: the machine has no 'pull'"),
    (
        'name = "trolley"',
        'name = "trolley"\nloop = { input = "torqe" }',
        "the machine has no 'torqe'; did you mean 'torque'?",
    ),
    ('name = "trolley"', 'name = "trolley"\nplanar = "q"', "planar: planar: no direction 'q'"),
    ('notes = ["made up"]', 'notes = "made up"', "notes = 'made up'; expected a list"),
]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"until": "x"}, "simulation: until = 'x'; expected seconds > 0"),
        ({"until": math.inf}, "simulation: until = inf; expected seconds > 0"),
        ({"every": "a"}, "simulation: every = 'a'; expected seconds > 0"),
        ({"method": "alpha"}, "simulation: method = 'alpha'; expected a method with its parameters"),
        ({"tolerance": 1e-4}, "simulation: tolerance = 0.0001; expected a Tolerance"),
        ({"start": "equilibrium"}, "simulation: start = 'equilibrium'; expected Start.DRAWN"),
        ({"rigid_twin": 1}, "simulation: rigid_twin = 1; expected True or False"),
    ],
    ids=lambda v: next(iter(v)) if isinstance(v, dict) else "",
)
def test_what_a_simulation_cannot_be_is_told_by_name(given, said):
    with pytest.raises(SceneError, match=re.escape(said)):
        fc.Simulation(**{"until": 1.0, **given})


@pytest.mark.parametrize(("old", "new", "said"), BAD, ids=lambda v: str(v)[:30])
def test_bad_files_are_told_where_and_what(written, old, new, said):
    assert old in TROLLEY
    path = written(TROLLEY.replace(old, new, 1))
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert str(path) in str(caught.value)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = 1", "defines no 'scene'"),
        ("scene = 5", "its 'scene' is a int"),
        ("import flexctrl\nscene = 1 / 0", "line 2: ZeroDivisionError"),
        ("scene = (", "line 1:"),
        (
            "import flexctrl as fc\n\nload = fc.PointMass('load', (0, 0, 0), -1.0)",
            "line 3: PointMass 'load': mass = -1.0",
        ),
    ],
)
def test_bad_python_scenes(written, text, said):
    with pytest.raises(SceneError, match=said):
        load_scene(written(text, "bad.py"))


def test_files_that_are_not_there_or_no_scenes(tmp_path, written):
    with pytest.raises(SceneError, match="no such file"):
        load_scene(tmp_path / "nowhere.toml")
    with pytest.raises(SceneError, match=r"a scene is a \.toml file"):
        load_scene(written("{}", "scene.json"))
    with pytest.raises(SceneError, match="describes no machine"):
        load_scene(written(""))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ('measured = "angle"', "reads 'angel', which is no output"),
        ('command = "torque"', "commands 'torqe', which is no input"),
        ('through = "travel_drive"', "has no part 'drive'"),
    ],
)
def test_controllers_are_checked_against_the_machine(written, change, said):
    wrong = change.replace("angle", "angel").replace('"torque"', '"torqe"').replace("travel_drive", "drive")
    scene = load_scene(written(TROLLEY.replace(change, wrong)))
    with pytest.raises(fc.errors.FlexctrlError, match=said):
        _ = scene.law


def test_a_freedom_to_hold_that_is_not_there(written):
    for name, said in (
        ("trolley.q", "no freedom 'q'"),
        ("trolley_0_x", "no free coordinate"),
        ("trolley.v", "no free"),
    ):
        scene = load_scene(written(TROLLEY + f'\n[equilibrium]\nhold = {{ "{name}" = 0.0 }}\n'))
        with pytest.raises(SceneError, match=said):
            _ = scene.rest


def test_a_scene_without_a_simulation_cannot_be_run(written):
    scene = load_scene(written(TROLLEY.split("[simulation]")[0]))
    with pytest.raises(SceneError, match=r"has no \[simulation\]"):
        scene.run()
