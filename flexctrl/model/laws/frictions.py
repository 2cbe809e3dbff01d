"""Families of pieces that rub, and of motors whose torque builds up."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from flexctrl.effects.coulomb_friction import Coulomb, CoulombFriction
from flexctrl.effects.effect import Effect, Inner
from flexctrl.effects.lugre_friction import LuGre, LuGreFriction
from flexctrl.effects.motor_lag import MotorLag
from flexctrl.effects.viscous_friction import ViscousFriction
from flexctrl.model.assembly import Block
from flexctrl.model.laws.families import Family, family
from flexctrl.model.laws.friction_kinds import LAG, SLIPS, friction_kind
from flexctrl.model.motion import Motion
from flexctrl.structure.contacts import Contact, MotorSide, contact_of
from flexctrl.structure.drives import Drive
from flexctrl.structure.structure import Structure

__all__ = ["friction_families", "inner_freedoms", "lag_blocks", "lag_compliance"]


def inner_freedoms(structure: Structure, effects: Sequence[Effect]) -> tuple[Inner, ...]:
    """Return the inner freedoms of some effects, in the order in which they are numbered."""
    return tuple(inner for e in effects for inner in e.inner(structure))


def friction_families(structure: Structure, effects: Sequence[Effect]) -> tuple[Family, ...]:
    """Return the families of pieces that rub, and of motors whose torque builds up.

    Parameters
    ----------
    structure : Structure
    effects : sequence of Effect

    Returns
    -------
    tuple of Family
        Laws of one kind at one type of contact make a family.
    """
    found: list[Family] = []
    inner = len(structure.drives)
    for effect in effects:
        if isinstance(effect, ViscousFriction):
            found += _rubbing(structure, "viscous", [(w, [c]) for w, c in effect.coefficients if c], None)
        elif isinstance(effect, CoulombFriction):
            found += _rubbing(structure, "dry", [(w, _dry(law)) for w, law in effect.acting], inner)
        elif isinstance(effect, LuGreFriction):
            smooth = [(w, [law.viscous]) for w, law in effect.laws if law.viscous and not law.static]
            found += _rubbing(structure, "viscous", smooth, None)
            found += _rubbing(structure, "lugre", [(w, _lugre(law)) for w, law in effect.acting], inner)
        elif isinstance(effect, MotorLag):
            found.append(_lags(structure, effect, inner))
        inner += len(effect.inner(structure))
    return tuple(f for f in found if f.count)


def _dry(law: Coulomb) -> list[float]:
    return [law.kinetic, law.static, law.stribeck]


def _lugre(law: LuGre) -> list[float]:
    return [law.stiffness, law.kinetic, law.static, law.stribeck, law.damping, law.viscous]


def _rubbing(s: Structure, law: str, places: list[tuple[str, list[float]]], inner: int | None) -> list[Family]:
    """Families of a law, one a type of contact; ``inner`` is the number of the first inner freedom."""
    contacts = [contact_of(s, where, law) for where, _ in places]
    found = []
    for kind in (k for k in SLIPS if k in set(map(type, contacts))):
        chosen = [i for i, c in enumerate(contacts) if isinstance(c, kind)]
        slots = [_motor(s, contacts[i]) + ([] if inner is None else [inner + i]) for i in chosen]
        parameters = [[*_axis(contacts[i]), *places[i][1]] for i in chosen]
        sides = [_sides(s, contacts[i]) for i in chosen]
        names = [contacts[i].part for i in chosen]
        found.append(family(friction_kind(law, kind), (), names, sides, parameters, slots))
    return found


def _motor(s: Structure, contact: Contact) -> list[int]:
    return [[d.name for d in s.drives].index(contact.drive)] if isinstance(contact, MotorSide) else []


def _sides(s: Structure, contact: Contact) -> list[int]:
    if isinstance(contact, MotorSide):
        return []
    return [s.number(contact.node), len(s.nodes) if contact.base is None else s.number(contact.base)]


def _axis(contact: Contact) -> tuple[float, ...]:
    return (0.0, 0.0, 0.0) if isinstance(contact, MotorSide) else contact.axis


def _lags(s: Structure, effect: MotorLag, inner: int) -> Family:
    numbers = {d.name: i for i, d in enumerate(s.drives)}
    slots = [[numbers[name], inner + k] for k, (name, _) in enumerate(effect.acting)]
    parameters = [[T, lag_compliance(s.drives[numbers[name]])] for name, T in effect.acting]
    return family(LAG, (), [name for name, _ in effect.acting], [[]] * len(slots), parameters, slots)


def lag_blocks(structure: Structure, effects: Sequence[Effect], motion: Motion) -> Iterator[tuple[str, Block]]:
    """Yield the stiffness blocks of motors whose torque builds up."""
    place = motion.inner_base
    for effect in effects:
        for k, (name, _) in enumerate(effect.acting if isinstance(effect, MotorLag) else ()):
            drive = structure.part(name)
            assert isinstance(drive, Drive)
            yield name, (np.array([place + k]), np.array([[lag_compliance(drive)]]))
        place += len(effect.inner(structure))


def lag_compliance(drive: Drive) -> float:
    """Return the weight of the equation T τ̇ + τ = M_d: a compliance makes it a displacement [rad/(N m)]."""
    return 1.0 / drive.stiffness
