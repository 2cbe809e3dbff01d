"""Where a machine is and how fast it moves."""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np

from flexctrl.frozen import frozen

__all__ = ["Dry", "State"]


@frozen
class Dry:
    """What the dry contacts of a machine do.

    Attributes
    ----------
    phase : numpy.ndarray, shape (inner,)
        Sliding (±1), sticking (2), or taken to be without friction (0).
    anchor : numpy.ndarray, shape (inner,)
        Where each that sticks is held: its angle or travel.
    """

    phase: np.ndarray
    anchor: np.ndarray

    @classmethod
    def loose(cls, count: int) -> Dry:
        """Return contacts without friction."""
        return cls(np.zeros(count), np.zeros(count))


@frozen
class State:
    """Where the machine is and how fast it moves.

    Attributes
    ----------
    x : numpy.ndarray, shape (nodes + 1, 3)
        Positions [m]; the last row is the ground.
    R : numpy.ndarray, shape (nodes + 1, 3, 3)
        Rotations since rest.
    q : numpy.ndarray, shape (n,)
        Each degree of freedom summed up over all steps: displacements [m], turns [rad], source angles [rad].
    v : numpy.ndarray, shape (n,)
        Rates of the degrees of freedom.
    driven : numpy.ndarray, shape (drives,)
        Driven coordinate of each drive, turns included [rad or m].
    t : float
        Time [s].
    dry : Dry
        What dry contacts do.
    shown : numpy.ndarray, shape (angles,)
        What each `Rotation` output shows, turns included [rad]; empty in small motion, where ``q`` tells.
    freedoms : tuple of str
        Names of the degrees of freedom; empty where a state has not come out of a run or a search.
    """

    x: np.ndarray
    R: np.ndarray
    q: np.ndarray
    v: np.ndarray
    driven: np.ndarray
    t: float = 0.0
    dry: Dry = field(default_factory=lambda: Dry.loose(0))
    shown: np.ndarray = field(default_factory=lambda: np.zeros(0))
    freedoms: tuple[str, ...] = ()

    def with_(self, *, v: np.ndarray | None = None, t: float | None = None, dry: Dry | None = None) -> State:
        """Return a copy at another time, with other rates or other contacts.

        Parameters
        ----------
        v : numpy.ndarray, optional
        t : float, optional
        dry : Dry, optional

        Returns
        -------
        State
        """
        return replace(
            self,
            v=self.v if v is None else np.asarray(v, float),
            t=self.t if t is None else t,
            dry=self.dry if dry is None else dry,
        )

    @property
    def loose(self) -> State:
        """The same with all dry contacts shaken loose."""
        return self.with_(dry=Dry.loose(self.dry.phase.size)) if self.dry.phase.any() else self
