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
    assert found["coarse"]["load_z"][-1] == pytest.approx(-3.00552, abs=5e-5)
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


def test_a_trolley_crosses_its_girder(tmp_path: Path) -> None:
    found = _finished("travelling_trolley.py").names
    runs, standing = found["runs"], found["standing"]
    for run in runs.values():
        assert run["s"][-1] == pytest.approx(found["START"] + found["DISTANCE"], abs=0.2)
        assert np.abs(run["sag"] - standing(run["s"])).max() < 5e-3 * np.abs(run["sag"]).max()
    left = {name: np.abs(run["sway"][run.t > 22.0]).max() for name, run in runs.items()}
    assert left["shaped by ZVD"] < 0.02 * left["plain"]
    found["draw"]().savefig(tmp_path / "travelling_trolley.png")
    assert (tmp_path / "travelling_trolley.png").stat().st_size > 5_000


def test_lee_frame_prints_what_its_page_shows_and_snaps_where_it_should() -> None:
    found = _finished("lee_frame.py")
    page = (ROOT / "docs" / "howto" / "paths.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"^```text\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
    assert found.printed == shown
    limits = [limit.factor for limit in found.names["path"].limits]
    assert limits == pytest.approx([18556.73, -9414.43], rel=1e-4)


def test_bode_shows_every_peak_and_margins(tmp_path: Path) -> None:
    found = _finished("bode.py").names
    channel = found["channels"]["flexible"]
    M, C, K = (A.toarray() for A in (channel.M, channel.C, channel.K))
    peaks = found["peaks"]()
    assert len(peaks) >= 4
    for hertz, size, _ in peaks:  # the peak itself, by plain solutions of (K + iωC − ω²M) q = B on a fine grid
        omega = 2 * np.pi * hertz * np.linspace(0.999, 1.001, 41)
        fine = [channel.Cq @ np.linalg.solve(K + 1j * w * C - w**2 * M, channel.B) for w in omega]
        assert size == pytest.approx(np.abs(fine).max(), rel=2e-3)
    assert min(share for _, _, share in peaks) < 0.6  # python-control's default grid walks past a half of one
    flexible, rigid = found["margins"]["flexible"], found["margins"]["rigid"]
    gain, phase, distance = found["margins_by_python_control"]()
    assert flexible.gain_up.margin == pytest.approx(gain, rel=1e-3)
    assert np.degrees(flexible.phase.margin) == pytest.approx(phase, abs=1e-2)
    assert flexible.modulus.value == pytest.approx(distance, rel=1e-3)
    assert flexible.gain_up.margin == pytest.approx(2.6434, rel=1e-3)
    assert rigid.gain_up.margin == np.inf
    found["draw"](tmp_path)
    assert 5_000 < (tmp_path / "bode_margins.png").stat().st_size < 150_000


def test_root_locus_by_eigenvalues_and_by_polynomials(tmp_path: Path) -> None:
    loci, found = _finished("root_locus.py").names["main"](tmp_path)
    assert loci["flexible"].critical[0].gain == pytest.approx(2.6434, rel=1e-3)
    assert not loci["rigid"].critical
    for case in found:  # gains from the frequency response; at each of them the eigenvalues have one pair on the axis
        upper = case.exact[(case.exact.imag > 1.0)]
        assert min(abs(upper.real) / abs(upper)) < 1e-6
        assert case.gain == pytest.approx(found[-1].gain, rel=1e-3)
    assert found[0].states < 60 < found[1].states
    assert found[0].error < 1e-6
    assert max(case.error for case in found if case.states > 100) > 1e-2  # or no answer at all
    assert 5_000 < (tmp_path / "root_locus.png").stat().st_size < 150_000


def test_reduction_achieves_the_error_asked(tmp_path: Path) -> None:
    names = _finished("reduction.py").names
    by_order, by_error = names["main"](tmp_path)
    full, omega = names["full"], 2 * np.pi * np.geomspace(0.1, 20.0, 400)
    exact = full.frequency_response(omega).values
    peak = abs(full.frequency_response().values).max(axis=-1)
    for reduced in by_error.values():
        assert reduced.error_up_to(20.0).worst <= names["GOAL"].tolerance
        gap = abs(exact - reduced.frequency_response(omega).values).max(axis=-1) / peak
        assert gap[1, 1] <= 1.01 * names["GOAL"].tolerance
    plain, static = by_order["6 lowest modes"], by_order["… and their static rest"]
    assert static.error_up_to(20.0).worst < 0.5 * plain.error_up_to(20.0).worst
    assert 5_000 < (tmp_path / "reduction.png").stat().st_size < 150_000


def test_spillover_certificates(tmp_path: Path) -> None:
    found = _finished("spillover.py").names["main"](tmp_path)
    laser = found["PD on the trolley"]
    assert laser.gain == pytest.approx(3.2529, rel=1e-3)
    assert laser.mode.lives_in == "girder"
    for certificate in found.values():
        assert certificate.rigid_gain > 3.5 > certificate.gain
    assert 5_000 < (tmp_path / "spillover.png").stat().st_size < 150_000


def test_validity_envelopes_lie_on_closed_forms(tmp_path: Path) -> None:
    names = _finished("validity_envelope.py").names
    found = names["main"](tmp_path)
    let_go, pushed, sway, hung = found.values()
    period, swing = names["closed_forms"](np.array([let_go.limit]), np.array([pushed.limit]))
    assert (period[0], swing[0]) == pytest.approx((0.01, 0.01), rel=0.01)
    assert let_go.limit == pytest.approx(0.398, abs=3e-3)
    assert _sway_period_error(sway.limit, sway.last.predicted, 9.81 / 10.0) == pytest.approx(0.01, rel=0.02)
    assert hung.limit == pytest.approx(1.839, rel=5e-3)
    assert 5_000 < (tmp_path / "validity_envelope.png").stat().st_size < 150_000


def _sway_period_error(angle: float, linear: float, over_length: float) -> float:
    """A load on a free cart, by energy: θ̇² = 2 (g/l) (1 + μ) (cos θ − cos θ₀)/(1 + μ sin² θ), μ = load/cart."""
    mu = (2 * np.pi / linear) ** 2 / over_length - 1.0
    x = (np.arange(4000) + 0.5) / 4000 * np.pi / 2  # θ = θ₀ sin x
    theta = angle * np.sin(x)
    speed = np.sqrt(2 * over_length * (1 + mu) * (np.cos(theta) - np.cos(angle)) / (1 + mu * np.sin(theta) ** 2))
    return float(4 * np.mean(angle * np.cos(x) / speed) * np.pi / 2 / linear - 1.0)
