"""What a machine looks like in a state: where its nodes are, how its beams bend between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from itertools import pairwise
from typing import Protocol

import numpy as np

from flexctrl.frozen import frozen
from flexctrl.mechanics.clamped_modes import clamped_shapes
from flexctrl.model.model import Model
from flexctrl.model.state import State
from flexctrl.structure.beams import Beam
from flexctrl.structure.structure import Structure

__all__ = ["Drawn", "Pose", "axis_curve", "bent_of", "pose_of", "posed", "seen"]


class Pose(Protocol):
    """Where the nodes are and how they have turned: a `State`."""

    @property
    def x(self) -> np.ndarray: ...

    @property
    def R(self) -> np.ndarray: ...


@frozen
class Drawn:
    """The pose of a structure as it is drawn.

    Attributes
    ----------
    x, R : numpy.ndarray
        Of the nodes.
    bent : mapping of str to numpy.ndarray, shape (elements, 2, modes)
        Amplitudes of the component modes of beams that have them, along y and z of each element [m].
    """

    x: np.ndarray
    R: np.ndarray
    bent: Mapping[str, np.ndarray] = field(default_factory=dict)

    @classmethod
    def of(cls, structure: Structure) -> Drawn:
        """Return the pose at rest."""
        x = np.array([n.position for n in structure.nodes])
        return seen(structure, cls(x, np.broadcast_to(np.eye(3), (len(x), 3, 3))))


def seen(structure: Structure, pose: Pose) -> Drawn:
    """Return the pose of a structure's nodes; those that say how far a trolley has travelled stand on it.

    Parameters
    ----------
    structure : Structure
    pose : State

    Returns
    -------
    Drawn
    """
    count = len(structure.nodes)
    x = pose.x[:count].copy()
    for track in structure.tracks:
        x[track.gauge] = x[track.node]
    return Drawn(x, pose.R[:count], pose.bent if isinstance(pose, Drawn) else {})


def pose_of(structure: Structure, coordinates: Sequence[str], state: State) -> Drawn:
    """Return the pose of a state of a model, beams bent by their component modes.

    Parameters
    ----------
    structure : Structure
    coordinates : sequence of str
        Of the model.
    state : State
        A frame of a run, say.

    Returns
    -------
    Drawn
    """
    return replace(seen(structure, state), bent=bent_of(structure, coordinates, state.q))


def bent_of(structure: Structure, coordinates: Sequence[str], values: np.ndarray) -> dict[str, np.ndarray]:
    """Return how component modes bend the beams that have them.

    Parameters
    ----------
    structure : Structure
    coordinates : sequence of str
        Of the model.
    values : numpy.ndarray, shape (n,)

    Returns
    -------
    dict of str to numpy.ndarray, shape (elements, 2, modes)
    """
    value = dict(zip(coordinates, values.tolist(), strict=True))
    found = {}
    for beam in (e for e in structure.elements if isinstance(e, Beam)):
        count = 0
        while f"{beam.name}_0_y{count + 1}" in value:
            count += 1
        if count:
            found[beam.name] = np.array(
                [
                    [[value[f"{beam.name}_{k}_{axis}{i + 1}"] for i in range(count)] for axis in "yz"]
                    for k in range(beam.elements)
                ]
            )
    return found


def posed(machine: Structure | Model, pose: Pose | None) -> tuple[Structure, Drawn]:
    """Return a structure, and what is to be drawn of it; of a model's states how component modes bend beams, too."""
    if isinstance(machine, Structure):
        return machine, seen(machine, pose) if pose else Drawn.of(machine)
    if isinstance(pose, State):
        return machine.structure, pose_of(machine.structure, machine.coordinates, pose)
    return posed(machine.structure, pose)


def axis_curve(beam: Beam, pose: Drawn, nodes: Sequence[int], points: int = 12) -> np.ndarray:
    """Return the deflected axis: cubics through the nodes along their turned axes, and what component modes add.

    Parameters
    ----------
    beam : Beam
    pose : Drawn
    nodes : sequence of int
        Numbers of the beam's nodes.
    points : int
        Of each element.

    Returns
    -------
    numpy.ndarray, shape (elements · points, 3)
    """
    s = np.linspace(0.0, 1.0, points)[:, None]
    h = (2 * s**3 - 3 * s**2 + 1, s**3 - 2 * s**2 + s, -2 * s**3 + 3 * s**2, s**3 - s**2)
    along = beam.axes[:, 0] * beam.length / beam.elements
    pieces = [
        h[0] * pose.x[a] + h[1] * (pose.R[a] @ along) + h[2] * pose.x[b] + h[3] * (pose.R[b] @ along)
        for a, b in pairwise(nodes)
    ]
    if beam.name in pose.bent:
        shapes = clamped_shapes(pose.bent[beam.name].shape[2], s[:, 0])
        for k, amplitudes in enumerate(pose.bent[beam.name]):
            across = 0.5 * (pose.R[nodes[k]] + pose.R[nodes[k + 1]]) @ beam.axes[:, 1:]
            pieces[k] = pieces[k] + (amplitudes @ shapes).T @ across.T
    return np.vstack(pieces)
