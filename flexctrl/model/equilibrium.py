"""Static equilibrium of a model, found from any start however soft."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from flexctrl.errors import EquilibriumError, LinearizationError, MechanismError, StructureError, shortened
from flexctrl.frozen import frozen
from flexctrl.model.balance import Balance
from flexctrl.model.consistent import check_state, off_rails
from flexctrl.model.eased import Eased, eased
from flexctrl.model.model import Model
from flexctrl.model.overturned import bent, displaced_beyond, overturned
from flexctrl.model.places import wandered
from flexctrl.model.search import SMALLEST_PART, Found, Newton, follow
from flexctrl.model.state import State
from flexctrl.structure.freedoms import check_finite, check_number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SOFT_REACH, _NEAR = (0.3, 0.1, 0.03), 0.1
_IN_PLACE, _ASTRAY = 1e-15, 1e-12


@frozen
class Rest:
    """A machine in equilibrium.

    Attributes
    ----------
    state : State
        The equilibrium; at rest.
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
    def unstable(self) -> int:
        """Independent directions in which the machine would leave the equilibrium by itself.

        Negative pivots of the tangent stiffness of the free coordinates, as long as the loads have a potential: zero
        is statically stable, or free to move without force. Loads without one (`FollowerForce`, `FollowerTorque`,
        `Torque` about a fixed axis) make the stiffness unsymmetric, and its pivots tell nothing: there the motions
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
    that fails, the loads come on in parts.

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
        check_state(model, start, "equilibrium: start")
    begin = (start or model.rest).loose
    held |= {i: float(begin.q[i]) for i in model.motion.frozen}
    return settled(Balance(model, model.input_vector(inputs or {}), held), begin, tolerance)


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
    found = _found(balance, start.with_(v=balance.still, t=0.0), tolerance)
    if fallen := off_rails(balance.model, found.state):
        raise EquilibriumError(
            f"no equilibrium found on the rails: {fallen[0]}; hold what travels, or balance its load",
            found.state,
            found.residual,
        )
    return rest_of(balance, found)


def _held(model: Model, hold: Mapping[str, float]) -> dict[int, float]:
    if not isinstance(hold, Mapping):
        raise StructureError(f"equilibrium: hold = {shortened(hold)}; expected displacements by name of coordinate")
    return {
        model.coordinate(name): check_finite(value, f"hold {name!r}", "equilibrium") for name, value in hold.items()
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
    return Rest(found.state, residual, outputs, balance.u, found.iterations, model, held)


def _found(balance: Balance, start: State, tolerance: float) -> Found:
    """Where a start leads to; itself, if nothing is left to do there."""
    force = balance.force(start)
    if not np.isfinite(force).all():
        raise EquilibriumError("no equilibrium found: the start's own forces are not finite; start from another shape")
    ease = eased(balance, start) if force.any() or balance.astray(start) else None
    if (ease.balance if ease else balance).idle(start):
        return Found(start, balance.residual(start), 0, True, True, True)
    return _behind(ease, start, tolerance) if ease else _searched(balance, start, tolerance)


def _behind(ease: Eased, start: State, tolerance: float) -> Found:
    """The search behind eased shafts, with motors that are held turned on until the torques stay as they are."""
    found, turned, before = _searched(ease.balance, start, tolerance), np.zeros(len(ease.motors)), np.inf
    iterations = found.iterations
    while (off := ease.unheld(ease.turned(found.state) - turned)) > _IN_PLACE and off <= 0.5 * before:
        turned, before = ease.turned(found.state), off
        found = _searched(ease.holding(turned), found.state, tolerance)
        iterations += found.iterations
    if off > _ASTRAY:
        raise EquilibriumError(_not_borne(ease), found.state, found.residual)
    left = ease.holding(turned).beyond_noise(found.state)
    return replace(found, state=ease.back(found.state), residual=min(found.residual, left), iterations=iterations)


def _searched(balance: Balance, start: State, tolerance: float) -> Found:
    """The search: straight on from a shape that stands by itself, else by masses."""
    if _stands(balance, start):
        straight = Newton(balance, tolerance).run(start, 60, watch=True)
        if straight.done and straight.steady:
            return straight
        followed, share = follow(balance, start, tolerance, strict=True, watch=True)
        if not followed.done and balance.astray(start):
            followed, share = _loads_first(balance, start, followed, share, tolerance)
        if not followed.done:  # it gives way, or stays where it is and is left by itself from there on
            followed, share = follow(balance, start, tolerance, strict=True)
        if not followed.done:
            raise EquilibriumError(_gave_way(balance, followed, share), followed.state, followed.residual)
        return followed
    force = balance.force(start)
    load = max(float(np.abs(force / balance.lever[balance.free]).max(initial=0.0)), 1e-300)
    shift = 10.0 * load / (balance.heaviest * balance.size) if force.size else 0.0
    found = _softly(balance, start, shift, tolerance)
    if not found.done:
        found = follow(balance, start, tolerance, strict=False)[0]
    if shift and not (found.done and _is_meant(balance, start, found.state)):
        down = Newton(balance, tolerance, _SOFT_REACH[0], downhill=True).run(start, 240, shift)
        found = _lasting(balance, found, down)
        if not (found.done and _is_meant(balance, start, found.state)) and balance.astray(start):
            found = _lasting(balance, found, _led_there(balance, start, shift, tolerance))
    if not found.done:
        raise EquilibriumError(_complaint(balance, found), found.state, found.residual)
    return found


def _softly(balance: Balance, start: State, shift: float, tolerance: float) -> Found:
    """Where masses that fade lead to; by shorter steps where a slack cable, say, overshoots by several lengths."""
    found = Newton(balance, tolerance, _SOFT_REACH[0]).run(start, 240, shift)
    for reach in _SOFT_REACH[1:] if shift else ():
        if found.done:
            break
        found = Newton(balance, tolerance, reach).run(start, 480, shift)
    return found


def _is_meant(balance: Balance, start: State, found: State) -> bool:
    """Whether an equilibrium lasts, or the start is near it and lasts no better: else a machine would not stay."""
    ways = balance.unstable(found)
    return not ways or (balance.moved(found.q - start.q) < _NEAR and ways <= balance.unstable(start))


def _lasting(balance: Balance, one: Found, other: Found) -> Found:
    """Return the equilibrium that is left in fewer directions, if one of two is one."""
    lasts = other.done and (not one.done or balance.unstable(other.state) < balance.unstable(one.state))
    return other if lasts else one


def _led_there(balance: Balance, start: State, shift: float, tolerance: float) -> Found:
    """Where a machine comes to whose held coordinates are brought to their places by and by, under all its loads.

    A cable drawn straight whose end is held nearer is pressed straight by steps that bring the end there at once.
    """
    hung = Newton(balance.held_as(start), tolerance, _SOFT_REACH[0]).run(start, 240, shift)
    return follow(balance, hung.state, tolerance, strict=True, watch=True)[0] if hung.done else hung


def _loads_first(balance: Balance, start: State, found: Found, share: float, tolerance: float) -> tuple[Found, float]:
    """What the loads lead to first and what is held then; what was found if these do not lead on.

    Pressed together and loaded from the side at once, a column is loaded from the side too late.
    """
    here = balance.held_as(start)
    loaded = Newton(here, tolerance).run(start, 60, watch=True)
    if not (loaded.done and loaded.steady):
        loaded = follow(here, start, tolerance, strict=True, watch=True)[0]
    return follow(balance, loaded.state, tolerance, strict=True, watch=True) if loaded.done else (found, share)


def _stands(balance: Balance, start: State) -> bool:
    """Whether a start stands by itself: it resists every displacement, and the smallest part of the loads in earnest.

    A cable with next to no bending stiffness, drawn straight, would bend by a million times its length.
    """
    K = balance.slope(start)
    return balance.holds(start, K) and SMALLEST_PART * balance.moved(balance.linear_step(start, K)) <= 1.0


def _not_borne(ease: Eased) -> str:
    return (
        f"no equilibrium found behind the shafts of {ease}: beside them doubles hold nothing of what they drive, and "
        "behind softer ones it does not stay in one place; leave them out of ShaftElasticity: rigid, they differ by "
        "nothing that can be seen"
    )


def _gave_way(balance: Balance, found: Found, share: float) -> str:
    if turned := overturned(balance.model, found.state):
        return f"no equilibrium found: the loads carry the machine as far as {share:.4g} of them, where {turned}"
    return (
        f"no equilibrium found: brought on gradually, the loads carry the machine as far as {share:.4g} of them; there "
        f"it gives way, or may move freely (relative residual of the whole {found.residual:.3g}, worst at "
        f"{balance.worst(found.state)}). Follow it past that limit with flexctrl.equilibrium_path, or start near the "
        "shape expected"
    )


def _complaint(balance: Balance, found: Found) -> str:
    if turned := overturned(balance.model, found.state):
        return f"no equilibrium found: {turned}"
    loose, worst = _pushed_freely(balance, found.state), balance.worst(found.state)
    free = "If the machine is free to move there, hold that coordinate"
    if loose:
        free = f"It is free in {' and '.join(loose)}, and pushed there: hold a coordinate"
    return (
        f"no equilibrium found: relative residual {found.residual:.3g}, worst at {worst}. {free} or balance its load; "
        "else try a start nearer to the shape expected, or apply the load in parts"
    )


def _pushed_freely(balance: Balance, state: State) -> list[str]:
    """The motions of the whole machine that nothing resists but a load drives."""
    model, scale, unit = balance.model, balance.scale(state), balance.unit[balance.free]
    force = unit * balance.force(state)
    K = sp.diags(unit) @ balance.among_free(balance.slope(state)) @ sp.diags(unit)
    T = model.motion.jacobian(state)[:, balance.free]
    pushed = []
    from flexctrl.model.certify import whole_body  # brings all that modes need

    for name, motion in whole_body(T, model.motion, state):
        way = motion / unit
        size = float(np.abs(way).max())
        resisted = bool((np.abs(K @ way) > 1e-6 * (abs(K) @ np.abs(way))).any())
        if not resisted and abs(float(force @ way)) > 1e-6 * scale * size * balance.size:
            pushed.append(name)
    return pushed
