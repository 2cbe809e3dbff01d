"""Kinds of pieces, and the casadi kernels of one: its forces, its energies, and their tangents.

Kernels read node slots of a flat vector z and add forces to a raw vector. A node's slot holds
x (3), R (9, row by row), velocity (6) and acceleration (6); a drive's slot θ_d, its two rates, and the
whole turns of its joint; an inner freedom's slot its value, its two rates, and its phase. The tangents read
three seeds more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, cached_property
from typing import TYPE_CHECKING

from flexctrl.effects.effect import Effect
from flexctrl.frozen import frozen
from flexctrl.kernels.kernel import Kernel
from flexctrl.mechanics.corotation import NodeMotion
from flexctrl.model.laws.inertial import turning

if TYPE_CHECKING:
    import casadi as ca

NODE_SLOT = 24
DRIVE_SLOT = 4


@frozen
class Shares:
    """What acts on a piece: forces of inertia, all other forces, kinetic and stored energy.

    ``lost`` is the power it takes from the machine, for pieces where that is not what forces lose at standstill;
    ``together`` all forces, for pieces where that takes fewer operations than both do.
    """

    inertia: ca.SX
    force: ca.SX
    kinetic: ca.SX
    stored: ca.SX
    lost: ca.SX | None = None
    together: ca.SX | None = None

    @property
    def whole(self) -> ca.SX:
        """All forces."""
        return self.inertia + self.force if self.together is None else self.together


Physics = Callable[[tuple[Effect, ...], Sequence[NodeMotion], "ca.SX", "ca.SX"], Shares]
"""(effects, node motions, slots of drives and inner freedoms, parameters) → what acts on the piece."""

Slope = Callable[[tuple[Effect, ...], Sequence[NodeMotion], "ca.SX", "ca.SX", "ca.SX"], "ca.SX"]
"""(effects, node motions, slots of inner freedoms, parameters, seeds) → ∂force/∂(raw motion)."""


@frozen
class Kind:
    """A kind of piece.

    Attributes
    ----------
    name : str
    nodes : int
        Nodes a piece.
    freedoms : int
        Raw freedoms a node that the piece pushes (3 or 6).
    drives : int
        Source angles and inner freedoms a piece.
    parameters : int
    physics : callable
    slope : callable, optional
        The tangent, where there is a quicker way to it than differentiating the physics.
    """

    name: str
    nodes: int
    freedoms: int
    drives: int
    parameters: int
    physics: Physics
    slope: Slope | None = None

    @property
    def width(self) -> int:
        """Raw freedoms a piece pushes."""
        return self.nodes * self.freedoms + self.drives


@frozen
class Kernels:
    """The kernels of one kind under some effects; made when first used, once a process (`kernels_of`)."""

    kind: Kind
    effects: tuple[Effect, ...]

    @cached_property
    def force(self) -> Kernel:
        """Kernel of the sum of all forces, inertia included."""
        symbols, parameters, shares = self._rest
        return _kernel(f"{self.kind.name}_force", symbols, parameters, shares.whole)

    @cached_property
    def energy(self) -> Kernel:
        """Kernel of kinetic energy, stored energy and dissipated power."""
        import casadi as ca

        symbols, parameters, shares = self._rest
        velocities = self._velocities(symbols)
        if ca.is_linear(shares.force, velocities):  # what is damped in proportion: the rest is not worked out
            drag = -ca.jtimes(shares.force, velocities, velocities)
        else:
            drag = ca.substitute(shares.force, velocities, ca.SX.zeros(velocities.numel())) - shares.force
        power = ca.dot(drag, self._raw_rates(symbols)) if shares.lost is None else shares.lost
        found = ca.vertcat(shares.kinetic, shares.stored, power)
        return _kernel(
            f"{self.kind.name}_energy", symbols, parameters, found, bool(power.is_zero())
        )  # losses: each step

    @cached_property
    def tangent(self) -> Kernel:
        """Kernel of ∂force/∂(raw motion), column by column.

        Three more inputs say how a raw increment moves the piece: it changes place, velocity
        and acceleration by that factor. (1, 0, 0) gives −K, (0, 1, 0) gives −C, (0, 0, 1) gives −M.
        """
        import casadi as ca

        symbols, parameters = symbols_of(self.kind)
        seeds = ca.SX.sym("seeds", 3)
        slope = self._slope(symbols, parameters, seeds)
        return _kernel(f"{self.kind.name}_tangent", ca.vertcat(symbols, seeds), parameters, ca.vec(ca.densify(slope)))

    def _slope(self, symbols: ca.SX, parameters: ca.SX, seeds: ca.SX) -> ca.SX:
        import casadi as ca

        zero = ca.SX(self.kind.width, 1)
        if self.kind.slope is not None and not turning(self.effects):
            nodes, slot = moved(self.kind, symbols, zero, seeds), symbols[NODE_SLOT * self.kind.nodes :]
            return self.kind.slope(self.effects, nodes, slot, parameters, seeds)
        increment = ca.SX.sym("increment", self.kind.width)
        shares = self._evaluate(symbols, parameters, increment, seeds)
        slope = ca.jacobian(ca.cse(shares.whole), increment)
        return ca.substitute(slope, increment, ca.densify(zero))

    @cached_property
    def _rest(self) -> tuple[ca.SX, ca.SX, Shares]:
        import casadi as ca

        kind = self.kind
        symbols, parameters = symbols_of(kind)
        return symbols, parameters, self._evaluate(symbols, parameters, ca.SX(kind.width, 1), ca.SX(3, 1))

    def _evaluate(self, symbols: ca.SX, parameters: ca.SX, increment: ca.SX, seeds: ca.SX) -> Shares:
        import casadi as ca

        nodes = moved(self.kind, symbols, increment, seeds)
        slot = symbols[NODE_SLOT * self.kind.nodes :]
        if self.kind.drives:
            slot = slot + ca.kron(increment[self.kind.nodes * self.kind.freedoms :], ca.vertcat(seeds, 0))
        return self.kind.physics(self.effects, nodes, slot, parameters)

    def _velocities(self, symbols: ca.SX) -> ca.SX:
        """All velocity symbols, rates of sources and inner freedoms included: zeroed to find what dissipates."""
        import casadi as ca

        count = self.kind.nodes
        found = [symbols[NODE_SLOT * i + 12 : NODE_SLOT * i + 18] for i in range(count)]
        return ca.vertcat(*found, *self._slot_rates(symbols))

    def _raw_rates(self, symbols: ca.SX) -> ca.SX:
        import casadi as ca

        count = self.kind.nodes
        found = [symbols[NODE_SLOT * i + 12 : NODE_SLOT * i + 12 + self.kind.freedoms] for i in range(count)]
        return ca.vertcat(*found, *self._slot_rates(symbols))

    def _slot_rates(self, symbols: ca.SX) -> list[ca.SX]:
        first = NODE_SLOT * self.kind.nodes + 1
        return [symbols[first + DRIVE_SLOT * k] for k in range(self.kind.drives)]


def symbols_of(kind: Kind) -> tuple[ca.SX, ca.SX]:
    """Return symbols of the slots that a piece reads, and of its parameters."""
    import casadi as ca

    return ca.SX.sym("z", NODE_SLOT * kind.nodes + DRIVE_SLOT * kind.drives), ca.SX.sym("p", kind.parameters)


def moved(kind: Kind, symbols: ca.SX, increment: ca.SX, seeds: ca.SX) -> list[NodeMotion]:
    """Return the motion of a piece's nodes after a raw increment, by factors ``seeds`` on place, rate, acceleration."""
    import casadi as ca

    nodes = []
    for i in range(kind.nodes):
        d = increment[kind.freedoms * i : kind.freedoms * (i + 1)]
        d = d if kind.freedoms == 6 else ca.vertcat(d, ca.SX(3, 1))
        nodes.append(_node_motion(symbols[NODE_SLOT * i : NODE_SLOT * (i + 1)], d, seeds))
    return nodes


def _node_motion(slot: ca.SX, d: ca.SX, seeds: ca.SX) -> NodeMotion:
    import casadi as ca

    R = ca.reshape(slot[3:12], 3, 3).T
    turned = R if d.is_zero() else R + ca.skew(seeds[0] * d[3:]) @ R
    return NodeMotion(
        slot[:3] + seeds[0] * d[:3],
        turned,
        slot[12:15] + seeds[1] * d[:3],
        slot[15:18] + seeds[1] * d[3:],
        slot[18:21] + seeds[2] * d[:3],
        slot[21:24] + seeds[2] * d[3:],
    )


def _kernel(name: str, inputs: ca.SX, parameters: ca.SX, outputs: ca.SX, seldom: bool = False) -> Kernel:
    import casadi as ca

    return Kernel(name, inputs, parameters, ca.densify(outputs), seldom=seldom)


@cache
def kernels_of(kind: Kind, effects: tuple[Effect, ...]) -> Kernels:
    """Return the kernels of a kind under some effects; equal values share them."""
    return Kernels(kind, effects)
