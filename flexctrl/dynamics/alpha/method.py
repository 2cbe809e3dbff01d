"""Generalised alpha, with steps of one length or with chosen ones."""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np

from flexctrl.dynamics import steps
from flexctrl.dynamics.alpha.point import Coefficients
from flexctrl.dynamics.alpha.spectrum import told_damping
from flexctrl.dynamics.alpha.steps import Stepper
from flexctrl.dynamics.feed import Feed
from flexctrl.dynamics.run import Tolerance
from flexctrl.dynamics.steps import MOST_STEPS, Controlled, Fixed, check_step
from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.model.plant import Plant
from flexctrl.structure.freedoms import check_number, check_seconds

__all__ = ["AdaptiveAlpha", "GeneralizedAlpha"]

_LAST = 1e-15
_LEFTOVER = 1e-11  # stiff parts that steps do not resolve make accelerations of it


def _quickest(plain: Stepper) -> Any:
    """Return steps in compiled loops, where the model and its feed allow that."""
    from flexctrl.dynamics.march.marching import can_march

    if not can_march(plain.model):
        return plain
    if not plain.feed.continuous:
        from flexctrl.dynamics.march.stepper import MarchingStepper

        return MarchingStepper(plain)
    from flexctrl.dynamics.march.answerer import AnsweringStepper, can_answer

    return AnsweringStepper(plain) if can_answer(plain.feed) else plain


class _Damped:
    """What the spectral radius at infinite frequency makes of generalised alpha."""

    rho: float

    @property
    def order(self) -> int:
        return 2

    @property
    def symmetric(self) -> bool:
        return self.rho == 1.0

    @property
    def damping(self) -> str:
        return told_damping(self.rho)


@frozen
class GeneralizedAlpha(_Damped):
    """Generalised alpha with a fixed step; second order.

    Parameters
    ----------
    step : float
        Step [s]; shortened a little so that a whole number of steps ends at each sample instant.
    rho : float
        Spectral radius at infinite frequency, 0 … 1: 1 keeps all energy, 0 kills the highest frequencies at once.

    Raises
    ------
    StructureError
        For a step that is not positive or ρ outside 0 … 1.
    """

    step: float
    rho: float = 0.9

    def __post_init__(self) -> None:
        check_step(self.step, "GeneralizedAlpha")
        _check_rho(self.rho)

    @property
    def pace(self) -> Fixed:
        return Fixed(self.step)

    def stepper(self, model: Plant, feed: Feed, tolerance: Tolerance) -> steps.Stepper[Any]:
        newton = min(1e-6, max(1e-3 * tolerance.absolute, _LAST))
        return _quickest(Stepper(model, feed, Coefficients.of(self.rho), newton))


@frozen
class AdaptiveAlpha(_Damped):
    """Generalised alpha with steps chosen from the estimated error, tried again where it is too large.

    Parameters
    ----------
    rho : float
        Spectral radius at infinite frequency, 0 … 1.
    first_step : float, optional
        [s]; left out: told by how the machine sets out.
    largest_step : float
        [s]
    most_steps : float
        Of a run; one whose steps have become so short that it would take more ends, and says so.

    Raises
    ------
    StructureError
        For a value out of range.
    """

    rho: float = 0.8
    first_step: float | None = None
    largest_step: float = np.inf
    most_steps: float = field(default=MOST_STEPS, repr=False)

    def __post_init__(self) -> None:
        _check_rho(self.rho)
        if self.first_step is not None:
            check_seconds(self.first_step, "first_step", "AdaptiveAlpha")
        check_seconds(self.largest_step, "largest_step", "AdaptiveAlpha", endless=True)
        check_number(self.most_steps, "most_steps", "AdaptiveAlpha", above=0.0)

    @property
    def pace(self) -> Controlled:
        return Controlled(self.first_step, self.largest_step, 3, self.most_steps)

    def stepper(self, model: Plant, feed: Feed, tolerance: Tolerance) -> steps.Stepper[Any]:
        newton = min(_LEFTOVER, max(1e-3 * tolerance.absolute, _LAST))
        # steps too long for what has damping but no mass are seen to be by their error, if it sets out as it does
        return _quickest(Stepper(model, feed, Coefficients.of(self.rho), newton, sight=np.inf))


def _check_rho(rho: float) -> None:
    if not 0.0 <= check_number(rho, "rho", "generalised alpha") <= 1.0:
        raise StructureError(f"generalised alpha: rho = {rho}; expected 0 … 1 (0.9 damps only the highest frequencies)")
