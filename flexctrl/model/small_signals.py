"""Outputs of small motion: linear about where the machine rests, as its equations are.

What is of second order in the motion is left out of both. A rope that swings by θ pulls by its weight, as it does where
parts move far but for θ²; its straight length in a picture of the small motion, ℓ √(1 + θ²), is no stretch.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from flexctrl.model.motion import Motion
from flexctrl.model.signals import Measure, Signals
from flexctrl.model.state import State

__all__ = ["small_signals"]


def small_signals(signals: Signals, motion: Motion) -> Signals:
    """Return the signals of small motion, y = y₀ + C_q (q − q₀) + C_v v.

    Parameters
    ----------
    signals : Signals
        Where parts move as far as they like.
    motion : Motion
        Its ``rest`` is what the motion is small about.

    Returns
    -------
    Signals
        With the same slopes everywhere, those at rest; `flexctrl.linearize` gives C_q and C_v.
    """
    T = motion.jacobian(motion.rest)
    return replace(signals, measures=tuple(_small(measure, motion, T) for measure in signals.measures))


def _small(measure: Measure, motion: Motion, T: sp.csr_matrix) -> Measure:
    rest, still = motion.rest, np.zeros(motion.raw)
    level, (cells, on_place, rated, on_rate) = measure.value(rest, still), measure.slope(rest, still)
    lever = sp.csr_matrix(sp.csr_matrix(on_place) @ T[cells])
    moved, weights, origin = lever.indices, lever.data, rest.q[lever.indices]

    def value(state: State, rates: np.ndarray) -> float:
        return level + float(weights @ (state.q[moved] - origin)) + float(on_rate @ rates[rated])

    return Measure(value, lambda state, rates: (cells, on_place, rated, on_rate))
