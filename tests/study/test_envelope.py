"""The linear-validity envelope: against elliptic integrals, buckling, and closed forms of large deflection."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipk

import flexctrl as fc
from flexctrl.errors import StructureError
from flexctrl.study.envelope import (
    ConstantLoad,
    CurveDifference,
    Deflection,
    FinalValue,
    Frequency,
    InitialDisplacement,
    InitialMode,
    InitialSpeed,
    Peak,
    Period,
    validity_envelope,
)

mpl.use("Agg")

LENGTH, G = 1.5, 9.81


def pendulum() -> fc.Model:
    rod = fc.Rope("rod", (0, 0, 0), (0, 0, -LENGTH), EA=1e5)
    bob = fc.PointMass("bob", rod.end, 2.0)
    structure = fc.Structure(
        [rod, bob],
        [fc.Support(rod.start, "u v w"), fc.Pin(rod.end, bob.node)],
        inputs=[fc.Force("push", bob.node, "x")],
        outputs=[fc.SwayAngle("sway", rod.start, bob.node, "x"), fc.Position("x", bob.node, "x")],
        name="pendulum",
    )
    return fc.assemble(fc.planar(structure, normal="y"), [fc.Gravity(), fc.LargeRotation()])


def column(elements: int = 6) -> fc.Model:
    section = fc.Section(EA=1e7, EI_y=100.0, EI_z=100.0, GJ=80.0, rhoA=2.0, rhoJ=1e-3)
    beam = fc.Beam("beam", (0, 0, 0), (4, 0, 0), section, elements=elements)
    structure = fc.Structure(
        [beam],
        [fc.Support(beam.start, "u v"), fc.Support(beam.end, "v")],
        inputs=[fc.Force("squeeze", beam.end, "-x")],
        outputs=[fc.Position("middle", beam.node(elements // 2), "y"), fc.Position("end", beam.end, "x")],
        name="column",
    )
    return fc.assemble(fc.planar(structure), [fc.Flexible(), fc.LargeRotation()])


def amplitude_of(error: float) -> float:
    """T/T₀ = 2 K(sin(θ/2))/π."""
    return float(brentq(lambda a: 2 / np.pi * ellipk(np.sin(a / 2) ** 2) - 1 - error, 1e-3, 3.1))


def test_pendulum_period_is_wrong_by_one_per_cent_at_0_398_rad():
    found = validity_envelope(pendulum(), InitialDisplacement("rod_0_ry"), Period("sway"), 0.01)
    assert amplitude_of(0.01) == pytest.approx(0.398177, abs=1e-6)
    assert found.limit == pytest.approx(amplitude_of(0.01), rel=2e-3)
    assert found.last.predicted == pytest.approx(2 * np.pi * np.sqrt(LENGTH / G), rel=1e-9)
    assert "linear period of sway is wrong by 1 % at initial rod_0_ry = 0.398" in str(found)
    amplitudes = [tried.amplitude for tried in found.trials]
    assert amplitudes == sorted(amplitudes)
    assert len(found.plot().axes) == 2


@pytest.mark.slow
def test_pendulum_at_a_large_error():
    found = validity_envelope(pendulum(), InitialMode(1), Period("sway"), 0.18, first=1.0)
    assert found.limit == pytest.approx(amplitude_of(0.18), rel=2e-3)
    assert found.unit.words == "initial rod_0_ry along mode 1"


def test_pendulum_started_with_a_speed():
    """Energy: sin(θ/2) = v/(2 ω₀) for an angular rate v at the bottom; linear: θ = v/ω₀."""
    omega = np.sqrt(G / LENGTH)
    found = validity_envelope(pendulum(), InitialSpeed("rod_0_ry"), Peak("sway"), 0.02)
    exact = brentq(lambda x: 2 * np.arcsin(x / 2) / x - 1.02, 0.01, 1.9)
    assert found.limit == pytest.approx(exact * omega, rel=2e-3)
    assert found.unit.symbol == "rad/s"


def test_pendulum_pushed_by_a_constant_force():
    """In equilibrium tan θ = F/mg; the linear model says θ = F/mg."""
    found = validity_envelope(pendulum(), ConstantLoad({"push": 2.0 * G}), Deflection("sway"), 0.05)
    exact = brentq(lambda x: 1 - np.arctan(x) / x - 0.05, 0.01, 2.0)
    assert found.limit == pytest.approx(exact, rel=1e-3)
    assert found.until == 0.0
    assert len(found.plot().axes) == 1


@pytest.mark.slow
def test_curve_and_final_value_see_the_same_runs():
    """At a small angle the curves differ by the lag of the phase: RMS of θ₀(cos ωt − cos ω't)."""
    until = 2.0
    options = {"error": 0.05, "until": until}
    curve = validity_envelope(pendulum(), InitialDisplacement("rod_0_ry"), CurveDifference("sway"), **options)
    t, omega = np.linspace(0, until, 4001), np.sqrt(G / LENGTH)

    def lag(a: float) -> float:
        slow = omega / (2 / np.pi * ellipk(np.sin(a / 2) ** 2))
        gap, whole = np.cos(slow * t) - np.cos(omega * t), np.cos(omega * t)
        return float(np.sqrt((gap**2).mean() / (whole**2).mean()))

    assert curve.limit == pytest.approx(brentq(lambda a: lag(a) - 0.05, 0.05, 2.0), rel=0.02)
    final = validity_envelope(pendulum(), InitialDisplacement("rod_0_ry"), FinalValue("sway"), **options)

    def late(a: float) -> float:
        slow = omega / (2 / np.pi * ellipk(np.sin(a / 2) ** 2))
        return abs(np.cos(slow * until) / np.cos(omega * until) - 1.0)

    assert final.limit == pytest.approx(brentq(lambda a: late(a) - 0.05, 0.05, 1.0), rel=0.02)


def test_softening_of_a_column():
    """f = f₀ √(1 − N/N_cr): wrong by x at N = (1 − (1 − x)²) N_cr, N_cr = π² EI/L²."""
    critical = np.pi**2 * 100.0 / 16.0
    for error in (0.01, 0.3):
        found = validity_envelope(column(), ConstantLoad({"squeeze": 1.0}), Frequency(1), error)
        assert found.limit == pytest.approx((1 - (1 - error) ** 2) * critical, rel=2e-3)
    assert found.last.predicted == pytest.approx(np.pi / 2 * np.sqrt(100 / 2.0 / 16.0**2), rel=2e-3)


def test_stiffening_of_a_pulled_column():
    """The same, tensile: f = f₀ √(1 + N/N_cr)."""
    found = validity_envelope(column(), ConstantLoad({"squeeze": -1.0}), Frequency(1), 0.1)
    assert found.limit == pytest.approx(0.21 * np.pi**2 * 100.0 / 16.0, rel=2e-3)


def test_the_envelope_ends_at_the_buckling_load():
    """A straight column shortens as the linear model says beyond π² EI/L² too, but does not stay straight."""
    model = column()
    path = fc.equilibrium_path(model, {"squeeze": 1.0}, 100.0)
    found = validity_envelope(model, ConstantLoad({"squeeze": 1.0}), Deflection("end"), 0.05)
    assert found.limit == pytest.approx(np.pi**2 * 100.0 / 16.0, rel=5e-4)
    assert found.limit == pytest.approx(path.branchings[0].factor, rel=1e-8)
    assert found.gives_way
    assert f"gives way at load = {found.limit:.4g} ×" in str(found)
    before = validity_envelope(model, ConstantLoad({"squeeze": 1.0}), Deflection("end"), 0.05, most=60.0)
    assert (before.limit, before.gives_way) == (np.inf, False)
    pulled = validity_envelope(model, ConstantLoad({"squeeze": -1.0}), Deflection("end"), 0.05, most=1e4)
    assert (pulled.limit, pulled.gives_way) == (np.inf, False)
    assert len(found.plot().axes) == 1


@pytest.mark.slow
def test_the_envelope_ends_where_a_shallow_truss_snaps():
    """Two bars in a shallow roof: the error is told before; with a large one allowed, the limit load ends it."""
    rise, half, stiffness = 0.1, 1.0, 1e4
    apex = fc.PointMass("apex", (0, 0, rise), 1.0)
    bars = [fc.Spring(f"bar{i}", (x, 0, 0), apex.node, stiffness=stiffness) for i, x in enumerate((-half, half))]
    structure = fc.Structure(
        [apex, *bars],
        [*(fc.Support(bar.start) for bar in bars), *(fc.Pin(bar.end, apex.node) for bar in bars)],
        inputs=[fc.Force("load", apex.node, "-z")],
        outputs=[fc.Position("height", apex.node, "z")],
        name="roof",
    )
    model = fc.assemble(fc.planar(structure, "y"), [fc.LargeRotation()])
    z = np.linspace(0.0, rise, 200_001)
    lengths = np.hypot(half, z)
    snap = float((2 * stiffness * (np.hypot(half, rise) - lengths) * z / lengths).max())
    found = validity_envelope(model, ConstantLoad({"load": 1.0}), Deflection("height"), 5.0)
    assert found.limit == pytest.approx(snap, rel=1e-4)
    assert found.gives_way


@pytest.mark.slow
def test_a_follower_load_ends_the_envelope_at_flutter():
    """Beck's column: 20.0509 EI/L²; its stiffness stays regular."""
    beam = fc.Beam("beam", (0, 0, 0), (2, 0, 0), fc.Section.rectangle(fc.STEEL, 0.02, 0.02), 12)
    structure = fc.Structure(
        [beam],
        [fc.Support(beam.start)],
        inputs=[fc.FollowerForce("push", beam.end, "-x")],
        outputs=[fc.Position("end", beam.end, "x")],
        name="beck",
    )
    model = fc.assemble(fc.planar(structure), [fc.Flexible(), fc.LargeRotation()])
    unit = fc.STEEL.E * 0.02**4 / 12 / 4.0
    found = validity_envelope(model, ConstantLoad({"push": unit}), Deflection("end"), 0.05, first=1.0, most=100.0)
    assert found.limit == pytest.approx(20.0509, rel=3e-3)
    assert found.gives_way


def test_a_linear_machine_is_right_everywhere():
    body = fc.PointMass("cart", (0, 0, 0), 2.0)
    spring = fc.Spring("spring", (-1, 0, 0), body.node, stiffness=50.0)
    structure = fc.Structure(
        [body, spring],
        [fc.Support(spring.start), fc.Pin(spring.end, body.node), fc.Support(body.node, "v w")],
        outputs=[fc.Position("x", body.node, "x")],
        name="oscillator",
    )
    model = fc.assemble(structure, [fc.LargeRotation()])
    found = validity_envelope(model, InitialDisplacement("cart_0_u"), Period("x"), 0.01, most=0.5)
    assert found.limit == np.inf
    assert found.last.amplitude == 0.5
    assert "is right within 1 % up to initial cart_0_u = 0.5 m" in str(found)


def test_refusals():
    model = pendulum()
    with pytest.raises(StructureError, match="did you mean 'sway'"):
        validity_envelope(model, InitialDisplacement("rod_0_ry"), Period("swag"))
    with pytest.raises(StructureError, match="did you mean 'rod_0_ry'"):
        validity_envelope(model, InitialDisplacement("rod_0_rx"), Period("sway"))
    with pytest.raises(StructureError, match="no mode 2"):
        validity_envelope(model, InitialMode(2), Period("sway"))
    with pytest.raises(StructureError, match="vary a ConstantLoad"):
        validity_envelope(model, InitialMode(1), Frequency(1))
    with pytest.raises(StructureError, match="no input is given a value"):
        validity_envelope(model, ConstantLoad({}), Deflection("x"))
    with pytest.raises(StructureError, match="error = 0"):
        validity_envelope(model, InitialMode(1), Period("sway"), 0.0)
    with pytest.raises(StructureError, match="amplitudes from 2"):
        validity_envelope(model, InitialMode(1), Period("sway"), first=2.0, most=1.0)
    with pytest.raises(StructureError, match="no such value"):
        validity_envelope(model, InitialDisplacement("rod_0_ry"), Period("sway"), until=0.5)
    bent = column()
    held = fc.equilibrium(bent, hold={"beam_3_v": 0.0})
    with pytest.raises(StructureError, match="no input of the model acts on it alone"):
        validity_envelope(bent, InitialMode(1), Period("middle"), at=held)


def test_what_an_equilibrium_holds_is_borne_by_inputs():
    model = pendulum()
    asked = InitialDisplacement("rod_0_ry"), Period("sway"), 0.01
    held = fc.equilibrium(model, hold={"rod_0_ry": 0.0})
    assert validity_envelope(model, *asked, at=held).limit == validity_envelope(model, *asked).limit
