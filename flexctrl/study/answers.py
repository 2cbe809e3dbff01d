"""What a scene answers: curves, slow poles, margins; and how far two answers are apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

import numpy as np
from scipy.optimize import linear_sum_assignment

from flexctrl.design.controller import LinearController
from flexctrl.dynamics.run import Run
from flexctrl.errors import ControllerError, FlexctrlError
from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.linear.statespace import modal_first_order
from flexctrl.study.broken_loop import broken_loop, linear_law
from flexctrl.study.frequency import margins
from flexctrl.study.gain_family import gain_family
from flexctrl.study.rounding import of_outputs
from flexctrl.study.subject import Subject

__all__ = ["Answer", "Change", "Curves", "answer_of", "change_between", "changes_known", "outputs_apart"]

_SLOW = 6  # poles that are compared, each with any of twice as many
_SURELY, _PARTED, _LOOKS = 1e-6, 30.0, 3
_TURN = 0.01
"""By how much a pole must turn or decay over the run not to count as at the origin: |s| times its length."""
_GROWS = 1e-6  # of a pole's magnitude; of an undamped one rounding leaves less


@frozen(eq=False)
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
        return cls(run.t, run.outputs, run.y, of_outputs(run))

    def __getitem__(self, name: str) -> np.ndarray:
        return self.y[:, self.outputs.index(name)]


@frozen(eq=False)
class Answer:
    """What a scene tells its user.

    Attributes
    ----------
    run : Run
    poles : numpy.ndarray of complex
        Poles off the origin with Im ≥ 0 [1/s], the slowest first, of the closed loop if the scene has a linear law.
        One that turns or decays by less than 0.01 over the run is not told from one at the origin.
    margins : mapping of str to (float, float)
        Gain margin (factor) and phase margin [rad] at each commanded input, the loop cut there.
    growing : complex
        The pole that grows fastest [1/s]; 0 if none does.
    finer : Run or None
        The same integrated more finely, which tells how well the run is known; None if there is none.
    """

    run: Run
    poles: np.ndarray
    margins: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    growing: complex = 0j
    finer: Run | None = None


@frozen
class Change:
    """How far an answer is from another.

    Attributes
    ----------
    outputs : mapping of str to float
        max |Δy| over the largest |y| of the first, by output; 0 where it is but rounding.
    poles : float
        Largest |Δs| over the larger |s| of both among the slow poles, paired so that the sum is least: 1 where one
        comes to rest or runs away, is gone or new, 2 at most; NaN if the first answer has none.
    margins : float
        Largest change of a gain or phase margin over the larger of both: 1 where one is limited and the other is not;
        NaN if the first answer has none.
    pole : complex
        The pole that changes so [1/s], of the first answer if it has it; NaN without any.
    known : mapping of str to float
        To what the change of each output is known, over the same magnitude: how much of it the integrators made.
    """

    outputs: Mapping[str, float]
    poles: float
    margins: float
    pole: complex = complex("nan")
    known: Mapping[str, float] = field(default_factory=dict)

    @property
    def outputs_worst(self) -> float:
        """The largest change of an output."""
        return max(self.outputs.values(), default=0.0)

    @property
    def outputs_known(self) -> float:
        """To what the changes of all outputs are known."""
        return max(self.known.values(), default=0.0)


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
    law, seconds = _linear_law(scene), float(run.t[-1] - run.t[0])
    try:
        poles = _moving(scene.linear.damped_poles() if law is None else _closed(scene.linear, law), seconds)
        cuts = {} if law is None else {name: _margins(scene, law, name) for name in law.outputs}
        return Answer(run, poles[: 2 * _SLOW], cuts, _growing(poles))
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


def _closed(linear: LinearModel, law: LinearController) -> np.ndarray:
    """Poles of the closed loop, and of the modes that it does not touch.

    Samples do not tell a mode faster than half of them from a slow one; poles that are mostly such a mode are left out.
    """
    family, plant = gain_family(linear, law), modal_first_order(linear)
    pace = np.zeros(len(plant.A))
    omega = np.repeat(np.sqrt(np.abs(linear._modal.modes.omega_squared)), 2)
    pace[: len(omega)] = omega
    touched, spectrum = family.states, family.at(1.0)
    told = np.abs(spectrum.poles) > 0.0
    if family.dt and len(touched):
        told &= pace[touched[np.abs(spectrum.shapes[: len(touched)]).argmax(axis=0)]] < np.pi / family.dt
    closed = [family.continuous(p) for p in spectrum.poles[told]]
    others = np.setdiff1d(np.arange(len(pace)), touched)
    return np.concatenate([np.array(closed, complex), np.linalg.eigvals(plant.A[np.ix_(others, others)])])


def _moving(poles: np.ndarray, seconds: float = np.inf) -> np.ndarray:
    """The poles that are neither at rest over so long a run nor the lower half of a pair, the slowest first.

    Rounding ε parts two poles at rest by about √(ε |s|max |s|), |s| of the slowest poles that move.
    """
    size = np.abs(poles)
    fastest = float(size.max(initial=0.0))
    rest = _SURELY * fastest
    for _ in range(_LOOKS):  # a slower pole that moves sets the limit lower
        slowest = float(size[size > rest].min(initial=fastest))
        rest = min(rest, _PARTED * np.sqrt(np.finfo(float).eps * fastest * slowest))
    moving = poles[(size > max(rest, _TURN / seconds)) & (poles.imag >= 0.0)]
    return moving[np.argsort(np.abs(moving))]


def _growing(poles: np.ndarray) -> complex:
    growing = poles[poles.real > _GROWS * np.abs(poles)]
    return complex(growing[growing.real.argmax()]) if growing.size else 0j


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
    known = changes_known((first.run, first.finer), (second.run, second.finer))
    return Change(outputs, poles, _margins_apart(first.margins, second.margins), pole, known)


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


def changes_known(first: tuple[Run, Run | None], second: tuple[Run, Run | None]) -> dict[str, float]:
    """Return to what changes between two runs are known, by output: how far they are from those between finer runs.

    Errors that both runs have alike take no part. Over the largest |y| of the first run, as `outputs_apart`.

    Parameters
    ----------
    first, second : (Run, Run or None)
        A run and a finer one of the same machine; None if there is none.

    Returns
    -------
    dict of str to float
        Infinite where a finer run is missing.
    """
    (run, finer), (other, other_finer) = first, second
    if finer is None or other_finer is None:
        return dict.fromkeys(run.outputs, np.inf)
    curves = Curves.of(run)
    there = [name for name in curves.outputs if name in other.outputs]
    known = dict.fromkeys(curves.outputs, 0.0)
    for name in there:
        coarse, fine = (_at(curves, b, name) - _at(curves, a, name) for a, b in ((run, other), (finer, other_finer)))
        known[name] = _relative(curves, name, fine - coarse)
    return known


def _apart(first: Curves, second: Run | Curves, name: str) -> float:
    if name not in second.outputs:
        return 1.0
    return _relative(first, name, _at(first, second, name) - first[name])


def _at(curves: Curves, run: Run | Curves, name: str) -> np.ndarray:
    """An output of a run at the instants of other curves."""
    return np.interp(curves.t, run.t, run[name])


def _relative(first: Curves, name: str, difference: np.ndarray) -> float:
    """The largest of a difference over the magnitude of an output; 0 if rounding may leave as much."""
    noise = float(first.noise[first.outputs.index(name)])
    gap = float(np.abs(difference).max())
    return 0.0 if gap <= noise else gap / max(float(np.abs(first[name]).max()), noise)


def _poles_apart(first: np.ndarray, second: np.ndarray) -> tuple[float, complex]:
    """The largest change of a slow pole of either, and which it is."""
    if not first.size:
        return np.nan, complex("nan")
    there, back = _nearest(first[:_SLOW], second), _nearest(second[:_SLOW], first)
    changes = [(gap, pole) for gap, pole, _ in there] + [
        (gap, pole if other is None else other) for gap, pole, other in back
    ]
    return max(changes, key=lambda found: found[0])


def _nearest(poles: np.ndarray, others: np.ndarray) -> list[tuple[float, complex, complex | None]]:
    """How far poles are from those they are paired with, and which these are; alone they are off by 1."""
    gaps = np.abs(poles[:, None] - others) / np.maximum(np.abs(poles)[:, None], np.abs(others))
    pairs = dict(zip(*(side.tolist() for side in linear_sum_assignment(gaps)), strict=True))
    return [
        (float(gaps[i, pairs[i]]), complex(p), complex(others[pairs[i]])) if i in pairs else (1.0, complex(p), None)
        for i, p in enumerate(poles)
    ]


def _margins_apart(first: Mapping[str, tuple[float, float]], second: Mapping[str, tuple[float, float]]) -> float:
    changes = [
        _margin_apart(a, b)
        for name, both in first.items()
        for a, b in zip(both, second.get(name, (np.nan, np.nan)), strict=True)
    ]
    return max(changes, default=np.nan)


def _margin_apart(a: float, b: float) -> float:
    """Change of a margin over the larger of both; none at all, or no limit, is as far from a number as can be."""
    if a == b or (np.isnan(a) and np.isnan(b)):
        return 0.0
    larger = max(abs(a), abs(b))
    return abs(b - a) / larger if np.isfinite(larger) and np.isfinite(a + b) else 1.0
