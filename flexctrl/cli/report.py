"""``flexctrl report``: everything about a scene on one page."""

from __future__ import annotations

import importlib
import platform
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import flexctrl
from flexctrl.cli.answer import Answer, plain
from flexctrl.cli.health import health
from flexctrl.cli.program import COMMANDS, Request
from flexctrl.design.hardware import Noisy
from flexctrl.errors import FlexctrlError
from flexctrl.frozen import frozen
from flexctrl.report.leads import LEADS
from flexctrl.report.modes import animation
from flexctrl.report.page import Section, page
from flexctrl.scene import Scene, load_scene

_HEALTH = "Numerical health"
_TITLES = {
    "table": "Machine",
    "modes": "Modes",
    "bode": "Bode",
    "rlocus": "Root locus",
    "compare": "Closed loop",
    "run": _HEALTH,
    "ladder": "Fidelity",
    "ledger": "Effects",
    "cost": "Accuracy",
}
_ORDER = ("outputs", "inputs", "final")
_AFTER = ("reference: ", "passed over: ", "cheapest within ", "stopped ", "no setting ")
_MODES = 12
_STOPPED = "stopped before it had an answer"
_PACKAGES = ("numpy", "scipy", "control", "casadi", "matplotlib", "llvmlite", "slycot")


@frozen
class Chapter:
    """What one command had to say, and whether it was stopped before it had an answer."""

    section: Section
    data: dict[str, Any]
    stopped: bool = False


def answer(request: Request) -> Answer:
    """Let every command speak, and bind what they say into one page; of a report that is stopped, what there is."""
    scene = load_scene(request.scene)
    out = request.out or Path()
    with tempfile.TemporaryDirectory() as folder:
        titles = _TITLES if scene.law is not None else {**_TITLES, "compare": "Simulation"}
        asked = {n: t for n, t in titles.items() if _applies(n, scene)}
        chapters = _chapters(asked, request, Path(folder))
        stopped = [asked[n] for n in asked if n not in chapters or chapters[n].stopped]
        if len(stopped) == len(asked):
            raise KeyboardInterrupt
        versions = Section("versions", "Versions", _versions(scene), lead=LEADS["versions"])
        sections = [*(c.section for n, c in chapters.items() if n != "run"), _health(scene, chapters), versions]
        motion = _motion(scene) if any(s.moving for s in sections) else {}
        text = page(scene.name, " ".join(scene.notes), sections, motion)
    path = out / f"{scene.name}.html"
    path.write_text(text, encoding="utf-8")
    failed = [s.title for s in sections if s.failed and s.title not in stopped]
    data = {
        "scene": scene.name,
        "page": str(path),
        "bytes": len(text.encode()),
        "sections": [s.title for s in sections],
        "failed": failed,
        "stopped": stopped,
    }
    said = [f"interrupted: {path} has what there was, without {', '.join(stopped)}"] if stopped else []
    said += [f"no answer for: {', '.join(failed)} (the page says why)"] if failed else []
    told = f"{scene.name}: {path} ({len(text) // 1024} KiB), {len(sections)} sections"
    return Answer(told, plain(data), "; ".join(said), bool(stopped))


def _chapters(titles: Mapping[str, str], request: Request, folder: Path) -> dict[str, Chapter]:
    """Ask one command after the other, until one is stopped."""
    found: dict[str, Chapter] = {}
    for name, title in titles.items():
        found[name] = _chapter(name, title, request, folder)
        if found[name].stopped:
            break
    return found


def _applies(name: str, scene: Scene) -> bool:
    timed = name in ("compare", "run", "ladder", "ledger", "cost")
    looped = name in ("bode", "rlocus")
    if looped and not (scene.structure.inputs and scene.structure.outputs):
        return False
    return not timed or scene.simulation is not None


def _chapter(name: str, title: str, request: Request, folder: Path) -> Chapter:
    own = folder / name
    own.mkdir()
    try:
        found = importlib.import_module(COMMANDS[name].module).answer(replace(request, out=own))
    except FlexctrlError as error:
        return Chapter(Section(name, title, str(error), failed=True), {})
    except KeyboardInterrupt:
        return Chapter(Section(name, title, _STOPPED, failed=True), {}, stopped=True)
    if found.interrupted:
        return Chapter(Section(name, title, f"{_STOPPED}: {found.problem}", failed=True), {}, stopped=True)
    pictures = () if name == "run" else tuple(sorted(own.glob("*.png"), key=_rank))
    text, more = _front(found.text) if name == "cost" else (found.text, "")
    section = Section(name, title, text, pictures, moving=name == "modes", lead=LEADS[name], more=more)
    return Chapter(section, found.data)


def _health(scene: Scene, chapters: Mapping[str, Chapter]) -> Section:
    """The run, if there is one, and what the other chapters rest on."""
    run = chapters.get("run")
    text = health(scene, run.section.text if run else "", {name: c.data for name, c in chapters.items()})
    return Section("run", _HEALTH, text, failed=run is not None and run.section.failed, lead=LEADS["run"])


def _rank(picture: Path) -> tuple[int, str]:
    """Curves before the shape at the end; all else by name."""
    known = picture.stem in _ORDER
    return (_ORDER.index(picture.stem) if known else len(_ORDER)), picture.stem


def _front(text: str) -> tuple[str, str]:
    """The settings that no other beats, and what follows from them; and all that were tried."""
    lines = text.splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("setting"))
    last = next((i for i, line in enumerate(lines) if line.startswith(_AFTER)), len(lines))
    kept = [line for i, line in enumerate(lines) if not first < i < last or line.endswith("*")]
    return "\n".join(kept), text


def _motion(scene: Scene) -> dict[str, Any]:
    modes = scene.linear.modes()
    return animation(modes.select(list(range(min(_MODES, len(modes))))))


def _versions(scene: Scene) -> str:
    lines = [f"flexctrl {flexctrl.__version__}", f"Python {platform.python_version()} on {sys.platform}"]
    lines += [f"{name} {_version(name)}" for name in _PACKAGES]
    lines += [f"made {datetime.now(UTC):%Y-%m-%d %H:%M} UTC", f"seeds of noise: {_seeds(scene.law) or 'none'}"]
    return "\n".join(lines)


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def _seeds(law: Any) -> str:
    """The seeds of all noise round a controller."""
    found = []
    while law is not None:
        if isinstance(law, Noisy):
            found.append(str(law.seed))
        law = getattr(law, "controller", None)
    return ", ".join(found)


__all__ = ["answer"]
