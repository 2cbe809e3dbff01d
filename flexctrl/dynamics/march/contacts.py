"""Dry contacts in compiled loops: how they slip, and what holds those that stick.

As `flexctrl.model.laws.switches` does. Steps in which one may stick or break loose are left to be ended there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from flexctrl.kernels.eights import eight, total
from flexctrl.kernels.native import Reals, Runs, Wholes, seldom
from flexctrl.model.flat.flat import carry, clear
from flexctrl.model.flat.flattening import Flattened, layout_of
from flexctrl.model.flat.workspace import Flat
from flexctrl.model.laws.friction_kinds import STUCK
from flexctrl.model.laws.kinds import DRIVE_SLOT
from flexctrl.model.state import State

__all__ = [
    "Contacts",
    "bear_more",
    "contacts_of",
    "enter_contacts",
    "feel",
    "firmness",
    "held_up",
    "may_switch",
    "mobility",
    "overcome",
    "sticks",
    "take_up",
]

_TURN = 2.0 * math.pi
_DEPENDENT = 1e-9
_SLACK = 1e-6


@dataclass
class Contacts:
    """The dry contacts of a model.

    Attributes
    ----------
    count, stuck : int
        How many there are, and how many of them stick.
    width, padded : int
        Length of what one kernel finds, and of vectors of the degrees of freedom.
    slips : Runs
        One a contact: slip speed, its rate, angle or travel, then the slope of the speed on the rates.
    found : Reals
        What they find.
    phases : Wholes
        Where the phases stand in the workspace.
    spare : Wholes
        Whether what each holds is held by others, which bear its share.
    anchors, most : Reals
        Where each that sticks is held, and what it bears.
    ease : Reals
        How easily each degree of freedom moves [1/kg or 1/(kg m²)].
    rows, answers : Reals
        Slip speeds from the rates of the degrees of freedom, for those that stick; what a force along each moves.
    matrix, sums : Reals
        Equations of the forces that hold.
    bearing : Reals
        These, with the sign of what they bear.
    speeds, changes, borne : Reals
        Slip speeds, their rates and forces that hold at the start of the step.
    fading : float
        How fast what is astray fades [1/s].
    known : int
        Whether these are known.
    watched : int
        Whether steps end before a contact may switch.
    """

    LASTING = ("count",)

    count: int
    width: int
    padded: int
    slips: Runs
    found: Reals
    phases: Wholes
    spare: Wholes
    anchors: Reals
    most: Reals
    ease: Reals
    rows: Reals
    answers: Reals
    matrix: Reals
    sums: Reals
    bearing: Reals
    speeds: Reals
    changes: Reals
    borne: Reals
    fading: float
    stuck: int = 0
    known: int = 0
    watched: int = 0


def contacts_of(F: Flattened) -> Contacts:
    """Return the dry contacts of a model."""
    switches, f = F.model.switches, F.flat
    count, width = len(switches.names), 3 + f.padded + f.carried
    order, cells = switches.slips.order, []
    if count:
        targets = layout_of(F.model).targets
        cells = [np.concatenate([np.arange(3), 3 + targets[own]]) for own in switches.slips.cells]
    phases = f.drive_base + DRIVE_SLOT * (f.drives + order) + 3
    rows, answers = np.zeros((2, count * f.padded))
    anchors, sums, bearing, speeds, changes, borne = np.zeros((6, count))
    ease = np.zeros(f.padded)
    ease[F.plan.position] = switches.ease if count else 0.0
    return Contacts(
        count=count,
        width=width,
        padded=f.padded,
        slips=switches.slips.each(cells),
        found=np.zeros(count * width),
        phases=phases.astype(np.int64),
        spare=np.zeros(count, dtype=np.int64),
        anchors=anchors,
        most=switches.static,
        ease=ease,
        rows=rows,
        answers=answers,
        matrix=np.zeros(count * count),
        sums=sums,
        bearing=bearing,
        speeds=speeds,
        changes=changes,
        borne=borne,
        fading=switches.fading,
    )


def enter_contacts(c: Contacts, F: Flattened, state: State) -> None:
    """Take up what the contacts do; `Flattened.enter` has put the phases in their places."""
    if c.count:
        switches, dry = F.model.switches, state.dry
        order = switches.slips.order
        c.anchors[:], c.spare[:] = dry.anchor[order], switches.spare(state)
        c.stuck, c.known = int((dry.phase[order] == STUCK).sum()), 0


def sticks(c: Contacts, f: Flat, k: int) -> bool:
    """Tell whether a contact sticks, and holds what no others do."""
    return f.z[c.phases[k]] == STUCK and c.spare[k] == 0


def feel(c: Contacts, f: Flat) -> None:
    """Work out how all contacts slip, and along which motion those that stick are held; forces are lost."""
    for k in range(c.count):
        own = c.found[c.width * k :]
        clear(c.width, own)
        c.slips[k](f.z, own)
        if sticks(c, f, k):
            row = c.rows[c.padded * k :]
            for i in range(f.padded + f.carried):
                f.force[i] = own[3 + i]
            carry(f)
            f.force[f.n] = 0.0
            for i in range(f.padded):
                row[i] = f.force[i]


def firmness(c: Contacts, on_rate: float, on_acceleration: float) -> float:
    """Return the slope of what is astray, for motions that add these times an increment to rates and accelerations."""
    return on_acceleration + c.fading * on_rate + 0.25 * c.fading * c.fading


def astray(c: Contacts, k: int) -> float:
    """Return what of a contact's slip is to be zero: its rate, and what brings it back to where it stuck."""
    own = c.found[c.width * k :]
    away = own[2] - c.anchors[k]
    away -= _TURN * math.floor(away / _TURN + 0.5)
    return own[1] + c.fading * own[0] + 0.25 * c.fading * c.fading * away


def along(n: int, a: Reals, b: Reals) -> float:
    """Return the product of two vectors."""
    found = 0.0 * eight(a)
    for i in range(0, n, 8):
        found = found + eight(a[i:]) * eight(b[i:])
    return total(found)


def mobility(c: Contacts, k: int) -> float:
    """Return what a unit force along a contact that sticks moves of it where each degree of freedom is by itself."""
    row = c.rows[c.padded * k :]
    found = 0.0 * eight(row)
    for i in range(0, c.padded, 8):
        found = found + eight(row[i:]) * eight(row[i:]) * eight(c.ease[i:])
    return total(found)


def held_up(c: Contacts, f: Flat, ease: float) -> bool:
    """Find the forces that hold what sticks, from what all others move, in the place of the forces, and ``answers``.

    A slip that is astray is put right; ``ease`` is the inverse of its slope. Tell whether that can be done.
    """
    n = c.count
    for i in range(n):
        row = c.rows[c.padded * i :]
        stuck = sticks(c, f, i)
        c.sums[i] = along(f.padded, row, f.force) - ease * astray(c, i) if stuck else 0.0
        for j in range(n):
            both = stuck and sticks(c, f, j)
            own = 1.0 if i == j else 0.0
            c.matrix[n * i + j] = along(f.padded, row, c.answers[c.padded * j :]) if both else own
    return sound(c)


@seldom
def sound(c: Contacts) -> bool:
    """Solve for the forces that hold; tell whether the contacts do not depend on each other."""
    n = c.count
    for k in range(n):
        whole = abs(c.matrix[n * k + k])
        for j in range(k):
            share = c.matrix[n * k + j] / c.matrix[n * j + j]
            for i in range(j, n):
                c.matrix[n * k + i] -= share * c.matrix[n * j + i]
            c.sums[k] -= share * c.sums[j]
        if not abs(c.matrix[n * k + k]) > _DEPENDENT * whole:
            return False
    for back in range(n):
        k = n - 1 - back
        for j in range(k + 1, n):
            c.sums[k] -= c.matrix[n * k + j] * c.sums[j]
        c.sums[k] /= c.matrix[n * k + k]
    return True


def bear_more(c: Contacts) -> None:
    """Add what was borne before."""
    for k in range(c.count):
        c.bearing[k] += c.borne[k]


def overcome(c: Contacts, f: Flat) -> bool:
    """Tell whether some contact does not bear what it has to."""
    worst = 0.0
    for k in range(c.count):
        if sticks(c, f, k):
            worst = max(worst, abs(c.bearing[k]) / c.most[k])
    return worst >= 1.0 - _SLACK


def may_switch(c: Contacts, f: Flat, h: float) -> bool:
    """Tell whether a contact may stick or break loose over the step under way.

    Slip speeds are taken for cubics between their values and rates at both ends: where these have four coefficients
    of one sign (Bernstein's), so has the speed. Forces that hold are not known to be smooth: no more is asked of them
    than that they are further from what they may be than they have changed.
    """
    for k in range(c.count):
        phase = f.z[c.phases[k]]
        own = c.found[c.width * k :]
        if phase == STUCK:
            left = c.most[k] - max(abs(c.bearing[k]), abs(c.borne[k]))
            if not left > abs(c.bearing[k] - c.borne[k]):
                return True
        elif phase != 0.0:
            inner = min(c.speeds[k] * phase + h / 3.0 * c.changes[k] * phase, own[0] * phase - h / 3.0 * own[1] * phase)
            if not min(inner, min(c.speeds[k] * phase, own[0] * phase)) > 0.0:
                return True
    return False


def take_up(c: Contacts) -> None:
    """Take the end of the step as the start of the next."""
    for k in range(c.count):
        own = c.found[c.width * k :]
        c.speeds[k] = own[0]
        c.changes[k] = own[1]
        c.borne[k] = c.bearing[k]
