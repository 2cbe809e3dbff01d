"""Static equilibrium of a model, found from any start however soft."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import EquilibriumError, SingularMatrixError, StructureError
from flexctrl.model.model import Model
from flexctrl.model.motion import State
from flexctrl.model.solve import factorise

_TARGET = 1e-12
_LARGEST_TURN = 0.3
_ITERATIONS = 240


@dataclass(frozen=True)
class Rest:
    """A machine in equilibrium.

    Attributes
    ----------
    state : State
        The equilibrium; at rest.
    residual : float
        Largest unbalanced force relative to the forces at work (moments: over the size of the machine).
    outputs : dict of str to float
        The model's outputs there.
    inputs : numpy.ndarray, shape (inputs,)
        The inputs it is in equilibrium with.
    iterations : int
    held : tuple of str
        Coordinates that were held.
    """

    state: State
    residual: float
    outputs: dict[str, float]
    inputs: np.ndarray
    iterations: int
    held: tuple[str, ...] = ()


def equilibrium(
    model: Model,
    hold: Mapping[str, float] | None = None,
    inputs: Mapping[str, float] | None = None,
    start: State | None = None,
    tolerance: float = 1e-9,
) -> Rest:
    """Find the state in which a model rests under its weight and constant inputs.

    Newton's method with a shift by the masses that fades with the residual (pseudo-transient
    continuation, Kelley & Keyes 1998): where the shape has no stiffness yet, as in a slack or
    straight chain, the masses give the step its direction. If that fails, the loads come on in parts.

    Parameters
    ----------
    model : Model
    hold : mapping of str to float, optional
        Coordinates held at a displacement from the drawn shape [m or rad].
    inputs : mapping of str to float, optional
        Constant inputs; what is not named is zero.
    start : State, optional
        Where to begin; default: the shape as drawn.
    tolerance : float
        Largest relative residual that counts as equilibrium.

    Returns
    -------
    Rest

    Raises
    ------
    EquilibriumError
        If none is found: with the residual, the worst freedom by name, what to try, and the best
        state reached.
    StructureError
        For an unknown coordinate or input, or something that is no model.
    """
    if not isinstance(model, Model):
        raise StructureError(f"equilibrium: {model!r} is no Model; give what flexctrl.assemble returns")
    u = model.input_vector(inputs or {})
    held = {model.coordinate(name): value for name, value in (hold or {}).items()}
    state = _place(model, start or model.rest, held)
    search = Search(model, u, np.array(sorted(set(range(model.n)) - set(held)), dtype=int))
    best, residual, iterations = search.run(state, _ITERATIONS)
    if not residual <= tolerance + search.noise(best):
        best, residual, iterations = search.in_parts(state, tolerance)
    if not residual <= tolerance + search.noise(best):
        raise EquilibriumError(search.complaint(best, residual), best, residual)
    outputs = dict(zip(model.outputs, model.measure(best).tolist(), strict=True))
    return Rest(best, residual, outputs, u, iterations, tuple(hold or ()))


def _place(model: Model, start: State, held: Mapping[int, float]) -> State:
    step = np.zeros(model.n)
    for i, value in held.items():
        step[i] = value - start.q[i]
    return model.advance(start, step, np.zeros(model.n), 0.0)


class Search:
    """The search for one equilibrium: residuals scaled to the forces at work."""

    def __init__(self, model: Model, u: np.ndarray, free: np.ndarray) -> None:
        self.model, self.u, self.free = model, u, free
        self.zero = np.zeros(model.n)
        self.size = model.structure.size
        turning = np.array([name.endswith(("_rx", "_ry", "_rz", "_turn")) for name in model.coordinates], dtype=bool)
        self.lever = np.where(turning, self.size, 1.0)
        self.turning = turning
        mass = np.asarray(model.mass().diagonal())
        heaviest = mass[~turning].max(initial=0.0) or mass.max(initial=0.0) or 1.0
        self.kept = np.zeros(len(free))
        self.inertia = np.maximum(mass, 1e-6 * heaviest * np.where(turning, self.size**2, 1.0))
        turned = self.inertia.max(initial=1e-300) / self.size**2
        self.heaviest = float(turned if turning.all() else self.inertia[~turning].max())

    def force(self, state: State) -> np.ndarray:
        force = self.model.balance(state, self.zero, self.zero) + self.model.loads(state, self.u)
        return force[self.free] - self.kept

    def scale(self, state: State) -> float:
        """The forces at work: all loads and weights together."""
        loads = np.abs(self.model.signals.loads @ self.u).sum()
        weights = np.abs(self.model.balance(self.model.rest, self.zero, self.zero) / self.lever).sum()
        return float(max(loads, weights, np.abs(self.force(state) / self.lever[self.free]).max(initial=0.0), 1e-300))

    def noise(self, state: State) -> float:
        """The relative residual that round-off of the positions alone makes: |K| times their last digits."""
        slope = abs(self.model.slope(state, self.zero, self.zero, (1.0, 0.0, 0.0), self.u))
        reach = np.where(self.turning, 1.0, max(self.size, float(np.abs(state.x).max(initial=0.0))))
        force = (slope @ (reach * np.finfo(float).eps)) / self.lever
        return 4.0 * float(force[self.free].max(initial=0.0)) / self.scale(state)

    def relative(self, force: np.ndarray, scale: float) -> float:
        worst = np.abs(force / self.lever[self.free]).max(initial=0.0) / scale
        return float(worst) if np.isfinite(worst) else np.inf

    def step(self, state: State, force: np.ndarray, shift: float) -> np.ndarray:
        slope = -self.model.slope(state, self.zero, self.zero, (1.0, 0.0, 0.0), self.u)
        matrix = slope[self.free][:, self.free] + sp.diags(shift * self.inertia[self.free])
        step = np.zeros(self.model.n)
        step[self.free] = factorise(matrix)(force)
        limit = np.where(self.turning, _LARGEST_TURN, 0.3 * self.size)
        over = np.abs(step / limit).max(initial=0.0)
        return step / over if over > 1.0 else step

    def in_parts(self, state: State, tolerance: float) -> tuple[State, float, int]:
        """Let go of what holds the start in equilibrium part by part, in smaller parts where that fails."""
        holding, done, part, total = self.force(state), 0.0, 0.125, 0
        while done < 1.0 and part > 1e-3:
            self.kept = max(0.0, 1.0 - done - part) * holding
            trial, residual, iterations = self.run(state, _ITERATIONS // 2)
            total += iterations
            if residual <= tolerance + self.noise(trial):
                state, done, part = trial, done + part, min(1.5 * part, 1.0 - done - part)
            else:
                part *= 0.5
        self.kept = np.zeros_like(self.kept)
        return state, self.relative(self.force(state), self.scale(state)), total

    def run(self, state: State, iterations: int) -> tuple[State, float, int]:
        force = self.force(state)
        scale = self.scale(state)
        load = max(np.abs(force / self.lever[self.free]).max(initial=0.0), 1e-300)
        shift = 10.0 * load / (self.heaviest * self.size) if force.size else 0.0
        floor, here = 1e-7 * shift, self.relative(force, scale)
        best, least, stalled = state, here, 0
        for iteration in range(iterations):
            if here <= _TARGET or (stalled > 8 and least <= max(1e-9, self.noise(best))):
                return best, least, iteration
            try:
                trial = self.model.advance(state, self.step(state, force, shift), self.zero, 0.0)
            except SingularMatrixError:
                shift = 10.0 * max(shift, floor)
                continue
            pushed = self.force(trial)
            there = self.relative(pushed, scale)
            if there > 1e3 * here or not np.isfinite(there):
                shift = 10.0 * max(shift, floor)
                continue
            shift = max(shift * (0.1 if there < here else 0.3 if there < 10.0 * here else 3.0), floor)
            state, force, here = trial, pushed, there
            stalled = 0 if here < 0.7 * least else stalled + 1
            if here < least:
                best, least = state, here
        return best, least, iterations

    def complaint(self, state: State, residual: float) -> str:
        force = np.abs(self.force(state) / self.lever[self.free])
        worst = self.model.coordinates[int(self.free[int(np.argmax(force))])] if force.size else "none"
        return (
            f"no equilibrium found: relative residual {residual:.3g}, worst at {worst}. If the machine is free to "
            "move there, hold that coordinate or balance its load; else try a start nearer to the shape "
            "expected, or apply the load in parts"
        )
