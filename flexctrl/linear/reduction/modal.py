"""Modal truncation with static correction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import ReductionError
from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.linear.modes import Modes
from flexctrl.linear.reduction.low_frequency import undamped, unsymmetric
from flexctrl.linear.reduction.result import ReducedModel, corrected
from flexctrl.linear.reduction.selection import BelowFrequency, Lowest, Selection
from flexctrl.linear.undamped import COMPLETE

__all__ = ["ModalTruncation"]

GAP = 1e-5
POOL = 8


@frozen
class ModalTruncation:
    """Keep some undamped modes: q = Φ η, η̈ + ΦᵀCΦ η̇ + Ω² η = Φᵀ B u.

    Rigid-body and unstable modes are always kept, exactly, and next to them modes 300 times slower than any other (a
    girder that spins about its own axis, free but for its mesh). With static correction, the feedthrough
    D = G(0) − G_kept(0) of the modes left out is added, so that the DC gain (with rigid-body modes: the
    constant term of the expansion at s = 0, the elastic part) is exact.

    Where the modes are uncoupled, |G − G_r| ≤ Σ |c_i b_i|/(2 ζ_i √(1 − ζ_i²) ω_i²) over the modes left out
    (plus Σ |c_i b_i|/ω_i² with static correction): the ``bound`` of the result.

    Parameters
    ----------
    keep : int or Selection
        Number of modes, rigid-body modes included, lowest first; more than the model has are not taken. Or ``Lowest``,
        ``BelowFrequency``, ``Participation``, ``DCGain``.
    static_correction : bool
        Add the static response of the modes left out.
    """

    keep: int | Selection
    static_correction: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.keep, int) and not hasattr(self.keep, "choose"):
            raise ReductionError(
                f"ModalTruncation: keep = {self.keep!r}; expected a whole number of modes, or a selection such as "
                "BelowFrequency(hz)"
            )

    def apply(self, full: LinearModel) -> ReducedModel:
        """Reduce a model.

        Parameters
        ----------
        full : LinearModel

        Returns
        -------
        ReducedModel

        Raises
        ------
        ReductionError
            If fewer modes are asked for than are rigid or unstable, or nothing is left.
        """
        rule = Lowest(self.keep) if isinstance(self.keep, int) else self.keep
        modes = _enough_modes(full, rule)
        chosen = _chosen(modes, rule)
        reduced = modal_model(full, modes, chosen)
        if self.static_correction:
            free = np.arange(modes.unstable, modes.unstable + modes.rigid + _soft(modes))
            with_free = np.union1d(chosen, free)
            zero = np.searchsorted(with_free, free)
            wider = modal_model(full, modes, with_free)
            D = corrected(full, wider, modes.shapes[:, free], np.eye(len(with_free))[:, zero]).D
            reduced = replace(reduced, D=D)
        bound = _bound(full, modes, chosen, self.static_correction)
        return ReducedModel(full, self, reduced, modes.shapes[:, chosen], modes.rigid, bound)


def _soft(modes: Modes) -> int:
    """Count flexible modes that lie so far below the next that K⁻¹ would drown the others in their rounding.

    A bent girder that spins about its own axis is one: free but for its mesh. They count as free motion here: kept
    before all others, and never part of the static correction, which would give their slow swing to all frequencies.
    """
    squared = modes.omega_squared[modes.unstable + modes.rigid :]
    gaps = np.flatnonzero(squared[:-1] < GAP * squared[1:])
    return int(gaps[-1]) + 1 if gaps.size else 0


def _enough_modes(full: LinearModel, rule: Selection) -> Modes:
    """All modes of a small model; of a large one, as many as the rule can need."""
    if unsymmetric(full):
        raise ReductionError(
            "K is not symmetric (loads follow the machine): it has no real undamped modes to keep; reduce it by "
            "BalancedTruncation or MomentMatching"
        )
    if len(full.coordinates) <= COMPLETE:
        return full.modes()
    order = getattr(rule, "order", 20)
    modes = full.modes(order if isinstance(rule, Lowest) else POOL * order)
    while isinstance(rule, BelowFrequency) and modes.omega[-1] < 2 * np.pi * rule.hz:
        modes = full.modes(2 * len(modes))
    return modes


def _chosen(modes: Modes, rule: Selection) -> np.ndarray:
    always = modes.unstable + modes.rigid
    order = getattr(rule, "order", always + len(modes))
    if order < max(always, 1):
        raise ReductionError(
            f"{order} modes asked for, but {modes.rigid} rigid-body and {modes.unstable} unstable modes are "
            f"always kept: ask for at least {max(always, 1)}"
        )
    always += min(_soft(modes), order - always)
    flexible = modes.select(np.arange(always, len(modes)))
    return np.concatenate([np.arange(always), always + rule.choose(flexible, order - always)])


def modal_model(full: LinearModel, modes: Modes, chosen: np.ndarray) -> LinearModel:
    """Projection with M = I, K = Ω² and free motion exact; a flexible mode keeps its number in the full model."""
    if not len(chosen):
        raise ReductionError("no mode is kept; ask for more modes or a higher frequency")
    first = {"unstable": 0, "rigid": modes.unstable, "flexible": modes.unstable + modes.rigid}
    label = {"unstable": "unstable", "rigid": "rigid", "flexible": "mode"}
    names = [f"{label[modes.kinds[i]]}{i - first[modes.kinds[i]] + 1}" for i in chosen]
    reduced = full.projected(modes.shapes[:, chosen], names)
    zero = slice(modes.unstable, modes.unstable + modes.rigid)
    resisted = np.ones(len(names))
    resisted[zero] = ~undamped(full, modes.shapes[:, zero])
    return replace(
        reduced,
        M=sp.identity(len(names), format="csc"),
        C=sp.csc_matrix(reduced.C.multiply(np.outer(resisted, resisted))),
        K=sp.csc_matrix(np.diag(modes.omega_squared[chosen])),
    )


def _bound(full: LinearModel, modes: Modes, chosen: np.ndarray, static_correction: bool) -> np.ndarray:
    """Σ over the modes left out of the peak of their share; infinite where dampers couple the modes."""
    shape = full.D.shape
    left = modes.select(np.setdiff1d(np.arange(len(modes)), chosen))
    if len(full.coordinates) > COMPLETE or not full._modal.classical or (left.damping <= 0).any():
        return np.zeros(shape) if not len(left) else np.full(shape, np.inf)
    zeta, omega = left.damping, left.omega
    oscillating = zeta < np.sqrt(0.5)
    peak = np.where(oscillating, 1.0 / (2 * zeta * np.sqrt(1 - np.minimum(zeta, 0.9) ** 2)), 1.0)
    if static_correction:
        peak = 1.0 + peak
    still = abs(left.output_gain) * peak / omega**2
    return (still + abs(left.output_rate_gain) / (2 * zeta * omega)) @ abs(left.input_gain)
