"""A rigid beam is the body that its elements are when their nodes move as those of one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flexctrl as fc
from flexctrl.model.laws import part_kinds
from flexctrl.model.laws.families import _beams, _rigid_beams

EFFECTS = (fc.Gravity((0.3, -9.0, 2.0)), fc.RayleighDamping(0.3, 0.0), fc.RotatingFrame((0.2, 0.1, 0.7)))
SECTIONS = {
    "slender": fc.Section(EA=2e5, EI_y=157, EI_z=80, GJ=157, rhoA=1.3, rhoJ=1e-2),
    "box": fc.Section.box(fc.STEEL, width=0.2, height=0.3, web=0.01, flange=0.02),
}


@pytest.mark.parametrize("effects", [EFFECTS[:1], EFFECTS[:2], EFFECTS], ids=["weight", "damping", "turning"])
@pytest.mark.parametrize("section", SECTIONS)
def test_force_and_energy_are_those_of_the_element(section, effects):
    """On six rigid motions of a beam in any place, in any motion: generalised forces agree."""
    rng = np.random.default_rng(3)
    beam = fc.Beam("beam", (0.3, -0.2, 0.5), (1.4, 0.7, -0.1), SECTIONS[section], elements=1)
    s = fc.Structure([beam])
    element = _beams(part_kinds.BEAM, s, effects, [beam], frozenset({"beam"}))
    body = _rigid_beams(s, effects, [beam])
    turn = Rotation.random(random_state=2).as_matrix()
    v, w, a, b = rng.normal(size=(4, 3))
    slots, motions = [], []
    for node in (beam.start, beam.end):
        x = turn @ np.array(node.position) + 0.4
        speed, pull = v + np.cross(w, x), a + np.cross(b, x) + np.cross(w, np.cross(w, x))
        slots.append(np.concatenate([x, turn.ravel(), speed, w, pull, b]))
        motions.append(np.vstack([np.hstack([np.eye(3), -skew(x)]), np.hstack([np.zeros((3, 3)), np.eye(3)])]))
    z, T = np.concatenate(slots), np.vstack(motions)
    told = [T.T @ f.kernels.force.function()(z, f.parameters[0]).full().ravel() for f in (body, element)]
    assert np.allclose(*told, rtol=1e-10, atol=1e-10 * np.abs(told[1]).max())
    energies = [f.kernels.energy.function()(z, f.parameters[0]).full().ravel() for f in (body, element)]
    assert np.allclose(*energies, rtol=1e-10, atol=1e-10)
    assert body.kernels.force.instructions < 0.4 * element.kernels.force.instructions


def skew(x: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [-x[1], x[0], 0.0]])
