"""Paths of equilibria under a growing load, through the points at which the load has to turn back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import NoneType
from typing import TYPE_CHECKING

import numpy as np

from flexctrl.errors import (
    MechanismError,
    SingularMatrixError,
    StructureError,
    check_kind,
    did_you_mean,
    shortened,
)
from flexctrl.frozen import frozen
from flexctrl.model.balance import Balance
from flexctrl.model.braked import balance_of
from flexctrl.model.built_up import built_up
from flexctrl.model.eased import Eased, eased
from flexctrl.model.equilibrium import Rest, equilibrium
from flexctrl.model.holding import coordinate_held
from flexctrl.model.model import Model
from flexctrl.model.overturned import overturned
from flexctrl.model.paths.course import Course, Direction, Station
from flexctrl.model.paths.critical import across, softest
from flexctrl.model.paths.walk import PathEnd, Walk
from flexctrl.model.state import State
from flexctrl.structure.freedoms import check_finite, check_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["BranchPoint", "EquilibriumPath", "LimitPoint", "PathEnd", "PathPoint", "equilibrium_path"]


@frozen(eq=False)
class PathPoint:
    """An equilibrium on a path.

    Attributes
    ----------
    factor : float
        λ, by which the load is multiplied.
    rest : Rest
        The equilibrium itself, as `linearize` and `simulate` take it.
    """

    factor: float
    rest: Rest

    @property
    def outputs(self) -> dict[str, float]:
        """The model's outputs."""
        return self.rest.outputs

    @property
    def unstable(self) -> int:
        """Independent directions in which it does not last; see `Rest`."""
        return self.rest.unstable


@frozen(eq=False)
class LimitPoint(PathPoint):
    """Where the load turns back: under load control the machine snaps through.

    Attributes
    ----------
    factor : float
        λ.
    rest : Rest
    mode : numpy.ndarray, shape (n,)
        The displacement in which it gives way.
    """

    mode: np.ndarray


@frozen(eq=False)
class BranchPoint(PathPoint):
    """Where another path crosses: the machine buckles.

    Attributes
    ----------
    factor : float
        λ.
    rest : Rest
    mode : numpy.ndarray, shape (n,)
        The displacement in which it gives way; a path that starts here leaves along it.
    """

    mode: np.ndarray


@frozen(eq=False)
class EquilibriumPath:
    """Equilibria under constant inputs and λ times a load, in order along their path.

    Attributes
    ----------
    load : dict of str to float
        The inputs that λ multiplies.
    points : tuple of PathPoint
        The computed ones; `limits` and `branchings` lie between them.
    limits : tuple of LimitPoint
    branchings : tuple of BranchPoint
    end : PathEnd
    iterations : int
        Newton's, altogether.
    """

    load: dict[str, float]
    points: tuple[PathPoint, ...]
    limits: tuple[LimitPoint, ...]
    branchings: tuple[BranchPoint, ...]
    end: PathEnd
    iterations: int

    @property
    def factor(self) -> np.ndarray:
        """λ along the path."""
        return np.array([p.factor for p in self.points])

    @property
    def unstable(self) -> np.ndarray:
        """Unstable directions along the path."""
        return np.array([p.unstable for p in self.points])

    def __getitem__(self, output: str) -> np.ndarray:
        """Return an output along the path."""
        known = self.points[0].outputs
        if output not in known:
            raise StructureError(f"path: no output {output!r}{did_you_mean(output, known)}")
        return np.array([p.outputs[output] for p in self.points])

    def plot(self, over: str | None = None) -> Figure:
        """Draw the load over an output: stable parts drawn through, unstable ones dashed, critical points marked.

        Parameters
        ----------
        over : str, optional
            The output; default: the one that changes most.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from flexctrl.plots.path import path_figure

        return path_figure(self, over)

    def __str__(self) -> str:
        limits = ", ".join(f"{p.factor:.6g}" for p in self.limits) or "none"
        crossings = ", ".join(f"{p.factor:.6g}" for p in self.branchings) or "none"
        last = self.points[-1].rest
        turned = overturned(last.model, last.state) if self.end is PathEnd.STUCK else ""
        return (
            f"{len(self.points)} equilibria, λ = {self.points[0].factor:.6g} … {self.points[-1].factor:.6g} "
            f"({turned or self.end.value}); limit points at λ = {limits}; branch points at λ = {crossings}"
        )


def equilibrium_path(
    model: Model,
    load: Mapping[str, float],
    until: float | Mapping[str, float],
    inputs: Mapping[str, float] | None = None,
    hold: Mapping[str, float] | None = None,
    start: State | PathPoint | None = None,
    most: int = 2000,
) -> EquilibriumPath:
    """Follow the equilibria of a model under λ times a load, past limit points.

    Pseudo-arclength continuation (Keller 1977; Riks 1979) from λ = 0, with step lengths that go by Newton's
    contraction and the bending of the path. Points where the load turns back are located to round-off, and so
    are points where another path crosses; after these the path keeps straight on.

    Parameters
    ----------
    model : Model
    load : mapping of str to float
        Inputs that grow with λ.
    until : float or mapping of str to float
        Where to end: at a value of λ, or where one of the named outputs has the value given with it. The last
        point has it exactly.
    inputs : mapping of str to float, optional
        Constant inputs.
    hold : mapping of str to float, optional
        Coordinates held at a displacement from the drawn shape [m or rad], as `Model.displace` takes it: of a node that
        turns about several axes these are components of its rotation vector.
    start : State or PathPoint, optional
        Where to begin: a shape near the first equilibrium; a point of another path; or a `BranchPoint`, from
        which the path leaves along its mode. Default: the shape as drawn.
    most : int
        Points at most.

    Returns
    -------
    EquilibriumPath
        Its ``end`` says whether it got there; what was computed is kept.

    Raises
    ------
    EquilibriumError
        If there is no equilibrium to begin with.
    MechanismError
        If nothing says where a freedom is, such as the turn of an end that is free of all.
    StructureError
        For an unknown name, or a load of nothing.
    """
    if not isinstance(model, Model):
        raise StructureError(f"equilibrium_path: {shortened(model)} is no Model; give what flexctrl.assemble returns")
    check_kind(hold, (Mapping, NoneType), "equilibrium_path: hold", "a mapping of freedoms to values")
    pushed = model.input_vector(load)
    if not pushed.any():
        raise StructureError("equilibrium_path: the load is nothing; name an input, e.g. load={'push': 1.0}")
    goals = _goals(model, until)
    held = {coordinate_held(model, name): check_finite(value, name, "hold") for name, value in (hold or {}).items()}
    count = check_whole(most, "most", "equilibrium_path", least=2)
    balance = Balance(model, model.input_vector(inputs or {}), held)
    try:
        state, factor = _outset(model, start, hold, inputs)
        ease = eased(balance, state)
        outset = (ease.balance, ease.onto(state)) if ease else (balance, state)
        course, first = _begin(*outset, factor, pushed, goals, start)
        walked = Walk(course, goals, count, isinstance(start, BranchPoint)).from_(first)
    except SingularMatrixError as error:
        raise _unheld(balance, error.where) from None

    def rest(station: Station) -> Rest:
        found = _rest(course, station)
        return _behind(ease, model, found) if ease else found

    return EquilibriumPath(
        dict(load),
        tuple(PathPoint(s.factor, rest(s)) for s in walked.stations),
        tuple(LimitPoint(s.factor, rest(s), _mode(course, s)) for s in walked.limits),
        tuple(BranchPoint(s.factor, rest(s), _mode(course, s)) for s in walked.crossings),
        walked.end,
        walked.iterations,
    )


def _outset(
    model: Model,
    start: State | PathPoint | None,
    hold: Mapping[str, float] | None,
    inputs: Mapping[str, float] | None,
) -> tuple[State, float]:
    """The first equilibrium, and its λ."""
    if isinstance(start, PathPoint):
        return start.rest.state, start.factor
    rest = equilibrium(model, hold, inputs, start)
    return built_up(balance_of(rest), rest.state), 0.0


def _behind(ease: Eased, model: Model, rest: Rest) -> Rest:
    """What was found behind eased shafts, behind the shafts themselves."""
    state = ease.back(rest.state)
    outputs = dict(zip(model.outputs, model.measure(state).tolist(), strict=True))
    return replace(rest, state=state, outputs=outputs, model=model)


def _unheld(balance: Balance, where: int) -> MechanismError:
    """What is to be said of a freedom that nothing holds."""
    name = balance.model.coordinates[balance.free[min(where, len(balance.free) - 1)]]
    remedy = "hold it with a Support, or in hold, or have a spring pull on it"
    return MechanismError(f"equilibrium_path: nothing says where {name} is as the load grows; {remedy}")


def _goals(model: Model, until: float | Mapping[str, float]) -> dict[str, float]:
    """Values at which the path ends; the load factor has no name."""
    if not isinstance(until, Mapping):
        return {"": check_finite(until, "until", "equilibrium_path")}
    for name, value in until.items():
        if name not in model.outputs:
            raise StructureError(f"equilibrium_path: no output {name!r}{did_you_mean(name, model.outputs)}")
        check_finite(value, f"until {name!r}", "equilibrium_path")
    return {name: float(value) for name, value in until.items()}


def _begin(
    balance: Balance,
    state: State,
    factor: float,
    load: np.ndarray,
    goals: Mapping[str, float],
    start: State | PathPoint | None,
) -> tuple[Course, Station]:
    """The course and its first station."""
    rough = Course(balance, load, 1.0)
    straight = rough.tangent(state, factor, Direction(np.zeros(len(balance.free)), 1.0))
    way = float(np.sqrt((straight.place**2) @ rough.weight)) / abs(straight.factor or 1.0)
    scale = abs(goals[""] - factor) if "" in goals else 1.0 / max(way, 1e-300)
    course = Course(balance, load, scale or 1.0)
    rising = np.sign(goals.get("", factor + 1.0) - factor)
    station = course.station(state, factor, Direction(np.zeros(len(balance.free)), float(rising)), 0)
    if isinstance(start, BranchPoint):
        away = across(course, station, start.mode[balance.free])
        station = Station(state, factor, away, station.turned, 0)
    return course, station


def _mode(course: Course, station: Station) -> np.ndarray:
    mode = np.zeros(course.balance.model.n)
    mode[course.balance.free] = softest(course, station)
    return mode


def _rest(course: Course, station: Station) -> Rest:
    balance = course.at(station.factor)
    model = balance.model
    outputs = dict(zip(model.outputs, model.measure(station.state).tolist(), strict=True))
    held = tuple(model.coordinates[i] for i in balance.held)
    loads = float(np.abs(model.signals.loads_at(station.state) @ (course.factor_scale * course.load)).sum())
    residual = balance.relative(balance.force(station.state), max(balance.scale(station.state), loads))
    return Rest(station.state, residual, outputs, balance.u, station.iterations, model, held)
