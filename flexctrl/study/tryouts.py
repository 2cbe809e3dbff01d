"""Settings tried on a scene: errors as many at a time as there are processors, times one after the other."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from typing import Any, cast

import numpy as np

from flexctrl.errors import FlexctrlError, StructureError
from flexctrl.study.answers import Curves
from flexctrl.study.reference import error_of, finished
from flexctrl.study.settings import Setting
from flexctrl.study.store import Point
from flexctrl.study.subject import Subject

__all__ = ["Workshop", "calibration", "errors", "time_of", "workers_of"]

_LEAST_RUNS, _MOST_RUNS = 3, 8
_ENOUGH = 0.3  # seconds of runs that are short
_SCATTERS, _SCATTER = 2.0, 1.2
"""By what factor one time may be off, and the shortest of several."""


def workers_of(asked: int | None) -> int:
    """Return how many processes share the work.

    Parameters
    ----------
    asked : int or None
        None: one for each processor if joblib is there, else one.

    Returns
    -------
    int

    Raises
    ------
    StructureError
        For a number that is not positive, or more than one without joblib.
    """
    if asked is not None and (isinstance(asked, bool) or not isinstance(asked, int) or asked < 1):
        raise StructureError(f"workers = {asked!r}; expected a whole number ≥ 1")
    try:
        import joblib  # noqa: F401
    except ImportError:
        if asked is not None and asked > 1:
            raise StructureError(
                f"workers = {asked}: several processes need joblib; pip install 'flexctrl[parallel]', or give 1"
            ) from None
        return 1
    return asked or os.cpu_count() or 1


class Workshop:
    """A scene computed in many ways; those of the same physics that follow one another share the machine.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene: Subject) -> None:
        self.scene = scene
        self._last: tuple[tuple[Any, ...], Subject] | None = None

    def of(self, setting: Setting) -> Subject:
        """Return the scene computed in one way.

        Parameters
        ----------
        setting : Setting

        Returns
        -------
        Scene
        """
        alike = self._last is not None and self._last[0] == setting.physics
        made = setting.run(self._last[1]) if alike and self._last else setting.of(self.scene)
        self._last = setting.physics, made
        return made


def errors(
    scene: Subject, settings: Sequence[Setting], reference: Curves, workers: int
) -> Iterator[tuple[Setting, Point]]:
    """Try settings, and yield a point of each, not timed, as it is found.

    Parameters
    ----------
    scene : Scene
    settings : sequence of Setting
    reference : Curves
        What errors are against.
    workers : int
        Processes.

    Yields
    ------
    (Setting, Point)
    """
    bare = replace(cast(Any, scene))  # without the models it has made
    if workers == 1 or len(settings) < 2 or not _can_be_sent(bare):
        shop = Workshop(scene)
        yield from ((setting, _tried(shop, setting, reference)) for setting in settings)
        return
    alike = [list(some) for _, some in groupby(settings, lambda setting: setting.physics)]
    yield from _shared(bare, sorted(alike, key=lambda some: -some[0].mesh), reference, min(workers, len(alike)))


def _shared(
    scene: Subject, alike: Sequence[Sequence[Setting]], reference: Curves, workers: int
) -> Iterator[tuple[Setting, Point]]:
    """Try settings in several processes, which end with it, however it ends: times are taken on a quiet machine."""
    from joblib import Parallel, delayed
    from joblib.externals.loky import get_reusable_executor
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    pool = Parallel(n_jobs=workers, return_as="generator_unordered")
    try:
        found = pool(delayed(_all_tried)(scene, settings, reference) for settings in alike)
        yield from ((point.setting, point) for points in found for point in points)
    except TerminatedWorkerError:
        raise FlexctrlError(
            f"{scene.name}: a process that tries settings was ended from outside, for want of memory perhaps; give "
            "fewer workers (what was found is kept if there is a store)"
        ) from None
    finally:
        get_reusable_executor().shutdown(wait=True, kill_workers=True)


def _can_be_sent(scene: Subject) -> bool:
    """Tell whether a scene can go to another process; a controller of the user's own may hold what cannot."""
    import cloudpickle

    try:
        cloudpickle.dumps(scene)
    except Exception:  # whatever an object raises that does not want to be copied
        return False
    return True


def _all_tried(scene: Subject, settings: Sequence[Setting], reference: Curves) -> list[Point]:
    shop = Workshop(scene)
    return [_tried(shop, setting, reference) for setting in settings]


def _tried(shop: Workshop, setting: Setting, reference: Curves) -> Point:
    try:
        run = finished(shop.of(setting))
    except FlexctrlError as error:
        return Point(setting, np.inf, np.inf, 0, str(error).splitlines()[0])
    return Point(setting, error_of(reference, run), np.nan, run.report.steps)


def time_of(shop: Workshop, setting: Setting, best: float = np.inf) -> float:
    """Return the processor time of a setting over that of a fixed calculation made in between: the least of several.

    Parameters
    ----------
    shop : Workshop
        Of a scene with rows at the end only: what is interpolated between steps would count against long ones.
    setting : Setting
    best : float
        The least time of a setting at least as accurate: what takes much longer is run less often.

    Returns
    -------
    float
    """
    scene = shop.of(setting)
    finished(scene)  # assembles and compiles
    times: list[float] = []
    spent = 0.0
    while _uncertain(times, best) and (len(times) < _LEAST_RUNS or (spent < _ENOUGH and len(times) < _MOST_RUNS)):
        unit, began = calibration(), time.process_time()
        finished(scene)
        took = time.process_time() - began
        times.append(took / min(unit, calibration()))
        spent += took
    return min(times)


def _uncertain(times: Sequence[float], best: float) -> bool:
    """Whether more runs might show a setting to be as quick as one at least as accurate."""
    scatter = _SCATTERS if len(times) < _LEAST_RUNS else _SCATTER
    return not times or min(times) <= scatter * best


def calibration() -> float:
    """Return the processor time of a fixed calculation [s]: small dense solves, as runs are made of."""
    A = np.eye(40) + 0.01 * np.arange(1600.0).reshape(40, 40) % 0.7
    b: np.ndarray = np.ones(40)
    began = time.process_time()
    for _ in range(100):
        b = np.linalg.solve(A, b)
        b = b / np.abs(b).max()
    return time.process_time() - began
