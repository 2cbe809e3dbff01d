"""Scenes that are run: loads, starts and what is held."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import TROLLEY

from flexctrl.errors import EquilibriumError
from flexctrl.scene import load_scene


def test_loads_push_beside_the_controller(written):
    text = TROLLEY + '\n[loads]\npush = { kind = "step", size = 4.0, at = 0.1 }\n'
    run = load_scene(written(text)).run()
    assert run["push"][0] == 0.0
    assert run["push"][-1] == 4.0
    assert np.abs(run["torque"]).max() > 0.0


def test_a_run_that_starts_in_equilibrium_stays_there_without_a_move(written):
    text = TROLLEY.replace("distance = 0.5", "distance = 0.0")
    run = load_scene(written(text)).run()
    sink = 5.0 * 9.81 * 2.0 / 2e5
    assert run["load_z"] == pytest.approx(np.full(len(run.t), -2.0 - sink), abs=1e-9)


def test_freedoms_are_held_by_node_or_by_name(written):
    for name in ("trolley.u", "trolley_0_u"):
        scene = load_scene(
            written(TROLLEY + f'\n[equilibrium]\nhold = {{ "{name}" = 0.3 }}\ninputs = {{ push = 2.0 }}\n')
        )
        rest = scene.rest.outputs
        assert rest["travel"] == pytest.approx(0.3)
        assert np.tan(rest["sway"]) == pytest.approx(2.0 / (5.0 * 9.81), rel=1e-9)
        assert scene.twin_rest.outputs["travel"] == pytest.approx(0.3)


def test_an_equilibrium_that_cannot_be_is_told(written):
    scene = load_scene(written(TROLLEY + "\n[equilibrium]\ninputs = { push = 2.0 }\n"))
    with pytest.raises(EquilibriumError):
        _ = scene.rest
