"""The same scene under other loads: cases on which a choice was not made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from flexctrl.design.piecewise import Trajectory
from flexctrl.design.tracking import Commanded, OpenLoop, Together, Tracking
from flexctrl.design.wrapping import Wrapper, breaks_of
from flexctrl.frozen import frozen
from flexctrl.study.subject import Subject

__all__ = ["FACTORS", "load_cases"]

FACTORS = (0.6, 1.2)


@frozen
class Times(Trajectory):
    """A signal times a number."""

    signal: Any
    factor: float

    def __call__(self, t: float) -> float:
        return self.factor * float(self.signal(t))

    def along(self, times: np.ndarray) -> np.ndarray:
        """Return the values at many instants."""
        if isinstance(self.signal, Trajectory):
            return self.factor * self.signal.along(times)
        return super().along(times)

    @property
    def derivative(self) -> Trajectory:
        """Its derivative, scaled alike."""
        return Times(self.signal.derivative, self.factor)

    @property
    def breaks(self) -> tuple[float, ...]:
        """Those of the signal."""
        return breaks_of(self.signal)


def load_cases(scene: Subject, factors: tuple[float, ...] = FACTORS) -> tuple[Subject, ...]:
    """Return a scene under scaled loads and commanded moves; none if it has neither.

    Parameters
    ----------
    scene : Scene
        With its controller built.
    factors : tuple of float

    Returns
    -------
    tuple of Scene
    """
    law = None if scene.law is None else _scaled(scene.law, 1.0)
    if not scene.loads and law is scene.law:
        return ()
    return tuple(
        scene.with_(controller=_scaled(scene.law, f), loads={n: _load(load, f) for n, load in scene.loads.items()})
        for f in factors
    )


def _load(load: Any, factor: float) -> Any:
    return Times(load, factor) if callable(load) else factor * load


def _scaled(law: Any, factor: float) -> Any:
    """Return a controller whose references and commands are scaled; itself if it has none."""
    if isinstance(law, Tracking):
        return replace(law, controller=_scaled(law.controller, factor), reference=_all(law.reference, factor))
    if isinstance(law, Commanded):
        return replace(law, controller=_scaled(law.controller, factor), signals=_all(law.signals, factor))
    if isinstance(law, OpenLoop):
        return replace(law, commands=_all(law.commands, factor))
    if isinstance(law, Together):
        parts = [_scaled(part, factor) for part in law.parts]
        return law if all(a is b for a, b in zip(parts, law.parts, strict=True)) else Together(*parts)
    if isinstance(law, Wrapper):
        inner = _scaled(law.controller, factor)
        return law if inner is law.controller else replace(law, controller=inner)
    return law


def _all(signals: Mapping[str, Any], factor: float) -> dict[str, Trajectory]:
    return {name: Times(signal, factor) for name, signal in signals.items()}
