"""Scene files: TOML, or a Python module that defines ``scene``."""

from __future__ import annotations

import runpy
import tomllib
import traceback
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from flexctrl.dynamics.alpha.method import AdaptiveAlpha, GeneralizedAlpha
from flexctrl.dynamics.run import Tolerance
from flexctrl.effects.damping import ModalDamping
from flexctrl.effects.effect import Effect
from flexctrl.effects.geometric_stiffness import GeometricStiffness
from flexctrl.errors import FlexctrlError, SceneError, check_kind
from flexctrl.linear.matfile import Units
from flexctrl.model.assemble import assemble
from flexctrl.model.holding import check_free
from flexctrl.scene import laws, parts, physics
from flexctrl.scene.reading import (
    Kind,
    Place,
    by_name,
    checked,
    flag,
    keys,
    known,
    legal_name,
    mapping,
    number,
    one_of,
    positive,
    several,
    text,
)
from flexctrl.scene.scene import Channel, Scene, Simulation, Start

_PLAIN = ("name", "notes", "machine", "effects", "moves", "controllers", "hardware", "loads", "equilibrium", "loop")
_KEYS = (*_PLAIN, *parts.TABLES, "simulation", "units")
_UNITS = Kind(Units, dict.fromkeys(("length", "mass", "force"), text))


def load_scene(path: str | Path) -> Scene:
    """Read a scene from a TOML file, or from a Python file that defines ``scene``.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Scene

    Raises
    ------
    SceneError
        Naming the file, the table and the key, and what was expected there.
    """
    check_kind(path, (str, Path), "load_scene: path", "the name of a .toml or .py file", SceneError)
    file = Path(path)
    if not file.is_file():
        raise SceneError(f"{file}: there is no such file")
    if file.suffix == ".py":
        return _from_python(file)
    if file.suffix != ".toml":
        raise SceneError(f"{file}: a scene is a .toml file, or a .py file that defines scene = flexctrl.Scene(…)")
    return scene_from(_parsed(file), Place(str(file)), file.stem)


def _parsed(file: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise SceneError(f"{file}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise SceneError(f"{file}: is not UTF-8 text ({error.reason} at byte {error.start})") from error
    except tomllib.TOMLDecodeError as error:
        raise SceneError(f"{file}: is not TOML: {error}") from error


def _from_python(file: Path) -> Scene:
    try:
        found = runpy.run_path(str(file), run_name="flexctrl_scene").get("scene")
    except SyntaxError as error:
        raise SceneError(f"{file}: line {error.lineno}: {error.msg}") from error
    except Exception as error:
        if isinstance(error, FlexctrlError) and not isinstance(error, ValueError):
            raise  # a computation in the file that failed: the scene itself may be right
        lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == str(file)]
        where = f"line {lines[-1]}: " if lines else ""
        kind = "" if isinstance(error, FlexctrlError) else f"{type(error).__name__}: "
        raise SceneError(f"{file}: {where}{kind}{error}") from error
    if not isinstance(found, Scene):
        got = "defines no 'scene'" if found is None else f"its 'scene' is a {type(found).__name__}"
        raise SceneError(f"{file}: {got}; expected scene = flexctrl.Scene(structure, …)")
    place = Place(str(file))
    _check_held(found, place.at("scene").at("hold"), lambda effect: place.at("scene").at(type(effect).__name__))
    return found


def scene_from(content: Mapping[str, Any], place: Place, name: str) -> Scene:
    """Make a scene from parsed tables.

    Parameters
    ----------
    content : mapping of str to object
        As tomllib returns them.
    place : Place
        The file, for messages.
    name : str
        Of the scene, if it does not say.

    Returns
    -------
    Scene
    """
    keys(content, place, dict.fromkeys(_KEYS, lambda value, where: value))
    title = legal_name(content.get("name", _legal(name)), place.at("name"))
    base = parts.machine(content["machine"], place.at("machine")) if "machine" in content else None
    structure = parts.structure(content, place, title, base)
    inputs, outputs = ([signal.name for signal in side] for side in (structure.inputs, structure.outputs))
    driven = known("input", inputs)
    rests = {"hold": mapping(number), "inputs": by_name(driven, number)}
    rest = keys(content.get("equilibrium", {}), place.at("equilibrium"), rests)
    moves = laws.moves(content.get("moves", {}), place.at("moves"))
    channel = Kind(Channel, {"input": driven, "output": known("output", outputs)})
    notes = several(text)(content.get("notes", []), place.at("notes"))
    units = _UNITS.read(content.get("units", {}), place.at("units"))
    scene = checked(
        lambda: Scene(
            structure=structure,
            effects=physics.effects(content.get("effects", {}), place.at("effects"), structure),
            controller=laws.controller(content, place, structure, moves),
            loads=by_name(driven, laws.load(moves))(content.get("loads", {}), place.at("loads")),
            simulation=_simulation(content["simulation"], place.at("simulation")) if "simulation" in content else None,
            hold=rest.get("hold", {}),
            rest_inputs=rest.get("inputs", {}),
            channel=channel.read(content.get("loop", {}), place.at("loop")),
            notes=notes,
            units=units,
        ),
        place,
    )
    _check_held(scene, place.at("equilibrium").at("hold"), lambda effect: place.at("effects").at(_LAID[type(effect)]))
    return scene


_LAID: dict[type, str] = {GeometricStiffness: "geometric_stiffness", ModalDamping: "modal_damping"}
"""Effects that are laid about an equilibrium, by the names they have in a scene file."""


def _check_held(scene: Scene, equilibrium: Place, of: Callable[[Effect], Place]) -> None:
    """Refuse to hold what is not there or not free, before anything is computed."""
    laid = [e for e in scene.effects if isinstance(e, GeometricStiffness | ModalDamping)]
    own = [(name, equilibrium.at(name)) for name in scene.hold]
    wanted = [*own, *((name, of(e).at("hold").at(name)) for e in laid for name, _ in e.hold)]
    if not wanted:
        return
    model = assemble(scene.structure, [e for e in scene.effects if e not in laid]) if laid else scene.model
    for name, place in wanted:
        checked(partial(check_free, model, name), place)


_TOLERANCE = Kind(Tolerance, {"relative": number, "absolute": positive})
_SIMULATION = {
    "until": positive,
    "step": positive,
    "rho": number,
    "tolerance": _TOLERANCE.read,
    "every": positive,
    "start": one_of(s.value for s in Start),
    "rigid_twin": flag,
}


def _legal(name: str) -> str:
    """A file's stem as a name."""
    word = "".join(c if c.isascii() and c.isalnum() else "_" for c in name)
    return word if word[:1].isalpha() else f"scene_{word}"


def _simulation(value: Any, place: Place) -> Simulation:
    given = keys(value, place, _SIMULATION, required=("until",))
    if "step" in given and "tolerance" in given:
        raise place.refuse("give step (fixed steps) or tolerance (steps that adapt), not both")
    rho = {"rho": given["rho"]} if "rho" in given else {}
    fixed = "step" in given
    method = checked(lambda: GeneralizedAlpha(given["step"], **rho) if fixed else AdaptiveAlpha(**rho), place)
    return Simulation(
        until=given["until"],
        method=method,
        tolerance=given.get("tolerance", Tolerance()),
        every=given.get("every"),
        start=Start(given.get("start", Start.DRAWN.value)),
        rigid_twin=given.get("rigid_twin", False),
    )


__all__ = ["load_scene", "scene_from"]
