"""What can be left out of a scene: its effects, parts of its damping, the hardware round its controller."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

from flexctrl.design.controller import Controller
from flexctrl.design.hardware import Sampled
from flexctrl.design.wrapping import Wrapper
from flexctrl.effects.component_modes import ComponentModes, elements_alone
from flexctrl.effects.damping import RayleighDamping
from flexctrl.effects.effect import Effect
from flexctrl.effects.flexibility import BeamFlexibility, Deforming
from flexctrl.effects.geometric_stiffness import GeometricStiffness
from flexctrl.effects.large_rotation import LargeRotation
from flexctrl.errors import ControllerError, FlexctrlError, StructureError
from flexctrl.frozen import frozen
from flexctrl.structure.beams import Beam
from flexctrl.structure.drives import Drive, LinearDrive, RotaryDrive, Winch
from flexctrl.structure.elements import Part
from flexctrl.structure.lines import Rope, Spring
from flexctrl.structure.structure import Structure
from flexctrl.study.sections import WAYS
from flexctrl.study.subject import Subject

__all__ = ["Omission", "omissions"]

_DASHPOTS: dict[str, tuple[type, ...]] = {
    "drive_damping": (RotaryDrive, LinearDrive),
    "rope_damping": (Rope, Winch),
    "spring_damping": (Spring,),
}

P = TypeVar("P", bound=Part | Drive)


@frozen
class Omission:
    """One thing that may be left out of a scene.

    Attributes
    ----------
    name : str
    without : callable
        Scene → the same without it; the scene itself if it does not have it.
    spares : bool
        Whether something is gone then, or only much stiffer.
    first : tuple of str
        What has to be left out before: effects that cannot be without it.
    """

    name: str
    without: Callable[[Subject], Subject]
    spares: bool = True
    first: tuple[str, ...] = ()

    def is_in(self, scene: Subject) -> bool:
        """Tell whether a scene has what is left out here; what it cannot be without, it has.

        Parameters
        ----------
        scene : Scene

        Returns
        -------
        bool
        """
        try:
            return self.without(scene) is not scene
        except FlexctrlError:  # sampling under a delay of whole samples
            return True


def omissions(scene: Subject) -> tuple[Omission, ...]:
    """Return everything that can be left out of a scene, each once.

    Effects; flexibility part by part, and component modes, without which the elements bend by their cubics alone;
    stretch, torsion and bending of the beams (made a thousand times stiffer), and their shear and rotary inertia where
    they have them; large rotation (small motion about the loaded equilibrium instead) and geometric stiffness; each
    kind of damping, of effects and of parts; the hardware round the controller.

    Parameters
    ----------
    scene : Scene
        With its controller built.

    Returns
    -------
    tuple of Omission
    """
    effects = _flat(scene)
    found: dict[str, Omission] = {}
    for effect in effects:
        for omission in _of_effect(effect, effects, scene.structure):
            found.setdefault(omission.name, omission)
    parts = (*scene.structure.elements, *scene.structure.drives)
    for name, kinds in _DASHPOTS.items():
        if any(_is_damped(p, kinds) for p in parts):
            found[name] = Omission(name, partial(_undamped, kinds))
    return (*(_after_what_needs_it(o, scene) for o in found.values()), *_of_controller(scene.law))


def _after_what_needs_it(omission: Omission, scene: Subject) -> Omission:
    """An omission that knows the effects which refuse to be without it, such as friction in a linear machine."""
    left = _flat(omission.without(scene))
    needing = tuple(snake(type(e)) for e in left if not _bears(e, [other for other in left if other is not e]))
    return replace(omission, first=needing) if needing else omission


def _bears(effect: Effect, others: Sequence[Effect]) -> bool:
    try:
        effect.check_beside(others)
    except StructureError:
        return False
    return True


def _of_effect(effect: Effect, effects: Sequence[Effect], structure: Structure) -> list[Omission]:
    if isinstance(effect, Deforming):
        return _of_deforming(effect, effects, structure)
    if isinstance(effect, RayleighDamping):
        shares = {"mass_damping": "alpha", "stiffness_damping": "beta"}
        return [
            Omission(name, partial(_without_share, share)) for name, share in shares.items() if getattr(effect, share)
        ]
    if isinstance(effect, LargeRotation):
        return [Omission("large_rotation", _small), Omission("geometric_stiffness", _unloaded)]
    kind = type(effect)
    return [Omission(snake(kind), partial(_without_effect, kind))]


def _of_deforming(effect: Deforming, effects: Sequence[Effect], structure: Structure) -> list[Omission]:
    """Part by part where there are several; ways in which beams give, and rotary inertia, also by themselves.

    Beams in component modes bend as others do, and are rigid with them; modes may go by themselves.
    """
    kind = BeamFlexibility if isinstance(effect, BeamFlexibility) else type(effect)
    parts = _deforming(kind, effects, structure)
    if not parts:
        return []
    found = [Omission(snake(kind), partial(_stiffened, kind, parts))]
    if len(parts) > 1:
        found = [Omission(f"{snake(kind)}_{name}", partial(_stiffened, kind, [name])) for name in parts]
    if isinstance(effect, BeamFlexibility):
        if isinstance(effect, ComponentModes) and any(effect.modes(p) for p in structure.elements):
            found.append(Omission("component_modes", _of_elements_alone))
        sections = [p.section for p in structure.elements if isinstance(p, Beam)]
        ways = [name for name, without in WAYS.items() if any(without(s) is not s for s in sections)]
        found += [Omission(name, partial(_with_sections, name), spares=False) for name in ways]
    return found


def _deforming(kind: type[Deforming], effects: Sequence[Effect], structure: Structure) -> list[str]:
    """Names of the parts that effects of a kind let deform."""
    acting = [e for e in effects if isinstance(e, kind)]
    return [p.name for p in (*structure.elements, *structure.drives) if any(e.bends(p) for e in acting)]


def _stiffened(kind: type[Deforming], names: Sequence[str], scene: Subject) -> Subject:
    """Some parts fewer that deform; an effect goes with its last."""
    effects: list[Effect] = []
    for effect in _flat(scene):
        bending = _deforming(kind, [effect], scene.structure)
        left = tuple(part for part in bending if part not in names)
        if isinstance(effect, kind) and len(left) < len(bending):
            effects += [replace(effect, of=left)] if left else []
        else:
            effects.append(effect)
    return _with_effects(scene, effects)


def _of_elements_alone(scene: Subject) -> Subject:
    """Beams in component modes bend by the cubics of their elements alone."""
    return _with_effects(scene, elements_alone(_flat(scene)))


def _with_sections(name: str, scene: Subject) -> Subject:
    """All beams without one way to give, or without rotary inertia: they keep their freedoms, so little is saved."""
    beams = [e for e in scene.structure.elements if isinstance(e, Beam)]
    if not any(e.bends(b) for e in _flat(scene) for b in beams):
        return scene
    sections = {b.name: WAYS[name](b.section) for b in beams}
    if all(sections[b.name] is b.section for b in beams):
        return scene
    elements = [replace(e, section=sections[e.name]) if isinstance(e, Beam) else e for e in scene.structure.elements]
    return scene.with_(structure=scene.structure.with_(elements=elements))


def snake(kind: type) -> str:
    """Return a type's name as scenes write it: ``rope_stretch``."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", kind.__name__.replace("LuGre", "Lugre")).lower()


def _flat(scene: Subject) -> list[Effect]:
    return [part for e in scene.effects for part in e.parts()]


def _with_effects(scene: Subject, effects: list[Effect]) -> Subject:
    """A scene with other effects; itself if they are no others."""
    return scene if effects == _flat(scene) else scene.with_(effects=effects)


def _without_effect(kind: type[Effect], scene: Subject) -> Subject:
    return _with_effects(scene, [e for e in _flat(scene) if type(e) is not kind])


def _small(scene: Subject) -> Subject:
    """Small motion about the loaded equilibrium."""
    return _with_effects(scene, [GeometricStiffness() if isinstance(e, LargeRotation) else e for e in _flat(scene)])


def _unloaded(scene: Subject) -> Subject:
    """Small motion as if nothing were loaded."""
    kinds = (LargeRotation, GeometricStiffness)
    return _with_effects(scene, [e for e in _flat(scene) if not isinstance(e, kinds)])


def _without_share(share: str, scene: Subject) -> Subject:
    """Leave out one share of Rayleigh damping, which goes with the last."""
    changed = [replace(e, **{share: 0.0}) if isinstance(e, RayleighDamping) else e for e in _flat(scene)]
    return _with_effects(scene, [e for e in changed if not isinstance(e, RayleighDamping) or e.alpha or e.beta])


def _undamped(kinds: tuple[type, ...], scene: Subject) -> Subject:
    """Without the dampers of some kinds of parts."""
    if not any(_is_damped(p, kinds) for p in (*scene.structure.elements, *scene.structure.drives)):
        return scene
    elements = [_still(e) if isinstance(e, kinds) else e for e in scene.structure.elements]
    drives = [_still(d) if isinstance(d, kinds) else d for d in scene.structure.drives]
    return scene.with_(structure=scene.structure.with_(elements=elements, drives=drives))


def _is_damped(part: Part | Drive, kinds: tuple[type, ...]) -> bool:
    return isinstance(part, kinds) and bool(getattr(part, "damping", 0.0))


def _still(part: P) -> P:
    """A part without its damper; all else of it was checked when it was made."""
    found = copy(part)
    object.__setattr__(found, "damping", 0.0)
    return found


def _of_controller(law: Controller | None) -> list[Omission]:
    kinds = list(dict.fromkeys(type(w) for w in _wrappers(law) if type(w).__module__ == Sampled.__module__))
    found = []
    for i, kind in enumerate(kinds):
        first = _in_the_way(law, kind, kinds[:i])
        if first is not None:
            names = tuple(snake(other) for other in first)
            found.append(Omission(snake(kind), partial(_without_hardware, kind), first=names))
    return found


def _in_the_way(law: Any, kind: type[Wrapper], outer: Sequence[type[Wrapper]]) -> list[type[Wrapper]] | None:
    """What is wrapped round one kind of hardware and cannot do without it; None if it cannot be left out at all."""
    if not _can_do_without(law, [*outer, kind]):
        return None
    needed = list(outer)
    for other in outer:
        fewer = [o for o in needed if o is not other]
        if _can_do_without(law, [*fewer, kind]):
            needed = fewer
    return needed


def _can_do_without(law: Any, kinds: Sequence[type[Wrapper]]) -> bool:
    try:
        for kind in kinds:
            law = _peeled(law, kind)
    except ControllerError:
        return False
    return True


def _without_hardware(kind: type[Wrapper], scene: Subject) -> Subject:
    law = _peeled(scene.law, kind)
    return scene if law is scene.law else scene.with_(controller=law)


def _wrappers(law: Controller | None) -> list[Wrapper]:
    return [law, *_wrappers(law.controller)] if isinstance(law, Wrapper) else []


def _peeled(law: Any, kind: type[Wrapper]) -> Any:
    """Return a controller without one kind of wrapper."""
    if not isinstance(law, Wrapper):
        return law
    given = law.original if isinstance(law, Sampled) else law.controller
    inner = _peeled(given, kind)
    if type(law) is kind:
        return inner
    return law if inner is given else replace(law, controller=inner)
