"""Walking along a path of equilibria: step lengths, what is passed on the way, where it ends."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum

from flexctrl.frozen import frozen
from flexctrl.model.paths.course import Course, Station
from flexctrl.model.paths.critical import Gauge, branching_between, limit_between, reached
from flexctrl.model.places import wandered

__all__ = ["PathEnd", "Walk", "Walked"]

_FIRST, _SHORTEST, _LONGEST = 2e-4, 1e-9, 0.06
_AIM, _BEND, _CLOSE = 5, 0.95, 1e-4


class PathEnd(Enum):
    """Why a path ends where it does."""

    REACHED = "reached what was asked for"
    POINTS = "as many points as were allowed"
    STUCK = "no equilibrium within the shortest step"
    WANDERED = "a rotation that a Support holds alone has wandered about its axis: further states hang on the way there"


@frozen(eq=False)
class Walked:
    """What a walk has met.

    Attributes
    ----------
    stations : tuple of Station
    limits, crossings : tuple of Station
        Where the load turns back, and where another path crosses.
    end : PathEnd
    iterations : int
        Newton's, altogether.
    """

    stations: tuple[Station, ...]
    limits: tuple[Station, ...]
    crossings: tuple[Station, ...]
    end: PathEnd
    iterations: int


@frozen(eq=False)
class Walk:
    """A walk along a course.

    Attributes
    ----------
    course : Course
    goals : mapping of str to float
        Values of outputs at which it ends; of λ under the name ``""``.
    most : int
        Stations at most.
    branching : bool
        Whether the first step leaves the path that led to the start.
    """

    course: Course
    goals: Mapping[str, float]
    most: int
    branching: bool

    def from_(self, first: Station) -> Walked:
        """Walk from a station until a goal is met."""
        course = self.course
        stations, limits, crossings = [first], [], []
        length, total, end = _FIRST, 0, PathEnd.POINTS
        while len(stations) < self.most:
            here = stations[-1]
            there = course.step(here, here.tangent, length)
            total += there.iterations if there else 12
            leaving = self.branching and len(stations) == 1
            if there is None or not (leaving or length < _CLOSE or self._near(here, there)):
                length *= 0.5
                if length < _SHORTEST:
                    end = PathEnd.STUCK
                    break
                continue
            if wandered(course.balance.model, there.state):
                end = PathEnd.WANDERED
                break
            gone = self._passed(here, there)
            if gone:
                there, length = self._first(here, length, gone)
            if not leaving:
                turned, crossed = self._critical(here, there, length)
                limits += turned
                crossings += crossed
            stations.append(there)
            if gone:
                end = PathEnd.REACHED
                break
            length = self._next(here, there, length)
        return Walked(tuple(stations), tuple(limits), tuple(crossings), end, total)

    def _near(self, here: Station, there: Station) -> bool:
        """Whether the path bends little between two stations, and stability changes there once at most."""
        if self.course.product(here.tangent, there.tangent) < _BEND:
            return False
        changes = abs(there.turned - here.turned)
        turns = here.tangent.factor * there.tangent.factor < 0.0
        return changes == 1 if turns else changes <= 1

    def _next(self, here: Station, there: Station, length: float) -> float:
        straight = self.course.product(here.tangent, there.tangent)
        grow = min(2.0, max(0.5, (_AIM / max(there.iterations, 1)) ** 0.5))
        bend = min(2.0, ((1.0 - 0.98) / max(1.0 - straight, 1e-9)) ** 0.5)
        return float(min(length * min(grow, bend), _LONGEST))

    def _passed(self, here: Station, there: Station) -> list[str]:
        """Goals that lie between two stations."""
        found = []
        for goal, value in self.goals.items():
            before, after = self._of(here, goal) - value, self._of(there, goal) - value
            if before != 0.0 and before * after <= 0.0:
                found.append(goal)
        return found

    def _of(self, station: Station, goal: str) -> float:
        if not goal:
            return station.factor
        model = self.course.balance.model
        return float(model.measure(station.state)[model.outputs.index(goal)])

    def _first(self, here: Station, length: float, passed: list[str]) -> tuple[Station, float]:
        """The nearest of the stations at which goals are met, and how far along the step it is."""

        def beyond(goal: str) -> Gauge:
            return lambda station: self._of(station, goal) - self.goals[goal]

        return min((reached(self.course, here, length, beyond(goal)) for goal in passed), key=lambda met: met[1])

    def _critical(self, here: Station, there: Station, length: float) -> tuple[list[Station], list[Station]]:
        """The limit or branch point within a step, if there is one."""
        if here.tangent.factor * there.tangent.factor < 0.0:
            return [limit_between(self.course, here, length)], []
        if here.turned != there.turned:
            return [], [branching_between(self.course, here, length)]
        return [], []
