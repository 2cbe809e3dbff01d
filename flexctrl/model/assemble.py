"""Putting a structure under effects, and the rigid twin."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from flexctrl.effects.component_modes import ComponentModes
from flexctrl.effects.damping import ModalDamping
from flexctrl.effects.effect import Effect
from flexctrl.effects.flexibility import Deforming
from flexctrl.effects.geometric_stiffness import GeometricStiffness
from flexctrl.effects.large_rotation import LargeRotation
from flexctrl.effects.rope_mass import RopeMass
from flexctrl.errors import StructureError, did_you_mean, shortened
from flexctrl.kernels.kernel import Backend, best_backend
from flexctrl.linear.model import LinearModel
from flexctrl.linear.modes import Modes
from flexctrl.model.braked import borne, rest_held
from flexctrl.model.equations import Small
from flexctrl.model.laws.frictions import inner_freedoms
from flexctrl.model.laws.gusts import check_gusts, idle_gusts
from flexctrl.model.linkages.mobility import motion_of
from flexctrl.model.model import Model
from flexctrl.model.tangents import tangents
from flexctrl.structure.beams import Beam
from flexctrl.structure.cut import cut_ropes
from flexctrl.structure.freedoms import listed
from flexctrl.structure.lines import Rope
from flexctrl.structure.outputs import Tension
from flexctrl.structure.relations import Group
from flexctrl.structure.structure import Structure
from flexctrl.structure.trolleys import Trolley

_SAME = 1e-6
"""Shares of its length to which a rope may be drawn at another: digits that drawings leave out."""
_FAR = 2e5
"""Times its size from the origin: at five times that, the last digits of places made steps an eighth as long."""


def assemble(structure: Structure, effects: Sequence[Effect], backend: Backend | None = None) -> Model:
    """Put a structure under some effects.

    Parameters
    ----------
    structure : Structure
    effects : sequence of Effect
        What the scene asks for, e.g. ``[Gravity(), Flexible(), LargeRotation()]``. What no effect
        bends is rigid; an effect left out costs nothing. The tension of a rigid rope is not an output
        of the model, and one drawn stretched keeps the distance drawn (`Model.notes` says so).
    backend : Backend, optional
        How the kernels run; default: compiled if the extra ``[fast]`` is installed.

    Returns
    -------
    Model

    Raises
    ------
    StructureError
        For something that is no effect, an effect given twice, effects that make no sense together, or a rope that is
        drawn slack and does not stretch.
    """
    if not isinstance(structure, Structure):
        raise StructureError(f"assemble: {shortened(structure)} is no Structure; give Structure(elements=…, joints=…)")
    parts = checked_effects(structure, effects)
    ropes = [p for p in structure.elements if isinstance(p, Rope) and not any(e.bends(p) for e in parts)]
    stretched = tuple(note for rope in ropes if (note := _drawn(rope)))
    structure, parts = _heavy(structure, parts)
    _check_trolleys(structure, parts)
    if any(isinstance(e, GeometricStiffness) for e in parts):
        return _prestressed(structure, parts, backend)
    rigid = [p for p in structure.elements if isinstance(p, Beam | Rope) and not any(e.bends(p) for e in parts)]
    groups = tuple(Group(p.name, tuple(structure.number(n) for n in p.nodes), line=isinstance(p, Rope)) for p in rigid)
    elastic = tuple(d.name for d in structure.drives if any(e.bends(d) for e in parts))
    stiff = {p.name for p in rigid if isinstance(p, Rope)} | {d.name for d in structure.drives} - set(elastic)
    unmeasured = tuple(o.name for o in structure.outputs if isinstance(o, Tension) and o.line in stiff)
    if unmeasured:
        structure = structure.with_(outputs=[o for o in structure.outputs if o.name not in unmeasured])
    runs = backend or best_backend()
    motion = motion_of(structure, structure.bodies + groups, elastic, runs, inner_freedoms(structure, parts))
    left_out = tuple(
        f"output {name} is left out: a rope that does not stretch measures no tension" for name in unmeasured
    )
    motion = replace(
        motion,
        notes=motion.notes
        + left_out
        + stretched
        + _far_away(structure, parts)
        + idle_gusts(structure, parts)
        + tuple(note for e in parts for note in e.left_out(structure, parts)),
    )
    empty = sp.csr_matrix((motion.n, motion.n))
    model = Model(structure, parts, motion, runs, empty)
    modal = [p for p in parts if isinstance(p, ModalDamping) and np.any(p.ratios)]
    return _modally_damped(model, modal[0]) if modal else model


def _far_away(structure: Structure, effects: Sequence[Effect]) -> tuple[str, ...]:
    """What is to be said of a machine that moves far and is drawn so far away that its places lose digits by that."""
    low, high = structure.box
    far = max(map(abs, (*low, *high)))
    if not any(isinstance(e, LargeRotation) for e in effects) or far <= _FAR * structure.size:
        return ()
    middle = ", ".join(f"{0.5 * (a + b):.6g}" for a, b in zip(low, high, strict=True))
    return (
        f"the machine is drawn {far:.2g} m from the origin, {far / structure.size:.2g} times its size: its places are "
        f"known to {np.spacing(far):.1g} m, and steps that feel this as noise get far shorter; draw it about an origin "
        f"of its own, ({middle}) for one",
    )


def checked_effects(structure: Structure, effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Return the parts of some effects, if they make sense together and on a structure.

    Parameters
    ----------
    structure : Structure
    effects : sequence of Effect

    Returns
    -------
    tuple of Effect

    Raises
    ------
    StructureError
        As `assemble`.
    """
    parts = _flat(effects)
    for effect in parts:
        effect.check_beside(parts)
        _check_names(structure, effect)
        effect.check_on(structure)
    check_gusts(structure, parts)
    return parts


def _check_trolleys(structure: Structure, parts: tuple[Effect, ...]) -> None:
    """Refuse trolleys that travel where nothing may move far, and rails with modes inside their elements."""
    large = any(isinstance(e, LargeRotation) for e in parts)
    for trolley in (p for p in structure.elements if isinstance(p, Trolley)):
        if not large and structure.join_table.rows[structure.number(trolley.travel)][0]:
            raise StructureError(
                f"assemble: Trolley {trolley.name!r} travels, which is no small motion; give LargeRotation() (and "
                f"linearize the model for small motion), or hold it with Support({trolley.name}.travel, 'u')"
            )
        for beam in (p for p in structure.elements if p.name in trolley.rail):
            if any(isinstance(e, ComponentModes) and e.modes(beam) for e in parts):
                raise StructureError(
                    f"assemble: Trolley {trolley.name!r} rolls on the cubics of its rail's elements; ComponentModes "
                    f"bends {beam.name!r} otherwise: name other beams in of=, or give the rail more elements"
                )


def _drawn(rope: Rope) -> str:
    """Say at what length a rope is kept that does not stretch; refuse one that is drawn slack."""
    drawn = math.dist(rope.start.position, rope.end.position)
    if abs(rope.length - drawn) <= _SAME * drawn:
        return ""
    if rope.length > drawn:
        raise StructureError(
            f"assemble: rope {rope.name!r} is {rope.length:g} m long, but drawn over {drawn:g} m, slack, and one that "
            "does not stretch is a rod between its ends: add RopeStretch() (rigid twins have none), or draw it over "
            "all its length"
        )
    return (
        f"rope {rope.name} is drawn over {drawn:.6g} m, stretched from {rope.length:.6g} m: without RopeStretch it "
        "keeps the distance drawn"
    )


def _heavy(structure: Structure, parts: tuple[Effect, ...]) -> tuple[Structure, tuple[Effect, ...]]:
    """Cut ropes with mass into their elements, in the structure and where effects name them; the others have none."""
    masses = [e for e in parts if isinstance(e, RopeMass)]
    heavy = {p.name for p in structure.elements for e in masses if e.weighs(p)}
    structure, pieces = cut_ropes(structure, heavy)

    def named(effect: Effect) -> Effect:
        if not isinstance(effect, Deforming | RopeMass) or not effect.of:
            return effect
        return replace(effect, of=tuple(piece for name in effect.of for piece in pieces.get(name, (name,))))

    return structure, tuple(named(e) for e in parts) if pieces else parts


def _check_names(structure: Structure, effect: Effect) -> None:
    """Refuse an effect on a part that is not there or not of its kind."""
    if isinstance(effect, Deforming):
        known = [p.name for p in (*structure.elements, *structure.drives) if effect.acts_on(p)]
        for name in effect.of:
            if name not in known:
                raise StructureError(
                    f"{type(effect).__name__}: structure {structure.name!r} has no such part {name!r}"
                    f"{did_you_mean(name, known)}; it acts on {', '.join(known) or 'nothing there'}"
                )


def _prestressed(structure: Structure, parts: tuple[Effect, ...], backend: Backend | None) -> Model:
    """Return the model of small motion about an equilibrium.

    What is held there is free in motion: the force that held it is a load.
    """
    [small] = [e for e in parts if isinstance(e, GeometricStiffness)]
    large = assemble(structure, [*(e for e in parts if e is not small), LargeRotation()], backend)
    from flexctrl.model.linearize import all_free, released  # brings all that modes need

    found = rest_held(large, dict(small.hold), dict(small.inputs))
    linear = released(found)
    _refuse_twists(linear)
    linear = all_free(linear, found)
    about = Small(np.zeros(large.n), linear.K, linear.C.tocsr(), linear.M, found.inputs)
    motion = replace(large.motion, rest=found.state)
    unloaded = replace(large, effects=parts, motion=motion, viscous=0.0 * large.viscous, about=about)
    load = -unloaded.loads(found.state, found.inputs)
    held = [large.coordinate(name) for name in found.held if name in large.coordinates]
    let_go = large.balance(found.state, *np.zeros((2, large.n))) + large.loads(found.state, found.inputs)
    unbraked = -large.motion.collect(found.state, borne(found))
    load[held] += (let_go - unbraked)[held]
    return replace(unloaded, about=replace(about, load=load + unbraked))


def _refuse_twists(linear: LinearModel) -> None:
    """Refuse shafts beside which K of a motion about another place would hold nothing."""
    if linear.place is None or linear.place.springs is None:
        return
    stiffness = zip(linear.coordinates, linear.place.springs.diagonal(), strict=True)
    shafts = [f"{name.removesuffix('_twist')} ({k:.3g} N m/rad)" for name, k in stiffness if k]
    raise StructureError(
        f"assemble: with GeometricStiffness the stiffness of what is driven is lost in the rounding of the shaft of "
        f"{', '.join(shafts)}: leave ShaftElasticity out for it, or give LargeRotation() and linearize"
    )


def _modally_damped(model: Model, damping: ModalDamping) -> Model:
    """Return a model with M Φ diag(2 ζ ω) Φᵀ M of the flexible modes about the equilibrium that the damping names."""
    from flexctrl.model.linearize import released  # brings all that modes need

    rest = rest_held(model, dict(damping.hold), dict(damping.inputs))
    linear = released(rest)
    count = None if isinstance(damping.ratios, float) else len(damping.ratios) + _not_vibrating(linear.modes())
    modes = linear.modes(count)
    first = _not_vibrating(modes)
    shapes, omega = modes.shapes[:, first:], modes.omega[first:]
    ratios = np.full(len(omega), damping.ratios) if isinstance(damping.ratios, float) else np.array(damping.ratios)
    count = min(len(ratios), len(omega))
    assert linear.place is not None
    basis = linear.place.basis
    moving = np.diff(basis.tocsr().indptr) > 0
    mass = tangents(model, rest.state.loose, rest.inputs)[0]
    momenta = moving[:, None] * (mass @ (basis @ shapes[:, :count]))
    viscous = sp.csr_matrix((momenta * (2.0 * ratios[:count] * omega[:count])) @ momenta.T)
    return replace(model, viscous=viscous, modal_about=rest.state)


def _not_vibrating(modes: Modes) -> int:
    return modes.unstable + modes.rigid


def rigid(model_or_effects: Model | Sequence[Effect]) -> Model | tuple[Effect, ...]:
    """Return the rigid twin: the same without the effects that let parts deform.

    Parameters
    ----------
    model_or_effects : Model or sequence of Effect

    Returns
    -------
    Model or tuple of Effect
        What was given, with `BeamFlexibility`, `ShaftElasticity` and `RopeStretch` left out.
    """
    if isinstance(model_or_effects, Model):
        kept = rigid(model_or_effects.effects)
        assert isinstance(kept, tuple)
        return assemble(model_or_effects.structure, kept, model_or_effects.backend)
    return tuple(e for e in _flat(model_or_effects) if not isinstance(e, Deforming))


def _flat(effects: Sequence[Effect]) -> tuple[Effect, ...]:
    given = listed(effects, "assemble: effects")
    for effect in given:
        if not isinstance(effect, Effect):
            raise StructureError(f"assemble: {effect!r} is no effect; give e.g. flexctrl.Gravity()")
    whole = [(p, e) for e in given for p in e.parts()]
    parts = tuple(p for p, _ in whole)
    for i, part in enumerate(parts):
        if type(part) in map(type, parts[:i]):
            others = [type(e).__name__ for p, e in whole if type(p) is type(part) and p is not e]
            within = f" (it is a part of {others[0]})" if others else ""
            raise StructureError(f"assemble: the effect {type(part).__name__} is given twice{within}; keep one")
    return parts
