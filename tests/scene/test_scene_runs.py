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


def test_a_load_that_names_a_move_is_the_move(written):
    """With its shaper: the same run as with the move written out."""
    shaped = '{ kind = "ramp", slope = 10.0, duration = 0.08, shaper = { kind = "zv", omega = 30.0 } }'
    named = load_scene(written(TROLLEY.replace("[moves]", f"[moves]\nhop = {shaped}") + '\n[loads]\npush = "hop"\n'))
    spelled = load_scene(written(TROLLEY + f"\n[loads]\npush = {shaped}\n"))
    run = named.run()
    assert run["push"][-1] == pytest.approx(0.8)
    assert (run["push"] == spelled.run()["push"]).all()


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


def test_what_an_equilibrium_holds_is_free_in_the_linear_model(written):
    """A hold that takes no force gives a free machine its place, and changes nothing else of it."""
    free = load_scene(written(TROLLEY)).linear
    held = load_scene(written(TROLLEY + '\n[equilibrium]\nhold = { "trolley.u" = 0.0 }\n')).linear
    assert held.coordinates == free.coordinates
    assert held.certificate.rigid_modes == free.certificate.rigid_modes
    assert np.abs(held.damped_poles() - free.damped_poles()).max() < 1e-9 * np.abs(free.damped_poles()).max()


def test_a_machine_held_by_a_force_is_linearised_as_it_is_let_go(written):
    text = TROLLEY + '\n[equilibrium]\nhold = { "trolley.u" = 0.3 }\ninputs = { push = 2.0 }\n'
    linear = load_scene(written(text)).linear
    assert "trolley_0_u" in linear.coordinates
    assert linear.certificate.held == ("trolley_0_u",)
    assert linear.certificate.residual < 1e-9


def test_an_equilibrium_that_cannot_be_is_told(written):
    scene = load_scene(written(TROLLEY + "\n[equilibrium]\ninputs = { push = 2.0 }\n"))
    with pytest.raises(EquilibriumError):
        _ = scene.rest
