"""Static equilibrium of a model, found from any start however soft."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.errors import EquilibriumError, LinearizationError, MechanismError, StructureError, shortened
from flexctrl.frozen import frozen
from flexctrl.model.balance import Balance
from flexctrl.model.built_up import borne_by_motors
from flexctrl.model.consistent import admitted, off_rails
from flexctrl.model.holding import coordinate_held
from flexctrl.model.model import Model
from flexctrl.model.overturned import bent, displaced_beyond, overturned
from flexctrl.model.places import wandered
from flexctrl.model.search import Found
from flexctrl.model.seeking import found
from flexctrl.model.state import State
from flexctrl.structure.freedoms import check_finite, check_number

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@frozen
class Rest:
    """A machine in equilibrium.

    Attributes
    ----------
    state : State
        The equilibrium; at rest. A motor that is held and lags (`MotorLag`) has built up the torque that holds it.
    residual : float
        Largest unbalanced force relative to the forces at work (moments: over the size of the machine); 0 where
        it is lost in the round-off of the positions.
    outputs : dict of str to float
        The model's outputs there.
    inputs : numpy.ndarray, shape (inputs,)
        The inputs it is in equilibrium with.
    iterations : int
    model : Model
    held : tuple of str
        What was held: coordinates, and freedoms that in this model follow from others (a motor behind a rigid shaft).
    brakes : tuple of (str, float)
        The forces that hold such freedoms [N or N m], by the names in ``held``; linear models bear them.
    """

    state: State
    residual: float
    outputs: dict[str, float]
    inputs: np.ndarray
    iterations: int
    model: Model = field(repr=False)
    held: tuple[str, ...] = ()
    brakes: tuple[tuple[str, float], ...] = ()

    @cached_property
    def holding(self) -> dict[str, float]:
        """The forces that hold what is held, by the names in ``held`` [N or N m].

        An input that acts on it alone bears it by as much: a motor's torque what holds ``<drive>_source``.
        """
        from flexctrl.model.braked import bearing  # which makes such equilibria

        numbers = {name: self.model.coordinate(name) for name in self.held if name in self.model.coordinates}
        force = Balance(bearing(self), self.inputs).whole_force(self.state.loose)
        return {name: -float(force[i]) for name, i in numbers.items()} | dict(self.brakes)

    def let_go(self) -> Rest:
        """Return this equilibrium with what is held borne by inputs instead, as runs and loops about it need it.

        Returns
        -------
        Rest
            Its ``inputs`` have the holding forces in them. What no input acts on by itself is held still.
        """
        from flexctrl.model.letting_go import let_go

        return let_go(self)

    @cached_property
    def unstable(self) -> int:
        """Independent directions in which the machine would leave the equilibrium by itself.

        Those of negative tangent stiffness of the free coordinates, as long as the loads have a potential: zero
        is statically stable, or free to move without force. Loads without one (`FollowerForce`, `FollowerTorque`,
        `Torque` about a fixed axis) make the stiffness unsymmetric, and its signs tell nothing: there the motions
        that grow are counted by their poles, whether they diverge or flutter. Worked out when asked for.

        Raises
        ------
        LinearizationError, MechanismError
            Under loads without a potential, if the poles cannot be told: beyond 1000 freedoms, for a motion with
            neither mass nor stiffness, or where massless freedoms are damped.
        """
        from flexctrl.model.braked import balance_of
        from flexctrl.model.stability import leaving  # brings all that modes need

        return leaving(balance_of(self), self.state)

    @property
    def stable(self) -> bool:
        """Whether no small disturbance alone makes the machine leave, be it by divergence or by flutter."""
        return self.unstable == 0

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to be said of it.

        An element that bends by more than a radian, which is too far for one; and that it does not last, where
        ``unstable`` tells so.
        """
        said = bent(self.model, [self.state]) if self.model.large else ""
        return tuple(note for note in (said, self._fleeting) if note)

    @property
    def _fleeting(self) -> str:
        """What is to be said of an equilibrium that the machine leaves by itself."""
        try:
            ways = self.unstable
        except (LinearizationError, MechanismError):  # nobody can tell
            ways = 0
        if not ways:
            return ""
        return (
            f"it does not last: the machine would leave it by itself in {ways} independent "
            f"direction{'s' * (ways > 1)}; if another one was meant, start nearer to that, or bring on what is held in "
            "parts, from one equilibrium to the next"
        )

    def plot(self) -> Figure:
        """Draw the machine at rest over the machine as drawn; small displacements are enlarged.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.overview import rest_figure

        return rest_figure(self)


def equilibrium(
    model: Model,
    hold: Mapping[str, float] | None = None,
    inputs: Mapping[str, float] | None = None,
    start: State | None = None,
    tolerance: float = 1e-9,
) -> Rest:
    """Find the state in which a model rests under its weight and constant inputs.

    Newton's method with predicted stresses (Magisano, Leonetti & Garcea 2017), whose number of iterations does
    not depend on how stiff the machine is along its members. A start that stands by itself leads only to what
    the loads, brought on gradually, lead it to: if the machine gives way before, there is no equilibrium, and
    the error says at which part of the load. Elsewhere (a slack or straight chain, whose shape has no stiffness
    yet) the masses give the step its direction: pseudo-transient continuation (Kelley & Keyes 1998), and if
    that fails, the loads come on in parts. `Rotation` outputs then show no whole turns from the way there, but where
    drives, beams or what is held count them.

    Parameters
    ----------
    model : Model
    hold : mapping of str to float, optional
        Coordinates held at a displacement from the drawn shape [m or rad], as `Model.displace` takes it: of a node that
        turns about several axes these are components of its rotation vector.
    inputs : mapping of str to float, optional
        Constant inputs; what is not named is zero.
    start : State, optional
        Where to begin; default: the shape as drawn.
    tolerance : float
        Largest relative residual that counts as equilibrium.

    Returns
    -------
    Rest
        ``unstable`` says whether it is one that lasts.

    Raises
    ------
    EquilibriumError
        If none is found: with the residual, the worst freedom by name, what to try, and the best
        state reached. So it is where rigid parts that were drawn in line would come apart.
    StructureError
        For an unknown coordinate or input, or something that is no model.
    """
    if not isinstance(model, Model):
        raise StructureError(f"equilibrium: {shortened(model)} is no Model; give what flexctrl.assemble returns")
    check_number(tolerance, "tolerance", "equilibrium", above=0.0)
    held = _held(model, hold or {})
    if start is not None:
        if not isinstance(start, State):
            raise StructureError(f"equilibrium: start = {shortened(start)}; expected a State (rest.state, run.final)")
        start = admitted(model, start, "equilibrium: start")
    begin = (start or model.rest).loose
    held |= {i: float(begin.q[i]) for i in model.motion.frozen}
    return motors_bearing(settled(Balance(model, model.input_vector(inputs or {}), held), begin, tolerance))


def motors_bearing(rest: Rest) -> Rest:
    """Return an equilibrium in which motors that lag have built up the torques that hold them.

    Parameters
    ----------
    rest : Rest

    Returns
    -------
    Rest
    """
    return replace(rest, state=borne_by_motors(rest.model, rest.state, rest.holding)) if rest.held else rest


def settled(balance: Balance, start: State, tolerance: float = 1e-9) -> Rest:
    """Return the equilibrium that a start leads to.

    Parameters
    ----------
    balance : Balance
    start : State
    tolerance : float

    Returns
    -------
    Rest

    Raises
    ------
    EquilibriumError
        As `equilibrium`.
    """
    there = found(balance, start.with_(v=balance.still, t=0.0), tolerance)
    if fallen := off_rails(balance.model, there.state):
        raise EquilibriumError(
            f"no equilibrium found on the rails: {fallen[0]}; hold what travels, or balance its load",
            there.state,
            there.residual,
        )
    return rest_of(balance, there)


def _held(model: Model, hold: Mapping[str, float]) -> dict[int, float]:
    if not isinstance(hold, Mapping):
        raise StructureError(f"equilibrium: hold = {shortened(hold)}; expected displacements by name of coordinate")
    return {
        coordinate_held(model, name): check_finite(value, f"hold {name!r}", "equilibrium")
        for name, value in hold.items()
    }


def rest_of(balance: Balance, found: Found) -> Rest:
    """Return what a search found as an equilibrium."""
    model = balance.model
    outputs = dict(zip(model.outputs, model.measure(found.state).tolist(), strict=True))
    held = tuple(model.coordinates[i] for i in balance.held)
    residual = min(found.residual, balance.beyond_noise(found.state))
    beyond = displaced_beyond(model, found.state.q) if balance.held else ""
    if not (beyond or np.isfinite(model.energy(found.state)).all()):
        beyond = overturned(model, found.state)
    if apart := beyond or model.apart(found.state) or wandered(model, found.state):
        raise EquilibriumError(f"no equilibrium found: {apart}", found.state, residual)
    state = replace(found.state, freedoms=model.coordinates)
    return Rest(state, residual, outputs, balance.u, found.iterations, model, held)
