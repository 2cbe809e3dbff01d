"""What happens over a step: events noted, and the step ended where one of them, a switch or a corner asks for that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.events.crossings import met, offset
from flexctrl.dynamics.events.landing import Missed, landed
from flexctrl.dynamics.events.switching import anew, is_brief, withheld
from flexctrl.dynamics.events.watch import TOGETHER, Crossing
from flexctrl.dynamics.records.dense import Curve
from flexctrl.dynamics.records.tensions import Interval
from flexctrl.dynamics.steps import Point, StepError
from flexctrl.model.laws.friction_kinds import STUCK

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["watched"]

_CHATTER, _LITTLE = 20, 1e-6
"""So many steps that end at once, beside one for each part, lead nowhere."""


def watched(journey: Journey, before: Point, after: Point) -> tuple[Point, Crossing | None]:
    """Note what happens over a step; end it where the run stops, a law of force switches or has a corner."""
    watch, curve = journey.watch, journey.track.curve(before, after)
    found = met(watch, journey.track.curve, before, after, journey.rows.every)
    landing = _first(journey, found, before)
    switch = -1 if landing is None else landing.gauge - len(watch.events)
    endless = journey.mark.stuck >= _CHATTER + len(watch.names) + len(watch.corner_names)
    if 0 <= switch < len(watch.names) and endless:
        name = watch.names[switch]
        raise StepError(journey.stepper.counts.worst, f"{name} switches without end at t = {before.state.t:.6g} s")
    if landing is None or endless:
        _note(journey, found, curve, (before, after))
        watch.settle(after)
        journey.mark.stuck = 0
        return after, None
    slid = after
    after, landing = landed(journey, before, after, landing)
    if after is before and _leaves(journey, before, landing):
        raise Missed(journey.stepper.counts.worst, "the step is longer than the way there and back from a corner")
    switch = landing.gauge - len(watch.events)  # the step ends at another corner now, maybe
    brief = 0 <= switch < len(watch.names) and is_brief(journey, before, after, slid, switch)
    closest = {c.gauge: c for c in sorted(found, key=lambda c: -abs(c.t - landing.t))}.values()
    there = [c for c in closest if c.gauge != landing.gauge and _is_there(journey, c, before, after, slid)]
    _note_before(journey, before, after, {c.gauge for c in there}, TOGETHER * (slid.state.t - before.state.t))
    if after is not before:  # what has been nudged over a corner is told of by the next step
        watch.settle(after)
    watch.switched()
    together = sorted((*there, landing), key=lambda c: c.gauge)
    for c in together:
        watch.cross(c)
        if not 0 <= c.gauge - len(watch.events) < len(watch.names):
            journey.happens(replace(c, t=landing.t), after.state, after.supply.u)
    journey.end_by(together, landing.t)
    if watch.last_word(landing.gauge):
        return after, None
    short = landing.t - before.state.t < 1e-6 * journey.mark.size
    journey.mark.stuck = journey.mark.stuck + 1 if short else 0
    if switch >= len(watch.names):
        return after, landing
    return _switched(journey, after, landing, switch, brief), None


def _first(journey: Journey, found: Sequence[Crossing], before: Point) -> Crossing | None:
    """Return what a step is to end at, if anything.

    What sticks may be torn loose by a rope that is caught: the corner comes first then, as forces jump there and there
    is no end at which just so much is borne. What breaks loose before it is seen in the step that is left.
    """
    watch, laws = journey.watch, len(journey.watch.events)
    ends = [c for c in found if watch.stops(c.gauge) and not journey.is_over(c)]
    if not ends or not laws <= ends[0].gauge < laws + len(watch.names):
        return ends[0] if ends else None
    if journey.plan.model.switches.phases(before.state)[ends[0].gauge - laws] != STUCK:
        return ends[0]
    return next((c for c in ends if c.gauge >= laws + len(watch.names)), ends[0])


def _leaves(journey: Journey, at: Point, corner: Crossing) -> bool:
    """Tell whether a corner met at once is left where the step begins: it is come back to within the step, then."""
    watch, state = journey.watch, at.firm.state
    if corner.gauge < len(watch.events) + len(watch.names):
        return False
    moved = journey.plan.model.advance(state, _LITTLE * journey.mark.size * state.v, state.v, state.t)
    side = -1.0 if corner.rising else 1.0
    here, there = (side * watch.values(s, at.supply.u)[corner.gauge] for s in (state, moved))
    return bool(there > max(here, watch.dusts[corner.gauge]))


def _note_before(journey: Journey, before: Point, after: Point, there: set[int], near: float) -> None:
    """Note events within a step that is cut short, as that one goes, but those that happen just where it ends."""
    if after.state.t == before.state.t:
        return
    watch, curve, asked = journey.watch, journey.track.curve(before, after), len(journey.watch.events)
    passed = met(watch, journey.track.curve, before, after, journey.rows.every)
    within = [c for c in passed if c.gauge < asked and not watch.stops(c.gauge)]
    told = [c for c in within if c.gauge not in there or c.t < after.state.t - near]
    _note(journey, told, curve, (before, after))


def _is_there(journey: Journey, crossing: Crossing, before: Point, after: Point, slid: Point) -> bool:
    """Tell whether an event asked for, seen in a step, happens just where that ends now that it is cut short."""
    watch, t, whole = journey.watch, before.state.t, slid.state.t - before.state.t
    if crossing.gauge >= len(watch.events):
        return False
    if after.state.t == t:
        return crossing.t - t <= TOGETHER * whole
    off = offset(watch, journey.track.curve(before, after), before, after, crossing.gauge)
    return abs(off) <= TOGETHER * whole


def _switched(journey: Journey, at: Point, landing: Crossing, switch: int, brief: bool) -> Point:
    """Go on under the law of force that holds from now on; note which contacts slide and stick under it."""
    fresh = withheld(journey, at, switch) if brief else anew(journey, at, switch)
    slid, slides = (journey.plan.model.switches.phases(p.state) != STUCK for p in (at, fresh))
    told = [switch, *(int(k) for k in np.flatnonzero(slid != slides) if k != switch)]
    for k in told:
        at_once = replace(landing, gauge=len(journey.watch.events) + k, rising=bool(slides[k]))
        if not (brief and journey.mark.stuck > 1 and _taken_back(journey, k, landing.t)):
            journey.happens(at_once, at.state, at.supply.u)
    return fresh


def _taken_back(journey: Journey, switch: int, t: float) -> bool:
    """Take back that a contact has broken loose where it now sticks: nothing has happened; tell whether it had."""
    told = next((e for e in reversed(journey.events) if e.name == journey.watch.names[switch]), None)
    if told is None or told.t != t or not told.rising:
        return False
    journey.events.remove(told)
    return True


def _note(journey: Journey, met: Sequence[Crossing], curve: Curve, ends: tuple[Point, Point]) -> None:
    before, after = ends
    interval = Interval(before.state, after.state, curve.seen)
    for c in met:
        journey.watch.cross(c)
        journey.happens(c, curve.at(c.t), before.supply.u, interval)
