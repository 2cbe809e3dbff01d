"""The loop that ``bode`` and ``rlocus`` look at, of the machine and of its rigid twin."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexctrl.cli.program import Request
from flexctrl.errors import SceneError, did_you_mean
from flexctrl.frozen import frozen
from flexctrl.linear.model import LinearModel
from flexctrl.model.equilibrium import Rest
from flexctrl.model.laws.idle import idle
from flexctrl.model.model import Model
from flexctrl.scene import Scene
from flexctrl.study.broken_loop import broken_loop, unlinear
from flexctrl.study.loop import Loop, open_loop

DRIFT = 1e-6
"""Modes slower than this share of the fastest are free motion, but for rounding."""


@frozen
class Cut:
    """Where a scene's loop is looked at.

    Attributes
    ----------
    scene : Scene
    input, output : str
        Signals of the plain response.
    controlled : bool
        Whether the scene's controller commands the input.
    """

    scene: Scene
    input: str
    output: str
    controlled: bool

    @property
    def machines(self) -> dict[str, LinearModel]:
        """The machine and its rigid twin, linearised about their equilibria; a twin that cannot move is left out."""
        twin = {"rigid": self.scene.twin_linear} if self.scene.twin.n else {}
        return {"flexible": self.scene.linear} | twin

    @property
    def notes(self) -> list[str]:
        """What the linear models leave out of the machine, of its twin and of the controller."""
        scene = self.scene
        own = left_out(scene.model, scene.rest)
        twin = left_out(scene.twin, scene.twin_rest) if scene.twin.n else []
        law = unlinear(scene.law) if self.controlled else without_law(scene)
        return [*own, *(f"rigid twin: {note}" for note in twin if note not in own), *law]

    @property
    def title(self) -> str:
        """What the loop is."""
        if self.controlled:
            return f"{self.scene.name}: loop cut at {self.input}"
        return f"{self.scene.name}: {self.output} from {self.input}"

    def loop(self, linear: LinearModel) -> Loop:
        """Return the loop: cut at the input under the scene's controller, else output fed back to input."""
        if self.controlled:
            return broken_loop(linear, self.scene.law, self.input)
        return open_loop(linear, 1.0, self.input, self.output)

    @property
    def span(self) -> tuple[float, float]:
        """Angular frequencies worth showing of both machines: a decade below the slowest mode to above the fastest."""
        omega = np.concatenate([m.omega[m.flexible] for m in (linear.modes() for linear in self.machines.values())])
        omega = omega[omega > DRIFT * omega.max(initial=0.0)]
        return (0.1 * float(omega.min()), 3.0 * float(omega.max())) if omega.size else (0.1, 1e3)

    def responds(self, linear: LinearModel) -> bool:
        """Whether the input moves the output at all."""
        chosen = linear.select([self.input], [self.output])
        span = np.geomspace(1e-2, 1e3, 7)
        size = np.abs(linear.frequency_response(span).values).max()
        return bool(np.abs(chosen.frequency_response(span).values).max() > 1e-12 * size)


def left_out(model: Model, rest: Rest) -> list[str]:
    """Return what a linear model leaves out of a machine.

    Parameters
    ----------
    model : Model
    rest : Rest
        The equilibrium that it is about.

    Returns
    -------
    list of str
    """
    return [*model.notes, *idle(model, rest.state)]


def without_law(scene: Scene) -> list[str]:
    """Return a note that a scene's controller has no part in what is shown; nothing for a scene without one."""
    return [] if scene.controller is None else ["the machine is shown by itself, without the scene's controller"]


def noted(notes: Sequence[str]) -> list[str]:
    """Return notes as lines below a table; none for none."""
    return ["", *(f"note: {note}" for note in notes)] if notes else []


def cut_of(scene: Scene, request: Request) -> Cut:
    """Choose where to look: as the command line says, else as the scene says, else the first signals.

    Parameters
    ----------
    scene : Scene
    request : Request

    Returns
    -------
    Cut

    Raises
    ------
    SceneError
        For a signal that the machine does not have, or a machine without signals.
    """
    commanded = scene.law.outputs if scene.law is not None else ()
    first = commanded or scene.model.inputs
    input = _chosen("input", request.input or scene.channel.input, scene.model.inputs, first, scene.name)
    outputs = scene.model.outputs
    seen = tuple(name for name in outputs if name in scene.twin.outputs)
    output = _chosen("output", request.output or scene.channel.output, outputs, seen or outputs, scene.name)
    return Cut(scene, input, output, input in commanded)


def _chosen(kind: str, wanted: str, known: tuple[str, ...], first: tuple[str, ...], scene: str) -> str:
    if wanted and wanted not in known:
        raise SceneError(f"{scene}: the machine has no {kind} {wanted!r}{did_you_mean(wanted, known)}")
    if not known:
        raise SceneError(f"{scene}: the machine has no {kind}s; give some in [{kind}s]")
    return wanted or first[0]


__all__ = ["Cut", "cut_of", "left_out", "noted", "without_law"]
