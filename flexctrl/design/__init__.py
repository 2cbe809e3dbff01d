"""The controller: commands and shapers, feedback and observers, and the hardware round them."""

from __future__ import annotations

from flexctrl.design.controller import Controller, as_controller
from flexctrl.design.feedback import FilteredRate, observer, observer_feedback, pd, pi, pid, state_feedback
from flexctrl.design.hardware import AntiWindup, Delayed, Noisy, Quantised, RateLimited, Sampled, Saturated
from flexctrl.design.optimal import Estimator, Regulator, bryson, kalman, lqg, lqr
from flexctrl.design.piecewise import Constant, PiecewisePolynomial, Sum, Trajectory
from flexctrl.design.shaper import Mode, Shaper, convolve
from flexctrl.design.shapers import ei, um_zv, um_zv_fit, um_zvd, um_zvd_fit, zv, zvd, zvdd
from flexctrl.design.shaping import CoarseGridWarning, Shaped, fir
from flexctrl.design.tracking import Commanded, FeedForward, OpenLoop, Together, Tracking
from flexctrl.design.trajectories import (
    MinimumJerk,
    Ramp,
    Spline,
    Step,
    Table,
    TimeOptimalPendulum,
    TrapezoidalVelocity,
)
from flexctrl.errors import ControllerError, DesignError

__all__ = [
    "AntiWindup",
    "CoarseGridWarning",
    "Commanded",
    "Constant",
    "Controller",
    "ControllerError",
    "Delayed",
    "DesignError",
    "Estimator",
    "FeedForward",
    "FilteredRate",
    "MinimumJerk",
    "Mode",
    "Noisy",
    "OpenLoop",
    "PiecewisePolynomial",
    "Quantised",
    "Ramp",
    "RateLimited",
    "Regulator",
    "Sampled",
    "Saturated",
    "Shaped",
    "Shaper",
    "Spline",
    "Step",
    "Sum",
    "Table",
    "TimeOptimalPendulum",
    "Together",
    "Tracking",
    "Trajectory",
    "TrapezoidalVelocity",
    "as_controller",
    "bryson",
    "convolve",
    "ei",
    "fir",
    "kalman",
    "lqg",
    "lqr",
    "observer",
    "observer_feedback",
    "pd",
    "pi",
    "pid",
    "state_feedback",
    "um_zv",
    "um_zv_fit",
    "um_zvd",
    "um_zvd_fit",
    "zv",
    "zvd",
    "zvdd",
]
