"""D9: snap-through: load control says that there is no equilibrium; the path goes through; stability is told.

The limits have their numbers in tests/validation (A9, A10, A12). In time the truss of A12 is let go under a load beyond
its limit: it snaps and swings on the far side, and the energy says how far: 2 · ½ EA (L(y) − L₀)²/L₀ = P (h − y).
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute
from scipy.optimize import brentq

import flexctrl as fc
from flexctrl.errors import EquilibriumError

PAGE = "hard"
SPAN, HEIGHT, EA = 10.0, 0.5, 1e4
LIMIT = 4.79925e-5 * EA


def truss() -> fc.Model:
    length = float(np.hypot(SPAN, HEIGHT))
    left = fc.Spring("left", (-SPAN, 0, 0), (0, HEIGHT, 0), stiffness=EA / length)
    right = fc.Spring("right", (SPAN, 0, 0), (0, HEIGHT, 0), stiffness=EA / length)
    apex = fc.PointMass("apex", (0, HEIGHT, 0), 1.0)
    held = [fc.Support(left.start, "u v w"), fc.Support(right.start, "u v w"), fc.Support(apex.node, "w")]
    pins = [fc.Pin(left.end, apex.node), fc.Pin(right.end, apex.node)]
    structure = fc.Structure(
        [left, right, apex],
        [*held, *pins],
        inputs=[fc.Force("load", apex.node, "-y")],
        outputs=[fc.Position("y", apex.node, "y")],
    )
    return fc.assemble(structure, [fc.Flexible(), fc.LargeRotation()])


@pytest.mark.parametrize("share", [0.5, 0.99, 0.9999])
def test_below_the_limit_there_is_one(share):
    rest = fc.equilibrium(truss(), inputs={"load": share * LIMIT})
    assert rest.stable
    assert rest.outputs["y"] > HEIGHT - 0.2115


@pytest.mark.parametrize("share", [1.001, 1.1, 2.0, 10.0])
def test_above_the_limit_load_control_does_not_jump(share):
    with pytest.raises(EquilibriumError, match="gives way") as error:
        fc.equilibrium(truss(), inputs={"load": share * LIMIT})
    reached = float(str(error.value).split("as far as ")[1].split(" ")[0])
    assert reached == pytest.approx(1.0 / share, rel=5e-3)
    assert "equilibrium_path" in str(error.value)
    assert error.value.state.x[:, 1].max() > 0.2


def test_the_far_side_is_found_from_near_it():
    model = truss()
    start = model.displace({"left_1_v": -2.5 * HEIGHT})
    rest = fc.equilibrium(model, inputs={"load": 2.0 * LIMIT}, start=start)
    assert rest.stable
    assert rest.outputs["y"] < -HEIGHT


def test_an_equilibrium_that_does_not_last_is_found_and_flagged():
    """Flat between its supports the truss is in balance without a load, on a maximum of its energy."""
    model = truss()
    rest = fc.equilibrium(model, start=model.displace({"left_1_v": -HEIGHT}))
    assert rest.outputs["y"] == pytest.approx(0.0, abs=1e-9)
    assert not rest.stable
    assert rest.unstable == 1


def test_displacement_control_passes_the_limit():
    rest = fc.equilibrium(truss(), hold={"left_1_v": -HEIGHT / 2})
    assert rest.outputs["y"] == pytest.approx(HEIGHT / 2, abs=1e-9)


def test_stability_changes_by_one_at_each_limit():
    path = fc.equilibrium_path(truss(), load={"load": LIMIT}, until={"y": -1.5 * HEIGHT})
    assert len(path.limits) == 2
    turns = np.flatnonzero(np.diff(path.unstable)) + 1
    assert path.unstable[[0, *turns]].tolist() == [0, 1, 0]


def test_a_column_loaded_beyond_euler_stays_straight_and_is_flagged():
    section = fc.Section(EA=1e6, EI_y=2.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=1e-3)
    beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), section, elements=10)
    structure = fc.Structure([beam], [fc.Support(beam.start)], inputs=[fc.Force("thrust", beam.end, "-x")])
    model = fc.assemble(structure, [fc.Flexible(), fc.LargeRotation()])
    euler = np.pi**2 / 4
    assert fc.equilibrium(model, inputs={"thrust": 0.99 * euler}).unstable == 0
    assert fc.equilibrium(model, inputs={"thrust": 1.5 * euler}).unstable == 1
    assert fc.equilibrium(model, inputs={"thrust": 2.5 * euler}).unstable == 2


SNAPS = {
    "AdaptiveAlpha": (fc.AdaptiveAlpha(), fc.Tolerance(1e-5, 1e-8)),
    "GeneralizedAlpha": (fc.GeneralizedAlpha(0.02), None),
    "ConservingMidpoint": (fc.ConservingMidpoint(0.05), None),
    "ExplicitRungeKutta": (fc.ExplicitRungeKutta(), fc.Tolerance(1e-7, 1e-10)),
}


@pytest.mark.parametrize("name", SNAPS)
@pytest.mark.parametrize("share", [1.05, 2.0])
def test_a_snap_in_time_is_bounded_by_its_energy(record, share, name):
    method, tolerance = SNAPS[name]
    load, length = share * LIMIT, np.hypot(SPAN, HEIGHT)
    run = fc.simulate(truss(), until=40.0, inputs={"load": load}, method=method, tolerance=tolerance, every=0.01)
    lowest = brentq(lambda y: (np.hypot(SPAN, y) - length) ** 2 * EA / length - load * (HEIGHT - y), -5.0, -0.6)
    record(
        f"D9 truss under {share:g} times its limit load, {name}: lowest place [m]",
        ours=run["y"].min(),
        reference=lowest,
        source="work of the load is the energy of the springs",
        tolerance=1e-3,
    )
    record(
        f"D9 truss under {share:g} times its limit load, {name}: energy lost or made",
        ours=run.report.energy_residual,
        reference=0.0,
        source="nothing dissipates",
        tolerance=Absolute(5e-3),
    )
