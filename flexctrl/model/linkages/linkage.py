"""Linkages: how nodes follow their masters, loops of rigid parts closed, as compiled functions of pose and rates.

Accelerations, the forces given back to masters, the matrix T and its change with the pose all follow from the
rates by differentiation: V = T(pose) w, A = T ẇ + Ṫ w, collected = Tᵀ F. Loops are closed by making some freedoms
depend on the others.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.kernels.kernel import Kernel
from flexctrl.model.linkages.open_linkage import OpenLinkage, attitude

if TYPE_CHECKING:
    import casadi as ca

Terms = tuple[list["ca.SX"], "ca.SX"]
"""Arguments of a function and what it gives."""

_LOST = 1e-6
"""Reciprocal condition of a loop that may move on in several ways."""

_PAST = 2e-6
_ROUND_OFF = 1e-14
"""How far past such a position a step goes [rad or m]."""

_CLOSING = 4
"""Newton corrections that close loops after a step; the contraction is the turn within the step."""


class Linkage(OpenLinkage):
    """A linkage whose loops are closed: the dependent freedoms follow from the independent ones."""

    @cached_property
    def place(self) -> Callable[..., np.ndarray]:
        """(old pose, step of the independent freedoms) → new pose (count, 12)."""
        return _callable("place", *self._placing)

    @cached_property
    def rates(self) -> Callable[..., np.ndarray]:
        """(pose, independent rates) → raw rates: (count, 6), then the source angles of rigid shafts."""
        return _callable("rates", *self._rating)

    @cached_property
    def accelerations(self) -> Callable[..., np.ndarray]:
        """(pose, independent rates, their rates) → raw accelerations."""
        return _callable("accelerations", *self._accelerating)

    @cached_property
    def drift(self) -> Callable[..., np.ndarray]:
        """(pose, independent rates, their rates) → how raw rates and accelerations change with the pose.

        ∂(raw rates)/∂(own motion), ∂(raw accelerations)/∂(own motion), ∂(raw accelerations)/∂(own rates), each of
        shape (raw, free), by columns: all of it the turning of levers.
        """
        import casadi as ca

        step = ca.SX.sym("step", self.free)
        d = ca.reshape(ca.substitute(self._raw, self._rate, step)[: 6 * self.count], 6, self.count)
        after = ca.substitute(ca.vertcat(self._raw, self._accelerations), ca.vec(self._pose), self._moved(d))
        by_pose = ca.substitute(ca.jacobian(after, step), step, ca.SX.zeros(self.free))
        by_rate = ca.jacobian(self._accelerations, self._rate)
        slopes = ca.vertcat(ca.vec(ca.densify(by_pose)), ca.vec(ca.densify(by_rate)))
        return _callable("drift", [self._pose, self._rate, self._change], slopes)

    @cached_property
    def collect(self) -> Callable[..., np.ndarray]:
        """(pose, raw forces) → forces on the independent freedoms."""
        return _callable("collect", *self._collecting)

    @cached_property
    def kernels(self) -> tuple[Kernel, Kernel, Kernel, Kernel, Kernel, Kernel]:
        """The same as kernels of one item: `place`, its rotations freed of drift, to `collect`; `driven`, `wound`."""
        import casadi as ca

        arguments, pose = self._placing
        pose = ca.reshape(pose, 12, self.count)
        square = [self._squared(i, attitude(pose[:, i])) for i in range(self.count)]
        kept = ca.vertcat(*[ca.vertcat(pose[:3, i], ca.vec(R.T)) for i, R in enumerate(square)])
        return (
            _kernel("place", arguments, kept),
            _kernel("rates", *self._rating),
            _kernel("accelerations", *self._accelerating),
            _kernel("collect", *self._collecting),
            _kernel("driven", *self._driving),
            _kernel("wound", *self._winding),
        )

    @cached_property
    def freely(self) -> Kernel:
        """`place` as a kernel of one item, with the drift that rotations have."""
        return _kernel("place_freely", *self._placing)

    def _squared(self, node: int, R: ca.SX) -> ca.SX:
        """Return a rotation freed of round-off drift; one that never changes has none."""
        import casadi as ca

        return R if ca.is_equal(R, attitude(self._pose[:, node]), 2) else _orthonormal(R)

    @property
    def _placing(self) -> Terms:
        return [self._pose, self._rate], self._closed_place()

    @property
    def _rating(self) -> Terms:
        return [self._pose, self._rate], self._raw

    @property
    def _accelerating(self) -> Terms:
        return [self._pose, self._rate, self._change], self._accelerations

    @property
    def _collecting(self) -> Terms:
        return [self._pose, self._force], self._collected

    @property
    def _driving(self) -> Terms:
        import casadi as ca

        still = [(ca.SX.zeros(3), ca.SX.zeros(3))] * self.count
        values = [self._drive_motion(link, self._pose, still).driven for link in self.links]
        return [self._pose], ca.vertcat(*values, ca.SX(0, 1))

    @property
    def _winding(self) -> Terms:
        import casadi as ca

        V = ca.reshape(self._raw[: 6 * self.count], 6, self.count)
        moving = [(V[:3, i], V[3:, i]) for i in range(self.count)]
        values = [self._drive_motion(link, self._pose, moving).driven_rate for link in self.links]
        return [self._pose, self._rate], ca.vertcat(*values, ca.SX(0, 1))

    @cached_property
    def matrix(self) -> Callable[..., np.ndarray]:
        """Pose → T, shape (raw, free), column by column."""
        import casadi as ca

        return _callable("matrix", [self._pose], ca.vec(ca.densify(ca.jacobian(self._raw, self._rate))))

    @cached_property
    def stiffening(self) -> Callable[..., np.ndarray]:
        """(pose, raw forces) → ∂collected/∂(raw motion of the nodes), shape (free, 6 count), by columns."""
        import casadi as ca

        d = ca.SX.sym("d", 6, self.count)
        collected = ca.substitute(self._collected, ca.vec(self._pose), self._moved(d))
        slope = ca.substitute(ca.jacobian(collected, ca.vec(d)), ca.vec(d), ca.SX.zeros(6 * self.count))
        return _callable("stiffening", [self._pose, self._force], ca.vec(ca.densify(slope)))

    @cached_property
    def on_rails(self) -> Callable[..., np.ndarray]:
        """(pose, raw forces) → forces of trolleys on their rails, 3 each."""
        return _callable("on_rails", [self._pose, self._force], self._on_rails(self._pose, self._force))

    @cached_property
    def driven(self) -> Callable[..., np.ndarray]:
        """Pose → driven coordinates of all drives; angles between −π and π."""
        return _callable("driven", *self._driving)

    @cached_property
    def wound(self) -> Callable[..., np.ndarray]:
        """(pose, step of the independent freedoms) → about what it adds to the driven coordinates: whole turns too."""
        return _callable("wound", *self._winding)

    @cached_property
    def grip(self) -> Callable[..., np.ndarray]:
        """Pose → how fast loops open with the independent freedoms, then with the dependent ones, by columns."""
        import casadi as ca

        return _callable("grip", [self._pose], ca.vec(ca.densify(ca.horzcat(*self._loop_slopes(self._pose)))))

    @cached_property
    def gaps(self) -> Callable[..., np.ndarray]:
        """Pose → how far loops are open [rad, or shares of the span]."""
        return _callable("gaps", [self._pose], self._gaps(self._pose, self.loops))

    @cached_property
    def play(self) -> Callable[..., np.ndarray]:
        """Pose → how far conditions are open that are only watched [rad, or shares of the span]."""
        return _callable("play", [self._pose], self._gaps(self._pose, self.spare))

    @cached_property
    def playing(self) -> Kernel:
        """`play` as a kernel of one item."""
        return _kernel("play", [self._pose], self._gaps(self._pose, self.spare))

    @cached_property
    def gauge(self) -> Kernel:
        """`gaps`, `grip` and `turning` as a kernel of one item: (pose, raw rates of the nodes) → all three."""
        import casadi as ca

        d = ca.SX.sym("d", 6, self.count)
        slopes = ca.vec(ca.densify(ca.horzcat(*self._loop_slopes(self._pose))))
        found = ca.vertcat(self._gaps(self._pose, self.loops), slopes, self._turning(d))
        return _kernel("loops", [self._pose, d], found)

    @cached_property
    def turning(self) -> Callable[..., np.ndarray]:
        """(pose, raw rates of the nodes) → how the dependent freedoms' share of `grip` changes, by columns."""
        import casadi as ca

        d = ca.SX.sym("d", 6, self.count)
        return _callable("turning", [self._pose, d], self._turning(d))

    def _turning(self, d: ca.SX) -> ca.SX:
        import casadi as ca

        within = ca.vec(ca.densify(self._loop_slopes(self._pose)[1]))
        return ca.densify(ca.jtimes(within, ca.vec(self._pose), self._moved(d) - ca.vec(self._pose)))

    def _moved(self, d: ca.SX) -> ca.SX:
        """Return the pose after a small raw motion of the nodes, shape (6, count), to first order."""
        import casadi as ca

        x, R = self._pose[:3, :], [attitude(self._pose[:, i]) for i in range(self.count)]
        turned = [r + ca.skew(d[3:, i]) @ r for i, r in enumerate(R)]
        return ca.vertcat(*[ca.vertcat(x[:, i] + d[:3, i], ca.vec(r.T)) for i, r in enumerate(turned)])

    def placed(self, pose: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Return the pose after a step of any size, with loops closed as far as round-off lets them be.

        A step that ends in the very position where a loop branches goes a little further, or nothing would say
        which way the loop moves on.
        """
        new, length = self._closed(pose, step), np.abs(step).max(initial=0.0)
        if self.loops and length > 0.0 and reciprocal_condition(self.slopes_at(new)[1]) < _LOST:
            return self._closed(pose, step * (1.0 + _PAST / length))
        return new

    def _closed(self, pose: np.ndarray, step: np.ndarray) -> np.ndarray:
        new, gap = self.place(pose, step), np.inf
        while self.loops and _ROUND_OFF < (now := np.abs(self.gaps(new)).max()) < 0.5 * gap:
            new, gap = self.place(new, np.zeros(self.free)), now
        return new

    def slopes_at(self, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how fast loops open with the independent and with the dependent freedoms, the latter scaled to 1."""
        slopes = self.grip(pose).reshape(-1, len(self.loops)).T
        within = slopes[:, self.free :]
        return slopes[:, : self.free], within / np.abs(within).max(axis=0)

    def turning_at(self, pose: np.ndarray, motion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how fast loops open with the dependent freedoms, and how that changes as nodes move."""
        own = len(self.loops)
        within = self.grip(pose)[self.free * own :]
        return within.reshape(own, own).T, self.turning(pose, motion).reshape(own, own).T

    def matrix_at(self, pose: np.ndarray) -> np.ndarray:
        """Return T at a pose."""
        return self.matrix(pose).reshape(self.free, self._raw.shape[0]).T

    def stiffening_at(self, pose: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return ∂collected/∂(raw motion) at a pose under constant raw forces."""
        return self.stiffening(pose, force).reshape(6 * self.count, self.free).T

    def drift_at(self, pose: np.ndarray, rate: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Return the three matrices of `drift` at a pose, shape (3, raw, free)."""
        flat = self.drift(pose, rate, change)
        rows = self._raw.shape[0]
        by_pose = flat[: 2 * rows * self.free].reshape(self.free, 2, rows).transpose(1, 2, 0)
        return np.concatenate([by_pose, flat[2 * rows * self.free :].reshape(1, self.free, rows).transpose(0, 2, 1)])

    @cached_property
    def _pose(self) -> ca.SX:
        import casadi as ca

        return ca.SX.sym("pose", 12, self.count)

    @cached_property
    def _rate(self) -> ca.SX:
        import casadi as ca

        return ca.SX.sym("rate", self.free)

    @cached_property
    def _force(self) -> ca.SX:
        import casadi as ca

        return ca.SX.sym("force", self._raw.shape[0])

    @cached_property
    def _change(self) -> ca.SX:
        import casadi as ca

        return ca.SX.sym("change", self.free)

    @cached_property
    def _accelerations(self) -> ca.SX:
        """Raw accelerations: T times the rates' rates, and T changing on its way."""
        import casadi as ca

        V = ca.reshape(self._raw[: 6 * self.count], 6, self.count)
        turning = [ca.skew(V[3:, i]) @ attitude(self._pose[:, i]) for i in range(self.count)]
        moving = ca.vertcat(*[ca.vertcat(V[:3, i], ca.vec(w.T)) for i, w in enumerate(turning)])
        carried = ca.jtimes(self._raw, ca.vec(self._pose), moving)
        return ca.substitute(self._raw, self._rate, self._change) + carried

    @cached_property
    def _collected(self) -> ca.SX:
        import casadi as ca

        return ca.jtimes(self._raw, self._rate, self._force, True)

    @cached_property
    def _raw(self) -> ca.SX:
        """Raw rates of all nodes and of the source angles behind rigid shafts."""

        return self._open_raw(self._pose, self._open_rates(self._pose, self._all(self._pose, self._rate)))

    def _all(self, pose: ca.SX, rate: ca.SX) -> ca.SX:
        """Return all freedoms' rates: the dependent ones keep the loops closed."""
        import casadi as ca

        if not self.loops:
            return rate
        if self.idle:
            return ca.vertcat(rate, ca.SX.zeros(len(self.loops)))
        onto, within = self._loop_slopes(pose)
        return ca.vertcat(rate, -ca.solve(within, onto @ rate))

    @cached_property
    def idle(self) -> bool:
        """Whether no independent freedom opens a loop, wherever it is: the dependent ones stay as they are."""
        import casadi as ca

        return bool(self.loops) and not ca.sparsify(self._loop_slopes(self._pose)[0]).nnz()

    def _closed_place(self) -> ca.SX:
        """Return the new pose; the dependent steps are found by Newton's method with the slopes after a first guess.

        Not with those before the step: where a loop may branch, these would throw the parts about.
        """
        import casadi as ca

        old, step = self._pose, self._rate
        if not self.loops:
            return self._open_place(old, step)
        dependent = self._all(old, step)[self.free :]
        if self.idle:
            return self._open_place(old, ca.vertcat(step, dependent))
        _, within = self._loop_slopes(ca.reshape(self._open_place(old, ca.vertcat(step, dependent)), 12, self.count))
        for _ in range(_CLOSING):
            reached = self._open_place(old, ca.vertcat(step, dependent))
            dependent = dependent - ca.solve(within, self._gaps(reached, self.loops))
        return self._open_place(old, ca.vertcat(step, dependent))


def _orthonormal(R: ca.SX) -> ca.SX:
    """Return R with its round-off drift from orthonormality removed."""
    import casadi as ca

    return R @ (1.5 * ca.DM.eye(3) - 0.5 * R.T @ R)


def _kernel(name: str, arguments: list[ca.SX], result: ca.SX) -> Kernel:
    import casadi as ca

    inputs = ca.vertcat(*[ca.vec(a) for a in arguments])
    return Kernel(name, inputs, ca.SX.sym("p", 0), ca.cse(ca.densify(result)))


def _callable(name: str, arguments: list[ca.SX], result: ca.SX) -> Callable[..., np.ndarray]:
    """Return a casadi function on numpy arrays, one item a column = one row of a C-ordered array."""
    import casadi as ca

    function = ca.Function(name, arguments, [ca.densify(result)], {"cse": True})
    inputs = [np.zeros(a.numel()) for a in arguments]
    output = np.zeros(result.numel())
    buffer, evaluate = function.buffer()
    for i, array in enumerate(inputs):
        if array.size:
            buffer.set_arg(i, array.data)  # type: ignore[call-arg]
    if output.size:
        buffer.set_res(0, output.data)  # type: ignore[call-arg]

    def call(*arrays: np.ndarray, keep: object = buffer) -> np.ndarray:
        for own, given in zip(inputs, arrays, strict=True):
            own[:] = given.ravel()
        if output.size:
            evaluate()
        return output.copy()

    return call


def reciprocal_condition(A: np.ndarray) -> float:
    """Return LAPACK's estimate of 1/cond(A) in the 1-norm; 0 for a singular or undefined matrix."""
    from scipy.linalg.lapack import dgecon, dgetrf

    lu, _, info = dgetrf(A)
    return float(dgecon(lu, np.abs(A).sum(axis=0).max())[0]) if info == 0 else 0.0
