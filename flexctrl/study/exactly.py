"""Scenes whose equations are linear are integrated exactly, with no more modes than they need."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from flexctrl.dynamics.linear_motion.exact import Exact
from flexctrl.study.settings import spacing_of
from flexctrl.study.subject import Subject

__all__ = ["exactly", "fewer_modes"]

_FEWEST = 1


def exactly(scene: Subject) -> Subject:
    """Return a scene integrated exactly, if that can be done at the price of a product with a matrix a step.

    That is where motion is small, no law of force switches (friction, backlash) and inputs are held between samples.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    Scene
        The scene itself where it cannot.
    """
    held = scene.law is None or scene.law.sample_time > 0.0
    model = scene.model
    if model.large or not model.n or model.switches.names or not held or isinstance(scene.simulation.method, Exact):
        return scene
    if any(callable(load) for load in scene.loads.values()) and scene.law is None:
        return scene
    return scene.with_(simulation=replace(scene.simulation, method=Exact(spacing_of(scene))))


def fewer_modes(scene: Subject) -> Iterator[Subject]:
    """Yield a scene that is integrated exactly with ever more of its modes, from one on, each time twice as many.

    Parameters
    ----------
    scene : Scene

    Yields
    ------
    Scene
        None at all for a scene that is integrated otherwise, or with some of its modes already.
    """
    method = scene.simulation.method
    if not isinstance(method, Exact) or method.modes is not None:
        return
    count = _FEWEST
    while count < scene.model.n:
        yield scene.with_(simulation=replace(scene.simulation, method=replace(method, modes=count)))
        count *= 2
