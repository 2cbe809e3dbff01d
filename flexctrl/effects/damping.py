"""Damping: proportional to mass and stiffness, or mode by mode."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.effects.effect import Effect
from flexctrl.effects.places import by_place, finite
from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.mechanics.beam import BeamForce, viscous_force
from flexctrl.mechanics.beam_inertia import drag
from flexctrl.mechanics.corotation import BeamMotion, NodeMotion
from flexctrl.mechanics.pieces import DriveMotion, LineMotion, space_inertia
from flexctrl.structure.freedoms import check_finite, listed

if TYPE_CHECKING:
    import casadi as ca


@frozen
class RayleighDamping(Effect):
    """C = α M + β K: α on absolute velocities, β on the rates of strain of each part.

    At rest the tangent is exactly α M + β K with K as assembled; in large motion the β part is
    frame-invariant. ζ(ω) = α/(2ω) + βω/2.

    Parameters
    ----------
    alpha : float
        Mass factor α [1/s], ≥ 0.
    beta : float
        Stiffness factor β [s], ≥ 0.

    Raises
    ------
    StructureError
        For a negative factor.
    """

    alpha: float = 0.0
    beta: float = 0.0

    def __post_init__(self) -> None:
        for name in ("alpha", "beta"):
            object.__setattr__(self, name, check_finite(getattr(self, name), name, "RayleighDamping", least=0.0))

    @classmethod
    def through(cls, zeta: float, omega1: float, omega2: float) -> RayleighDamping:
        """Return the damping whose ratio is ``zeta`` at two frequencies.

        Parameters
        ----------
        zeta : float
            Damping ratio at both.
        omega1, omega2 : float
            Frequencies [rad/s].

        Returns
        -------
        RayleighDamping
        """
        owner = "RayleighDamping.through"
        zeta = check_finite(zeta, "zeta", owner, least=0.0)
        omega1 = check_finite(omega1, "omega1", owner, above=0.0)
        omega2 = check_finite(omega2, "omega2", owner, above=0.0)
        return cls(2.0 * zeta * omega1 * omega2 / (omega1 + omega2), 2.0 * zeta / (omega1 + omega2))

    def beam(self, m: BeamMotion) -> BeamForce:
        """−β Jᵀ K_e J ḋ − α M_e V, J the slope of strains in the deformations d."""
        return viscous_force(m) * self.beta + drag(m) * self.alpha

    def spring(self, m: LineMotion) -> ca.SX:
        """β k ℓ̇."""
        return self.beta * m.p["stiffness"] * m.rate

    def rope(self, m: LineMotion) -> ca.SX:
        """β k ℓ̇."""
        return self.beta * m.p["stiffness"] * m.rate

    def body(self, node: NodeMotion, p: dict[str, ca.SX]) -> ca.SX:
        """−α times the momentum."""
        import casadi as ca

        return -self.alpha * ca.vertcat(p["mass"] * node.v, space_inertia(node, p) @ node.w)

    def drive(self, m: DriveMotion) -> ca.SX:
        """−β k_θ on the rate of the shaft's twist, −α J θ̇_d on the motor."""
        import casadi as ca

        torque = self.beta * m.p["stiffness"] * (m.p["ratio"] * m.driven_rate - m.source_rate)
        motor = torque - self.alpha * m.p["inertia"] * m.source_rate
        return ca.vertcat(-m.p["ratio"] * torque * m.gradient, motor)


@frozen
class ModalDamping(Effect):
    """C = M Φ diag(2 ζᵢ ωᵢ) Φᵀ M from the undamped modes about the machine's equilibrium; 0 is no damping.

    Motions without stiffness, and those in which the machine would leave the equilibrium, are not damped. C does not
    turn with the machine: what turns far from the equilibrium is braked as well, of which runs have a note, and
    `linearize` refuses to go there. A `Scene` fills in its own ``hold`` and ``rest_inputs``.

    Parameters
    ----------
    ratios : float or sequence of float
        Damping ratio of every flexible mode, or of the first ones in order (the rest are undamped).
    hold : mapping of str to float, optional
        Freedoms held in the equilibrium, ``"girder.start.u"`` or a coordinate's name, and where [m or rad]; the modes
        are those of the machine that is free there again, under the forces that held it.
    inputs : mapping of str to float, optional
        Constant inputs it is in equilibrium with, in their units.

    Raises
    ------
    StructureError
        For a ratio that is negative, and for what is no number.
    """

    ratios: tuple[float, ...] | float
    hold: tuple[tuple[str, float], ...]
    inputs: tuple[tuple[str, float], ...]

    def __init__(
        self,
        ratios: float | Sequence[float],
        hold: Mapping[str, float] | None = None,
        inputs: Mapping[str, float] | None = None,
    ) -> None:
        def checked(ratio: float) -> float:
            return check_finite(ratio, "ratio", "ModalDamping", least=0.0)

        if isinstance(ratios, Sequence | np.ndarray):
            several = tuple(checked(z) for z in listed(ratios, "ModalDamping: ratios"))
            if not several:
                raise StructureError("ModalDamping: no ratios given; give one number or one per mode")
            object.__setattr__(self, "ratios", several)
        else:
            object.__setattr__(self, "ratios", checked(ratios))
        for name, what, given in (("hold", "place", hold), ("inputs", "value", inputs)):
            object.__setattr__(self, name, by_place(given or {}, f"ModalDamping: {name}", what, finite))

    def everywhere(self) -> Effect:
        """Kernels do not know about equilibria."""
        return ModalDamping(self.ratios)
