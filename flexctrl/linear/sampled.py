"""Responses of large models whatever damps them: a small space that holds the answer, its error estimated at each s."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from flexctrl.linear.condense import Scaled
from flexctrl.linear.direct import direct_transfer, infinite, state_at
from flexctrl.linear.modes import Modes
from flexctrl.linear.sampled_space import grown, metric_of, started

__all__ = ["sampled_transfer"]

TOGETHER = 3
SAMPLES = 8
FEW = 24
MOST_COLUMNS = 400
_ROUNDING = 1e-9

Evaluator: TypeAlias = "Callable[[np.ndarray], np.ndarray]"


def sampled_transfer(base: Scaled, modes: Modes, top: float) -> Callable[[np.ndarray], np.ndarray]:
    """Galerkin projection on modes, static solutions and solutions at some s, until the error is small at all s.

    The space starts with the modes given and P⁻¹ B, P = sym(K + a C + a² M), a > 0. For each s asked for, the
    residual r = B − (K + s C + s² M) x is known from its share in a few fixed vectors. It is orthogonal to the space;
    its effect on an output c is what P⁻¹ r makes the space do through C and M, solved for, and at most
    2 |c|_P⁻¹ |r|_P⁻¹ outside of it, where no pole is near. Where this exceeds 2e-10 of |H|, the worst s are solved by
    sparse factors and join the space (a rational Krylov space with greedy points: S. Gugercin, A. Antoulas,
    C. Beattie, SIAM J. Matrix Anal. Appl. 30 (2008) 609–638; errors as in reduced-basis methods: G. Rozza, D. Huynh,
    A. Patera, Arch. Comput. Methods Eng. 15 (2008) 229–275).
    What a space of 400 vectors does not bring under the bound is solved one by one; so are a few s alone.

    Parameters
    ----------
    base : Scaled
        In coordinates with free motion apart.
    modes : Modes
        The lowest of the same model, past `top`.
    top : float
        Largest |s|, rad/s: it sets the scale of a.

    Returns
    -------
    callable
        s of shape (N,) to H of shape (n_outputs, n_inputs, N).
    """
    count = base.model.B.shape[1]
    direct = direct_transfer(base)
    evaluators: list[Evaluator] = []

    def evaluate(s: np.ndarray) -> np.ndarray:
        s = np.asarray(s, dtype=complex)
        if not evaluators and s.size <= FEW:
            return direct(s) if s.all() else _with_rest(base, modes, direct, s)
        if not evaluators:
            few = [_through(base, np.arange(i, min(i + TOGETHER, count))) for i in range(0, count, TOGETHER)]
            evaluators.extend(_of_few_inputs(part, modes, top) for part in few)
        return _with_rest(base, modes, lambda z: np.concatenate([one(z) for one in evaluators], axis=1), s)

    return evaluate if count else direct


def _through(base: Scaled, inputs: np.ndarray) -> Scaled:
    model = base.model
    names = tuple(model.inputs[i] for i in inputs)
    return replace(base, model=replace(model, B=model.B[:, inputs], D=model.D[:, inputs], inputs=names))


def _touched(rows: np.ndarray, rigid: np.ndarray) -> bool:
    """Tell whether free motion is seen by some row, or pushed, beyond the rounding of its shapes."""
    return bool((np.abs(rows @ rigid) > _ROUNDING * (np.abs(rows) @ np.abs(rigid))).any())


def _with_rest(base: Scaled, modes: Modes, evaluate: Evaluator, s: np.ndarray) -> np.ndarray:
    """The values, at s = 0 those of the expansion there: finite where free motion is not pushed or not seen."""
    from flexctrl.linear.reduction.low_frequency import low_frequency  # its package needs responses

    still = s == 0
    if not (still.any() and modes.rigid):
        return evaluate(s)
    rigid = modes.shapes[:, modes.unstable : modes.unstable + modes.rigid] / base.scales[:, None]
    model = base.model
    if _touched(model.Cq, rigid) and _touched(model.B.T, rigid):
        raise infinite(0.0, "the model")
    values = np.empty((*model.D.shape, s.size), dtype=complex)
    values[..., ~still] = evaluate(s[~still])
    values[..., still] = low_frequency(model, rigid).constant[:, :, None]
    return values


def _of_few_inputs(base: Scaled, modes: Modes, top: float) -> Evaluator:
    state, direct = state_at(base.model), direct_transfer(base)
    metric = metric_of(base.model, _shift(modes, top))
    if metric is None:
        return direct
    space = started(metric, modes.shapes / base.scales[:, None])

    def evaluate(s: np.ndarray) -> np.ndarray:
        nonlocal space
        values, miss = space.values(s)
        while np.count_nonzero(left := ~(miss <= 1.0)) > SAMPLES:
            size = space.V.shape[1]
            found = np.hstack([state(complex(z)) for z in s[_worst(s, miss)]])
            space = grown(space, np.hstack([found.real, found.imag]))
            values[..., left], miss[left] = space.values(s[left])
            if not size < space.V.shape[1] <= MOST_COLUMNS:
                break
        left = ~(miss <= 1.0)
        values[..., left] = direct(s[left])
        return values

    return evaluate


def _shift(modes: Modes, top: float) -> float:
    """A real a > 0 about as large as the slowest poles, right of all of them."""
    lowest = float(modes.omega[modes.flexible].min(initial=np.inf))
    return max(min(lowest, top), 0.01 * top, 2.0 * float(modes.growth.max(initial=0.0)))


def _worst(s: np.ndarray, miss: np.ndarray) -> list[int]:
    """Some of the worst points, apart from each other."""
    bad = np.flatnonzero(~(miss <= 1.0))
    place = np.empty(s.size)
    place[bad[np.argsort(np.abs(s[bad]))]] = np.arange(bad.size)
    chosen: list[int] = []
    for i in bad[np.argsort(-miss[bad])]:
        if all(abs(place[i] - place[j]) > bad.size / (2 * SAMPLES) for j in chosen):
            chosen.append(int(i))
        if len(chosen) == SAMPLES:
            break
    return chosen
