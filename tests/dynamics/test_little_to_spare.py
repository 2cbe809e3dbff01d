"""A dry contact with little to spare goes the wrong way in coarse steps: finer ones tell, or stronger contacts."""

from __future__ import annotations

import numpy as np
import pytest

import flexctrl as fc
from flexctrl.dynamics import breakaway

HANGS = "breaks loose"


def line(masses, spring, play, rope, friction, stiction) -> fc.Model:
    """Ground, a spring with play, a mass, a rope just taut, a mass; both masses slide dry."""
    near, far = (fc.PointMass(name, (x, 0, 0), m) for name, x, m in zip("AB", (1, 2), masses, strict=True))
    held = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=spring)
    tow = fc.Rope("tow", (1, 0, 0), (2, 0, 0), EA=rope)
    joints = [fc.Support(held.start, "u v w"), fc.Support(near.node, "v w"), fc.Support(far.node, "v w")]
    joints += [fc.Pin(near.node, held.end), fc.Pin(near.node, tow.start), fc.Pin(far.node, tow.end)]
    outputs = [fc.Position("a", near.node, "x"), fc.Position("b", far.node, "x")]
    dry = {f"{name}.u": fc.Coulomb(F, static=S) for name, F, S in zip("AB", friction, stiction, strict=True)}
    effects = [fc.LargeRotation(), fc.RopeStretch(), fc.Backlash({"spring": play}), fc.CoulombFriction(dry)]
    return fc.assemble(fc.Structure([near, far, held, tow], joints, outputs=outputs), effects)


LATE = line((0.748431, 2.898641), 889.931, 0.00220263, 15356.5, (2.503438, 0.384738), (12.51719, 0.769476))
EARLY = line((0.593088, 1.676243), 58160.1, 0.00171313, 40369.7, (18.64833, 3.514501), (93.24164, 3.514501))


@pytest.mark.parametrize(("model", "speed"), [(LATE, 0.8436339), (EARLY, 1.3637287)], ids=["late", "early"])
def test_what_breaks_loose_by_a_little_is_told(model, speed):
    """Steps of 1 ms go the wrong way by 0.4 of the motion, as steps of 2 ms do; those of 0.5 ms do not."""
    how = {"until": 0.8, "start": model.drawn.with_(v=np.array([0.0, speed])), "every": 0.005}
    true = fc.simulate(model, method=fc.Unchecked(fc.ExplicitRungeKutta()), tolerance=fc.Tolerance(1e-8, 1e-11), **how)
    off = {}
    for step in (1e-3, 5e-4):
        run = fc.simulate(model, method=fc.GeneralizedAlpha(step), **how)
        off[step] = np.abs(run["a"] - true["a"]).max() / np.ptp(true["a"])
        told = any("by a finer run" in note for note in run.report.notes)
        assert told == (off[step] > 0.05), (step, off, run.report.notes)
    assert off[1e-3] > 0.3
    assert off[5e-4] < 0.02


COARSE = [
    (LATE, 0.8436339, fc.GeneralizedAlpha(2e-3), fc.Tolerance(), 0.235),
    (LATE, 0.8436339, fc.AdaptiveAlpha(), fc.Tolerance(1e-3, 1e-6), 0.235),
]


def hanging(run: fc.Run) -> list[str]:
    return [note for note in run.report.notes if HANGS in note]


def instant(note: str) -> float:
    """When the contact that it names breaks loose [s]."""
    return float(note.partition("A.u breaks loose at t = ")[2].split()[0])


@pytest.mark.parametrize(("model", "speed", "method", "tolerance", "when"), COARSE, ids=["late", "chosen"])
def test_what_no_other_steps_tell_contacts_that_bear_a_little_more_or_less_do(model, speed, method, tolerance, when):
    """Runs that are off by 0.4 of the motion of `a`: of one a run in quarter steps tells, of the other none."""
    how = {"until": 0.8, "start": model.drawn.with_(v=np.array([0.0, speed])), "every": 0.005}
    true = fc.simulate(model, method=fc.Unchecked(fc.ExplicitRungeKutta()), tolerance=fc.Tolerance(1e-8, 1e-11), **how)
    run = fc.simulate(model, method=method, tolerance=tolerance, **how)
    assert np.abs(run["a"] - true["a"]).max() > 0.3 * np.ptp(true["a"])
    assert hanging(run) or run.report.output_errors["a"] > 0.3
    for note in hanging(run):
        assert note.startswith("whether A.u breaks loose")
        assert instant(note) == pytest.approx(when, rel=0.02)
    bare = fc.simulate(model, method=fc.Unchecked(method), tolerance=tolerance, **how)
    assert np.array_equal(bare.y, run.y)
    assert not hanging(bare)


STIFFNESS, SPEED, MASS = 400.0, 1.0, 1.0
RATE = np.sqrt(STIFFNESS / MASS)
PEAK = STIFFNESS * SPEED / RATE
"""Of what holds the near mass while the far one swings: F = k v/ω sin ωt."""


def swinging(bears: float, kinetic: float = 2.0) -> tuple[fc.Model, fc.State]:
    """A mass that lies dry, and bears so much; one on a spring beside it, thrown."""
    near, far = fc.PointMass("A", (0, 0, 0), 1.0), fc.PointMass("B", (1, 0, 0), MASS)
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=STIFFNESS)
    joints = [fc.Support(near.node, "v w"), fc.Support(far.node, "v w")]
    joints += [fc.Pin(near.node, spring.start), fc.Pin(far.node, spring.end)]
    outputs = [fc.Position("a", near.node, "x"), fc.Position("b", far.node, "x")]
    dry = fc.CoulombFriction({"A.u": fc.Coulomb(min(kinetic, bears), static=bears)})
    model = fc.assemble(fc.Structure([near, far, spring], joints, outputs=outputs), [fc.LargeRotation(), dry])
    return model, model.drawn.with_(v=np.array([0.0, SPEED]))


@pytest.mark.parametrize("method", [fc.AdaptiveAlpha(), fc.ExplicitRungeKutta()], ids=["alpha", "explicit"])
@pytest.mark.parametrize(("share", "other"), [(0.8, ""), (0.98, "more"), (1.02, "less"), (1.2, "")])
def test_what_holds_or_breaks_loose_by_a_fiftieth_is_told(share, other, method):
    """It breaks loose at sin ωt = F_s/(k v/ω): what bears 2 % less than the peak at once, with 5 % more never."""
    model, start = swinging(share * PEAK)
    run = fc.simulate(model, until=0.5, start=start, method=method)
    assert np.ptp(run["a"]) > 0.05 if share < 1.0 else np.ptp(run["a"]) < 1e-12
    notes = hanging(run)
    assert len(notes) == bool(other)
    if notes:
        bears = share if share < 1.0 else 0.95 * share
        assert f"with so much {other}, " in notes[0]
        assert instant(notes[0]) == pytest.approx(np.arcsin(bears) / RATE, rel=0.01)


def test_contacts_that_slide_with_what_they_break_loose_at_are_not_asked(monkeypatch):
    """No force falls there: a little of it moves what comes after by a little."""
    monkeypatch.setattr(breakaway, "made", None)
    model, start = swinging(0.98 * PEAK, kinetic=PEAK)
    assert fc.simulate(model, until=0.5, start=start).status is fc.Status.FINISHED


@pytest.mark.parametrize("cut", [0.07, 0.3])
def test_what_goes_on_is_told_of_what_has_hung_before(cut, tmp_path):
    model, start = swinging(0.98 * PEAK)
    whole = fc.simulate(model, until=0.5, start=start)
    fc.simulate(model, until=cut, start=start).checkpoint.save(tmp_path / "cut.npz")
    rest = fc.simulate(model, until=0.5, start=fc.load_checkpoint(tmp_path / "cut.npz"))
    assert np.array_equal(rest.final.q, whole.final.q)
    (note,) = hanging(rest)
    assert "A.u breaks loose before t = " in note
