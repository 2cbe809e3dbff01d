"""Settings tried on a scene: errors as many at a time as there are processors, times one after the other."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from flexctrl.errors import FlexctrlError, StructureError
from flexctrl.study.answers import Curves
from flexctrl.study.reference import error_of, finished
from flexctrl.study.settings import Setting
from flexctrl.study.store import Point
from flexctrl.study.subject import Subject

__all__ = ["calibration", "errors", "time_of", "workers_of"]

_LEAST_RUNS, _MOST_RUNS = 3, 8
_ENOUGH = 0.3  # seconds of runs that are short


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
    bare = scene.with_()  # without the models it has made
    if workers == 1 or len(settings) < 2 or not _can_be_sent(bare):
        yield from ((setting, _tried(scene, setting, reference)) for setting in settings)
        return
    from joblib import Parallel, delayed

    pool = Parallel(n_jobs=min(workers, len(settings)), return_as="generator")
    found = pool(delayed(_tried)(bare, setting, reference) for setting in settings)
    yield from zip(settings, found, strict=True)


def _can_be_sent(scene: Subject) -> bool:
    """Tell whether a scene can go to another process; a controller of the user's own may hold what cannot."""
    import cloudpickle

    try:
        cloudpickle.dumps(scene)
    except Exception:  # whatever an object raises that does not want to be copied
        return False
    return True


def _tried(scene: Subject, setting: Setting, reference: Curves) -> Point:
    try:
        run = finished(setting.of(scene))
    except FlexctrlError as error:
        return Point(setting, np.inf, np.inf, 0, str(error).splitlines()[0])
    return Point(setting, error_of(reference, run), np.nan, run.report.steps)


def time_of(scene: Subject, setting: Setting) -> float:
    """Return the processor time of a setting over that of a fixed calculation made in between: the least of several.

    Rows are asked for at the end only: what is interpolated between steps would count against long ones.

    Parameters
    ----------
    scene : Scene
    setting : Setting

    Returns
    -------
    float
    """
    plan = replace(scene.simulation, every=scene.simulation.until)
    bare = setting.of(scene.with_(simulation=plan))
    finished(bare)  # assembles and compiles
    times: list[float] = []
    spent = 0.0
    while len(times) < _LEAST_RUNS or (spent < _ENOUGH and len(times) < _MOST_RUNS):
        unit, began = calibration(), time.process_time()
        finished(bare)
        took = time.process_time() - began
        times.append(took / min(unit, calibration()))
        spent += took
    return min(times)


def calibration() -> float:
    """Return the processor time of a fixed calculation [s]: small dense solves, as runs are made of."""
    A = np.eye(40) + 0.01 * np.arange(1600.0).reshape(40, 40) % 0.7
    b: np.ndarray = np.ones(40)
    began = time.process_time()
    for _ in range(100):
        b = np.linalg.solve(A, b)
        b = b / np.abs(b).max()
    return time.process_time() - began
