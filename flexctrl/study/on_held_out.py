"""Settings on load cases that they were not chosen on."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from flexctrl.dynamics.run import Run
from flexctrl.errors import FlexctrlError
from flexctrl.study.held_out import FACTORS, load_cases
from flexctrl.study.reference import error_of, finished
from flexctrl.study.settings import Setting
from flexctrl.study.store import Store
from flexctrl.study.subject import Subject

__all__ = ["HeldOut"]


class HeldOut:
    """The held-out cases of a scene, and the runs of the reference on them when these are asked for first.

    Parameters
    ----------
    scene : Scene
    reference : Setting
        That of the reference.
    store : Store
        What is known already, and where it is kept.
    """

    def __init__(self, scene: Subject, reference: Setting, store: Store) -> None:
        self.scene, self.reference, self.store = scene, reference, store

    def errors(self, setting: Setting) -> tuple[float, ...]:
        """Return a setting's error on each case; infinite where it ends early.

        Parameters
        ----------
        setting : Setting

        Returns
        -------
        tuple of float
        """
        known = self.store.known_held(setting, self.reference)
        if known is not None:
            return known
        found = tuple(_error(setting.of(case), run) for case, run, _ in self._ran if run is not None)
        return self.store.keep_held(setting, self.reference, found)

    @property
    def notes(self) -> tuple[str, ...]:
        """Cases on which nothing could be checked, as the reference ends early there: of those that were asked for."""
        return self.store.notes(self.reference)

    @cached_property
    def _ran(self) -> tuple[tuple[Subject, Run | None, str], ...]:
        """Each case, the reference on it, and why there is none."""
        pairs = zip(FACTORS, load_cases(self.scene), strict=False)
        found = tuple((case, *_run(self.reference.of(case), factor)) for factor, case in pairs)
        self.store.keep_notes(self.reference, tuple(told for _, _, told in found if told))
        return found


def _run(scene: Subject, factor: float) -> tuple[Run | None, str]:
    try:
        return finished(scene), ""
    except FlexctrlError as error:
        why = str(error).splitlines()[0]
        return None, f"not checked with loads and moves × {factor:g}, where the reference cannot be run: {why}"


def _error(scene: Subject, reference: Run) -> float:
    try:
        return error_of(reference, finished(scene))
    except FlexctrlError:
        return np.inf
