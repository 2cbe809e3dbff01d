"""Arguments, exit codes and what goes to which stream. Everything heavy is imported by the commands."""

from __future__ import annotations

import argparse
import importlib
import json
import math
import re
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

import flexctrl
from flexctrl.errors import EquilibriumError, FlexctrlError, MechanismError, SceneError, did_you_mean
from flexctrl.frozen import frozen

OK, FAILED, BAD_INPUT = 0, 1, 2


@frozen
class Command:
    """One command: where it lives and what its help says.

    Attributes
    ----------
    module : str
        Has ``answer(request) -> Answer``.
    gives : str
    example : str
    options : tuple of str
        Which of the options in `_OPTIONS` it takes.
    """

    module: str
    gives: str
    example: str
    options: tuple[str, ...] = ()


COMMANDS = {
    "table": Command(
        "flexctrl.cli.table",
        "join table, element list, audit of freedoms",
        "flexctrl table examples/ceiling_crane.toml",
    ),
    "run": Command(
        "flexctrl.cli.run",
        "simulation with the scene's loads and controller; the rigid twin beside it if the scene asks",
        "flexctrl run examples/ceiling_crane.toml --out results",
    ),
    "modes": Command(
        "flexctrl.cli.modes",
        "equilibrium, frequencies, damping, which part moves in each mode",
        "flexctrl modes examples/bridge_crane.toml --count 8 --out results",
        ("count",),
    ),
    "bode": Command(
        "flexctrl.cli.bode",
        "frequency responses of the machine and its rigid twin, and the margins of the scene's controller",
        "flexctrl bode examples/bridge_crane.toml --input left_torque --output left_angle --out results",
        ("input", "output"),
    ),
    "rlocus": Command(
        "flexctrl.cli.rlocus",
        "root locus of the machine and its rigid twin",
        "flexctrl rlocus examples/flexible_arm.toml --input elbow_torque --output elbow_angle --out results",
        ("input", "output"),
    ),
    "compare": Command(
        "flexctrl.cli.compare",
        "rigid against flexible: curves and numbers",
        "flexctrl compare examples/bridge_crane.toml --out results",
    ),
    "ledger": Command(
        "flexctrl.cli.ledger",
        "every effect: what leaving it out changes, what it costs, and the smallest set that will do",
        "flexctrl ledger examples/ceiling_crane.toml --tolerance 0.01 --out results",
        ("tolerance", "outputs-only"),
    ),
    "cost": Command(
        "flexctrl.cli.cost",
        "error against time for many settings, and the cheapest for the tolerance asked",
        "flexctrl cost examples/ceiling_crane.toml --tolerance 0.01 --out results",
        ("tolerance", "workers"),
    ),
    "ladder": Command(
        "flexctrl.cli.ladder",
        "the scene from rigid to refined: error and time of each rung of physics",
        "flexctrl ladder examples/ceiling_crane.toml --out results",
        ("tolerance",),
    ),
    "report": Command(
        "flexctrl.cli.report",
        "one self-contained HTML page: machine, modes, loops, runs, ledger, cost, versions",
        "flexctrl report examples/bridge_crane.toml --out results",
        ("tolerance", "count", "input", "output"),
    ),
}

_OPTIONS: dict[str, dict[str, object]] = {
    "count": {"type": int, "default": 12, "metavar": "N", "help": "how many modes to show, lowest first (12)"},
    "tolerance": {"type": float, "default": 0.01, "metavar": "X", "help": "relative change that is borne (0.01)"},
    "outputs-only": {"action": "store_true", "help": "hold the outputs; poles and margins are told but do not count"},
    "input": {"default": "", "metavar": "NAME", "help": "input where the loop is looked at or cut"},
    "output": {"default": "", "metavar": "NAME", "help": "output of the response"},
    "workers": {
        "type": int,
        "default": None,
        "metavar": "N",
        "help": "processes that find errors; times are taken in one (all processors with joblib, else 1)",
    },
}


@frozen
class Request:
    """What was asked on the command line.

    Attributes
    ----------
    scene : str
        Path of the scene.
    out : Path or None
        Directory for pictures and data.
    count : int
    input, output : str
    tolerance : float
    outputs_only : bool
    workers : int or None
    """

    scene: str
    out: Path | None = None
    count: int = 12
    input: str = ""
    output: str = ""
    tolerance: float = 0.01
    outputs_only: bool = False
    workers: int | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.tolerance < math.inf:
            raise SceneError(f"--tolerance {self.tolerance}: expected a relative change > 0, e.g. 0.01")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments; default: those of the process.

    Returns
    -------
    int
        0, 1 for a run that failed or was interrupted, 2 for bad input.
    """
    arguments = vars(_parser().parse_args(argv))
    with _ending_as_by_ctrl_c():
        return _answered(arguments)


@contextmanager
def _ending_as_by_ctrl_c() -> Iterator[None]:
    """Let a signal to end do what Ctrl-C does: stop where things fit together, keep what was found, say so."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(number: int, frame: FrameType | None) -> None:
        asked = signal.getsignal(signal.SIGINT)
        (asked if callable(asked) else signal.default_int_handler)(number, frame)

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _answered(arguments: dict[str, Any]) -> int:
    """Give a command's answer, or say why there is none; return how the process ends."""
    command, as_json, scene = COMMANDS[arguments.pop("command")], arguments.pop("json"), arguments["scene"]
    try:
        request = Request(**arguments)
        if request.out is not None:
            request.out.mkdir(parents=True, exist_ok=True)
        answer = importlib.import_module(command.module).answer(request)
        print(json.dumps(answer.data, allow_nan=False, ensure_ascii=False) if as_json else answer.text, flush=True)
    except FlexctrlError as error:
        return _complain(
            _told_of(scene, error), BAD_INPUT if isinstance(error, ValueError | MechanismError) else FAILED
        )
    except BrokenPipeError:
        sys.stdout = None  # the reader has gone; nothing is left to flush
        return OK
    except OSError as error:
        return _complain(error, BAD_INPUT)
    except KeyboardInterrupt:
        return _complain("interrupted", FAILED)
    if answer.problem:
        return _complain(answer.problem, FAILED)
    return OK


def _told_of(scene: str, error: FlexctrlError) -> str:
    """What is wrong, in which file, and where in it an equilibrium can be helped."""
    told = str(error)
    where = "" if scene in told or told.startswith("--") else f"{scene}: "
    if not isinstance(error, EquilibriumError):
        return where + told
    help = (
        'in the file: [equilibrium] hold = { "part.start.u" = 0.0 } holds a freedom, inputs = { … } balances the load'
    )
    return f"{where}{told} ({help})"


def _complain(problem: object, code: int) -> int:
    print(f"flexctrl: {problem}", file=sys.stderr)
    return code


class _Parser(argparse.ArgumentParser):
    """One that asks whether another word was meant."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong, and how to go on."""
        said = re.search(r"invalid choice: '(\S+)'|unrecognized arguments: (--[\w-]+)", message)
        known = [*COMMANDS, *(f"--{name}" for name in (*_OPTIONS, "out", "json", "version"))]
        hint = did_you_mean(said[1] or said[2], known) if said else ""
        super().error(message + (hint if "did you mean" in hint else ""))


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="flexctrl",
        description="Flexible machines and their controllers, from one scene file.",
        epilog="example: flexctrl run examples/ceiling_crane.toml --out results",
    )
    parser.add_argument("--version", action="version", version=f"flexctrl {flexctrl.__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, command in COMMANDS.items():
        sub = commands.add_parser(
            name, help=command.gives, description=command.gives, epilog=f"example: {command.example}"
        )
        sub.add_argument("scene", metavar="SCENE", help="a .toml scene, or a .py file that defines scene")
        sub.add_argument("--out", type=Path, metavar="DIR", help="write pictures and data there")
        sub.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
        for option in command.options:
            sub.add_argument(f"--{option}", **_OPTIONS[option])  # type: ignore[arg-type]
    return parser


__all__ = ["COMMANDS", "Command", "Request", "main"]
