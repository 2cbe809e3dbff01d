"""Sampled models that are exact for the inputs a hold really makes, delay included."""

from __future__ import annotations

from numbers import Real
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as la

from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.linear.statespace import FirstOrder, modal_first_order

if TYPE_CHECKING:
    import control

__all__ = ["FirstOrderHold", "Hold", "ZeroOrderHold", "discretize"]

Taps = dict[int, np.ndarray]


@frozen
class ZeroOrderHold:
    """The input stays at its last sample (a digital-to-analogue converter).

    Attributes
    ----------
    delay : float
        Time from a sample to its effect, s; any multiple or fraction of the sampling time.
    """

    delay: float = 0.0

    def __post_init__(self) -> None:
        _check_delay(self.delay)


@frozen
class FirstOrderHold:
    """The input runs straight from sample to sample (exact for ramps; needs the next sample at delay 0).

    Without a delay of a sample or more the next sample acts on the state at once, so the states are z = x − H u: a run
    from z = 0 starts at x = H u₀, at rest only if the input begins at 0. From rest with another u₀ it starts at
    z = −H u₀, where at delay 0 (A − 1) H = B − Γ, Γ being the B of a `ZeroOrderHold` of the same dt.

    Attributes
    ----------
    delay : float
        s.
    """

    delay: float = 0.0

    def __post_init__(self) -> None:
        _check_delay(self.delay)


MOST_PAST = 5000
"""Past samples that a model may keep as states."""

Hold = ZeroOrderHold | FirstOrderHold


def discretize(linear: LinearModel, dt: float, hold: Hold | None = None) -> control.StateSpace:
    """Sampled state space x(t + dt) from x(t) and the samples, exact for the hold.

    Block by block in modal coordinates, by the exponential of [[A, b, 0], [0, 0, 1], [0, 0, 0]] (Van Loan
    1978); the double integrators of rigid-body motion by their own formula. A delay τ = d dt + f keeps the
    past samples it needs as states; the output at a sample instant sees the input that acts just then.

    Parameters
    ----------
    linear : LinearModel
    dt : float
        Sampling time, s.
    hold : Hold, optional
        ``ZeroOrderHold()`` if left out.

    Returns
    -------
    control.StateSpace
        With `dt`, and the names of inputs, outputs and states.

    Raises
    ------
    StructureError
        If dt is not positive or the delay is negative.
    """
    import control

    kind = ZeroOrderHold() if hold is None else hold
    if not isinstance(kind, ZeroOrderHold | FirstOrderHold):
        raise StructureError(f"hold = {hold!r}; expected ZeroOrderHold(delay) or FirstOrderHold(delay)")
    if not isinstance(dt, Real) or not 0.0 < dt < np.inf:
        raise StructureError(f"sampling time dt = {dt!r} s: give a positive number")
    if kind.delay * max(len(linear.inputs), 1) > MOST_PAST * dt:
        raise StructureError(
            f"delay = {kind.delay} s is {kind.delay / dt:.3g} samples, each a state for every input; "
            f"expected {MOST_PAST} at most: sample less often"
        )
    first = modal_first_order(linear)
    steps, part = _split_delay(kind.delay, dt)
    transition, moved, seen = _sampled(first, dt, kind, steps, part)
    A, B, C, D = _with_memory(transition, moved, seen, first.C)
    past = [f"{name}_past{j}" for j in range(1, 1 + max(*moved, *seen)) for name in linear.inputs]
    return control.ss(
        A,
        B,
        C,
        D,
        dt,
        inputs=list(linear.inputs),
        outputs=list(linear.outputs),
        states=[*first.states, *past],
        name=linear.name,
    )


def _check_delay(delay: float) -> None:
    if isinstance(delay, bool) or not isinstance(delay, Real) or not 0.0 <= delay < np.inf:
        raise StructureError(f"delay = {delay!r} s: give zero or a positive number")


def _split_delay(delay: float, dt: float) -> tuple[int, float]:
    """Whole steps and the rest, 0 ≤ rest < dt; a rest within rounding of a step is a step."""
    steps = round(delay / dt)
    if abs(delay / dt - steps) < 1e-9:
        return steps, 0.0
    steps = int(delay // dt)
    return steps, delay - steps * dt


def _sampled(first: FirstOrder, dt: float, kind: Hold, steps: int, part: float) -> tuple[np.ndarray, Taps, Taps]:
    """Transition matrix, and the weight of the sample `lag` steps ago on the next state and on the output."""
    transition = _exponential(first, dt)[0]
    rest, step_a, ramp_a = _exponential(first, dt - part)
    _, step_b, ramp_b = _exponential(first, part)
    share = part / dt
    if isinstance(kind, ZeroOrderHold):
        moved = {steps: step_a} | ({steps + 1: rest @ step_b} if part else {})
        seen = {steps + (1 if part else 0): first.D}
        return transition, moved, seen
    bend_a, bend_b = ramp_a / dt, ramp_b / dt
    moved = {steps - 1: bend_a, steps: step_a - bend_a + rest @ (step_b * (1 - share) + bend_b)}
    seen = {steps: first.D * (1 - share)}
    if part:
        moved[steps + 1] = rest @ (step_b * share - bend_b)
        seen[steps + 1] = first.D * share
    return transition, moved, seen


def _with_memory(
    transition: np.ndarray, moved: Taps, seen: Taps, output: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """State space with the past samples as states; a weight on the next sample is moved into the output."""
    n, m = next(iter(moved.values())).shape
    ahead = moved.get(-1, np.zeros((n, m)))
    zero_x, zero_y = np.zeros((n, m)), np.zeros((output.shape[0], m))
    depth = max(*moved, *seen)
    size = n + depth * m
    A, B = np.zeros((size, size)), np.zeros((size, m))
    A[:n, :n] = transition
    B[:n] = moved.get(0, zero_x) + transition @ ahead
    C = np.hstack([output, *(seen.get(j, zero_y) for j in range(1, depth + 1))])
    for j in range(1, depth + 1):
        A[:n, n + (j - 1) * m : n + j * m] = moved.get(j, zero_x)
    if depth:
        B[n : n + m] = np.eye(m)
        A[n + m :, n : size - m] = np.eye(size - n - m)
    return A, B, C, seen.get(0, zero_y) + output @ ahead


def _exponential(first: FirstOrder, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """e^(A t), its response to a unit step and to a unit ramp of each input."""
    n = len(first.A)
    transition, step, ramp = np.zeros((n, n)), np.zeros_like(first.B), np.zeros_like(first.B)
    for rows in first.blocks:
        E, S, R = _block(first.A[rows, rows], first.B[rows], t)
        transition[rows, rows], step[rows], ramp[rows] = E, S, R
    return transition, step, ramp


def _block(A: np.ndarray, B: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    if A.shape == (2, 2) and np.array_equal(A, [[0.0, 1.0], [0.0, 0.0]]):
        force = B[1]
        step = np.stack([0.5 * t * t * force, t * force])
        ramp = np.stack([t**3 / 6.0 * force, 0.5 * t * t * force])
        return np.array([[1.0, t], [0.0, 1.0]]), step, ramp
    if len(B) == 2 and not B[0].any():
        E, step, ramp = _augmented(A, np.array([[0.0], [1.0]]), t)
        return E, step @ B[1:], ramp @ B[1:]
    return _augmented(A, B, t)


def _augmented(A: np.ndarray, B: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    n, m = B.shape
    whole = np.zeros((n + 2 * m, n + 2 * m))
    whole[:n, :n], whole[:n, n : n + m] = A * t, B * t
    whole[n : n + m, n + m :] = np.eye(m)
    E = la.expm(whole)
    return E[:n, :n], E[:n, n : n + m], E[:n, n + m :] * t
