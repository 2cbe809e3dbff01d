"""Runs that are not worth going on with: loops that throw the machine away, and steps without end."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from flexctrl.dynamics.methods.explicit import ExplicitRungeKutta
from flexctrl.dynamics.methods.extrapolation import Richardson
from flexctrl.dynamics.methods.midpoint import ConservingMidpoint
from flexctrl.dynamics.notes.straying import lost, spun, thrown
from flexctrl.dynamics.steps import Controlled, Fixed, StepError
from flexctrl.model.model import Model

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["foresee", "look_back", "remedy"]

_FORESEEN = 20_000
_GONE, _SPUN = "has gone a million times the size of the machine", "turns by a thousand radians from sample to sample"
_BEFORE = "or end the run before"


def look_back(journey: Journey) -> None:
    """Raise StepError where the run has come to what it cannot go on from."""
    worst, where = journey.stepper.counts.worst, f"at t = {journey.point.state.t:.6g} s"
    if apart := journey.plan.model.apart(journey.point.state):
        raise StepError(worst, f"{apart} (t = {journey.point.state.t:.6g} s)")
    if journey.books.overflown:
        beyond = "energies are beyond all numbers"
        look = "look at the commands and at the start"
        look = remedy(journey) if isinstance(journey.plan.method, ExplicitRungeKutta) else look
        raise StepError(worst, f"{beyond} {where}; {look}")
    if nonsense := journey.books.nonsense:
        raise StepError(worst, f"{nonsense} {where}; {remedy(journey)}")
    look = "look at signs and gains of the controller"
    if lost(journey):
        gone = f"{where} a part has gone so far that no number tells the shape of the machine any more"
        raise StepError(worst, f"the loop is not stable: {gone}; {look}")
    if isinstance(journey.plan.method.pace, Fixed) and not isinstance(journey.plan.model, Model):
        return  # numbers of a linear model tell its shape however large they are
    for found, gone in ((thrown(journey), _GONE), (spun(journey), _SPUN)):
        if found is not None:
            raise StepError(found, f"the loop is not stable: {where} a part {gone}, ever faster; {look}, {_BEFORE}")


def foresee(journey: Journey) -> None:
    """Raise StepError if the run would take more steps than it may, at the pace of the latter half of them."""
    pace, steps, t = journey.plan.method.pace, journey.mark.steps, journey.point.state.t
    before, since = journey.seen
    if not isinstance(pace, Controlled) or steps < max(_FORESEEN, 2 * before):
        return
    journey.seen = steps, t
    mean = (t - since) / (steps - before)
    left = (journey.plan.until - t) / mean if mean > 0.0 else math.inf
    if before and steps + left > pace.most:
        raise StepError(
            journey.stepper.counts.worst,
            f"steps are {mean:.1e} s long on average at t = {t:.6g} s: {left:.1e} more of them to "
            f"{journey.plan.until:g} s; look for rates beyond what is meant, stiff parts or a contact that chatters, "
            f"give a larger Tolerance or a shorter run, or allow them with most_steps (now {pace.most:g})",
        )


def remedy(journey: Journey) -> str:
    """Return what to do where steps of this length make energy."""
    pace, method = journey.plan.method.pace, journey.plan.method
    if isinstance(method, Richardson):
        finer = f"steps smaller than {pace.step:g} s" if isinstance(pace, Fixed) else "a smaller Tolerance"
        return f"the coarser of the two runs of Richardson no longer follows the motion: take {finer}"
    if isinstance(method, ExplicitRungeKutta):
        return "stiff parts are for implicit methods: take AdaptiveAlpha, or GeneralizedAlpha(step)"
    if not isinstance(pace, Fixed):
        mean = journey.point.state.t / max(journey.mark.steps, 1)
        return f"give a smaller Tolerance, or steps of one length: GeneralizedAlpha({0.1 * mean:.1g})"
    smaller = f"take steps smaller than {pace.step:g} s, or AdaptiveAlpha, which finds them"
    motion, switches = journey.plan.model.motion, journey.plan.model.switches
    if isinstance(method, ConservingMidpoint) or motion.flows.size or switches.names or journey.books.sums.lost:
        return smaller
    return f"{smaller}, or ConservingMidpoint({pace.step:g}), which keeps energies of springs in such steps"
