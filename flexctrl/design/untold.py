"""Which laws change with time in ways that their breaks do not tell."""

from __future__ import annotations

from typing import Any

from flexctrl.design.controller import LinearController
from flexctrl.design.piecewise import Trajectory
from flexctrl.design.tracking import Commanded, FeedForward, OpenLoop, Together, Tracking
from flexctrl.design.wrapping import Wrapper

__all__ = ["untold"]

_HOUSE = "flexctrl."


def untold(law: Any) -> bool:
    """Tell whether a continuous law may change with time as nobody knows beforehand.

    Parameters
    ----------
    law : Controller

    Returns
    -------
    bool
        False where all that depends on time are trajectories that come with flexctrl, which know their breaks.
    """
    if isinstance(law, Together):
        return any(untold(part) for part in law.parts)
    if isinstance(law, OpenLoop):
        return any(_unknown(signal) for signal in law.commands.values())
    if isinstance(law, Tracking | Commanded | FeedForward):
        return any(_unknown(signal) for _, signal in law.pairs) or untold(law.controller)
    if isinstance(law, Wrapper) and type(law).__module__.startswith(_HOUSE):
        return untold(law.controller)
    return not isinstance(law, LinearController)


def _unknown(signal: Any) -> bool:
    if not isinstance(signal, Trajectory) or not type(signal).__module__.startswith(_HOUSE):
        return True
    inside = (getattr(signal, "signal", None), getattr(signal, "trajectory", None), *getattr(signal, "terms", ()))
    return any(_unknown(part) for part in inside if part is not None)
