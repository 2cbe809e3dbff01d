"""The spillover certificate: which gain of a controller destabilises which part of a flexible machine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import TYPE_CHECKING, Any

import numpy as np

from flexctrl.design.controller import LinearController
from flexctrl.errors import EquilibriumError, StructureError
from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.model.assemble import rigid
from flexctrl.model.braked import places_held, rest_held
from flexctrl.model.equilibrium import Rest, equilibrium
from flexctrl.model.linearize import linearize
from flexctrl.model.model import Model
from flexctrl.model.state import State
from flexctrl.structure.freedoms import numbers
from flexctrl.structure.inputs import MotorTorque
from flexctrl.study.broken_loop import linear_law
from flexctrl.study.critical_mode import CriticalMode, critical_mode
from flexctrl.study.gain_family import Crossing, GainFamily, first_crossing, gain_family

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from flexctrl.study.confirm import Confirmation

__all__ = ["Spillover", "spillover"]

_RATIO = np.log(1.4)
_BRANCH = 60


@frozen(eq=False)
class Spillover:
    """How much of its gain a controller may have on a machine, and what goes unstable beyond.

    Attributes
    ----------
    gain : float
        Critical factor k* on the loop gain: stable just below, unstable just above. Infinite if the loop stays
        stable up to ``searched[1]``, 0 if no stable gain was found.
    lower : float
        The loop is stable from here up to ``gain``, and unstable just below: 0 if it stays stable down to
        ``searched[0]``. A machine that falls over by itself needs some gain.
    mode : CriticalMode or None
        What goes unstable at ``gain``; None if nothing does. At gain 0 the worst mode at the controller's own gain.
    rigid_gain : float or None
        The same critical gain on the rigid twin; None if the plant was a linear model.
    searched : tuple of float
        Range of gains.
    gains : numpy.ndarray, shape (m,)
        Gains along the branch of the critical mode.
    branch : numpy.ndarray of complex, shape (m,)
        Its poles s there [1/s].
    linear : LinearModel
    law : LinearController
        The controller without references, limits, rounding and noise.
    plant : Model or None
    at : State or None
        The equilibrium the linear model belongs to.
    inputs : numpy.ndarray
        Its constant inputs.
    """

    gain: float
    lower: float
    mode: CriticalMode | None
    rigid_gain: float | None
    searched: tuple[float, float]
    gains: np.ndarray
    branch: np.ndarray
    linear: LinearModel = field(repr=False)
    law: LinearController = field(repr=False)
    plant: Model | None = field(repr=False)
    at: State | None = field(repr=False)
    inputs: np.ndarray = field(repr=False)

    @property
    def stable(self) -> bool:
        """Whether the machine is stable under the controller as it is."""
        return self.lower < 1.0 < self.gain

    def confirm(self, margin: float = 0.02) -> Confirmation:
        """Run the nonlinear machine just below and above the critical gain; see `flexctrl.study.confirm.confirm`.

        Parameters
        ----------
        margin : float
            Relative distance from the critical gain.
        """
        from flexctrl.study.confirm import confirm

        return confirm(self, margin)

    def plot(self, confirmation: Confirmation | None = None) -> Figure:
        """Draw the critical mode's damping over the gain, and where its energy is.

        Parameters
        ----------
        confirmation : Confirmation, optional
            From `confirm`: its runs are drawn too.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.spillover import spillover_figure

        return spillover_figure(self, confirmation)

    def __str__(self) -> str:
        return "\n".join([f"{self.linear.name} {self._verdict()}", *self._twin()])

    def _verdict(self) -> str:
        where = _where(self.mode) if self.mode is not None else ""
        if self.gain == 0.0:
            low, high = self.searched
            return f"is unstable at every gain from {low:.3g} to {high:.4g} × the controller's, {where}"
        if self.lower >= 1.0:
            return f"is unstable: it needs {self.lower:.4g} × the controller's gain{self._beyond(where)}"
        below = f"; below {self.lower:.4g} × it is unstable too" if self.lower else ""
        if self.mode is None:
            return f"stays stable up to {self.searched[1]:.4g} × the controller's gain{below}"
        if self.gain < 1.0:
            return f"is unstable: it bears only {self.gain:.4g} × the controller's gain; beyond, it goes {where}{below}"
        return f"goes unstable at {self.gain:.4g} × the controller's gain, {where}{below}"

    def _beyond(self, where: str) -> str:
        return f", and bears no more than {self.gain:.4g} ×; beyond, it goes {where}" if where else ""

    def _twin(self) -> list[str]:
        if self.rigid_gain is None:
            return []
        if self.rigid_gain == np.inf:
            return [f"its rigid twin stays stable up to {self.searched[1]:.4g} ×"]
        return [f"its rigid twin {'is never stable' if not self.rigid_gain else f'bears {self.rigid_gain:.4g} ×'}"]


def _where(mode: CriticalMode) -> str:
    how = f"at {mode.frequency_hz:.4g} Hz" if mode.frequency_hz else "without oscillating"
    if not mode.lives_in:
        return f"{how}, out of mode {mode.origin.number}"
    kinetic, at_kinetic = _home(mode.kinetic_shares)
    if not any(mode.strain_shares.values()):
        return f"{how}, in the mode that lives in {kinetic} ({at_kinetic} of kinetic energy)"
    strained, at_strained = _home(mode.strain_shares)
    there = "" if kinetic == strained else f" in {kinetic}"
    return (
        f"{how}, in the mode that lives in {strained} ({at_strained} of strain energy, {at_kinetic} of kinetic{there})"
    )


def _home(shares: Mapping[str, float]) -> tuple[str, str]:
    """The part with the largest share, with all that have the same; and how much each has."""
    most = max(shares.values())
    names = [name for name, share in shares.items() if share > 0.99 * most]
    return " and ".join(names), f"{100 * most:.0f} %" + (" each" if len(names) > 1 else "")


def spillover(
    plant: Model | LinearModel,
    controller: Any,
    at: Rest | State | None = None,
    least: float = 1e-3,
    most: float = 1e3,
) -> Spillover:
    """Find the gain at which a controller destabilises a flexible machine, and the part that gives way.

    The loop gain is scaled from the controller's own (1) up until an eigenvalue of the closed loop leaves the
    stable half plane (the unit circle under a sampled controller, with the machine sampled exactly); if the loop
    is unstable at 1, from the first stable gain below, or else above. The scan goes down from there too, for
    machines that are stable under some gain only. Modes are followed from gain to gain by their eigenvalues
    and slopes, and the critical gain is finished by Newton's method.

    Parameters
    ----------
    plant : Model or LinearModel
    controller : Controller or python-control system
        Typically designed on the rigid twin; continuous or sampled; signals by name, its minus sign inside.
        References, limits, rounding and noise in it play no part.
    at : Rest or State, optional
        Equilibrium of a model; default: found from the drawn shape. What it holds is let go of, borne by the inputs
        that act on it alone (`Rest.let_go`). The twin holds the same, or else is balanced under the same inputs;
        where these do not bear it (its ropes do not stretch), with its motors at the same angles.
    least, most : float
        Range of gains to search, ``least < 1 < most``.

    Returns
    -------
    Spillover

    Raises
    ------
    StructureError
        For an empty range, an unknown signal, an output that depends directly on an input, or an input that acts on
        nothing but what the equilibrium holds.
    EquilibriumError
        If the twin has none.
    ControllerError
        If the controller is not linear.
    """
    if not 0.0 < numbers([least])[0] < 1.0 < numbers([most])[0]:
        raise StructureError(f"spillover: gains from {least} to {most}; expected 0 < least < 1 < most")
    law = linear_law(controller)
    if isinstance(plant, LinearModel):
        return _certificate(plant, law, (least, most), None, None, np.zeros(len(plant.inputs)), None)
    rest = equilibrium(plant) if at is None else at
    free = rest.let_go() if isinstance(rest, Rest) else rest
    u = free.inputs if isinstance(free, Rest) else np.zeros(len(plant.inputs))
    linear = linearize(plant, at=free)
    _refuse_idle(linear, law)
    twin = _twin_rest(plant, rest)
    bears = _critical(gain_family(linearize(twin.model, at=twin), law), (least, most))[1]
    state = rest.state if isinstance(rest, Rest) else rest
    return _certificate(linear, law, (least, most), plant, state, u, bears)


def _refuse_idle(linear: LinearModel, law: LinearController) -> None:
    assert linear.certificate is not None
    if idle := sorted({*linear.certificate.idle} & {*law.outputs}):
        raise StructureError(
            f"spillover: the equilibrium holds all that the controller's {', '.join(idle)} acts on, so that no gain "
            "does anything; give one that leaves some of it free"
        )


def _twin_rest(model: Model, rest: Rest | State) -> Rest:
    """The rigid twin's equilibrium."""
    twin = rigid(model)
    assert isinstance(twin, Model)
    try:
        return _twin_held(twin, rest) if isinstance(rest, Rest) else equilibrium(twin)
    except EquilibriumError as error:
        message = f"spillover: the rigid twin: {error}. Give spillover the linear model to do without the twin"
        raise EquilibriumError(message, error.state, error.residual) from None


def _twin_held(twin: Model, rest: Rest) -> Rest:
    """The same is held, or else the same inputs bear the twin, or as many as hold its motors where they are."""
    inputs = dict(zip(rest.model.inputs, rest.inputs.tolist(), strict=True))
    if rest.held:
        return rest_held(twin, places_held(rest, rest.held), inputs).let_go()
    try:
        return equilibrium(twin, inputs=inputs)
    except EquilibriumError:
        bearing = [i for i in twin.structure.inputs if isinstance(i, MotorTorque) and inputs[i.name]]
        if not bearing:
            raise
        held = places_held(rest, [f"{i.drive}_source" for i in bearing])
        return rest_held(twin, held, inputs | {i.name: 0.0 for i in bearing}).let_go()


def _critical(family: GainFamily, searched: tuple[float, float]) -> tuple[float, float, Crossing | None]:
    """Ends of the stable interval and the crossing at the upper; for no such interval, the worst pole at gain 1."""
    inside = _stable_gain(family, searched)
    if not inside:
        first = family.at(1.0)
        return 0.0, 0.0, Crossing(first, first.worst)
    lower, upper = (first_crossing(family, inside, end) for end in searched)
    return 0.0 if lower is None else lower.gain, np.inf if upper is None else upper.gain, upper


def _stable_gain(family: GainFamily, searched: tuple[float, float]) -> float:
    """The first stable gain from 1 on downwards, then upwards; 0 if there is none."""
    least, most = searched
    down = np.append(np.exp(-np.arange(0.0, -np.log(least), _RATIO)), least)
    up = np.append(np.exp(np.arange(_RATIO, np.log(most), _RATIO)), most)
    return next((float(gain) for gain in (*down, *up) if family.at(gain).stable), 0.0)


def _certificate(
    linear: LinearModel,
    law: LinearController,
    searched: tuple[float, float],
    plant: Model | None,
    at: State | None,
    u: np.ndarray,
    twin: float | None,
) -> Spillover:
    family = gain_family(linear, law)
    lower, gain, crossing = _critical(family, searched)
    empty = np.zeros(0)
    if crossing is None:
        return Spillover(gain, lower, None, twin, searched, empty, empty, linear, law, plant, at, u)
    gains, branch = _branch(family, crossing, searched)
    mode = critical_mode(linear, law, family, crossing, complex(np.interp(1.0, gains, branch)))
    return Spillover(gain, lower, mode, twin, searched, gains, branch, linear, law, plant, at, u)


def _branch(family: GainFamily, crossing: Crossing, searched: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Follow the critical pole to lower gains, at least to 1, and a little beyond."""
    center = crossing.gain
    low, high = max(searched[0], min(0.03 * center, 0.3)), max(1.3 * center, 1.001)
    wanted = np.unique([*np.geomspace(low, center, _BRANCH), *np.geomspace(center, high, _BRANCH // 3), 1.0])
    found = {center: complex(crossing.spectrum.poles[crossing.pole])}
    for way in (wanted[wanted < center][::-1], wanted[wanted > center]):
        here, pole = crossing.spectrum, crossing.pole
        for gain in way:
            here, pole = family.followed(here, pole, float(gain))
            found[float(gain)] = complex(here.poles[pole])
    gains = np.array(sorted(found))
    return gains, np.array([family.continuous(found[gain]) for gain in gains])
