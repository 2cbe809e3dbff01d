"""The Python examples run, and give the numbers they should: closed forms, references, pinned results."""

from __future__ import annotations

import contextlib
import io
import re
import runpy
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.slow


@dataclass(frozen=True)
class Finished:
    """What a script left behind and what it printed."""

    names: dict[str, Any]
    printed: str


@cache
def _finished(script: str) -> Finished:
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        names = runpy.run_path(str(ROOT / "examples" / script))
    return Finished(names, printed.getvalue())


def test_the_tutorial_shows_what_the_cantilever_prints() -> None:
    page = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
    shown = re.findall(r"^```text\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
    printed = _finished("cantilever.py").printed
    assert len(shown) == 6
    for block in shown:
        assert block in printed


def test_cantilever_frequency_sag_and_pendulum_are_the_textbooks() -> None:
    found = _finished("cantilever.py").names
    assert found["first"] == pytest.approx(found["textbook"], rel=2e-4)
    EI, weight, own = found["box"].EI_y, 100.0 * 9.81, found["box"].rhoA * 9.81
    root = weight * 1.5 + own * 1.5**2 / 2  # moment of load and jib on the mast
    sag = root * 3.0 * 1.5 / EI + weight * 1.5**3 / (3 * EI) + own * 1.5**4 / (8 * EI)
    assert 3.0 - found["rest"].outputs["jib_z"] == pytest.approx(sag, rel=0.02)
    drawn = 2 * np.pi * found["modes"].frequencies[1]
    cart = 200.0 + 4.5 * found["box"].rhoA + 0.01 * found["travel"].effective_ratio ** 2
    assert drawn == pytest.approx(np.sqrt(9.81 / 2.0 * (1 + 100.0 / cart)), rel=0.01)


def test_cantilever_shaper_leaves_next_to_no_sway() -> None:
    runs = _finished("cantilever.py").names["runs"]
    left = {name: np.abs(run["sway"][run.t > 8.0]).max() for name, run in runs.items()}
    assert left["PD, flexible"] == pytest.approx(0.184, abs=1e-3)
    assert left["PD and shaper, flexible"] < 0.03 * left["PD, flexible"]
    for run in runs.values():
        assert run["angle"][-1] == pytest.approx(400.0, rel=5e-3)


def test_cantilever_draws(tmp_path: Path) -> None:
    _finished("cantilever.py").names["draw"](tmp_path)
    assert (tmp_path / "bode.png").stat().st_size > 5_000
    assert (tmp_path / "move.png").stat().st_size > 5_000


def test_ceiling_crane_lies_on_exudyns_curves(tmp_path: Path) -> None:
    found = _finished("ceiling_crane.py").names
    assert found["apart"](found["fine"], "x1_minus_x4", "x1_minus_x4") < 1e-4
    assert found["apart"](found["fine"], "load_z", "z13") < 1.2e-5
    assert found["coarse"]["load_z"][-1] == pytest.approx(-3.00707, abs=5e-5)
    found["draw"](tmp_path)
    assert (tmp_path / "ceiling_crane.png").stat().st_size > 5_000


def test_bridge_crane_controllers() -> None:
    found = _finished("bridge_crane_closed_loop.py").names
    comparisons = found["main"]()
    settled, sway, torque = zip(*(found["figures"](c.flexible) for c in comparisons.values()), strict=True)
    assert np.isinf(settled[0])  # PD alone lets the load swing on
    assert settled[1] < 16.0
    assert settled[2] < 18.0
    assert sway[0] == pytest.approx(2.55, abs=0.05)
    assert max(sway[1:]) < 0.05
    assert max(torque) < found["LIMIT"]
    for comparison in comparisons.values():
        assert comparison.flexible["load_x"][-1] == pytest.approx(5.0, abs=0.6)
        assert np.abs(comparison.rigid["bend"]).max() < 1e-9 < np.abs(comparison.flexible["bend"]).max()


def test_lee_frame_prints_what_its_page_shows_and_snaps_where_it_should() -> None:
    found = _finished("lee_frame.py")
    page = (ROOT / "docs" / "howto" / "paths.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"^```text\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
    assert found.printed == shown
    limits = [limit.factor for limit in found.names["path"].limits]
    assert limits == pytest.approx([18556.73, -9414.43], rel=1e-4)
