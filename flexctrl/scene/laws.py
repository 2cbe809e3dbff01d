"""Readers of moves, shapers, feedback laws and hardware."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from flexctrl.design.feedback import FilteredRate
from flexctrl.design.piecewise import Constant, Sum
from flexctrl.design.shaper import Shaper, convolve
from flexctrl.design.shapers import ei, um_zv, um_zvd, zv, zvd, zvdd
from flexctrl.design.trajectories import (
    MinimumJerk,
    Ramp,
    Spline,
    Step,
    Table,
    TimeOptimalPendulum,
    TrapezoidalVelocity,
)
from flexctrl.errors import did_you_mean
from flexctrl.scene.control import PID, Controlled, Gains, Hardware, Move, Reference, StateFeedback, Transfer
from flexctrl.scene.reading import (
    Kind,
    Place,
    Reader,
    by_name,
    flag,
    known,
    mapping,
    number,
    of_kind,
    one_of,
    positive,
    several,
    table,
    whole,
)
from flexctrl.structure.structure import Structure

_MODE = {"omega": positive, "zeta": number}
SHAPERS = {
    "zv": Kind(zv, _MODE),
    "zvd": Kind(zvd, _MODE),
    "zvdd": Kind(zvdd, _MODE),
    "ei": Kind(ei, {**_MODE, "tolerance": positive}),
    "um_zv": Kind(um_zv, _MODE),
    "um_zvd": Kind(um_zvd, _MODE),
}
"""Shapers by the name they have in a scene file."""

_BEGIN = {"at": number, "start": number}
_POINTS = {"times": several(number), "values": several(number)}
MOVES = {
    "constant": Kind(Constant, {"value": number}),
    "step": Kind(Step, {"size": number, **_BEGIN}),
    "ramp": Kind(Ramp, {"slope": number, "duration": positive, **_BEGIN}),
    "trapezoidal_velocity": Kind(
        TrapezoidalVelocity, {"distance": number, "speed": positive, "acceleration": positive, **_BEGIN}
    ),
    "minimum_jerk": Kind(MinimumJerk, {"distance": number, "duration": positive, **_BEGIN}),
    "table": Kind(Table, _POINTS),
    "spline": Kind(Spline, _POINTS),
    "time_optimal_pendulum": Kind(
        TimeOptimalPendulum, {"distance": number, "acceleration": positive, "omega": positive, **_BEGIN}
    ),
}
"""Commands by the name they have in a scene file."""


def _terms(value: Any, place: Place) -> tuple[Any, ...]:
    """Read the moves of a sum, at least one."""
    found = several(lambda item, where: of_kind(item, where, MOVES))(value, place)
    if not found:
        raise place.expected("a list of moves, at least one", value)
    return found


MOVES["sum"] = Kind(Sum, {"terms": _terms})


def move(value: Any, place: Place) -> Move:
    """Read a command: a number (constant), or a table of its kind, with a shaper if there is one."""
    if not isinstance(value, Mapping):
        return Move(Constant(number(value, place)))
    given = dict(value)
    shaper = _shaper(given.pop("shaper"), place.at("shaper")) if "shaper" in given else None
    return Move(of_kind(given, place, MOVES), shaper)


def _shaper(value: Any, place: Place) -> Shaper:
    """Read one shaper, or a list of them, one per mode."""
    if isinstance(value, list):
        return convolve(*several(lambda item, where: of_kind(item, where, SHAPERS))(value, place))
    return of_kind(value, place, SHAPERS)


moves = mapping(move)
"""Reader of the table ``moves``."""


def load(moves: Mapping[str, Move]) -> Reader:
    """Return the reader of a load: a number (constant), the name of a move, or a table of one's kind.

    Parameters
    ----------
    moves : mapping of str to Move
        Those that have names.

    Returns
    -------
    callable
    """

    def read(value: Any, place: Place) -> Any:
        if isinstance(value, str) and value not in moves:
            raise place.refuse(
                f"there is no move {value!r}; a load is a number, the name of one of the [moves], "
                f"or a table {{ kind = … }} as there{did_you_mean(value, moves)}"
            )
        if isinstance(value, str):
            return moves[value].times(1.0)
        return move(value, place).times(1.0) if isinstance(value, Mapping) else number(value, place)

    return read


def controller(
    content: Mapping[str, Any], place: Place, machine: Structure, moves: Mapping[str, Move]
) -> Controlled | None:
    """Read the tables ``controllers`` and ``hardware``.

    Parameters
    ----------
    content : mapping of str to object
        Of the file.
    place : Place
        The file.
    machine : Structure
        Whose signals and drives may be named.
    moves : mapping of str to Move
        What may be followed.

    Returns
    -------
    Controlled or None
        None if the file has no controllers.

    Raises
    ------
    SceneError
        Naming table, key and what was expected.
    """
    kinds = _law_kinds(moves, machine)
    read = several(lambda item, where: of_kind(item, where, kinds))
    laws = read(content.get("controllers", []), place.at("controllers"))
    if not laws:
        if "hardware" in content:
            raise place.at("hardware").refuse("there are no [[controllers]] to put it round")
        return None
    return Controlled(laws, _hardware(machine).read(table(content.get("hardware", {}), place), place.at("hardware")))


def _hardware(machine: Structure) -> Kind:
    inputs, _ = _signals(machine)
    either = known("input or output", (*(i.name for i in machine.inputs), *(o.name for o in machine.outputs)))
    return Kind(
        Hardware,
        {
            "sample_time": positive,
            "noise": by_name(either, number),
            "seed": whole,
            "steps": by_name(either, positive),
            "rate_limits": by_name(inputs, positive),
            "limits": by_name(inputs, positive),
            "delay": whole,
        },
    )


def _signals(machine: Structure) -> tuple[Callable[[Any, Place], str], Callable[[Any, Place], str]]:
    """Readers of the names of inputs, and of outputs."""
    return known("input", (i.name for i in machine.inputs)), known("output", (o.name for o in machine.outputs))


def _law_kinds(moves: Mapping[str, Move], machine: Structure) -> dict[str, Kind]:
    reference = _reference(moves, known("drive", (d.name for d in machine.drives)))
    inputs, outputs = _signals(machine)
    loop: dict[str, Reader] = {"measured": outputs, "command": inputs, "reference": reference}
    gains = {"kp": number, "ki": number, "kd": number}
    references = by_name(outputs, reference)
    return {
        "pid": Kind(PID, {**loop, **gains, "rate": _rate(outputs), "limit": positive}),
        "lqr": Kind(
            StateFeedback,
            {
                "largest": by_name(outputs, positive),
                "effort": by_name(inputs, positive),
                "reads": several(outputs),
                "references": references,
            },
        ),
        "gains": Kind(Gains, {"gains": by_name(inputs, by_name(outputs, number)), "references": references}),
        "transfer_function": Kind(Transfer, {**loop, "num": several(number), "den": several(number)}),
    }


def _rate(outputs: Callable[[Any, Place], str]) -> Reader:
    """Return the reader of the name of a rate signal, or of the time constant of a filter."""
    return lambda value, place: (
        outputs(value, place) if isinstance(value, str) else FilteredRate(positive(value, place))
    )


def _reference(moves: Mapping[str, Move], drives: Reader) -> Reader:
    def chosen(value: Any, place: Place) -> Move:
        return moves[one_of(moves)(value, place)]

    def read(value: Any, place: Place) -> Reference:
        if isinstance(value, str):
            return Reference(chosen(value, place))
        if isinstance(value, Mapping):
            return Kind(Reference, {"move": chosen, "through": drives, "rate": flag}).read(value, place)
        return Reference(Move(Constant(number(value, place))))

    return read


__all__ = ["MOVES", "SHAPERS", "controller", "load", "move", "moves"]
