"""What a linear model that was made from a machine can show for itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from flexctrl.frozen import frozen


@frozen
class Certificate:
    """Evidence that a linear model is the derivative of its machine at an equilibrium.

    Attributes
    ----------
    residual : float
        Largest unbalanced force at the equilibrium over the forces at work; 0 where it is lost in round-off.
    asymmetry : float
        max |K − Kᵀ| / max |K|, before K was made symmetric where no load explains it.
    definiteness : float
        Smallest pivot of the scaled mass matrix; not negative.
    taylor_slope : float
        Slope of log |f(εd) + εKd| over log ε: 2 for a right K (3 where the machine is symmetric in d;
        infinite where the forces are linear).
    rigid_modes : tuple of str
        Motions without stiffness, in words.
    condition_mass, condition_stiffness : float
        Condition numbers (1-norm) after scaling by the diagonal; infinite where singular.
    loads : tuple of str
        Loads at work without a potential; they may make K unsymmetric, and what they add is kept.
    frequency_error : float
        Bound of the relative error of the lowest 20 undamped frequencies by the rounding of K, and of the places that
        tell the stresses.
    gyroscopic : float
        max |C − Cᵀ| / 2 max |C|: 0 for dampers, 1 for Coriolis forces alone (`RotatingFrame`). Undamped modes do
        not know of it, damped poles do.
    held : tuple of str
        What the equilibrium held and the model has let go of: the forces that held it, constant, are part of the
        equilibrium, and no inputs.
    idle : tuple of str
        Inputs that do nothing here: all that they act on is held. To let go of it linearise about ``rest.state`` under
        inputs that bear what `Rest.holding` tells.
    """

    residual: float
    asymmetry: float
    definiteness: float
    taylor_slope: float
    rigid_modes: tuple[str, ...]
    condition_mass: float
    condition_stiffness: float
    loads: tuple[str, ...] = ()
    gyroscopic: float = 0.0
    frequency_error: float = 0.0
    held: tuple[str, ...] = ()
    idle: tuple[str, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to be said of inputs."""
        if not self.idle:
            return ()
        return (
            f"inputs without effect, as all that they act on is held: {', '.join(self.idle)}; "
            "linearize(model, at=rest.state, inputs=…) lets go of it, under inputs that bear what rest.holding tells",
        )

    def heard(self, inputs: Sequence[str]) -> Certificate:
        """Return it for some of the inputs.

        Parameters
        ----------
        inputs : sequence of str

        Returns
        -------
        Certificate
        """
        return replace(self, idle=tuple(name for name in self.idle if name in inputs))

    def __str__(self) -> str:
        rigid = "; ".join(self.rigid_modes) or "none"
        why = f" (by {', '.join(self.loads)})" if self.loads else ""
        held = f", with constant forces on {', '.join(self.held)}" if self.held else ""
        turning = f", skew share of C {self.gyroscopic:.1e}" if self.gyroscopic else ""
        return (
            f"equilibrium residual {self.residual:.1e}{held}, asymmetry of K {self.asymmetry:.1e}{why}, "
            f"smallest pivot of M {self.definiteness:.1e}, Taylor slope {self.taylor_slope:.2f}, "
            f"condition of M {self.condition_mass:.1e}, of K {self.condition_stiffness:.1e}{turning}, "
            f"lowest frequencies within {self.frequency_error:.1e}; "
            f"{'; '.join((f'rigid-body modes: {rigid}', *self.notes))}"
        )
