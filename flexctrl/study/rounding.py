"""What rounding leaves of a signal, which is told as nothing where numbers are shown."""

from __future__ import annotations

import numpy as np

from flexctrl.dynamics.run import Run
from flexctrl.dynamics.scales import output_yardsticks

__all__ = ["beyond", "of_outputs", "of_signal"]

_ROUNDING = 1e-12
"""Thousands of roundings: of a signal's largest magnitude, of the machine's size."""


def of_outputs(run: Run) -> np.ndarray:
    """Return what rounding may leave of outputs that are zero, of a machine that moves by its own size or a radian.

    Parameters
    ----------
    run : Run

    Returns
    -------
    numpy.ndarray, shape (outputs,)
    """
    seconds = float(run.t[-1] - run.t[0])
    step = seconds / max(run.report.steps, 1) if seconds > 0.0 else 1.0
    return _ROUNDING * output_yardsticks(run.track.feed.model, step)


def of_signal(name: str, runs: list[Run]) -> float:
    """Return below what the numbers of one signal are rounding: of the larger of its curves, or of an output at zero.

    Parameters
    ----------
    name : str
    runs : list of Run
        That have it.

    Returns
    -------
    float
    """
    largest = max(float(np.abs(run[name]).max(initial=0.0)) for run in runs)
    zero = [float(of_outputs(run)[run.outputs.index(name)]) for run in runs if name in run.outputs]
    return max([_ROUNDING * largest, *zero])


def beyond(rounding: float, value: float) -> float:
    """Return a value as it is shown: 0 where it is less than rounding leaves.

    Parameters
    ----------
    rounding : float
    value : float

    Returns
    -------
    float
    """
    return 0.0 if abs(value) < rounding else value
