"""Sampled laws that jump: what becomes of a run whose law reads a little more than it does, or less.

Where a law jumps, what it says may hang on less than steps err by: a run in other steps that falls on the same side is
wrong alike. One whose law misreads by as much as steps err falls on the other.
"""

from __future__ import annotations

from dataclasses import field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from flexctrl.design.wrapping import Wrapper
from flexctrl.dynamics.checking import news
from flexctrl.dynamics.methods.checked import Beside
from flexctrl.dynamics.notes.answers import Manner
from flexctrl.dynamics.notes.apart import Apart
from flexctrl.dynamics.notes.beside import agreeing
from flexctrl.dynamics.notes.outputs import fast, seen, told_from, ways
from flexctrl.dynamics.others import Beginning, made, noted
from flexctrl.dynamics.run import Run
from flexctrl.frozen import frozen
from flexctrl.model.model import Model

if TYPE_CHECKING:
    import casadi as ca

    from flexctrl.design.lowering import Told, Tracer
    from flexctrl.dynamics.journey import Journey

__all__ = ["Misreading", "misread"]

_PARTED, _MUCH = 0.02, 0.1
"""How far, of an output's range, runs are to be apart for a note, and what is noted of what the law reads anyway."""
_HANGS = (
    "what the law says at its samples hangs on less than steps err by: if it reads {off} {more}, {where} is {far:.2g} "
    "of its range elsewhere: see whether {remedy} agrees; no real sensor is right to that"
)


@frozen(eq=False)
class Misreading(Wrapper):
    """A sampled law that reads more than there is, but at the start, where all is known.

    Attributes
    ----------
    controller : Controller
    off : numpy.ndarray, shape (inputs,)
        How much more.
    """

    off: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def aside(self) -> str:
        """What tells it from the law inside."""
        return ", reading more" if self.off.sum() > 0.0 else ", reading less"

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.controller.command(t, x, y + _later(t) * self.off)

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.controller.update(t, x, y + _later(t) * self.off)

    def lowered(self, tracer: Tracer, x: ca.SX, y: ca.SX) -> Told:
        """Return what it says, as expressions."""
        return tracer.of(self.controller, x, y + tracer.clock(_later) * tracer.number(self.off))


def _later(t: float) -> float:
    return float(t > 0.0)


def misread(told: Run, run: Run, journey: Journey, beginning: Beginning, law: Manner) -> Run:
    """Return a run with what others tell whose law reads a little more, or less, where nothing else is told.

    Parameters
    ----------
    told : Run
        With what runs in other steps tell.
    run : Run
        Without.
    journey : Journey
        How it went.
    beginning : Beginning
    law : Manner
        How the law answers.

    Returns
    -------
    Run
    """
    if law not in (Manner.ABRUPT, Manner.HUNTING):
        return told
    off = _errors(told, journey)
    for way in (off, -off):
        if news(told, run) or not off.any():
            break
        told = _with(told, journey, beginning, way)
    return told


def _errors(run: Run, journey: Journey) -> np.ndarray:
    """By how much what the law reads is off, as far as is told; nothing where that is noted anyway."""
    known, reads = run.report.output_errors, journey.plan.feed.reads
    shares = np.array([known.get(run.outputs[i], 0.0) for i in reads])
    return np.asarray(shares * ways(journey, run.y)[reads] * (shares.max() < _MUCH))


def _with(run: Run, journey: Journey, beginning: Beginning, off: np.ndarray) -> Run:
    """The run with what is to be said of one whose law reads so much more."""
    alike = Beside(journey.plan.method, journey.plan.tolerance, 1.0, "in the same steps")
    standing, other = made(run, journey, alike, _misread(beginning, off))
    note = "" if other is None else _note(run, other.run, journey, off)
    return noted(standing, note) if note else standing


def _misread(beginning: Beginning, off: np.ndarray) -> Beginning:
    def misreading(law: Any) -> Any:
        return None if law is None else Misreading(law, off)

    feed = replace(beginning.feed, controller=misreading(beginning.feed.controller), met=[])
    return replace(beginning, feed=feed, spare=misreading(beginning.spare))


def _note(run: Run, other: Run, journey: Journey, off: np.ndarray) -> str:
    """What is to be said where the two have parted; empty if they have not."""
    model, way = journey.plan.model, ways(journey, run.y)
    assert isinstance(model, Model)
    judged = [*seen(journey, run.y)[1], *_rates(model, journey, way)]
    apart = Apart.of(run, other, 0.5).most
    far = {i: float(apart[i] / way[i]) for i in judged}
    parted = sorted((i for i in judged if far[i] >= _PARTED), key=lambda i: -far[i])
    if not parted:
        return ""
    worst, *others = parted
    names = [run.outputs[i] for i in journey.plan.feed.reads]
    most = " and ".join(f"{name} {abs(value):.1g}" for name, value in zip(names, off, strict=True) if value)
    more = "more" if off.sum() > 0.0 else "less"
    known = {"off": most, "more": more, "where": run.outputs[worst], "far": far[worst]}
    named = ", ".join(f"{run.outputs[i]} {far[i]:.2g}" for i in others)
    return _HANGS.format(remedy=agreeing(journey), **known) + (f"; so are {named}" if named else "")


def _rates(model: Model, journey: Journey, way: np.ndarray) -> list[int]:
    """The forces and rates that go through more than steps resolve."""
    needed = told_from(journey)
    return [i for i in fast(model) if np.inf > way[i] > needed[i]]
