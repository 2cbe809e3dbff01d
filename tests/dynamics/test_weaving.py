"""Rows between compiled steps are those of the curve over each step, on every kind of machine."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.design import FilteredRate, MinimumJerk, pid

sys.path.insert(0, str(Path(__file__).parents[1] / "laws"))
from machines import bridle, double_girder, four_bar, machine

pytest.importorskip("llvmlite")

RIGID = (fc.Gravity(), fc.LargeRotation())
FULL = (*RIGID, fc.Flexible(), fc.RayleighDamping(0.1, 0.002))
SMALL = (fc.Gravity(), fc.Flexible(), fc.GeometricStiffness())
PACES = {"fixed": fc.GeneralizedAlpha(2e-3), "controlled": fc.AdaptiveAlpha(first_step=1e-3)}
MACHINES: dict[str, Callable[[], fc.Model]] = {
    **{f"tree{k}": lambda k=k: fc.assemble(machine(k, 5), FULL) for k in (1, 3, 7, 11)},
    **{f"rigid_tree{k}": lambda k=k: fc.assemble(machine(k, 5), RIGID) for k in (1, 10, 11)},
    **{part.__name__: lambda part=part: fc.assemble(part(), RIGID) for part in (four_bar, bridle, double_girder)},
    "bridle_that_bends": lambda: fc.assemble(bridle(), FULL),
    "bridge_crane": lambda: fc.load_scene(Path(__file__).parents[2] / "examples" / "bridge_crane.toml").model,
    "small_motion": lambda: fc.assemble(machine(3, 5), SMALL),
}


def moving(model: fc.Model) -> fc.State:
    rng = np.random.default_rng(4)
    return model.rest.with_(v=0.3 * rng.normal(size=model.n))


def one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every row be found by itself."""
    monkeypatch.setattr("flexctrl.dynamics.march.ride.Dense", object)


def alike(a: fc.Run, b: fc.Run, tolerance: float = 1e-11) -> None:
    assert (a.status, a.report.steps) == (b.status, b.report.steps)
    assert np.array_equal(a.final.q, b.final.q)
    assert np.allclose(a.t, b.t, rtol=1e-12, atol=1e-15)
    assert (np.abs(a.y - b.y) <= tolerance * np.abs(b.y).max(axis=0, initial=1.0)).all()
    assert np.array_equal(a.u, b.u)
    assert [s.t for s in a.frames] == pytest.approx([s.t for s in b.frames], rel=1e-12)
    for mine, other in zip(a.frames, b.frames, strict=True):
        for part in ("x", "R", "q", "v", "driven", "shown"):
            found, right = getattr(mine, part), getattr(other, part)
            assert np.allclose(found, right, rtol=0.0, atol=1e-10 * np.abs(right).max(initial=1.0)), part


@pytest.mark.parametrize(("name", "pace"), [*((name, "controlled") for name in MACHINES), ("tree7", "fixed")])
def test_rows_are_those_of_the_curves(name, pace, monkeypatch):
    """Drawn from the same kept states by plain Python, row by row."""
    model = MACHINES[name]()
    how = {"until": 0.04, "start": moving(model) if name != "bridge_crane" else model.rest, "method": PACES[pace]}
    a = fc.simulate(model, every=0.7e-3, **how)
    with monkeypatch.context() as patch:
        one_by_one(patch)
        alike(a, fc.simulate(model, every=0.7e-3, **how))


@dataclass(frozen=True)
class Asked:
    """A law that compiled loops do not know."""

    sample_time: float = 4e-3
    inputs: ClassVar[tuple[str, ...]] = ("travel",)
    outputs: ClassVar[tuple[str, ...]] = ("push",)

    def initial(self) -> np.ndarray:
        return np.zeros(1)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([100.0 - 900.0 * y[0] if x[0] % 3 else 50.0])

    def update(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x + 1.0


def known() -> fc.Sampled:
    inner = pid(900.0, 200.0, 30.0, measured="travel", rate=FilteredRate(0.01), command="push")
    return fc.Sampled(fc.Tracking(inner, {"travel": MinimumJerk(0.3, 0.2, at=0.02)}), 4e-3)


LAWS = {"asked": Asked, "known": known}


def crane() -> fc.Model:
    return fc.assemble(fc.cranes.ceiling_crane(), [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])


@pytest.mark.parametrize("every", [1.3e-3, 11e-3])
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("pace", PACES)
def test_rows_between_samples(pace, law, every, monkeypatch):
    """Rows at samples, and in between, with the inputs in force there; none of them is found by itself."""
    how = {"controller": LAWS[law](), "until": 0.05, "method": fc.Unchecked(PACES[pace]), "every": every}
    with monkeypatch.context() as patch:
        patch.setattr("flexctrl.dynamics.records.dense.Hermite.at", None)
        a = fc.simulate(crane(), **how)
    assert np.allclose(a.t[:-1], every * np.arange(len(a.t) - 1), rtol=1e-12, atol=1e-15)
    with monkeypatch.context() as patch:
        one_by_one(patch)
        alike(a, fc.simulate(crane(), **how))


@pytest.mark.parametrize("law", [*LAWS, None])
@pytest.mark.parametrize("pace", PACES)
def test_rows_go_on_bit_for_bit(pace, law, monkeypatch):
    """After a stop at a sample and within one; and wherever the clock ends a march."""
    inputs = None if law else {"push": 200.0}
    how = {"controller": LAWS[law]() if law else None, "method": PACES[pace], "every": 0.9e-3, "inputs": inputs}
    whole = fc.simulate(crane(), until=0.06, **how)
    for middle in (0.02, 0.0307):
        half = fc.simulate(crane(), until=middle, **how)
        rest = fc.simulate(crane(), until=0.06, start=half.checkpoint, **how)
        mine = whole.t >= rest.t[0]
        for part in ("t", "y", "u"):
            assert np.array_equal(getattr(rest, part), getattr(whole, part)[mine])
    monkeypatch.setattr("flexctrl.dynamics.march.ride._SECONDS", 1e-6)
    hurried = fc.simulate(crane(), until=0.06, **how)
    for part in ("t", "y", "u"):
        assert np.array_equal(getattr(hurried, part), getattr(whole, part))


def test_rows_of_a_stream_are_those_kept(tmp_path):
    how = {"controller": known(), "until": 0.1, "every": 1.3e-3}
    kept = fc.simulate(crane(), **how)
    fc.simulate(crane(), **how, record=fc.CsvStream(tmp_path / "rows.csv"))
    written = np.genfromtxt(tmp_path / "rows.csv", delimiter=",", skip_header=1)
    assert np.array_equal(written, np.column_stack([kept.t, kept.y, kept.u]))


def test_more_rows_than_there_is_room_for_at_once():
    """Thousands within one step; they are on one cubic."""
    run = fc.simulate(crane(), until=0.02, inputs={"push": 100.0}, method=fc.GeneralizedAlpha(0.01), every=5e-6)
    assert len(run.t) == 4001
    rows = run["travel"][:2001]
    fitted = np.polynomial.Polynomial.fit(run.t[:2001], rows, 3)
    assert np.abs(fitted(run.t[:2001]) - rows).max() <= 1e-9 * np.abs(rows).max()
