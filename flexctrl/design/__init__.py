"""The controller: commands and shapers, feedback and observers, and the hardware round them; loaded when used."""

from __future__ import annotations

import difflib
import importlib
from typing import Any

_HOMES = {
    "flexctrl.design.controller": ("Controller", "as_controller"),
    "flexctrl.design.feedback": ("FilteredRate", "observer", "observer_feedback", "pd", "pi", "pid", "state_feedback"),
    "flexctrl.design.hardware": ("AntiWindup", "Delayed", "Noisy", "Quantised", "RateLimited", "Sampled", "Saturated"),
    "flexctrl.design.holding": ("Held",),
    "flexctrl.design.optimal": ("Estimator", "IdleInputWarning", "Regulator", "bryson", "kalman", "lqg", "lqr"),
    "flexctrl.design.piecewise": ("Constant", "PiecewisePolynomial", "Sum", "Trajectory"),
    "flexctrl.design.shaper": ("Mode", "Shaper", "convolve"),
    "flexctrl.design.shapers": ("ei", "um_zv", "um_zv_fit", "um_zvd", "um_zvd_fit", "zv", "zvd", "zvdd"),
    "flexctrl.design.shaping": ("CoarseGridWarning", "Shaped", "fir"),
    "flexctrl.design.tracking": ("Commanded", "FeedForward", "OpenLoop", "Together", "Tracking"),
    "flexctrl.design.trajectories": (
        "MinimumJerk",
        "Ramp",
        "Spline",
        "Step",
        "Table",
        "TimeOptimalPendulum",
        "TrapezoidalVelocity",
    ),
    "flexctrl.errors": ("ControllerError", "DesignError"),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        close = difflib.get_close_matches(name, __all__, n=1)
        hint = f"; did you mean {close[0]!r}?" if close else ""
        raise AttributeError(f"module 'flexctrl.design' has no attribute {name!r}{hint}")
    value = globals()[name] = getattr(importlib.import_module(_HOME[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
