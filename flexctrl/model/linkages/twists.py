"""The angles that `Rotation` outputs show: about an axis, with whole turns counted as they go by."""

from __future__ import annotations

import numpy as np

from flexctrl.frozen import frozen
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
