"""What the studies of cost and accuracy are made of: a scene that can be run, changed, and run again."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol, TypeVar

from flexctrl.design.controller import Controller
from flexctrl.dynamics.run import Run
from flexctrl.effects.automatic import Automatic
from flexctrl.effects.effect import Effect
from flexctrl.errors import StructureError, shortened
from flexctrl.linear.model import LinearModel
from flexctrl.model.model import Model
from flexctrl.structure.freedoms import check_finite
from flexctrl.structure.structure import Structure

__all__ = ["Subject", "check_outputs", "planned", "prepared"]

_ROWS = 1000

S = TypeVar("S", bound="Subject")


class Subject(Protocol):
    """What is studied: a `Scene`."""

    @property
    def structure(self) -> Structure: ...

    @property
    def effects(self) -> tuple[Effect, ...]: ...

    @property
    def law(self) -> Controller | None: ...

    @property
    def model(self) -> Model: ...

    @property
    def linear(self) -> LinearModel: ...

    @property
    def name(self) -> str: ...

    @property
    def simulation(self) -> Any: ...

    @property
    def loads(self) -> Mapping[str, Any]: ...

    def run(self, model: Model | None = None, progress: Callable[[float], None] | None = None) -> Run:
        """Simulate."""

    def with_(
        self: S,
        *,
        structure: Structure | None = ...,
        effects: Sequence[Effect] | None = ...,
        controller: Any = ...,
        loads: Mapping[str, Any] | None = ...,
        simulation: Any = ...,
    ) -> S:
        """Return a copy with some fields replaced."""


def prepared(scene: Subject, tolerance: float, study: str) -> Subject:
    """Return a scene with its controller built once, outputs at even instants, and no twin beside it.

    Parameters
    ----------
    scene : Scene
    tolerance : float
        Largest relative change or error that the study is asked for.
    study : str
        Who asks, for the message.

    Returns
    -------
    Scene

    Raises
    ------
    StructureError
        For a tolerance that is not positive, what is no scene, or a scene without a simulation or outputs.
    """
    check_finite(tolerance, "tolerance (relative, as 0.01)", study, above=0.0)
    plan = planned(scene, study)
    check_outputs(scene.structure, study)
    every = plan.every or plan.until / _ROWS
    effects = [e for e in scene.effects if not isinstance(e, Automatic)]  # studies are of all that are named
    if len(effects) < len(scene.effects):
        scene = scene.with_(effects=effects)
    return scene.with_(controller=scene.law, simulation=replace(plan, every=every, rigid_twin=False))


def check_outputs(structure: Structure, study: str) -> None:
    """Refuse a machine that nothing is measured on.

    Parameters
    ----------
    structure : Structure
    study : str
        Who asks, for the message.

    Raises
    ------
    StructureError
    """
    if not structure.outputs:
        raise StructureError(
            f"{study}: {structure.name or 'the machine'} has no outputs, and nothing to judge by; give some, as "
            "outputs=[Position('tip_z', beam.end, 'z')]"
        )


def planned(scene: Subject, study: str) -> Any:
    """Return how a scene is run; refuse what is no scene, or has no simulation.

    Parameters
    ----------
    scene : Scene
    study : str
        Who asks, for the message.

    Returns
    -------
    Simulation

    Raises
    ------
    StructureError
    """
    if isinstance(scene, type) or not hasattr(scene, "simulation"):
        raise StructureError(f"{study}: {shortened(scene)} is no Scene; give flexctrl.Scene(…) or load_scene('….toml')")
    if scene.simulation is None:
        raise StructureError(f"{study}: scene {scene.name!r} has no simulation; give at least until = … (seconds)")
    return scene.simulation
