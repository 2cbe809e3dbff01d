"""What a scene file means: machines, effects, and every parameter of every kind."""

from __future__ import annotations

import inspect

import pytest
from scenes import EXAMPLES, TROLLEY

import flexctrl as fc
from flexctrl.cranes import bridge_crane, ceiling_crane
from flexctrl.errors import SceneError
from flexctrl.scene import load_scene
from flexctrl.scene.laws import MOVES, SHAPERS
from flexctrl.scene.parts import MACHINES
from flexctrl.scene.physics import EFFECTS


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
