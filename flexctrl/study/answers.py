"""What a scene answers: curves, slow poles, margins; and how far two answers are apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import linear_sum_assignment

from flexctrl.design.controller import LinearController
from flexctrl.dynamics.run import Run
from flexctrl.dynamics.scales import output_yardsticks
from flexctrl.errors import ControllerError, FlexctrlError
from flexctrl.study.broken_loop import broken_loop, linear_law
from flexctrl.study.frequency import margins
from flexctrl.study.gain_family import gain_family
from flexctrl.study.subject import Subject

__all__ = ["Answer", "Change", "Curves", "answer_of", "change_between", "outputs_apart"]

_SLOW = 6
_ROUNDING = 1e-12  # of the machine's size; thousands of roundings


@dataclass(frozen=True, eq=False)
class Curves:
    """The outputs of a run and nothing else: little to send to another process.

    Attributes
    ----------
    t : numpy.ndarray, shape (m,)
    outputs : tuple of str
    y : numpy.ndarray, shape (m, outputs)
    noise : numpy.ndarray, shape (outputs,)
        What rounding may leave of an output that is zero.
    """

    t: np.ndarray
    outputs: tuple[str, ...]
    y: np.ndarray
    noise: np.ndarray

    @classmethod
    def of(cls, run: Run) -> Curves:
        """Take those of a run."""
        step = max(float(run.t[-1] - run.t[0]), 1e-300) / max(run.report.steps, 1)
        return cls(run.t, run.outputs, run.y, _ROUNDING * output_yardsticks(run.track.feed.model, step))

    def __getitem__(self, name: str) -> np.ndarray:
        return self.y[:, self.outputs.index(name)]


@dataclass(frozen=True, eq=False)
class Answer:
    """What a scene tells its user.

    Attributes
    ----------
    run : Run
    poles : numpy.ndarray of complex
        The slowest poles off the origin with Im ≥ 0 [1/s], of the closed loop if the scene has a linear law.
    margins : mapping of str to (float, float)
        Gain margin (factor) and phase margin [rad] at each commanded input, the loop cut there.
    """

    run: Run
    poles: np.ndarray
    margins: Mapping[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Change:
    """How far an answer is from another.

    Attributes
    ----------
    outputs : mapping of str to float
        max |Δy| over the largest |y| of the first, by output; 0 where it is but rounding.
    poles : float
        Largest |Δs| over the larger |s| of both among the slow poles, paired so that the sum is least: 1 where one
        comes to rest or runs away, 2 at most; NaN without any.
    margins : float
        Largest relative change of a gain or phase margin; NaN without a linear loop.
    pole : complex
        The pole of the first answer that changes so [1/s]; NaN without any.
    """

    outputs: Mapping[str, float]
    poles: float
    margins: float
    pole: complex = complex("nan")

    @property
    def outputs_worst(self) -> float:
        """The largest change of an output."""
        return max(self.outputs.values(), default=0.0)


def answer_of(scene: Subject, run: Run) -> Answer:
    """Return what a scene answers, its run given.

    Parameters
    ----------
    scene : Scene
    run : Run

    Returns
    -------
    Answer
    """
    law = _linear_law(scene)
    try:
        if law is None:
            return Answer(run, _slow(scene.linear.damped_poles()))
        family = gain_family(scene.linear, law)
        poles = np.array([family.continuous(p) for p in family.at(1.0).poles if abs(p) > 0.0])
        return Answer(run, _slow(poles), {name: _margins(scene, law, name) for name in law.outputs})
    except FlexctrlError:  # no equilibrium, say: the curves still count
        return Answer(run, np.zeros(0, complex))


def _linear_law(scene: Subject) -> LinearController | None:
    if scene.law is None:
        return None
    try:
        law = linear_law(scene.law)
    except ControllerError:
        return None
    return law if law.inputs else None


def _slow(poles: np.ndarray) -> np.ndarray:
    """The slowest poles that are neither at rest nor the lower half of a pair."""
    size = np.abs(poles)
    moving = poles[(size > 1e-6 * size.max(initial=0.0)) & (poles.imag >= 0.0)]
    return moving[np.argsort(np.abs(moving))][:_SLOW]


def _margins(scene: Subject, law: LinearController, name: str) -> tuple[float, float]:
    found = margins(broken_loop(scene.linear, law, name))
    return found.gain_up.margin, found.phase.margin


def change_between(first: Answer, second: Answer) -> Change:
    """Return how far a second answer is from a first.

    Parameters
    ----------
    first, second : Answer
        An output that the second does not have is changed wholly (1).

    Returns
    -------
    Change
    """
    outputs = outputs_apart(first.run, second.run)
    poles, pole = _poles_apart(first.poles, second.poles)
    return Change(outputs, poles, _margins_apart(first.margins, second.margins), pole)


def outputs_apart(first: Run | Curves, second: Run | Curves) -> dict[str, float]:
    """Return max |Δy| over the largest |y| of the first run, by output; 1 for one that the second does not have.

    Of an output that is zero, by symmetry say, rounding leaves something. What is below 10⁻¹² of the motion of a
    machine that moves by its own size, or by a radian, is no change, and no magnitude to measure changes by.

    Parameters
    ----------
    first, second : Run or Curves

    Returns
    -------
    dict of str to float
    """
    curves = first if isinstance(first, Curves) else Curves.of(first)
    return {name: _apart(curves, second, name) for name in curves.outputs}


def _apart(first: Curves, second: Run | Curves, name: str) -> float:
    if name not in second.outputs:
        return 1.0
    noise = float(first.noise[first.outputs.index(name)])
    gap = float(np.abs(np.interp(first.t, second.t, second[name]) - first[name]).max())
    if gap <= noise:
        return 0.0
    return gap / max(float(np.abs(first[name]).max()), noise)


def _poles_apart(first: np.ndarray, second: np.ndarray) -> tuple[float, complex]:
    """The largest change of a pole, and which it is."""
    if not first.size or not second.size:
        return np.nan, complex("nan")
    gaps = np.abs(first[:, None] - second) / np.maximum(np.abs(first)[:, None], np.abs(second))
    if gaps.shape[0] > gaps.shape[1]:  # poles that are gone
        gaps = np.hstack([gaps, np.ones((gaps.shape[0], gaps.shape[0] - gaps.shape[1]))])
    found = gaps[linear_sum_assignment(gaps)]
    return float(found.max()), complex(first[int(np.argmax(found))])


def _margins_apart(first: Mapping[str, tuple[float, float]], second: Mapping[str, tuple[float, float]]) -> float:
    changes = [
        abs(b / a - 1.0)
        for name in first.keys() & second.keys()
        for a, b in zip(first[name], second[name], strict=True)
        if np.isfinite(a) and np.isfinite(b) and a != 0.0
    ]
    return max(changes, default=np.nan)
