"""Places and angles among the outputs: how far each may be off, over its own motion."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.sparse as sp

from flexctrl.dynamics.notes.adding import remedy
from flexctrl.dynamics.notes.percent import percent
from flexctrl.dynamics.scales import output_yardsticks, yardsticks
from flexctrl.dynamics.steps import Parting
from flexctrl.dynamics.swift.stiff_lines import SURE
from flexctrl.model.model import Model
from flexctrl.structure.outputs import (
    AngularVelocity,
    DriveAngle,
    DriveSpeed,
    Position,
    Rotation,
    SwayAngle,
    Tension,
    Velocity,
)

if TYPE_CHECKING:
    from flexctrl.dynamics.journey import Journey

__all__ = ["Fast", "OutputErrors", "by_rows", "by_sums", "fast", "placed", "reach", "seen", "told_from", "ways"]

_TOLD, _BESIDE = 0.05, 2.0
_ROUND_OFF, _LEAST = 1e-12, 1e-9
"""Of what outputs are where nodes move by sizes and radians: less is the last digits of places, and of equilibria."""
_NAMED = 3
_LEFT = 16.0 / 9.0
"""Two runs that lag by φ and φ/4 behind a vibration ±a are ¾ φ a apart; what is extrapolated is off by ½ φ² a."""
_BY_SUMS = "{name} has moved by {way:.2g}, and errors of {steps} steps may have added up to {far} of that: {remedy}"
_BESIDE_IT = "by a {kind} run, {name} is off by {far} of its motion, which is {way:.2g}: {remedy}"
_PLACES = (Position, SwayAngle, Rotation, DriveAngle)

Fast = Tension | DriveSpeed | Velocity | AngularVelocity
"""A force or a rate."""


class OutputErrors(NamedTuple):
    """What there is to be told of single outputs.

    Attributes
    ----------
    shares : mapping of str to float
        By how much each place or angle may be off, over the range of its own values.
    notes : tuple of str
        What is to be said of those that are off by more than the machine is.
    """

    shares: Mapping[str, float]
    notes: tuple[str, ...] = ()


def told_from(journey: Journey, faint: float = 1.0) -> np.ndarray:
    """Return what forces and rates have to go through to be told of, shape (outputs,).

    That is what absolute tolerances leave of them; of a tension what the last corrections of steps do: stiff lines
    stretch by less than any tolerance, and their forces are those that masses ask for.

    Parameters
    ----------
    journey : Journey
    faint : float
        Share of that from which rates are told of, by runs that show them alike.

    Returns
    -------
    numpy.ndarray
    """
    model, absolute = journey.plan.model, journey.plan.tolerance.negligible
    assert isinstance(model, Model)
    tense = np.array([isinstance(output, Tension) for output in model.structure.outputs], dtype=bool)
    return np.where(tense, min(SURE, absolute), faint * absolute) * output_yardsticks(model, journey.mark.size)


def placed(model: Model) -> list[int]:
    """Return which outputs are places or angles."""
    return [i for i, output in enumerate(model.structure.outputs) if isinstance(output, _PLACES)]


def fast(model: Model) -> list[int]:
    """Return which outputs are forces or rates."""
    return [i for i, output in enumerate(model.structure.outputs) if isinstance(output, Fast)]


def by_sums(journey: Journey, y: np.ndarray) -> OutputErrors:
    """Return what local errors of steps may have added up to in each output.

    Parameters
    ----------
    journey : Journey
        At its end, with its drift.
    y : numpy.ndarray, shape (rows, outputs)

    Returns
    -------
    OutputErrors
        Empty for linear models and where no rows are kept.
    """
    model, late = journey.plan.model, journey.drift.late
    if not (isinstance(model, Model) and late.size and len(y) > 2):
        return OutputErrors({})
    sight = reach(journey)
    way, judged = _seen(journey, y, sight)
    off = sight @ late
    if isinstance(journey.judging, Parting):
        with np.errstate(divide="ignore", invalid="ignore"):
            off = np.fmax(off, _LEFT * (sight @ journey.judging.parted) ** 2 / way)
    shares = {model.outputs[i]: min(float(off[i] / way[i]), 1.0) for i in judged}
    return OutputErrors(shares, _notes(journey, y, shares, journey.drift.share, _BY_SUMS))


def _alike(journey: Journey) -> dict[str, float]:
    """Return by what share outputs that are differences may be off by what is late in both places alike.

    As large a share of what they are apart by as of either. What else steps do to it another run tells.
    """
    model, late, moved = journey.plan.model, journey.drift.late, journey.books.sums.moved
    assert isinstance(model, Model)
    apart = [i for i in placed(model) if getattr(model.structure.outputs[i], "minus", None) is not None]
    share = np.divide(late, moved, out=np.zeros_like(late), where=moved > 0.0)
    sight = reach(journey) if apart else None
    return {} if sight is None else {model.outputs[i]: float(share[sight[i].indices].max(initial=0.0)) for i in apart}


def by_rows(journey: Journey, y: np.ndarray, off: np.ndarray, error: float, kind: str) -> OutputErrors:
    """Return how far each output is off by another run, or by sums of local errors where these tell more.

    A vibration that neither run resolves is missing in both.

    Parameters
    ----------
    journey : Journey
        At its end, with its drift and what that tells of outputs.
    y : numpy.ndarray, shape (rows, outputs)
    off : numpy.ndarray, shape (outputs,)
        What another run has each output off by.
    error : float
        How far the machine is off.
    kind : str
        What the other run is: coarser, or finer.

    Returns
    -------
    OutputErrors
    """
    model, summed = journey.plan.model, journey.outputs.shares
    if not summed:
        return journey.outputs
    way, judged = seen(journey, y)
    alike = _alike(journey)
    summed = {name: min(share, alike.get(name, 1.0)) for name, share in summed.items()}
    beside = {model.outputs[i]: min(float(off[i] / way[i]), 1.0) for i in judged}
    more = {name: share for name, share in beside.items() if share > summed[name]}
    less = {name: share for name, share in summed.items() if name not in more}
    notes = _notes(journey, y, more, error, _BESIDE_IT.replace("{kind}", kind)) + _notes(
        journey, y, less, error, _BY_SUMS
    )
    return OutputErrors({**summed, **more}, notes)


def reach(journey: Journey) -> sp.csr_matrix:
    """Return by how much each degree of freedom moves each output, without signs, shape (outputs, n)."""
    model, state = journey.plan.model, journey.point.state
    assert isinstance(model, Model)
    still = np.zeros(model.motion.raw)
    return abs(model.signals.sight(state, still, still.size) @ model.motion.jacobian(state))


def seen(journey: Journey, y: np.ndarray) -> tuple[np.ndarray, list[int]]:
    """Return how far outputs go, and which are places or angles that go farther than their last digits."""
    return _seen(journey, y, reach(journey))


def _seen(journey: Journey, y: np.ndarray, sight: sp.csr_matrix) -> tuple[np.ndarray, list[int]]:
    model = journey.plan.model
    assert isinstance(model, Model)
    yards = yardsticks(model)
    least = _LEAST * (sight @ np.where(np.isfinite(yards), yards, 0.0))
    # what no freedom moves has last digits all the same: freedoms turn the coupler of a parallelogram by nothing
    least = np.maximum(least, _ROUND_OFF * output_yardsticks(model, journey.mark.size))
    way = ways(journey, y)
    return way, [i for i in placed(model) if way[i] > least[i]]


def ways(journey: Journey, y: np.ndarray) -> np.ndarray:
    """Return how far outputs go, from where the whole run began.

    Parameters
    ----------
    journey : Journey
    y : numpy.ndarray, shape (rows, outputs)

    Returns
    -------
    numpy.ndarray, shape (outputs,)
    """
    return np.ptp(np.vstack([journey.plan.model.measure(journey.origin.state), y]), axis=0)


def _notes(journey: Journey, y: np.ndarray, shares: Mapping[str, float], error: float, said: str) -> tuple[str, ...]:
    """What is to be said of outputs that are farther off than all else: of the worst, and the names of others."""
    far = [name for name in shares if shares[name] > max(_TOLD, _BESIDE * error)]
    if not far:
        return ()
    worst, *others = sorted(far, key=lambda name: -shares[name])
    way = float(ways(journey, y)[journey.plan.model.outputs.index(worst)])
    share, do = shares[worst], remedy(journey, shares[worst])
    note = said.format(name=worst, way=way, far=percent(share), steps=journey.mark.steps, remedy=do)
    if not others:
        return (note,)
    named = ", ".join(f"{name} {percent(shares[name])}" for name in others[:_NAMED])
    more = f" and {len(others) - _NAMED} more" if len(others) > _NAMED else ""
    return (f"{note}; beside it {named}{more}",)
