"""What is said of scenes that mean nothing."""

from __future__ import annotations

import math
import re

import pytest
from scenes import TROLLEY

import flexctrl as fc
from flexctrl.errors import SceneError
from flexctrl.scene import load_scene

BAD = [
    ("[elements]", "[elemens]", "elemens: unknown key; did you mean 'elements'?"),
    ('kind = "rope"', 'kind = "rop"', "[elements.rope] kind: there is no 'rop'; did you mean 'rope'?"),
    ('kind = "rope", ', "", "[elements] rope: the key 'kind' is missing"),
    ("mass = 5.0", "weight = 5.0", "[elements.load] weight: unknown key"),
    ("mass = 5.0", 'mass = "heavy"', "[elements.load] mass = 'heavy'; expected a number"),
    ("mass = 5.0", "mass = -5.0", "[elements] load: PointMass 'load': mass = -5.0; expected a number ≥ 0"),
    (", mass = 5.0", "", "[elements] load: the key 'mass' is missing"),
    ("EA = 2e5", "EA = true", "[elements.rope] EA = True; expected a number"),
    ("EA = 2e5", "EA = nan", "[elements.rope] EA = nan; expected a finite number"),
    ("EA = 2e5", "EA = inf", "[elements.rope] EA = inf; expected a finite number"),
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
    ("torque = { kind", "tor-que = { kind", "[inputs] tor-que: MotorTorque: name = 'tor-que'; expected ASCII letters"),
    ('drive = "travel_drive" }\nspeed', 'drive = "drive" }\nspeed', "DriveAngle 'angle': there is no drive 'drive'"),
    ('top = "trolley", ', "", "[outputs] sway: the key 'top' is missing"),
    ("gravity = true", "gravty = true", "there is no effect 'gravty'; did you mean 'gravity'?"),
    ("gravity = true", "gravity = 9.81", "[effects] gravity = 9.81; expected true, false or a table"),
    ("gravity = true", "gravity = { g = 9.81 }", "[effects.gravity] g = 9.81; expected three numbers"),
    ("beta = 1e-3", "gamma = 1e-3", "[effects.rayleigh_damping] gamma: unknown key; known: alpha, beta"),
    ('kind = "minimum_jerk"', 'kind = "minimum_jump"', "[moves.along] kind: there is no 'minimum_jump'"),
    ("duration = 0.6", "duration = 0", "[moves.along] duration = 0; expected a number > 0"),
    ('move = "along"', 'move = "across"', "[controllers.1.reference] move: there is no 'across'"),
    ('kind = "pid"', 'kind = "pdi"', "[controllers.1] kind: there is no 'pdi'; did you mean 'pid'?"),
    ('rate = "speed"', 'rate = "angle"', "[controllers] 1: PID: rate = 'angle' is the measured signal itself; give"),
    ("kp = 0.2", "kpp = 0.2", "[controllers.1] kpp: unknown key; did you mean 'kp'?"),
    ("sample_time = 0.01", "sample_time = 0", "[hardware] sample_time = 0; expected a number > 0"),
    ("until = 0.2", "until = -1", "[simulation] until = -1; expected a number > 0"),
    ("until = 0.2", "until = inf", "[simulation] until = inf; expected a finite number"),
    ("until = 0.2", "until = nan", "[simulation] until = nan; expected a finite number"),
    ("until = 0.2", "until = 1e300", "simulation: until = 1e+300; expected seconds > 0 below 1e+50"),
    ("[simulation]", '[units]\nmass = "tons"\n[simulation]', "units: Units: mass = 'tons' is no unit of mass"),
    ("[simulation]", '[units]\nlength = "mm"\n[simulation]', "units: Units: N is not kg·mm/s², so M q̈ and K q"),
    ("[simulation]", '[units]\ntime = "ms"\n[simulation]', "[units] time: unknown key; known: length, mass, force"),
    ("until = 0.2\n", "", "simulation: the key 'until' is missing"),
    ("step = 2e-3", "steps = 2e-3", "[simulation] steps: unknown key; did you mean 'step'?"),
    ("step = 2e-3", "step = 2e-3\ntolerance = { relative = 1e-3 }", "give step (fixed steps) or tolerance"),
    ("rho = 0.8", "rho = 1.8", "generalised alpha: rho = 1.8; expected 0 … 1"),
    ('start = "equilibrium"', 'start = "rest"', "[simulation] start: there is no 'rest'"),
    ("rigid_twin = true", "rigid_twin = 1", "[simulation] rigid_twin = 1; expected true or false"),
    (
        'name = "trolley"',
        'name = "my crane"',
        "toml: name = 'my crane'; expected ASCII letters, digits and underscores, a letter or an",
    ),
    ('name = "trolley"', "name = ", "is not TOML"),
    ('name = "trolley"', 'name = "trolley"\nmachine = "tower_crane"', "machine: there is no 'tower_crane'"),
    ('name = "trolley"', 'name = "trolley"\nloads = { pull = 1.0 }', "loads: the machine has no input 'pull'"),
    (
        'name = "trolley"',
        'name = "trolley"\nloads = { push = "alon" }',
        "[loads] push: there is no move 'alon'; a load is a number, the name of one of the [moves]",
    ),
    (
        'name = "trolley"',
        'name = "trolley"\nloop = { input = "torqe" }',
        "[loop] input: the machine has no input 'torqe'; did you mean 'torque'?",
    ),
    (
        "gravity = true",
        "viscous_friction = { dive = 1.0 }",
        "effects: ViscousFriction: there is no drive or part",
    ),
    ("gravity = true", 'coulomb_friction = { "load.q" = 1.0 }', "effects: CoulombFriction: 'load.q' names no node"),
    ("gravity = true", "wind = { areas = { lod = 1.0 }, speed = [1, 0, 0] }", "effects: Wind: 'lod' names no node"),
    ("gravity = true", 'rope_mass = { of = ["trolley"] }', "effects: RopeMass: "),
    ("gravity = true", "geometric_stiffness = true", "effects: GeometricStiffness is part of LargeRotation; give one"),
    ("large_rotation = true", "backlash = { travel_drive = 0.1 }", "effects: Backlash is not linear"),
    ('measured = "angle"', 'measured = "angel"', "[controllers.1] measured: the machine has no output 'angel'"),
    ('command = "torque"', 'command = "torqe"', "[controllers.1] command: the machine has no input 'torqe'"),
    ('through = "travel_drive"', 'through = "drive"', "[controllers.1.reference] through: the machine has no drive"),
    (
        "[hardware]",
        "[hardware]\nnoise = { angel = 1.0 }",
        "[hardware] noise: the machine has no input or output",
    ),
    ('name = "trolley"', 'name = "trolley"\nplanar = "q"', "planar: planar: no direction 'q'"),
    ('notes = ["made up"]', 'notes = "made up"', "notes = 'made up'; expected a list"),
]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"until": "x"}, "simulation: until = 'x'; expected seconds > 0"),
        ({"until": math.inf}, "simulation: until = inf; expected seconds > 0 below 1e+50"),
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


def test_a_freedom_to_hold_that_is_not_there(written):
    for name, said in (
        ("trolley.q", "no freedom 'q'"),
        ("trolley_0_x", "no free coordinate 'trolley_0_x'; did you mean 'trolley_0_u'"),
        ("trolly.u", "did you mean 'trolley'"),
        ("trolley.v", "no such freedom there; free: u$"),
        ("travel_sorce", "did you mean 'travel_drive_source'"),
    ):
        with pytest.raises(SceneError, match=said) as refused:
            load_scene(written(TROLLEY + f'\n[equilibrium]\nhold = {{ "{name}" = 0.0 }}\n'))
        assert f"[equilibrium.hold] {name}: " in str(refused.value)


def test_what_prestress_is_to_hold_is_looked_up_as_well(written):
    laid = TROLLEY.replace("large_rotation = true", 'geometric_stiffness = { hold = { "trolley.q" = 0.0 } }')
    with pytest.raises(SceneError, match=r"\[effects.geometric_stiffness.hold\] trolley.q: .*no freedom 'q'"):
        load_scene(written(laid))


def test_what_a_scene_in_python_is_to_hold_is_looked_up_at_once(written):
    text = "import flexctrl as fc\nscene = fc.Scene(fc.cranes.ceiling_crane(), hold={'girder.strat.u': 0.0})\n"
    with pytest.raises(SceneError, match=r"scene.py: \[scene.hold\] girder.strat.u: .*names no node of 'girder'"):
        load_scene(written(text, "scene.py"))


def test_a_scene_without_a_simulation_cannot_be_run(written):
    scene = load_scene(written(TROLLEY.split("[simulation]")[0]))
    with pytest.raises(SceneError, match=r"has no \[simulation\]"):
        scene.run()
