"""Dry contacts that break loose, or hold, by little: what becomes of a run if they bore a little more, or less.

What breaks loose falls from the force it bears to the smaller one it slides with. So what comes after may hang on less
than steps err by, and runs in other steps may be wrong alike. A run in the same steps is not, of a machine whose
contacts bear a few percent more, or less.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import zip_longest
from typing import TYPE_CHECKING

from flexctrl.dynamics.checking import news
from flexctrl.dynamics.checkpoint import Checkpoint
from flexctrl.dynamics.methods.checked import Beside
from flexctrl.dynamics.notes.beside import PARTED, agreeing
from flexctrl.dynamics.notes.outputs import seen
from flexctrl.dynamics.others import Beginning, Other, made, noted
from flexctrl.dynamics.run import Run
from flexctrl.effects.coulomb_friction import Coulomb, CoulombFriction
from flexctrl.effects.effect import Effect
from flexctrl.model.model import Model
from flexctrl.model.plant import Plant

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["loosened"]

_LITTLE = 0.05
"""Of the force that breaks a contact loose. In steps of 2 ms a mass that a caught rope tugs at holds, as it does in
truth, from 4.5 % more on; where nothing breaks loose instead, 5 % have moved machines by up to 14 %."""
_HANGS = (
    "whether {contact} breaks loose {when} hangs on {little:.0%} of the force that it takes: with so much "
    "{other}, {where} is {far:.2g} of {whole} elsewhere: see whether {remedy} agrees; no real friction is known to that"
)


def loosened(told: Run, run: Run, journey: Journey, beginning: Beginning) -> Run:
    """Return a run with what others tell whose contacts bear a little more, or less, where nothing else is told.

    Parameters
    ----------
    told : Run
        With what runs in other steps tell.
    run : Run
        Without.
    journey : Journey
        How it went.
    beginning : Beginning

    Returns
    -------
    Run
    """
    for share in _shares(run, journey, beginning):
        if news(told, run):
            break
        told = _with(told, journey, beginning, share)
    return told


def _shares(run: Run, journey: Journey, beginning: Beginning) -> tuple[float, ...]:
    """By how much contacts are to bear more: what has broken loose may hold then, and what sticks may not."""
    model = journey.plan.model
    assert isinstance(model, Model)
    switching, falling = model.switches, _falling(model)
    stuck = any(event.name in falling for event in run.events) or (falling and switching.sticks(run.final))
    loose = any(event.name in falling and event.rising for event in run.events)
    gone_on = bool(falling) and isinstance(beginning.start, Checkpoint)  # it may have parted before, and not yet far
    return (_LITTLE,) * (loose or gone_on) + (-_LITTLE,) * bool(stuck or gone_on)


def _falling(model: Plant) -> set[str]:
    """Which contacts slide with less than what it takes to break them loose."""
    dry = (effect for effect in model.effects if isinstance(effect, CoulombFriction))
    return {where for effect in dry for where, law in effect.acting if law.static > law.kinetic}


def _with(run: Run, journey: Journey, beginning: Beginning, share: float) -> Run:
    """The run with what is to be said of one whose contacts bear more by a share."""
    plan = journey.plan
    assert isinstance(plan.model, Model)
    feed = replace(beginning.feed, model=_bearing(plan.model, share))
    alike = Beside(plan.method, plan.tolerance, 1.0, "in the same steps")
    standing, other = made(run, journey, alike, replace(beginning, feed=feed))
    note = "" if other is None else _note(run, other, journey, beginning.t, share)
    return noted(standing, note) if note else standing


def _bearing(model: Model, share: float) -> Model:
    """The model with contacts that bear more by a share, where they slide with less."""
    return replace(model, effects=tuple(_firmer(effect, share) for effect in model.effects))


def _firmer(effect: Effect, share: float) -> Effect:
    if not isinstance(effect, CoulombFriction):
        return effect
    return CoulombFriction({where: _law(law, share) for where, law in effect.laws})


def _law(law: Coulomb, share: float) -> Coulomb:
    falls = law.static > law.kinetic
    return Coulomb(law.kinetic, max(law.kinetic, (1.0 + falls * share) * law.static), law.stribeck)


def _note(run: Run, other: Other, journey: Journey, begin: float, share: float) -> str:
    """What is to be said where the two have parted; empty if they have not."""
    gap = other.gap
    where, far, whole = gap.where, gap.most, "the motion"
    way, judged = seen(journey, run.y)
    if far < PARTED and judged:
        worst = max(judged, key=lambda i: gap.outputs[i] / way[i])
        where, far, whole = run.outputs[worst], float(gap.outputs[worst] / way[worst]), "its motion"
    if far < PARTED:
        return ""
    when, contact = _parting(run, other.run, _falling(journey.plan.model), begin)
    more = "more" if share > 0.0 else "less"
    known = {"contact": contact, "when": when, "little": _LITTLE, "other": more, "where": where, "far": far}
    return _HANGS.format(remedy=agreeing(journey), whole=whole, **known)


def _parting(run: Run, other: Run, falling: set[str], begin: float) -> tuple[str, str]:
    """When which contact breaks loose in one of two runs only: the first by half of the most that any is apart by."""
    apart = []
    for name in sorted(falling):
        own, others = ([e.t for e in r.events if e.name == name and e.rising and e.t > begin] for r in (run, other))
        apart += [(abs(a - b), min(a, b), name) for a, b in zip_longest(own, others, fillvalue=run.final.t)]
    most = max((way for way, _, _ in apart), default=0.0)
    if not most:
        return f"before t = {begin:.3g} s", " or ".join(sorted(falling))
    t, contact = min((t, name) for way, t, name in apart if way >= 0.5 * most)
    return f"at t = {t:.3g} s", contact
