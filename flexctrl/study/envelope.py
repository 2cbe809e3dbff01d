"""The linear-validity envelope: how far a linear model may be trusted."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.dynamics.steps import Integrator
from flexctrl.errors import StructureError, check_kind
from flexctrl.frozen import frozen
from flexctrl.model.equilibrium import Rest, equilibrium
from flexctrl.model.linearize import linearize
from flexctrl.model.model import Model
from flexctrl.model.state import State
from flexctrl.structure.freedoms import numbers
from flexctrl.study.amplitudes import (
    Amplitude,
    Case,
    ConstantLoad,
    InitialDisplacement,
    InitialMode,
    InitialSpeed,
    Unit,
)
from flexctrl.study.giving_way import giving_way_between
from flexctrl.study.predictions import (
    CurveDifference,
    Deflection,
    FinalValue,
    Frequency,
    Peak,
    Period,
    Quantity,
    Trial,
    trial,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "ConstantLoad",
    "CurveDifference",
    "Deflection",
    "Envelope",
    "FinalValue",
    "Frequency",
    "InitialDisplacement",
    "InitialMode",
    "InitialSpeed",
    "Peak",
    "Period",
    "Trial",
    "validity_envelope",
]

_PERIODS = 2.6
_CLOSE = 2e-3
_BEFORE = 1e-5
_TRIALS = 40
_TINY = 1e-12


@frozen(eq=False)
class Envelope:
    """Up to which amplitude a linear model predicts a quantity within an error.

    Attributes
    ----------
    name : str
        Of the machine.
    quantity : Quantity
    error : float
        Relative error that is allowed.
    limit : float
        Amplitude at which it is reached; infinite if it is not up to the largest one tried.
    unit : Unit
        What the amplitude is.
    trials : tuple of Trial
        All amplitudes tried, ascending.
    until : float
        Length of the runs [s]; 0 if nothing was run.
    gives_way : bool
        Whether the machine stops bearing the load at the limit, by buckling, snapping through or fluttering, with
        an error still below what is allowed.
    """

    name: str
    quantity: Quantity
    error: float
    limit: float
    unit: Unit
    trials: tuple[Trial, ...]
    until: float
    gives_way: bool = False

    @property
    def last(self) -> Trial:
        """The trial at the limit, or the largest one."""
        near = self.limit if np.isfinite(self.limit) else self.trials[-1].amplitude
        return min(self.trials, key=lambda tried: abs(tried.amplitude - near))

    def plot(self) -> Figure:
        """Draw the error over the amplitude, and both curves at the limit.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.envelope import envelope_figure

        return envelope_figure(self)

    def __str__(self) -> str:
        percent, last = f"{100 * self.error:.3g} %", self.last
        if not np.isfinite(self.limit):
            most = f"{last.amplitude:.4g} {self.unit.symbol}"
            return f"{self.name}: the linear {self.quantity} is right within {percent} up to {self.unit.words} = {most}"
        where = f"{self.unit.words} = {self.limit:.4g} {self.unit.symbol}"
        if self.gives_way:
            right = f"the linear {self.quantity} is right within {percent} up to there"
            return f"{self.name}: the machine gives way at {where}; {right}"
        numbers = f"linear {last.predicted:.5g}, nonlinear {last.actual:.5g}"
        return f"{self.name}: the linear {self.quantity} is wrong by {percent} at {where} ({numbers})"


def validity_envelope(
    model: Model,
    vary: Amplitude,
    quantity: Quantity,
    error: float = 0.01,
    at: Rest | State | None = None,
    until: float | None = None,
    first: float | None = None,
    most: float | None = None,
    method: Integrator | None = None,
) -> Envelope:
    """Find the amplitude, speed or load from which a linear prediction is wrong by more than an error.

    The linear model answers exactly (modal exponentials), the nonlinear one by a run, by its
    equilibrium (`Deflection`) or by its linearisation about the loaded shape (`Frequency`). The amplitude grows
    from a small one until the error is exceeded, then the bracket is narrowed by the rule of false
    position on logarithms, in which the error of most predictions is straight. Under a constant load a
    `Deflection` or `Frequency` is told up to where the machine gives way at most: where its stiffness, on the path
    of equilibria from rest, stops being positive definite. Beyond, the equilibrium that the linear model is
    tangent to is one that the machine leaves.

    Parameters
    ----------
    model : Model
    vary : InitialDisplacement, InitialMode, InitialSpeed or ConstantLoad
        What is enlarged.
    quantity : Period, Peak, FinalValue, CurveDifference, Deflection or Frequency
        What is predicted; the error is relative to the linear prediction.
    error : float
        E.g. 0.01 for one per cent.
    at : Rest or State, optional
        The equilibrium to linearise about; default: found from the drawn shape.
    until : float, optional
        Length of the runs [s]; default: two and a half periods of the mode let go, else of the slowest.
    first, most : float, optional
        Where the search begins and ends; default: small and large against a radian or the machine's size.
    method : GeneralizedAlpha or AdaptiveAlpha, optional
        Of the nonlinear runs; default: generalised alpha in 1600 steps, which is right to 1e-5 of the
        period for the default length. A run that excites much faster ones wants smaller steps.

    Returns
    -------
    Envelope

    Raises
    ------
    StructureError
        For an unknown name, an error that is not positive, or a quantity the linear model does not have.
    """
    check_kind(vary, Amplitude, "validity_envelope: vary", "what is varied, as InitialSpeed('swing')")
    check_kind(quantity, Quantity, "validity_envelope: quantity", "what is told, as Period('swing')")
    if not 0.0 < numbers([error])[0] < 10.0:
        raise StructureError(f"validity_envelope: error = {error}; expected e.g. 0.01 for one per cent")
    case = _case(model, at)
    unit = vary.unit(case)
    small, large = first or unit.first, most or max(unit.most, 10.0 * (first or 0.0))
    if not 0.0 < small < large:
        raise StructureError(f"validity_envelope: amplitudes from {small} to {large}; expected 0 < first < most")
    static = isinstance(quantity, Deflection | Frequency)
    span = 0.0 if static else until or _PERIODS * 2.0 * math.pi / _pace(case, vary)
    search = _Search(case, vary, quantity, error, span, method, [])
    limit = search.limit(small, large)
    trials = tuple(sorted(search.trials, key=lambda tried: tried.amplitude))
    return Envelope(model.structure.name, quantity, error, limit, unit, trials, span, search.gave_way)


def _case(model: Model, at: Rest | State | None) -> Case:
    rest = equilibrium(model) if at is None else at
    rest = rest.let_go() if isinstance(rest, Rest) else rest
    if isinstance(rest, Rest) and rest.held:
        raise StructureError(
            f"validity_envelope: the equilibrium holds {', '.join(rest.held)}, which a run does not, and no input of "
            "the model acts on it alone: give the model one, or an equilibrium without it"
        )
    linear = linearize(model, at=rest)
    if isinstance(rest, Rest):
        return Case(model, rest.state, rest.inputs, linear)
    return Case(model, rest, np.zeros(len(model.inputs)), linear)


def _pace(case: Case, vary: Amplitude) -> float:
    """The frequency that sets the length of the runs [rad/s]."""
    if isinstance(vary, InitialMode):
        modes = case.linear.modes()
        if modes.unstable + modes.rigid < vary.number <= len(modes):
            return float(modes.omega[vary.number - 1])
    return case.slowest


@dataclass
class _Search:
    """One search under way, in logarithms of amplitude and error."""

    case: Case
    vary: Amplitude
    quantity: Quantity
    error: float
    until: float
    method: Integrator | None
    trials: list[Trial]
    gave_way: bool = False

    def excess(self, amplitude: float) -> float:
        """Logarithm of the error over what is allowed."""
        tried = trial(self.case, self.vary, self.quantity, amplitude, self.until, self.method)
        self.trials.append(tried)
        return math.log(max(tried.error, _TINY) / self.error) if np.isfinite(tried.error) else math.inf

    def limit(self, first: float, most: float) -> float:
        """Return the amplitude at which the error is what is allowed; infinite if it is less up to ``most``."""
        low, below = first, self.excess(first)
        while below > 0.0:
            low *= math.exp(-min(below, 3.0)) if np.isfinite(below) else 0.1
            if low < 1e-6 * first:
                return 0.0
            below = self.excess(low)
        growth = 2.0
        while True:
            high = min(low * growth, most)
            above = self.excess(high)
            if above >= 0.0:
                high, above = self._bearing(low, high, above)
                return high if self.gave_way else self._between(low, below, high, above)
            if high >= most:
                return math.inf
            power = max((above - below) / math.log(high / low), 0.5)
            growth = min(max(1.1 * math.exp(-above / power), 1.2), 4.0)
            low, below = high, above

    def _bearing(self, low: float, high: float, above: float) -> tuple[float, float]:
        """The upper end, or just below where the machine gives way before it, and its excess."""
        if not self.trials[-1].gave_way:
            return high, above
        critical = high * giving_way_between(self.case, self.vary.begin(self.case, high)[2])
        if not low < critical < high:
            return high, above
        above = self.excess((1.0 - _BEFORE) * critical)
        self.gave_way = above < 0.0
        return critical, above

    def _between(self, low: float, below: float, high: float, above: float) -> float:
        """Rule of false position, Illinois variant; halving where the upper end has no finite error."""
        kept = 0
        while len(self.trials) < _TRIALS:
            share = -below / (above - below) if np.isfinite(above) else 0.5
            middle = low * (high / low) ** share
            if high / low < 1.0 + _CLOSE:
                self.gave_way = not np.isfinite(above) and any(t.gave_way for t in self.trials if t.amplitude == high)
                return middle
            here = self.excess(middle)
            if abs(here) < _CLOSE:
                return middle
            if here < 0.0:
                low, below = middle, here
                above *= 0.5 if kept < 0 and np.isfinite(above) else 1.0
                kept = -1
            else:
                high, above = middle, here
                below *= 0.5 if kept > 0 else 1.0
                kept = 1
        return math.sqrt(low * high)
