"""The exact tangent of a beam element, derived in its frame.

A force on an element depends on the motion of its nodes only through what is seen in the element frame, and
through the frame itself. So its slope is put together from small pieces: how the force changes with what is
seen, how that changes with an increment of the nodes while the frame stands still, and what the turning of
the frame adds. This takes half the instructions of differentiating the whole.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from flexctrl.frozen import frozen
from flexctrl.mechanics.beam import BeamForce, framed_force
from flexctrl.mechanics.corotation import BeamMotion, NodeMotion, OwnMotion, beam_motion, framed_motion
from flexctrl.mechanics.rotation import inverse_tangent

if TYPE_CHECKING:
    import casadi as ca


@frozen
class _Seen:
    """What is seen in the element frame, and the frame; symbols or values."""

    frame: ca.SX
    chord: ca.SX
    axes: tuple[ca.SX, ...]
    sides: tuple[ca.SX, ...]
    theta: tuple[ca.SX, ...]
    middle: tuple[ca.SX, ...]
    rates: tuple[ca.SX, ...]
    accelerations: tuple[ca.SX, ...]
    modal: OwnMotion | tuple[()]

    @classmethod
    def symbols(cls, own: OwnMotion | tuple[()]) -> _Seen:
        import casadi as ca

        def some(name: str, count: int) -> tuple[ca.SX, ...]:
            return tuple(ca.SX.sym(f"{name}{i}", 3) for i in range(count))

        frame, chord = ca.SX.sym("frame", 3, 3), ca.SX.sym("chord")
        amplitudes, rates, accelerations = (ca.SX.sym(f"modal{i}", own[0].numel() if own else 0) for i in range(3))
        modal = OwnMotion(amplitudes, rates, accelerations, own.along) if own else ()
        around = (some("axis", 2), some("side", 2), some("theta", 2), some("middle", 2))
        return cls(frame, chord, *around, some("rate", 3), some("acceleration", 3), modal)

    @classmethod
    def of(cls, m: BeamMotion, first: NodeMotion, second: NodeMotion, rest: ca.SX) -> _Seen:
        sides = tuple(m.frame.T @ (node.R @ rest[:, 1]) for node in (first, second))
        return cls(m.frame, m.chord, m.axes, sides, m.theta, m.middle, m.rates, m.accelerations, m.modal)

    @property
    def all(self) -> ca.SX:
        """All but the frame."""
        import casadi as ca

        place = (self.chord, *self.axes, *self.sides, *self.theta)
        return ca.vertcat(*place, *self.middle, *self.rates, *self.accelerations, *self.modal[:3])

    def motion(self, p: dict[str, ca.SX], rates: tuple[ca.SX, ...] | None = None) -> BeamMotion:
        seen = (self.chord, self.axes, self.sides, self.theta, self.middle, rates or self.rates, self.accelerations)
        return framed_motion(p, self.frame, *seen, self.modal)


def beam_slope(
    first: NodeMotion,
    second: NodeMotion,
    parameters: ca.SX,
    seeds: ca.SX,
    force: Callable[[BeamMotion], BeamForce],
    modal: OwnMotion | tuple[()] = (),
) -> ca.SX:
    """Return ∂force/∂(increment of both nodes and of the element's own modes), 12 × 12 and more, in space axes.

    It is put together of motions of the middle of the chord and those beside it: what moves as a whole does not change
    what is seen.

    Parameters
    ----------
    first, second : NodeMotion
    parameters : casadi.SX
        In the order of `flexctrl.mechanics.beam.PARAMETERS`.
    seeds : casadi.SX, 3
        What an increment adds to place, rates and accelerations.
    force : callable
        The force on the element of its motion.
    modal : OwnMotion, or empty
        That of the element's own modes, where it has any.

    Returns
    -------
    casadi.SX
        Nodes first, modes last.
    """
    import casadi as ca

    m, modes = beam_motion(first, second, parameters, modal), sum(eta.numel() for eta in modal[:1])
    seen = _Seen.symbols(modal)
    local = seen.motion(m.p)
    acting, mean = force(local), ca.SX.sym("mean", 3)
    on_mean = ca.densify(ca.SX(3, 1) + acting.mean)
    push = ca.cse(framed_force(local, replace(acting, mean=mean)))
    increment, turn = ca.SX.sym("increment", 12 + modes), ca.SX.sym("turn", 3)
    change = _change(seen, increment, turn, seeds)
    turned = ca.jacobian(ca.vec(seen.frame @ ca.skew(turn)), turn)

    def slopes(of: ca.SX) -> tuple[ca.SX, ca.SX]:
        """By the increment while the frame stands still, and by the turn of the frame."""
        on_seen, on_frame = ca.jacobian(of, seen.all), ca.jacobian(of, ca.vec(seen.frame))
        on_turn = on_seen @ ca.jacobian(change, turn) + seeds[0] * on_frame @ turned
        return on_seen @ ca.jacobian(change, increment), on_turn

    through = ca.jacobian(push, mean)  # 12 × 3: what the mean's force hangs on goes through it once
    still, on_turn = (a + through @ b for a, b in zip(slopes(push), slopes(on_mean), strict=True))
    carried = ca.vertcat(*[ca.cross(turn, push[3 * i : 3 * i + 3]) for i in range(4)], ca.SX(modes, 1))
    spin = seen.motion(m.p, tuple(ca.vertsplit(increment[3:12], 3))).spin
    slope = still + (on_turn + seeds[0] * ca.jacobian(carried, turn)) @ ca.jacobian(spin, increment)
    slope = ca.substitute(slope, mean, on_mean)
    now = _Seen.of(m, first, second, ca.reshape(parameters[:9], 3, 3).T)
    slope = ca.substitute(slope, ca.vertcat(seen.all, ca.vec(seen.frame)), ca.vertcat(now.all, ca.vec(now.frame)))
    out_of_frame = ca.diagcat(*[m.frame] * 4, ca.SX.eye(modes))
    of_nodes = ca.diagcat(_of_nodes(), ca.DM.eye(modes))
    return of_nodes.T @ (out_of_frame @ slope @ out_of_frame.T) @ of_nodes


def _of_nodes() -> ca.DM:
    """Middle of the chord, ω₁, v₂ − v₁ and ω₂ of motions of the nodes, 12 × 12."""
    import casadi as ca

    return ca.kron(ca.DM([[0.5, 0, 0.5, 0], [0, 1, 0, 0], [-1, 0, 1, 0], [0, 0, 0, 1]]), ca.DM.eye(3))


def _change(seen: _Seen, increment: ca.SX, turn: ca.SX, seeds: ca.SX) -> ca.SX:
    """Return how what is seen changes with an increment (middle, ω₁, v₂ − v₁, ω₂) and a turn of the frame."""
    import casadi as ca

    u = ca.vertsplit(increment[:12], 3)
    twists = [u[1] - turn, u[3] - turn]
    axes, sides = (
        [ca.cross(twist, axis) for twist, axis in zip(twists, both, strict=True)] for both in (seen.axes, seen.sides)
    )
    # the rate of a rotation vector is T⁻¹ times the spin; T⁻¹(θ) = T⁻ᵀ(−θ)
    theta = [inverse_tangent(-t, twist) for t, twist in zip(seen.theta, twists, strict=True)]
    place = ca.vertcat(u[2][0], *axes, *sides, *theta)

    def moved(k: int, by: list[ca.SX], seen: tuple[ca.SX, ...]) -> list[ca.SX]:
        return [seeds[k] * d - seeds[0] * ca.cross(turn, v) for d, v in zip(by, seen, strict=True)]

    middle = [*moved(1, u[:1], seen.middle[:1]), *moved(2, u[:1], seen.middle[1:])]
    rates, accelerations = moved(1, u[1:], seen.rates), moved(2, u[1:], seen.accelerations)
    modal = [seeds[k] * increment[12:] for k in range(len(seen.modal[:3]))]
    return ca.vertcat(seeds[0] * place, *middle, *rates, *accelerations, *modal)
