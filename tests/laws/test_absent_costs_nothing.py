"""What an effect costs, counted: freedoms, nonzeros, instructions. Absent, or with nothing to act on: none."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.effects.effect import Effect

TUBE = fc.Section.tube(fc.STEEL, radius=0.05, thickness=0.004)


def machine(drives: bool = True, ropes: bool = True, masses: bool = True) -> fc.Structure:
    """A boom on a slewing drive; a load on a rope."""
    boom = fc.Beam("boom", (0, 0, 0), (2, 0, 0), TUBE, elements=2)
    parts, joints = [boom], [fc.Support(boom.start, held="u v w rx ry")]
    if ropes:
        rope = fc.Rope("rope", boom.end, (2, 0, -1), EA=1e5, rhoA=0.5, elements=3)
        parts.append(rope)
        joints.append(fc.Pin(boom.end, rope.start))
        if not masses:
            joints.append(fc.Support(rope.end, held="u v w"))
    if masses:
        load = fc.PointMass("load", (2, 0, -1) if ropes else (2, 0, 0), mass=5.0)
        parts.append(load)
        joints.append(fc.Pin(rope.end if ropes else boom.end, load.node))
    motor = fc.RotaryDrive("motor", boom.start, axis="z", stiffness=50.0, ratio=20.0, inertia=1e-3, damping=0.1)
    return fc.Structure(parts, joints, drives=[motor] if drives else [])


def counted(structure: fc.Structure, effects: list) -> tuple[int, int, dict[str, int]]:
    """Freedoms, nonzeros of the tangent, instructions by kind of piece."""
    model = fc.assemble(structure, effects)
    still = np.zeros(model.n)
    slope = np.abs(model.slope(model.rest, still, still, (1.0, 1.0, 1.0), np.zeros(0)).toarray())
    kinds: dict[str, int] = {}
    for family in model.forces.families:
        name = family.kernels.kind.name
        kinds[name] = kinds.get(name, 0) + family.count * family.kernels.force.instructions
    return model.n, int((slope > 1e-12 * slope.max()).sum()), kinds


BARE = [fc.LargeRotation()]
ADDED = [
    (fc.Gravity(), 0, {"rigid_beam", "point"}),
    (fc.BeamFlexibility(), 12, {"beam"}),
    (fc.ComponentModes(2), 20, {"beam_with_2_modes"}),
    (fc.ShaftElasticity(), 1, {"rotary_drive"}),
    (fc.RopeStretch(), 1, {"rope"}),
    (fc.Wind({"load": 1.0}, (10, 0, 0)), 0, {"wind"}),
    (fc.RopeMass(), 4, {"heavy_rope"}),
    (fc.RayleighDamping(alpha=0.1), 0, {"rigid_beam", "point", "rotary_drive"}),
    (fc.RotatingFrame((0.0, 0.0, 1.0)), 0, {"rigid_beam", "point"}),
    (fc.ViscousFriction({"motor": 0.05}), 0, {"viscous_motor"}),
    (fc.CoulombFriction({"motor": 0.05}), 0, {"dry_motor"}),
    (fc.LuGreFriction({"motor": fc.LuGre(1e3, 0.05)}), 1, {"lugre_motor"}),
    (fc.MotorLag({"motor": 0.05}), 1, {"motor_lag"}),
    (fc.Backlash({"motor": 1e-3}), 0, set()),  # a rigid shaft has no spring to let go
    (fc.ModalDamping(0.01), 0, set()),  # a matrix beside the kernels
]


@pytest.mark.parametrize(("effect", "freedoms", "touched"), ADDED, ids=lambda v: type(v).__name__)
def test_an_effect_adds_to_what_it_acts_on_and_to_nothing_else(effect, freedoms, touched):
    n, _, before = counted(machine(), BARE)
    more, _, after = counted(machine(), [*BARE, effect])
    assert more - n == freedoms
    grown = {kind for kind in after if after[kind] != before.get(kind, 0)}
    assert grown == touched


def test_every_effect_there_is_is_counted():
    """One that is added to the library is to be added here."""
    known = {type(effect) for effect, _, _ in ADDED} | {type(e) for e in BARE}
    composed = {fc.Flexible, fc.GeometricStiffness, fc.Automatic}  # of others; instead of another; a choice
    public = {getattr(fc, name) for name in fc.__all__}
    effects = {kind for kind in public if isinstance(kind, type) and issubclass(kind, Effect) and kind is not Effect}
    assert effects - known - composed - {fc.RopeStretch} == set()


def test_backlash_takes_the_place_of_a_spring():
    n, _, before = counted(machine(), [*BARE, fc.ShaftElasticity()])
    more, _, after = counted(machine(), [*BARE, fc.ShaftElasticity(), fc.Backlash({"motor": 1e-3})])
    assert more == n
    assert set(before) - set(after) == {"rotary_drive"}
    assert set(after) - set(before) == {"loose_rotary"}
    assert all(after[kind] == before[kind] for kind in set(after) & set(before))


@pytest.mark.parametrize("beside", [[], BARE], ids=["small motion", "large"])
@pytest.mark.parametrize(
    "effect",
    [
        fc.CoulombFriction({"motor": 0.0}),
        fc.CoulombFriction({}),
        fc.LuGreFriction({"motor": fc.LuGre(1e3, 0.0)}),
        fc.Backlash({"motor": 0.0}),
        fc.ViscousFriction({"motor": 0.0}),
        fc.MotorLag({"motor": 0.0}),
    ],
    ids=lambda e: type(e).__name__,
)
def test_of_no_strength_it_is_absent_from_linear_machines_too(effect, beside):
    effects = [*beside, fc.Gravity(), fc.Flexible()]
    assert counted(machine(), [*effects, effect]) == counted(machine(), effects)


@pytest.mark.parametrize("stretches", [False, True])
def test_a_winch_costs_itself_and_nothing_else(stretches):
    """A hoist beside a boom: what either is made of alone."""
    crab, hook = fc.PointMass("crab", (0, 1, 5), 10.0), fc.PointMass("hook", (0, 1, 3), 4.0)
    winch = fc.Winch("winch", hook.node, crab.node, EA=1e5, radius=0.1, ratio=2.0, inertia=0.02)
    effects = [*BARE, fc.Gravity(), *([fc.RopeStretch()] if stretches else [])]
    alone = counted(fc.Structure([crab, hook], [fc.Support(crab.node)], [winch]), effects)
    boom = machine(drives=False)
    both = boom.with_(
        elements=[*boom.elements, crab, hook], joints=[*boom.joints, fc.Support(crab.node)], drives=[winch]
    )
    n, nonzeros, kinds = counted(boom, effects)
    n2, nonzeros2, kinds2 = counted(both, effects)
    assert (n2, nonzeros2) == (n + alone[0], nonzeros + alone[1])
    assert kinds2 == {kind: kinds.get(kind, 0) + alone[2].get(kind, 0) for kind in kinds | alone[2]}


@pytest.mark.parametrize(
    ("effect", "without"),
    [
        (fc.RopeStretch(), {"ropes": False}),
        (fc.ShaftElasticity(), {"drives": False}),
    ],
    ids=lambda v: type(v).__name__ if not isinstance(v, dict) else "",
)
def test_where_there_is_nothing_to_act_on_an_effect_costs_nothing(effect, without):
    effects = [*BARE, fc.Gravity(), fc.BeamFlexibility()]
    assert counted(machine(**without), effects) == counted(machine(**without), [*effects, effect])


def test_a_rigid_part_is_one_piece_with_no_elastic_force():
    """A boom that does not bend: one body instead of two elements, as many instructions as without the effect."""
    flexible = [*BARE, fc.Gravity(), fc.BeamFlexibility()]
    other = fc.Beam("other", (0, 0, 5), (1, 0, 5), TUBE)
    grown = machine().with_(
        elements=[*machine().elements, other],
        joints=[*machine().joints, fc.Support(other.start, held="u v w rx ry rz")],
    )
    n, nonzeros, kinds = counted(machine(), [*BARE, fc.Gravity()])
    some = [*BARE, fc.Gravity(), fc.BeamFlexibility(of=["other"])]
    alone = fc.Structure([other], [fc.Support(other.start, held="u v w rx ry rz")])
    n1, nonzeros1, kinds1 = counted(alone, flexible)
    n2, nonzeros2, kinds2 = counted(grown, some)
    assert (n2, nonzeros2) == (n + n1, nonzeros + nonzeros1)
    assert kinds2 == {kind: kinds.get(kind, 0) + kinds1.get(kind, 0) for kind in kinds | kinds1}
    assert kinds["rigid_beam"] < 0.3 * kinds1["beam"]


@pytest.mark.parametrize(
    "effect",
    [
        fc.Gravity((0.0, 0.0, 0.0)),
        fc.RayleighDamping(0.0, 0.0),
        fc.ModalDamping(0.0),
        fc.ViscousFriction({"motor": 0.0}),
        fc.CoulombFriction({"motor": 0.0}),
        fc.MotorLag({"motor": 0.0}),
        fc.Backlash({"motor": 0.0}),
        fc.Wind({"load": 0.0}, (10, 0, 0)),
        fc.Wind({"load": 1.0}, (10, 0, 0), density=0.0),
        fc.RotatingFrame((0.0, 0.0, 0.0)),
    ],
    ids=lambda effect: type(effect).__name__,
)
def test_zero_strength_is_absence(effect):
    """Not only the answer: an effect of no strength leaves no state, entry, instruction or switch behind."""
    shaft = [*BARE, fc.ShaftElasticity()]
    bristle = fc.LuGreFriction({"motor": fc.LuGre(1e3, 0.05)})
    for effects in (BARE, shaft, [*shaft, fc.BeamFlexibility(), fc.RopeStretch(), bristle]):
        without, with_it = (fc.assemble(machine(), [*effects, *more]) for more in ([], [effect]))
        assert counted(machine(), [*effects, effect]) == counted(machine(), effects)
        assert with_it.coordinates == without.coordinates
        assert with_it.switches.names == without.switches.names == ()
        assert with_it.kinks.names == without.kinks.names
