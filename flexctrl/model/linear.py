"""The linear model, second order in its coordinates: the truth that every export comes from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

__all__ = ["LinearModel", "PartMatrices"]


@dataclass(frozen=True)
class PartMatrices:
    """What one part (a beam, a drive …) contributes to K and M: for energy shares by part.

    Attributes
    ----------
    stiffness, mass : scipy.sparse.csc_matrix, shape (n, n)
        The part's own share, in the model's coordinates.
    """

    stiffness: sp.csc_matrix
    mass: sp.csc_matrix


@dataclass(frozen=True)
class LinearModel:
    """M q̈ + C q̇ + K q = B u,  y = Cq q + Cv q̇ + D u, with names.

    Attributes
    ----------
    M, C, K : scipy.sparse.csc_matrix, shape (n, n)
        Mass, damping and stiffness (geometric stiffness included); SI units. M may be singular.
    B : numpy.ndarray, shape (n, n_inputs)
        Input distribution.
    Cq, Cv : numpy.ndarray, shape (n_outputs, n)
        Output rows on displacement and velocity.
    D : numpy.ndarray, shape (n_outputs, n_inputs)
        Feedthrough.
    coordinates, inputs, outputs : tuple of str
        Names, legal for python-control.
    name : str
        Name of the machine.
    parts : mapping of str to PartMatrices
        Each part's share of K and M; empty where unknown.
    """

    M: sp.csc_matrix
    C: sp.csc_matrix
    K: sp.csc_matrix
    B: np.ndarray
    Cq: np.ndarray
    Cv: np.ndarray
    D: np.ndarray
    coordinates: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    name: str = "linear"
    parts: Mapping[str, PartMatrices] = field(default_factory=dict)
