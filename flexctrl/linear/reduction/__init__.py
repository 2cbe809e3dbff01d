"""Model reduction: each method a frozen value, each result with its measured error.

``reduce(linear, ModalTruncation(8, static_correction=True))`` or, by error instead of order,
``reduce(linear, RelativeError(0.01, up_to_hz=20), using=ModalTruncation)``.
"""

from __future__ import annotations

from collections.abc import Callable

from flexctrl.errors import ReductionError, shortened
from flexctrl.linear.model import LinearModel
from flexctrl.linear.reduction.balanced import BalancedTruncation, hankel_singular_values
from flexctrl.linear.reduction.craig_bampton import CraigBampton
from flexctrl.linear.reduction.error import ErrorReport, RelativeError, smallest
from flexctrl.linear.reduction.low_frequency import LowFrequency, low_frequency, rigid_basis
from flexctrl.linear.reduction.modal import ModalTruncation
from flexctrl.linear.reduction.moments import MomentMatching
from flexctrl.linear.reduction.result import Method, Reduced, ReducedModel
from flexctrl.linear.reduction.selection import BelowFrequency, DCGain, Lowest, Participation
from flexctrl.linear.reduction.states import ReducedStates

__all__ = [
    "BalancedTruncation",
    "BelowFrequency",
    "CraigBampton",
    "DCGain",
    "ErrorReport",
    "LowFrequency",
    "Lowest",
    "Method",
    "ModalTruncation",
    "MomentMatching",
    "Participation",
    "Reduced",
    "ReducedModel",
    "ReducedStates",
    "RelativeError",
    "hankel_singular_values",
    "low_frequency",
    "reduce",
    "rigid_basis",
]


def reduce(
    linear: LinearModel, to: Method | RelativeError, using: Callable[[int], Method] = ModalTruncation
) -> Reduced:
    """Reduce a linear model; signal names, rigid-body and unstable motion are kept.

    Massless freedoms are condensed first.

    Parameters
    ----------
    linear : LinearModel
    to : Method or RelativeError
        ``ModalTruncation``, ``CraigBampton``, ``BalancedTruncation``, ``MomentMatching``; or the error wanted.
    using : callable
        For an error: the method as a function of its order, e.g. ``BalancedTruncation`` or
        ``lambda order: MomentMatching((0.0, 30j), order)``.

    Returns
    -------
    Reduced
        ``ReducedModel`` (second order, with ``.linear``) or ``ReducedStates``; both have ``to_ss()``,
        ``frequency_response()``, ``damped_poles()`` and the measured ``error``.
    """
    if isinstance(to, RelativeError):
        if not callable(using):
            raise ReductionError(
                f"reduce: using = {using!r}; expected a method as a function of its order, e.g. BalancedTruncation "
                "itself, or lambda order: MomentMatching((0.0, 30j), order)"
            )
        return smallest(linear.condense(), to, using)
    if isinstance(to, type) or not hasattr(to, "apply"):
        raise ReductionError(
            f"reduce: {shortened(to)} is no method; expected e.g. ModalTruncation(8) or RelativeError(0.01)"
        )
    return to.apply(linear.condense())
