"""The shipped scenes run from the command line, and give the numbers they should."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexctrl.cli.program import main

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
PROMISED = {"scene", "status", "steps", "rejected_steps", "newton_iterations", "wall_s", "dofs", "energy_residual"}


def _json_of(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    assert main([*arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_ceiling_crane(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "out"
    answer = _json_of(capsys, "run", str(EXAMPLES / "ceiling_crane.toml"), "--out", str(out))
    assert set(answer) >= PROMISED
    assert answer["status"] == "finished"
    assert answer["steps"] == 500
    assert answer["dofs"] == 65
    assert answer["energy_residual"] < 1e-3
    assert answer["outputs"]["load_z"]["final"] == pytest.approx(-3.00552, abs=5e-5)
    assert answer["rigid"]["outputs"]["load_z"]["final"] == pytest.approx(-2.97065, abs=5e-5)
    curves = np.genfromtxt(out / "run.csv", delimiter=",", names=True)
    assert curves["load_z"][-1] == pytest.approx(answer["outputs"]["load_z"]["final"], abs=1e-9)
    assert (out / "outputs.png").stat().st_size > 5_000


@pytest.mark.slow
def test_bridge_crane_carries_its_load_five_metres_and_back(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    answer = _json_of(capsys, "run", str(EXAMPLES / "bridge_crane.toml"), "--out", str(tmp_path))
    assert answer["status"] == "finished"
    curves = np.genfromtxt(tmp_path / "run.csv", delimiter=",", names=True)
    held = curves["load_x"][(curves["t"] > 28.0) & (curves["t"] < 31.0)]
    assert np.abs(held - 5.0).max() < 4e-3
    for machine in (answer, answer["rigid"]):
        assert machine["outputs"]["load_x"]["final"] == pytest.approx(0.0, abs=2e-3)
        assert machine["outputs"]["sway"]["max_abs"] == pytest.approx(0.0186, abs=1.5e-3)
        assert machine["inputs"]["left_torque"]["max_abs"] < 250.0


@pytest.mark.slow
def test_flexible_arm_reaches_its_pose(capsys: pytest.CaptureFixture[str]) -> None:
    answer = _json_of(capsys, "run", str(EXAMPLES / "flexible_arm.toml"))
    x, y = np.cos(np.pi / 3) + 0.8 * np.cos(np.pi / 6), np.sin(np.pi / 3) - 0.8 * np.sin(np.pi / 6)
    for machine, near in ((answer, 5e-4), (answer["rigid"], 1e-4)):
        assert machine["status"] == "finished"
        assert machine["outputs"]["tip_x"]["final"] == pytest.approx(x, abs=near)
        assert machine["outputs"]["tip_y"]["final"] == pytest.approx(y, abs=near)
    assert answer["outputs"]["tip_z"]["final"] == pytest.approx(-0.01235, abs=2e-4)


@pytest.mark.parametrize(
    ("scene", "first"), [("ceiling_crane", 0.34711), ("bridge_crane", 0.1574), ("flexible_arm", 3.966)]
)
def test_modes_of_the_scenes(capsys: pytest.CaptureFixture[str], scene: str, first: float) -> None:
    answer = _json_of(capsys, "modes", str(EXAMPLES / f"{scene}.toml"))
    assert answer["equilibrium"]["residual"] < 1e-9
    flexible = [f for f in answer["frequencies_hz"] if f > 0.1]
    assert flexible[0] == pytest.approx(first, rel=2e-3)
