"""Shares in words."""

from __future__ import annotations

__all__ = ["percent"]

_WHOLE = 0.995


def percent(share: float) -> str:
    """Return a share in percent, of two digits: 100 %, not 1e+02 %.

    Parameters
    ----------
    share : float

    Returns
    -------
    str
    """
    return f"{100.0 * share:.2g} %" if share < _WHOLE else f"{100.0 * share:.0f} %"
