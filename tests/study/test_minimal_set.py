"""The minimal set: it holds what was asked for, nothing more can go, it is not slower, and it is what it says it is."""

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import SceneError, StructureError
from flexctrl.scene.physics import effects
from flexctrl.scene.reading import Place
from flexctrl.study.answers import answer_of, change_between
from flexctrl.study.omissions import omissions


def rotor() -> fc.Scene:
    """A disc on an elastic shaft under a sampled law that feels its angle: the rigid one has no upper gain margin."""
    disc = fc.RigidBody("disc", (0, 0, 0), 10.0, (1.0, 1.0, 2.0), {"hub": (0, 0, 0)})
    hub = disc.point("hub")
    motor = fc.RotaryDrive("motor", hub, axis="z", stiffness=4000.0, ratio=1.0, inertia=0.5, damping=2.0)
    structure = fc.Structure(
        [disc],
        [fc.Support(hub, "u v w rx ry")],
        [motor],
        [fc.MotorTorque("torque", motor)],
        [fc.Rotation("phi", hub, "z")],
    )
    law = fc.design.pid(3.0, 0.0, 6.0, measured="phi", rate=fc.design.FilteredRate(0.02), command="torque")
    simulation = fc.Simulation(until=1.0, every=0.01, method=fc.GeneralizedAlpha(2e-3))
    law = fc.Saturated(fc.Sampled(law, 0.002), {"torque": 50.0})
    return fc.Scene(structure, [fc.Flexible(), fc.LargeRotation()], law, {"torque": 0.5}, simulation)


@pytest.fixture(scope="module")
def scene():
    return rotor()


@pytest.fixture(scope="module")
def whole(scene):
    return fc.ledger(scene, 0.02)


@pytest.fixture(scope="module")
def curves(scene):
    return fc.ledger(scene, fc.Within(outputs=0.02))


@pytest.mark.slow
def test_margins_of_the_answer_are_held_unless_only_curves_are_asked_for(whole, curves):
    """Without the shaft's elasticity the curves stay and the gain margin falls by a lot."""
    entry = whole["shaft_elasticity"]
    assert entry.change.outputs_worst < 0.02 < entry.change.margins
    assert entry.keep
    assert "shaft_elasticity" not in curves.minimal_set
    assert whole.minimal_change.margins <= 0.02
    assert curves.minimal_change.margins > 0.1
    assert "margins" in str(whole).splitlines()[-1]


@pytest.mark.slow
def test_nothing_more_can_go(scene, whole, curves):
    """What is kept would change the answer by too much on top of what has gone, or there is a reason told."""
    base = scene.with_(controller=scene.law)
    full = answer_of(base, base.run())
    for found, poles in ((whole, 0.02), (curves, np.inf)):
        items = {o.name: o for o in omissions(base)}
        for name in found.minimal_set:
            if found[name].stays:
                continue
            less = items[name].without(found.scene)
            plan = scene.simulation
            change = change_between(full, answer_of(less, less.with_(simulation=plan).run()))
            assert change.outputs_worst > 0.02 or change.poles > poles or change.margins > poles, name


@pytest.mark.slow
def test_it_is_not_slower_and_is_what_it_says(scene, whole, curves):
    items = omissions(scene.with_(controller=scene.law))
    for found in (whole, curves):
        assert found.speedup > 0.9
        has = {o.name for o in items if o.is_in(found.scene)}
        assert set(found.minimal_set) == has - {e.name for e in found.entries if not e.keep}
        assert has == set(found.minimal_set)
        assert found.minimal_size.work <= found.size.work


@pytest.mark.parametrize(("kd", "unstable"), [(2.0, False), (-0.5, True)])
def test_an_unstable_loop_is_noted(kd, unstable):
    """A servo that damps, and one that feeds the swing of the shaft."""
    law = fc.Sampled(
        fc.design.pid(3.0, 0.0, kd, measured="phi", rate=fc.design.FilteredRate(0.02), command="torque"), 0.002
    )
    scene = rotor().with_(controller=law, simulation=fc.Simulation(until=0.05, every=0.01))
    found = fc.ledger(scene, fc.Within(margins=0.5))
    notes = [note for note in found.notes if "unstable" in note]
    assert len(notes) == unstable
    assert (found.full.growing.real > 0.0) == unstable
    assert ("margins say nothing" in str(found)) == unstable


@pytest.mark.long
def test_what_went_with_others_is_not_called_kept():
    """A hoist that nothing balances: small motion about an equilibrium cannot be tried, as if unloaded it can."""
    crab, hook = fc.PointMass("crab", (0, 0, 5), 20.0), fc.PointMass("hook", (0, 0, 2), 4.0)
    winch = fc.Winch("winch", hook.node, crab.node, EA=1e5, radius=0.1, ratio=2.0, inertia=0.02, damping=50.0)
    structure = fc.Structure(
        [crab, hook],
        [fc.Support(crab.node)],
        [winch],
        [fc.MotorTorque("lift", winch)],
        [fc.Position("z", hook.node, "z")],
    )
    scene = fc.Scene(
        structure,
        [fc.Gravity(), fc.Flexible(), fc.LargeRotation()],
        loads={"lift": -2.6},
        simulation=fc.Simulation(until=0.3, every=0.01),
    )
    found = fc.ledger(scene, 0.02)
    kinds = {type(e) for e in found.scene.effects}
    assert found["large_rotation"].keep == (fc.LargeRotation in kinds)
    assert ("gravity" in found.minimal_set) == (fc.Gravity in kinds)
    for omission in omissions(scene):
        assert omission.is_in(found.scene) or omission.name not in found.minimal_set


def test_tolerances_are_values():
    assert fc.Within.of(0.01, "ledger") == fc.Within(outputs=0.01, poles=0.01, margins=0.01)
    read = effects({"automatic": {"outputs": 0.01, "margins": 0.1}}, Place("scene.toml"), rotor().structure)
    assert read == (fc.Automatic(fc.Within(outputs=0.01, margins=0.1)),)
    assert effects({"automatic": {"tolerance": 0.02}}, Place("scene.toml"), rotor().structure) == (fc.Automatic(0.02),)
    with pytest.raises(StructureError, match="asks for nothing"):
        fc.Within()
    with pytest.raises(StructureError, match="Within: margins"):
        fc.Within(margins=-1.0)
    with pytest.raises(StructureError, match="expected a number > 0"):
        fc.Automatic("0.01")
    with pytest.raises(SceneError, match="tolerance"):
        effects({"automatic": {"tolerances": 0.02}}, Place("scene.toml"), rotor().structure)
