"""Laws that answer little to much: what grows about rest is held by these, as a loop about one place does not see."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

__all__ = ["limited"]

_NEARBY, _FAR, _HALF = 1e-4, 0.1, 0.5
"""Shares of what readings go through, and of slopes."""


def limited(told: Callable[[np.ndarray], np.ndarray], y: np.ndarray, way: np.ndarray) -> bool:
    """Tell whether a law answers by half, for their size, to readings a tenth of their range away, and holds growth.

    Parameters
    ----------
    told : callable
        The commands for what is read.
    y, way : numpy.ndarray, shape (readings,)
        Where it is asked, and the range of each reading over the run.

    Returns
    -------
    bool
    """

    def slopes(share: float) -> np.ndarray:
        both = ([told(y + side * share * d) for d in np.diag(way) if d.any()] for side in (1.0, -1.0))
        return np.abs(np.subtract(*map(np.array, both))) / share

    near, far = slopes(_NEARBY), slopes(_FAR)
    return bool((far < _HALF * near)[near > _FAR * near.max(initial=0.0)].any())
