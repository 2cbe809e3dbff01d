"""The nonlinear model as a state space, for python-control."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from flexctrl.errors import MechanismError, SingularMatrixError, StructureError, shortened
from flexctrl.frozen import frozen
from flexctrl.model.audit import Freedom, audit
from flexctrl.model.equilibrium import Rest
from flexctrl.model.flows import flowing
from flexctrl.model.linkages.chart import Chart
from flexctrl.model.linkages.charting import chart_of
from flexctrl.model.model import Model
from flexctrl.model.solve import factorise
from flexctrl.model.state import State

if TYPE_CHECKING:
    import control

__all__ = ["Equations", "to_nlsys"]


@frozen(eq=False)
class Equations:
    """ξ̇ = X(ξ) v,  M(ξ) v̇ = f(ξ, v, u): what python-control integrates.

    Attributes
    ----------
    chart : Chart
    free : numpy.ndarray of int
        Degrees of freedom that move and have mass: their rates are states. What is of first order (a motor's torque)
        has its rate from the others.
    placed : numpy.ndarray of int
        Chart coordinates that are states.
    """

    chart: Chart
    free: np.ndarray
    placed: np.ndarray

    @property
    def states(self) -> tuple[str, ...]:
        """Coordinates, then the rates of the degrees of freedom with mass."""
        names = self.chart.names
        return (*(names[i] for i in self.placed), *(f"{names[i]}_rate" for i in self.free))

    def coordinates(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return all chart coordinates and all rates of a state vector; what is held stays."""
        xi, v = np.zeros(len(self.chart.names)), np.zeros(self.chart.model.n)
        xi[self.placed], v[self.free] = x[: len(self.placed)], x[len(self.placed) :]
        return xi, v

    def state(self, x: np.ndarray, t: float = 0.0) -> State:
        """Return the machine's state of a state vector."""
        xi, v = self.coordinates(np.asarray(x, dtype=float))
        return self.chart.state(xi, v, t)

    def rate(self, t: float, x: np.ndarray, u: np.ndarray, params: Any = None) -> np.ndarray:
        """Return ẋ."""
        model = self.chart.model
        inputs = np.asarray(u, dtype=float).reshape(-1)[
            : len(model.inputs)
        ]  # control gives one NaN where there are none
        xi, v = self.coordinates(np.asarray(x, dtype=float))
        state = flowing(model, self.chart.state(xi, v, t), inputs)
        changed, swirl = self.chart.rate(xi, state)
        v, still = state.v, np.zeros(model.n)
        force = model.balance(state, v, still) + model.loads(state, inputs)
        mass = -model.slope(state, v, still, (0.0, 0.0, 1.0), inputs)
        if len(self.free) < model.n:
            mass, force = mass[self.free][:, self.free], force[self.free]
        pushed = factorise(mass)(force)
        return np.append(changed[self.placed], pushed + swirl[self.free])

    def output(self, t: float, x: np.ndarray, u: np.ndarray, params: Any = None) -> np.ndarray:
        """Return the outputs."""
        return self.chart.model.measure(self.state(x, t))


def to_nlsys(model: Model, at: Rest | State | None = None) -> control.NonlinearIOSystem:
    """Return a model as a state space for python-control.

    The states are coordinates of the shape, measured from the reference (displacements, rotation vectors, turns
    of hinges, source angles, torques of `MotorLag`, bristles of `LuGreFriction`; named as the model's coordinates),
    then the rates of the degrees of freedom (``…_rate``; spins in space axes) but those of first order (torques,
    bristles), which follow from the others. They agree with the states of the linear model to first order, but for
    bristles, which stand still in that. Inputs are total values, not deviations.

    Parameters
    ----------
    model : Model
    at : Rest or State, optional
        Where the coordinates are zero; default: the shape as drawn. What a `Rest` holds stays held.

    Returns
    -------
    control.NonlinearIOSystem
        Continuous; names of inputs, outputs and states are the model's.

    Raises
    ------
    StructureError
        For freedoms without mass, by name.
    MechanismError
        For a motion with neither mass nor stiffness.

    Notes
    -----
    A node whose spin about one axis is held while it may turn about the other two (``held="ry"``) wanders about
    that axis to second order: its rotation has three coordinates and the system one more state than twice the
    freedoms, which the linear model does not see (a pole at zero).

    Rotations in space reach to a full turn from the reference, those of a rigid rope to half a turn, a hinge
    on a body that itself turns about an oblique axis to half a turn of that body; about fixed axes there is
    no limit. `flexctrl.simulate` has none at all, solves massless freedoms, and is far quicker on stiff machines.
    """
    import control

    equations = equations_of(model, at)
    return control.nlsys(
        equations.rate,
        equations.output,
        inputs=list(model.inputs),
        outputs=list(model.outputs),
        states=list(equations.states),
        name=model.structure.name,
        dt=0,
    )


def equations_of(model: Model, at: Rest | State | None = None) -> Equations:
    """Return the equations behind `to_nlsys`, for drawing or for other integrators.

    Parameters
    ----------
    model : Model
    at : Rest or State, optional

    Returns
    -------
    Equations
        With ``states``, ``rate(t, x, u)``, ``output(t, x, u)`` and ``state(x)``, the machine's `State`.
    """
    if at is not None and not isinstance(at, Rest | State):
        raise StructureError(f"to_nlsys: at = {shortened(at)}; expected a Rest (from equilibrium) or a State")
    if isinstance(at, Rest) and at.brakes:
        bound = ", ".join(name for name, _ in at.brakes)
        raise StructureError(
            f"to_nlsys: the equilibrium holds {bound}, which in this model follows from other coordinates; give "
            "rest.state, and the force that holds it by an input"
        )
    reference = model.rest if at is None else at.state if isinstance(at, Rest) else at
    held = {model.coordinate(name) for name in at.held} if isinstance(at, Rest) else set()
    chart = chart_of(model, reference)
    turning = {k for r in chart.rotations for k in r.coordinates}
    first_order = set(model.motion.flows.tolist())
    free = np.array([i for i in range(model.n) if i not in held | first_order], dtype=int)
    placed = np.array([i for i in range(len(chart.names)) if i not in held or i in turning], dtype=int)
    _refuse_massless(model, at, held, first_order)
    equations = Equations(chart, free, placed)
    try:
        equations.rate(0.0, np.zeros(len(equations.states)), np.zeros(len(model.inputs)))
    except SingularMatrixError as error:
        raise StructureError(f"to_nlsys: {model.coordinates[free[error.where]]} moves no mass; {_REMEDY}") from error
    return equations


_REMEDY = (
    "a state space needs mass in every freedom. Give the part mass or rotary inertia (rhoJ, rhoI), a drive its motor's "
    "inertia or a rigid shaft (leave out ShaftElasticity); or use linearize(model).to_ss(), which condenses massless "
    "freedoms exactly, or simulate, which solves them as it goes"
)


def _refuse_massless(model: Model, at: Rest | State | None, held: set[int], flows: set[int]) -> None:
    found = audit(model, at)
    loose = [names for names in found.mechanisms if not any(model.coordinate(name) in held for name in names)]
    if loose:
        raise MechanismError(
            "to_nlsys: neither mass nor stiffness in the motion of "
            + "; of ".join(" with ".join(m) for m in loose)
            + ": hold the freedom, or give it stiffness and inertia"
        )
    kinds = (Freedom.STATIC, Freedom.RELAXING, Freedom.FALLING)
    light = [name for kind in kinds for name in found.named(kind)]
    light = [name for name in light if model.coordinate(name) not in held | flows]
    if light:
        raise StructureError(f"to_nlsys: no mass moves with {', '.join(light)}; {_REMEDY}")
