"""The angles that `Rotation` outputs show: about an axis, with whole turns counted as they go by."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexctrl.frozen import frozen
from flexctrl.model.turned import angle_went, face
from flexctrl.structure.outputs import Rotation
from flexctrl.structure.structure import Structure

__all__ = ["Twists"]


@frozen
class Twists:
    """Which angles are shown.

    The angle is what is left of the rotation of one node against another about an axis of the latter when the tilt of
    the axis is undone (the twist of swing and twist). It is known up to whole turns; these are the ones that bring it
    next to where it is expected.

    Attributes
    ----------
    at, base : numpy.ndarray of int, shape (angles,)
        Nodes; the base that carries the axis may be the ground.
    axes : numpy.ndarray, shape (angles, 3)
    """

    at: np.ndarray
    base: np.ndarray
    axes: np.ndarray

    @classmethod
    def of(cls, structure: Structure) -> Twists:
        """Return the angles of a structure's outputs, in their order."""
        outputs = [o for o in structure.outputs if isinstance(o, Rotation)]
        ground = len(structure.nodes)
        at = [structure.number(o.at) for o in outputs]
        base = [ground if o.minus is None else structure.number(o.minus) for o in outputs]
        axes = np.array([o.direction for o in outputs], dtype=float).reshape(-1, 3)
        return cls(np.array(at, dtype=int), np.array(base, dtype=int), axes)

    def __len__(self) -> int:
        return len(self.at)

    def next_to(self, expected: np.ndarray, R: np.ndarray) -> np.ndarray:
        """Return the angles of a pose.

        Parameters
        ----------
        expected : numpy.ndarray, shape (angles,)
            To less than half a turn.
        R : numpy.ndarray, shape (nodes + 1, 3, 3)
            Rotations of the nodes since rest.

        Returns
        -------
        numpy.ndarray, shape (angles,)
        """
        Q = np.swapaxes(R[self.base], 1, 2) @ R[self.at]
        axial = np.stack([Q[:, 2, 1] - Q[:, 1, 2], Q[:, 0, 2] - Q[:, 2, 0], Q[:, 1, 0] - Q[:, 0, 1]], axis=1)
        along = np.einsum("ki,kij,kj->k", self.axes, Q, self.axes)
        angle = np.arctan2((axial * self.axes).sum(axis=1), np.trace(Q, axis1=1, axis2=2) - along)
        return angle + 2.0 * np.pi * np.rint((expected - angle) / (2.0 * np.pi))

    def swept(self, before: np.ndarray, R: np.ndarray, about: np.ndarray) -> np.ndarray:
        """Return how far the angles go from one pose to another.

        Parameters
        ----------
        before, R : numpy.ndarray, shape (nodes + 1, 3, 3)
        about : numpy.ndarray, shape (angles,)
            About how far, for those that go farther than half a turn.

        Returns
        -------
        numpy.ndarray, shape (angles,)
        """
        pairs: Any = zip(self.quaternions(before), self.quaternions(R), self.axes.tolist(), about.tolist(), strict=True)
        return np.array([angle_went(*pair) for pair in pairs])

    def quaternions(self, R: np.ndarray) -> list[list[float]]:
        """Return those of the nodes against their bases, of any length, scalars first.

        Parameters
        ----------
        R : numpy.ndarray, shape (nodes + 1, 3, 3)

        Returns
        -------
        list of list of float
        """
        found: list[Any] = [[0.0] * 4 for _ in self.at]
        for at, base, q in zip(
            R[self.at].reshape(-1, 9).tolist(), R[self.base].reshape(-1, 9).tolist(), found, strict=True
        ):
            face(at, base, q)
        return found

    def short_of_opposite(self, number: int, R: np.ndarray) -> float:
        """Return by how much an axis is short of pointing the other way, where its angle is not defined [rad].

        Parameters
        ----------
        number : int
            Of the angle.
        R : numpy.ndarray, shape (nodes + 1, 3, 3)

        Returns
        -------
        float
        """
        axis, at, base = self.axes[number], self.at[number], self.base[number]
        tilted = R[base].T @ R[at] @ axis
        return float(np.arctan2(np.linalg.norm(np.cross(axis, tilted)), -axis @ tilted))
