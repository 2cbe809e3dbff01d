"""What is enlarged until a linear prediction fails: an initial displacement, an initial speed, a load."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import field
from functools import cached_property

import numpy as np

from flexctrl.errors import StructureError
from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.model.model import Model
from flexctrl.model.state import State

__all__ = ["Amplitude", "Case", "ConstantLoad", "InitialDisplacement", "InitialMode", "InitialSpeed", "Unit"]

_TURNING = ("_rx", "_ry", "_rz", "_turn", "_source")


@frozen(eq=False)
class Case:
    """A machine at rest and its linear model there.

    Attributes
    ----------
    model : Model
    rest : State
    inputs : numpy.ndarray
        Constant inputs it rests under.
    linear : LinearModel
    """

    model: Model
    rest: State
    inputs: np.ndarray
    linear: LinearModel

    @cached_property
    def outputs(self) -> np.ndarray:
        """Outputs at rest."""
        return self.model.measure(self.rest)

    @cached_property
    def slowest(self) -> float:
        """Lowest frequency above zero [rad/s]."""
        modes = self.linear.modes()
        if len(modes) == modes.unstable + modes.rigid:
            raise StructureError(f"{self.linear.name} does not oscillate; give until, the time to look at")
        return float(modes.omega[modes.flexible][0])


@frozen
class Unit:
    """In what an amplitude is told, and where a search for it begins and ends.

    Attributes
    ----------
    words, symbol : str
    first, most : float
    """

    words: str
    symbol: str
    first: float
    most: float


class Amplitude(ABC):
    """Something that can be small or large."""

    @abstractmethod
    def unit(self, case: Case) -> Unit:
        """Return how the amplitude is told.

        Parameters
        ----------
        case : Case

        Returns
        -------
        Unit
        """

    @abstractmethod
    def begin(self, case: Case, amplitude: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return what an amplitude means.

        Parameters
        ----------
        case : Case
        amplitude : float

        Returns
        -------
        step, v : numpy.ndarray, shape (n,)
            Initial displacement and rates of the degrees of freedom.
        u : numpy.ndarray, shape (inputs,)
            Inputs that act beside the case's own.
        """


@frozen
class InitialDisplacement(Amplitude):
    """One coordinate displaced from rest, all others in place, and let go.

    Attributes
    ----------
    coordinate : str
        A name in ``model.coordinates``.
    """

    coordinate: str

    def unit(self, case: Case) -> Unit:
        symbol, first, most = _kind(case, self.coordinate)
        return Unit(f"initial {self.coordinate}", symbol, first, most)

    def begin(self, case: Case, amplitude: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        step = np.zeros(case.model.n)
        step[case.model.coordinate(self.coordinate)] = amplitude
        return step, np.zeros(case.model.n), np.zeros(len(case.inputs))


@frozen
class InitialSpeed(Amplitude):
    """One coordinate started at a rate from rest.

    Attributes
    ----------
    coordinate : str
        A name in ``model.coordinates``.
    """

    coordinate: str

    def unit(self, case: Case) -> Unit:
        symbol, first, most = _kind(case, self.coordinate)
        return Unit(
            f"initial rate of {self.coordinate}", f"{symbol}/s", first * case.slowest, 2.0 * most * case.slowest
        )

    def begin(self, case: Case, amplitude: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        v = np.zeros(case.model.n)
        v[case.model.coordinate(self.coordinate)] = amplitude
        return np.zeros(case.model.n), v, np.zeros(len(case.inputs))


@frozen
class InitialMode(Amplitude):
    """The machine displaced along one of its modes and let go.

    Attributes
    ----------
    number : int
        As in ``linear.modes()``, from 1.
    measured_by : str
        The coordinate whose displacement is the amplitude; default: the one that moves most.
    """

    number: int
    measured_by: str = ""

    def unit(self, case: Case) -> Unit:
        name = self._name(case)
        symbol, first, most = _kind(case, name)
        return Unit(f"initial {name} along mode {self.number}", symbol, first, most)

    def begin(self, case: Case, amplitude: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        shape, place = self._shape(case), case.model.coordinate(self._name(case))
        if abs(shape[place]) < 1e-9 * np.abs(shape).max():
            raise StructureError(
                f"mode {self.number} does not move {self.measured_by}; measure it by another coordinate"
            )
        return amplitude / shape[place] * shape, np.zeros(case.model.n), np.zeros(len(case.inputs))

    def _shape(self, case: Case) -> np.ndarray:
        modes = case.linear.modes()
        if not 1 <= self.number <= len(modes):
            raise StructureError(f"{case.linear.name} has modes 1 … {len(modes)}; there is no mode {self.number}")
        return np.asarray(modes.shapes[:, self.number - 1])

    def _name(self, case: Case) -> str:
        return self.measured_by or case.model.coordinates[int(np.argmax(np.abs(self._shape(case))))]


@frozen
class ConstantLoad(Amplitude):
    """Inputs that act from the start, all multiplied by the amplitude.

    Attributes
    ----------
    inputs : mapping of str to float
        What acts at amplitude 1.
    """

    inputs: Mapping[str, float] = field(default_factory=dict)

    def unit(self, case: Case) -> Unit:
        terms = [f"{name} = {value:g}" for name, value in self.inputs.items()]
        return Unit("load", "× (" + ", ".join(terms) + ")", 0.01, 1e4)

    def begin(self, case: Case, amplitude: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        u = amplitude * case.model.input_vector(self.inputs)
        if not u.any():
            raise StructureError("ConstantLoad: no input is given a value; e.g. ConstantLoad({'push': 1.0})")
        return np.zeros(case.model.n), np.zeros(case.model.n), u


def _kind(case: Case, coordinate: str) -> tuple[str, float, float]:
    """Unit of a coordinate, a small and a large displacement of it."""
    place = case.model.coordinate(coordinate)
    if coordinate.endswith("_source"):
        gear = abs(case.model.motion.ratios[list(case.model.motion.sources).index(place)])
        return "rad", 0.05 * gear, 3.0 * gear
    if coordinate.endswith(_TURNING):
        return "rad", 0.05, 3.0
    return "m", 0.01 * case.model.structure.size, case.model.structure.size
