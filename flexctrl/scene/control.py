"""Moves, feedback laws and hardware in a scene file."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import field

import numpy as np

from flexctrl.design.controller import Controller, LinearController, as_controller
from flexctrl.design.feedback import FilteredRate, check_rate, pid, state_feedback
from flexctrl.design.hardware import AntiWindup, Delayed, Noisy, Quantised, RateLimited, Sampled, Saturated
from flexctrl.design.optimal import bryson, lqr
from flexctrl.design.piecewise import Constant, PiecewisePolynomial, Trajectory, simplified
from flexctrl.design.shaper import Shaper
from flexctrl.design.shaping import Shaped
from flexctrl.design.tracking import Together, Tracking
from flexctrl.errors import SceneError, StructureError, did_you_mean
from flexctrl.frozen import frozen
from flexctrl.scene.scene import Plan, Scene
from flexctrl.structure.drives import Drive


@frozen
class Move:
    """A command by itself: a path in time, shaped or not.

    Attributes
    ----------
    path : Trajectory
    shaper : Shaper or None
    """

    path: Trajectory
    shaper: Shaper | None = None

    def times(self, factor: float) -> Trajectory:
        """Return the command in other units."""
        path = _scaled(self.path, factor)
        return path if self.shaper is None else Shaped(path, self.shaper)


def _scaled(path: Trajectory, factor: float) -> Trajectory:
    if factor == 1.0:
        return path
    if isinstance(path, Constant):
        return Constant(factor * path.value)
    pieces = simplified(path)
    assert isinstance(pieces, PiecewisePolynomial)
    rows = tuple(tuple(factor * c for c in row) for row in pieces.coefficients)
    return PiecewisePolynomial(pieces.knots, rows, factor * pieces.before)


@frozen
class Reference:
    """What a measured signal is to follow.

    Attributes
    ----------
    move : Move
    through : str
        Name of a drive whose motor angle per unit of its motion multiplies the move; empty: none.
    rate : bool
        Whether the signal follows the move's rate.
    """

    move: Move
    through: str = ""
    rate: bool = False

    def signal(self, scene: Scene) -> Trajectory:
        """Return the command in the signal's own units."""
        path = self.move.times(_gear(scene, self.through))
        return path.derivative if self.rate else path


def _gear(scene: Scene, drive: str) -> float:
    if not drive:
        return 1.0
    found = scene.structure.part(drive)
    if not isinstance(found, Drive):
        known = [d.name for d in scene.structure.drives]
        raise StructureError(f"reference through {drive!r}: that is no drive{did_you_mean(drive, known)}")
    return found.effective_ratio


class Law(ABC):
    """A continuous feedback law and what it follows."""

    @abstractmethod
    def build(self, scene: Scene) -> Controller:
        """Return the law, continuous, with its references bound."""


@frozen
class PID(Law):
    """u = kp (r − y) + ki ∫(r − y) + kd (ṙ − ẏ).

    Attributes
    ----------
    measured, command : str
    kp, ki, kd : float
    rate : str or FilteredRate
        Signal of ẏ, or how it is got from y.
    reference : Reference or None
        Left out: y is kept at 0.
    limit : float
        The integral stops while |u| is beyond; infinite: it never stops.
    """

    measured: str
    command: str
    kp: float
    ki: float = 0.0
    kd: float = 0.0
    rate: str | FilteredRate = field(default_factory=lambda: FilteredRate(0.01))
    reference: Reference | None = None
    limit: float = np.inf

    def __post_init__(self) -> None:
        check_rate(self.measured, self.rate, "PID")

    def build(self, scene: Scene) -> Controller:
        """Return the law."""
        law = pid(self.kp, self.ki, self.kd, measured=self.measured, rate=self.rate, command=self.command)
        inner = law if np.isinf(self.limit) else AntiWindup(law, {self.command: self.limit})
        if self.reference is None:
            return as_controller(inner)
        path = self.reference.signal(scene)
        follow = {self.measured: path} | ({self.rate: path.derivative} if isinstance(self.rate, str) else {})
        return Tracking(inner, {name: p for name, p in follow.items() if name in as_controller(inner).inputs})


@frozen
class StateFeedback(Law):
    """u = −K (x − x_r), K by LQR on the rigid twin about its equilibrium, x read from measured signals.

    Attributes
    ----------
    largest : mapping of str to float
        Output → largest acceptable deviation (Bryson's rule).
    effort : mapping of str to float
        Input → largest acceptable command; these inputs are commanded.
    reads : tuple of str
        Outputs that tell the twin's states.
    references : mapping of str to Reference
        Others stay at their value at rest.
    """

    largest: Mapping[str, float]
    effort: Mapping[str, float]
    reads: tuple[str, ...]
    references: Mapping[str, Reference] = field(default_factory=dict)

    def build(self, scene: Scene) -> Controller:
        """Design the gain and return the law."""
        outputs = tuple(dict.fromkeys((*self.reads, *self.largest)))
        plant = scene.twin_linear.select(tuple(self.effort), outputs).to_ss()
        gain = lqr(plant, *bryson(plant, self.largest, self.effort)).gain
        law = state_feedback(gain, plant[list(self.reads), :])
        at_rest = scene.twin_rest.outputs
        follow: dict[str, Trajectory] = {name: Constant(at_rest[name]) for name in self.reads if at_rest[name]}
        return Tracking(law, follow | {name: r.signal(scene) for name, r in self.references.items()})


@frozen
class Gains(Law):
    """u = Σ g (y − r), gains as given.

    Attributes
    ----------
    gains : mapping of str to mapping of str to float
        Input → output → g, with its sign (negative for negative feedback).
    references : mapping of str to Reference
    """

    gains: Mapping[str, Mapping[str, float]]
    references: Mapping[str, Reference] = field(default_factory=dict)

    def build(self, scene: Scene) -> Controller:
        """Return the law."""
        reads = tuple(dict.fromkeys(name for row in self.gains.values() for name in row))
        D = np.array([[row.get(name, 0.0) for name in reads] for row in self.gains.values()])
        n, m = D.shape
        law = LinearController(np.zeros((0, 0)), np.zeros((0, m)), np.zeros((n, 0)), D, reads, tuple(self.gains))
        return Tracking(law, {name: r.signal(scene) for name, r in self.references.items()})


@frozen
class Transfer(Law):
    """u = C(s) (r − y), C(s) = num/den in falling powers of s.

    Attributes
    ----------
    measured, command : str
    num, den : tuple of float
    reference : Reference or None
    """

    measured: str
    command: str
    num: tuple[float, ...]
    den: tuple[float, ...]
    reference: Reference | None = None

    def build(self, scene: Scene) -> Controller:
        """Return the law."""
        import control

        negative = [-c for c in self.num]
        law = control.tf(negative, list(self.den), inputs=[self.measured], outputs=[self.command])
        return Tracking(law, {} if self.reference is None else {self.measured: self.reference.signal(scene)})


@frozen
class Hardware:
    """What stands between the laws and the machine, from the inside out in this order.

    Attributes
    ----------
    sample_time : float
        [s]; 0: continuous.
    noise : mapping of str to float
        Standard deviation by signal.
    seed : int
    steps : mapping of str to float
        Steps of quantisation by signal.
    rate_limits, limits : mapping of str to float
        Largest rate of change and magnitude by command.
    delay : int
        Whole samples.
    """

    sample_time: float = 0.0
    noise: Mapping[str, float] = field(default_factory=dict)
    seed: int = 0
    steps: Mapping[str, float] = field(default_factory=dict)
    rate_limits: Mapping[str, float] = field(default_factory=dict)
    limits: Mapping[str, float] = field(default_factory=dict)
    delay: int = 0

    def around(self, law: Controller) -> Controller:
        """Return the law in its hardware."""
        wrapped: Controller = Sampled(law, self.sample_time) if self.sample_time else law
        wrapped = Noisy(wrapped, self.noise, self.seed) if self.noise else wrapped
        wrapped = Quantised(wrapped, self.steps) if self.steps else wrapped
        wrapped = RateLimited(wrapped, self.rate_limits) if self.rate_limits else wrapped
        wrapped = Saturated(wrapped, self.limits) if self.limits else wrapped
        return Delayed(wrapped, self.delay) if self.delay else wrapped


@frozen
class Controlled(Plan):
    """Laws side by side in common hardware.

    Attributes
    ----------
    laws : tuple of Law
    hardware : Hardware
    """

    laws: tuple[Law, ...]
    hardware: Hardware = Hardware()

    def build(self, scene: Scene) -> Controller:
        """Return the controller for a scene."""
        built = [law.build(scene) for law in self.laws]
        for law in built:
            as_controller(law, scene.model.inputs, scene.model.outputs)
        if not built:
            raise SceneError("a controller needs at least one law")
        return self.hardware.around(built[0] if len(built) == 1 else Together(*built))


__all__ = ["PID", "Controlled", "Gains", "Hardware", "Law", "Move", "Reference", "StateFeedback", "Transfer"]
