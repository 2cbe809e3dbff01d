"""Sections that lack one way to give, or the rotary inertia of bending."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from flexctrl.structure.sections import Section

__all__ = ["WAYS"]

_STIFF = 1e3
_STRAINS = ("EA", "GA_y", "GA_z", "GJ", "EI_y", "EI_z")  # in the order of a coupled law


def _stiffer(*names: str) -> Callable[[Section], Section]:
    """What makes some rigidities a thousand times as large, of a coupled law its diagonal: what they resist is gone."""

    def stiffer(section: Section) -> Section:
        if section.stiffness:
            law = np.array(section.stiffness)
            places = [_STRAINS.index(name) for name in names]
            law[places, places] *= _STIFF
            return Section.coupled(law, section.rhoA, section.rhoJ, section.rhoI_y, section.rhoI_z)
        return replace(section, **{name: _STIFF * getattr(section, name) for name in names})

    return stiffer


def _unsheared(section: Section) -> Section:
    if section.stiffness:
        return _stiffer("GA_y", "GA_z")(section)
    return replace(section, GA_y=np.inf, GA_z=np.inf) if section.shears else section


def _without_rotary_inertia(section: Section) -> Section:
    return replace(section, rhoI_y=0.0, rhoI_z=0.0) if section.rhoI_y or section.rhoI_z else section


WAYS: dict[str, Callable[[Section], Section]] = {
    "beam_stretch": _stiffer("EA"),
    "beam_torsion": _stiffer("GJ"),
    "beam_bending": _stiffer("EI_y", "EI_z"),
    "beam_shear": _unsheared,
    "rotary_inertia": _without_rotary_inertia,
}
"""By the name of what goes: a section → the same without it; itself if it does not have it."""
