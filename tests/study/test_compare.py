"""Numbers of curves, dominant frequencies, and rigid against flexible."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.errors import StructureError
from flexctrl.study.compare import Comparison, compare, dominant_frequency, numbers


def test_numbers_of_a_sine_on_uneven_instants():
    t = np.sort(np.random.default_rng(1).uniform(0.0, 2.0, 4000))
    t[0], t[-1] = 0.0, 2.0
    found = numbers(t, 3.0 * np.sin(2 * np.pi * 2.0 * t))
    assert found.rms == pytest.approx(3.0 / np.sqrt(2.0), rel=1e-4)
    assert found.max_abs == pytest.approx(3.0, rel=1e-4)
    assert found.final == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("frequency", [1.7, 5.03, 12.4, 31.7])
@pytest.mark.parametrize("drift", [0.0, 4.0])
def test_the_dominant_frequency_of_an_oscillation_on_a_slope(frequency, drift):
    t = np.linspace(0.0, 3.0, 900)
    y = 2.0 + drift * t + 0.3 * np.cos(2 * np.pi * frequency * t + 0.4) + 0.05 * np.sin(2 * np.pi * 3.1 * frequency * t)
    assert dominant_frequency(t, y) == pytest.approx(frequency, rel=5e-3)


@pytest.mark.parametrize("curve", [np.zeros(50), np.linspace(0, 3, 50), np.linspace(0, 1, 50) ** 2, np.ones(2)])
def test_what_does_not_oscillate_has_no_frequency(curve):
    assert dominant_frequency(np.linspace(0.0, 1.0, len(curve)), curve) == 0.0


def bouncing() -> fc.Structure:
    """A mass on a rope: rigid it stays, flexible it bounces at √(k/m) under a step of its weight."""
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -2), EA=4e4)
    load = fc.PointMass("load", rope.end, 5.0)
    joints = [fc.Support(rope.start), fc.Pin(rope.end, load.node)]
    outputs = [fc.Position("height", load.node, "z")]
    return fc.Structure([rope, load], joints, outputs=outputs, name="bouncing")


EFFECTS = (fc.Gravity(), fc.Flexible(), fc.LargeRotation())


def test_a_difference_is_known_by_finer_runs():
    """A load that bounces about its sink, against one that does not: z = −(g/ω²)(1 − cos ωt) is their difference."""
    model = fc.assemble(bouncing(), EFFECTS)
    coarse, finer = (compare(model, until=0.6, method=fc.GeneralizedAlpha(h, 1.0), every=1e-2) for h in (5e-3, 2.5e-3))
    held = coarse.held_against(finer)
    omega = np.sqrt(4e4 / 2.0 / 5.0)
    truth = -9.81 / omega**2 * (1.0 - np.cos(omega * coarse.flexible.t))
    error = numbers(coarse.flexible.t, coarse.flexible["height"] + 2.0 - truth).rms
    assert held.known["height"] == pytest.approx(0.75 * error, rel=0.1)  # second order: a quarter is left
    assert "known to" in str(held)
    assert "known to" not in str(coarse)


def test_a_dropped_load_bounces_by_twice_its_static_sink():
    model = fc.assemble(bouncing(), EFFECTS)
    told = []
    found = compare(model, until=0.6, method=fc.GeneralizedAlpha(5e-4, 1.0), every=1e-3, progress=told.append)
    height, sink, hertz = found["height"], 5.0 * 9.81 * 2.0 / 4e4, np.sqrt(4e4 / 2.0 / 5.0) / (2 * np.pi)
    assert height.rigid.final == -2.0
    assert height.max_difference == pytest.approx(2.0 * sink, rel=1e-3)
    assert height.frequency_hz == pytest.approx(hertz, rel=5e-3)
    assert height.rigid_frequency_hz == 0.0
    assert found.finished
    assert told == sorted(told)
    assert "height" in str(found)


def test_a_model_that_starts_at_rest_has_a_twin_that_does():
    model = fc.assemble(bouncing(), EFFECTS)
    found = compare(model, until=0.02, start=fc.equilibrium(model), method=fc.GeneralizedAlpha(1e-3))
    assert found["height"].max_difference == pytest.approx(5.0 * 9.81 * 2.0 / 4e4, rel=1e-6)
    assert found["height"].frequency_hz == 0.0


def test_runs_of_different_machines_are_not_compared():
    model = fc.assemble(bouncing(), EFFECTS)
    run = fc.simulate(model, until=1e-3)
    other = fc.assemble(bouncing().with_(outputs=[]), EFFECTS)
    with pytest.raises(StructureError, match="different signals"):
        Comparison.between(run, fc.simulate(other, until=1e-3))


def test_saved_columns_are_both_runs(tmp_path):
    model = fc.assemble(bouncing(), EFFECTS)
    found = compare(model, until=0.05, method=fc.GeneralizedAlpha(1e-3), every=1e-3)
    found.save_csv(tmp_path / "both.csv")
    columns = np.genfromtxt(tmp_path / "both.csv", delimiter=",", names=True)
    np.testing.assert_allclose(columns["height"], found.flexible["height"])
    np.testing.assert_allclose(columns["height_rigid"], -2.0)


def test_saved_numbers_are_those_of_every_signal(tmp_path):
    model = fc.assemble(bouncing(), EFFECTS)
    found = compare(model, until=0.05, method=fc.GeneralizedAlpha(1e-3), every=1e-3)
    found.save_json(tmp_path / "both.json")
    assert json.loads((tmp_path / "both.json").read_text(encoding="utf-8")) == [asdict(s) for s in found.signals]
    (height,) = json.loads((tmp_path / "both.json").read_text(encoding="utf-8"))
    assert height["flexible"]["max_abs"] == np.abs(found.flexible["height"]).max()


@pytest.mark.parametrize(("size", "shown"), [(1e-20, "0"), (1e-9, "1e-09")])
def test_rounding_is_shown_as_nothing_and_kept_in_the_numbers(tmp_path, size, shown):
    """Beside a load that hangs 2 m below, a rigid twin at nearly zero: a nanometre is none."""
    found = compare(fc.assemble(bouncing(), EFFECTS), until=0.02, method=fc.GeneralizedAlpha(1e-3), every=1e-3)
    twin = replace(found.rigid, y=np.full_like(found.rigid.y, size))
    again = Comparison.between(found.flexible, twin)
    row = str(again).splitlines()[1].split()
    assert row[2] == row[4] == shown
    again.save_json(tmp_path / "both.json")
    assert json.loads((tmp_path / "both.json").read_text(encoding="utf-8"))[0]["rigid"]["max_abs"] == size


def test_a_signal_that_is_rounding_in_both_runs_does_not_swing():
    """An output at zero by symmetry: its curve is what the machine's size leaves of rounding, and has no frequency."""
    model = fc.assemble(bouncing(), EFFECTS)
    found = compare(model, until=0.05, method=fc.GeneralizedAlpha(1e-3), every=1e-3)
    faint = 1e-15 * np.sin(400.0 * found.flexible.t)[:, None]
    row = str(Comparison.between(replace(found.flexible, y=faint), replace(found.rigid, y=-faint))).splitlines()[1]
    assert row.split()[1:] == ["0", "0", "0", "0", "0", "–"]


def test_what_only_the_flexible_machine_measures_is_left_out():
    machine = bouncing()
    rope = next(part for part in machine.elements if isinstance(part, fc.Rope))
    model = fc.assemble(machine.with_(outputs=[*machine.outputs, fc.Tension("pull", rope)]), EFFECTS)
    found = compare(model, until=0.01, method=fc.GeneralizedAlpha(1e-3), every=1e-3)
    assert "pull" in found.flexible.outputs
    assert "pull" not in [s.name for s in found.signals]
    assert any("pull" in note for note in found.rigid.report.notes)
