"""The paper's ceiling crane against Exudyn: another element, another code.

The stored reference is Exudyn's ``ANCFCable`` with 32 elements per member and 5 µs steps
(``tests/benchmarks/exudyn_crane.py`` makes it). Its cable has no rotary inertia in bending and no
torsion, as the crane's members here.
"""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.cranes import ceiling_crane

TESTS = Path(__file__).resolve().parents[1]
SAMPLING, DURATION, PUSH = 1e-4, 0.05, 500.0
EFFECTS = (fc.Gravity(), fc.Flexible(), fc.LargeRotation())
SAG = -0.1245314
"""z₄ under gravity with the girder's ends held [m]."""


@dataclass(frozen=True)
class Curves:
    """The paper's two curves: x₁ − x₄ (Fig. 11) and z₁₃ (Fig. 12) [m]."""

    relative: np.ndarray
    height: np.ndarray

    def distance(self, other: Curves) -> tuple[float, float]:
        """RMS difference of both curves."""
        return _rms(self.relative - other.relative), _rms(self.height - other.height)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@cache
def _reference() -> Curves:
    table = np.genfromtxt(TESTS / "data" / "ceiling_crane_exudyn.csv", delimiter=",", names=True, skip_header=3)
    np.testing.assert_allclose(table["t"], np.arange(501) * SAMPLING, atol=1e-9)
    return Curves(table["x1_minus_x4"], table["z13"])


@cache
def _run(elements: int, step: float) -> fc.Run:
    return _simulate(fc.assemble(ceiling_crane(elements), EFFECTS), step, SAMPLING)


def _simulate(model: fc.Model, step: float, every: float) -> fc.Run:
    method = fc.GeneralizedAlpha(step=step, rho=0.9)
    return fc.simulate(model, until=DURATION, inputs={"push": PUSH}, method=method, every=every)


def _curves(run: fc.Run) -> Curves:
    assert run.status is fc.Status.FINISHED
    return Curves(run["x1_minus_x4"], run["load_z"])


def _harness() -> ModuleType:
    pytest.importorskip("exudyn", reason="Exudyn itself is run with the extra [bench] only")
    spec = importlib.util.spec_from_file_location("exudyn_crane", TESTS / "benchmarks" / "exudyn_crane.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up there
    spec.loader.exec_module(module)
    return module


def _crane_with_sag(elements: int) -> fc.Structure:
    crane = ceiling_crane(elements)
    girder = crane.part("girder")
    assert isinstance(girder, fc.Beam)
    return crane.with_(outputs=[fc.Position("z4", at=girder.node(3 * elements), direction="z")])


@cache
def _sag(elements: int) -> float:
    model = fc.assemble(_crane_with_sag(elements), EFFECTS)
    ends = dict.fromkeys(("girder_0_u", f"girder_{6 * elements}_u"), 0.0)
    return fc.equilibrium(model, hold=ends).outputs["z4"]


@pytest.mark.slow
def test_a_converged_run_lies_on_exudyns_curves() -> None:
    relative, height = _curves(_run(16, 2.5e-5)).distance(_reference())
    assert relative < 1e-4
    assert height < 1e-5


@pytest.mark.slow
def test_the_space_error_falls_with_the_square_of_the_element_length() -> None:
    counts = np.array([1, 2, 4, 8])
    errors = np.array([_curves(_run(int(n), 5e-5)).distance(_reference()) for n in counts])
    for curve in errors.T:
        slope = -np.polyfit(np.log(counts), np.log(curve), 1)[0]
        assert 1.8 < slope < 3.0
        assert (np.diff(curve) < 0.0).all()


def test_one_element_a_member_already_tells_the_shape_of_the_curves() -> None:
    reference = _reference()
    relative, height = _curves(_run(1, 1e-4)).distance(reference)
    assert relative < 0.05 * np.ptp(reference.relative)
    assert height < 0.15 * np.ptp(reference.height)


def test_the_rigid_twins_load_rises_without_oscillation() -> None:
    twin = fc.rigid(fc.assemble(ceiling_crane(), EFFECTS))
    curves = _curves(_simulate(twin, 5e-4, 5e-4))
    assert (np.diff(curves.height, 2) > 0.0).all()
    assert curves.height[0] == -3.0 < curves.height[-1]
    np.testing.assert_allclose(curves.relative, 0.0, atol=1e-12)


def test_the_flexible_load_does_oscillate() -> None:
    turns = np.diff(np.sign(np.diff(_curves(_run(1, 1e-4)).height)))
    assert np.count_nonzero(turns) >= 2
    assert np.count_nonzero(np.diff(np.sign(np.diff(_reference().height)))) >= 2


def test_the_girder_sags_under_gravity_as_far_as_it_should() -> None:
    assert _sag(8) == pytest.approx(SAG, abs=1e-7)


def test_the_uncompiled_path_gives_the_same_numbers() -> None:
    pytest.importorskip("llvmlite", reason="the compiled path needs the extra [fast]")
    models = [fc.assemble(ceiling_crane(2), EFFECTS, backend) for backend in (fc.CasadiVM(), fc.Compiled())]
    method = fc.GeneralizedAlpha(step=1e-4)
    tight = fc.Tolerance(absolute=1e-11)
    plain, compiled = (
        fc.simulate(m, until=0.01, inputs={"push": PUSH}, method=method, tolerance=tight) for m in models
    )
    np.testing.assert_allclose(compiled.y, plain.y, rtol=0.0, atol=1e-9)


@pytest.mark.slow
def test_exudyn_still_makes_the_stored_curves() -> None:
    exudyn = _harness()
    run = exudyn.exudyn_crane(8, 2.5e-5, exudyn.TIGHT)
    stride = (len(run.t) - 1) // 500
    relative, height = Curves(run.x1_minus_x4[::stride], run.z13[::stride]).distance(_reference())
    assert relative < 1e-4
    assert height < 1e-5


@pytest.mark.slow
def test_exudyn_sags_as_far() -> None:
    assert _harness().exudyn_gravity_sag(8) == pytest.approx(_sag(8), abs=5e-7)
