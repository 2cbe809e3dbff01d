"""Root locus: closed forms, exact branches, and accuracy where polynomials fail."""

from __future__ import annotations

import control as ct
import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from plants import cantilever, chain, plant
from scenes import TROLLEY
from scipy.signal import tf2ss

import flexctrl as fc
from flexctrl.cranes import bridge_crane
from flexctrl.errors import StructureError
from flexctrl.scene import load_scene
from flexctrl.study.frequency import margins
from flexctrl.study.loop import open_loop
from flexctrl.study.root_locus import critical_gains, root_locus

mpl.use("Agg")


def damped_feedback(linear, output: str):
    """Lead of a rate feedback with two roll-off poles at 300 rad/s."""
    return open_loop(linear, ct.tf([1, 0], [1 / 300**2, 2 / 300, 1]), "force", output)


def test_second_order_branches_in_closed_form():
    """s² + 2s + k: two real poles meet at k = 1 and part at right angles."""
    locus = root_locus(open_loop(ct.ss(ct.tf([1.0], [1, 2, 0]))))
    for k, row in zip(locus.gains, locus.loci, strict=True):
        exact = np.roots([1, 2, k])
        np.testing.assert_allclose(np.sort_complex(row), np.sort_complex(exact), atol=1e-7)


def test_critical_gain_in_closed_form():
    """k/(s (s+1) (s+2)): k = 6 at sqrt 2 rad/s."""
    found = critical_gains(open_loop(ct.ss(ct.tf([1.0], [1, 3, 2, 0]))))
    assert len(found) == 1
    np.testing.assert_allclose([found[0].gain, found[0].omega], [6.0, np.sqrt(2)], rtol=1e-10)
    assert found[0].unstable_above


def test_a_loop_that_must_have_gain_to_be_stable():
    """k (s + 3)/(s − 1)²: stable above k = 2, leaving through ±i sqrt(1 + 3k) = ±i sqrt 7."""
    found = critical_gains(open_loop(ct.ss(ct.tf([1.0, 3.0], [1, -2, 1]))))
    assert len(found) == 1
    np.testing.assert_allclose([found[0].gain, found[0].omega], [2.0, np.sqrt(7)], rtol=1e-9)
    assert not found[0].unstable_above


def test_a_branch_along_the_boundary_is_no_crossing():
    """Double integrator with lead: stable at every gain, tangent to the axis at none but 0."""
    body = plant([[1.0]], [[0.0]], [[1.0]], [[1.0]])
    assert critical_gains(open_loop(body, ct.tf([1.0, 1.0], [1]))) == ()
    assert critical_gains(open_loop(body, ct.tf([1.0, 1.0], [1e-3, 1]))) == ()


def test_a_pole_through_the_origin_is_a_crossing():
    """k/(s + 1) with positive feedback, written as −k: s = k − 1."""
    found = critical_gains(open_loop(ct.ss(ct.tf([-1.0], [1, 1]))))
    assert len(found) == 1
    np.testing.assert_allclose([found[0].gain, found[0].omega], [1.0, 0.0], atol=1e-9)


def test_collocated_rate_feedback_never_destabilises():
    linear = cantilever(10, beta=1e-5)
    locus = root_locus(open_loop(linear, ct.tf([1, 0], [1]), "force", "tip"))
    assert (locus.loci.real < 1e-9 * abs(locus.loci)).all()


def test_branches_are_continuous_and_end_at_the_zeros():
    linear = chain(6, beta=0.02)
    loop = open_loop(linear, 1.0, "force", "x1")
    locus = root_locus(loop)
    np.testing.assert_allclose(np.sort_complex(locus.loci[0]), np.sort_complex(loop.poles))
    far = np.array([abs(locus.loci[-1] - z).min() for z in loop.zeros])
    assert (far < 0.05 * abs(loop.zeros)).all()
    # every step of every branch is the nearest continuation: no swap shortens the total path
    for a, b in zip(locus.loci, locus.loci[1:], strict=False):
        own = abs(b - a)
        for i in range(len(a)):
            for j in range(i):
                swapped = abs(b[i] - a[j]) + abs(b[j] - a[i])
                assert own[i] + own[j] <= swapped * (1 + 1e-6) + 1e-9


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_sixty_states_agree_with_python_control_and_a_hundred_and_thirty_do_not():
    """At 62 states polynomials still give eight digits; at 130 they raise or lie (design fact)."""
    small = damped_feedback(cantilever(15, beta=2e-5), "tip")
    gains = np.array([0.5, 2.0, 8.0])
    mine = root_locus(small, gains)
    theirs = ct.root_locus_map(ct.ss(small.A, small.B, small.C, small.D), gains=gains)
    low = [row[abs(row) < 500] for row in mine.loci[[np.flatnonzero(mine.gains == k)[0] for k in gains]]]
    for row, other in zip(low, theirs.loci, strict=True):
        assert max(abs(other - pole).min() / abs(pole) for pole in row) < 1e-5
    large = damped_feedback(cantilever(32, beta=1e-5), "tip")
    mine = root_locus(large, np.array([1.0, 3.0]))
    assert len(large.A) == 130
    residual = [abs(1 + mine.gains[-1] * large.curve(mine.loci[-1][abs(mine.loci[-1]) < 1e3]))]
    assert np.max(residual) < 1e-5
    with pytest.raises((np.linalg.LinAlgError, ValueError)):
        ct.root_locus_map(ct.ss(large.A, large.B, large.C, large.D), gains=[1.0, 3.0])


@pytest.mark.parametrize("rest", [0.0, 1e-16, -1e-16])
def test_what_rounding_leaves_of_a_zero_at_rest_is_no_critical_gain(rest):
    """A washout's states are made by SLICOT or scipy; the latter leaves L(0) = ∓1e-16, no gain of 1e16."""
    loop = open_loop(ct.ss([[0, 1], [-4, -0.4]], [[0], [1]], [[rest, 1]], [[0]]), ct.ss([[-3]], [[1]], [[1]], [[0]]))
    assert root_locus(loop).critical == ()
    assert root_locus(loop).gains[-1] < 1e6
    assert abs(loop.zeros).min() < 1e-12


def test_what_rounding_leaves_of_free_motion_hides_no_critical_gain_at_rest(tmp_path):
    """The sway of a load does not see that its trolley is free: L(0) = 1/(m ℓ ω²), ω² = g/ℓ (1 + m/M)."""
    path = tmp_path / "trolley.toml"
    path.write_text(TROLLEY, encoding="utf-8")
    linear = load_scene(path).linear
    found = critical_gains(open_loop(linear, -1.0, "push", "sway"))
    at_rest = [c.gain for c in found if c.omega == 0.0]
    assert at_rest == pytest.approx([5.0 * 9.81 * (1 + 5.0 / 20.0)], rel=1e-4)
    critical_gains(open_loop(linear, 1.0, "push", "sway"))


def test_a_static_gain_turned_about_is_critical_at_rest():
    """1 − k/4 = 0: however small its static gain is beside its peak, a pole passes s = 0."""
    for static in (1.0, 1e-6):
        loop = open_loop(ct.ss(ct.tf([1.0, -static], [1, 0.4, 4])))
        (found,) = (c for c in root_locus(loop).critical if c.omega == 0)
        assert found.gain == pytest.approx(4 / static)


@pytest.mark.slow
def test_critical_gains_of_a_flexible_loop_are_its_gain_margins():
    """Two independent routes: eigenvalues over the gain, and crossings of the frequency response."""
    for output in ("tip", "middle"):
        loop = damped_feedback(cantilever(15, beta=2e-5), output)
        locus = root_locus(loop)
        by_eigenvalues = list(critical_gains(loop, locus))
        crossings = sorted(c.margin for c in margins(loop).phase_crossings if c.margin < locus.gains[-1])
        assert len(by_eigenvalues) > 2
        for critical in by_eigenvalues:
            assert min(abs(critical.gain / k - 1) for k in crossings) < 1e-6


def test_python_control_draws_the_result():
    locus = root_locus(open_loop(chain(4, beta=0.02), 1.0, "force", "x1"))
    data = locus.to_control()
    np.testing.assert_array_equal(data.loci, locus.loci)
    lines = data.plot().lines
    assert len(lines[0, 2]) == 8
    plt.close("all")


def test_sampled_loop_crosses_the_unit_circle():
    """Integrator with d samples of delay: K h = 2 sin(π/(2(2d + 1))), period 2(2d + 1) samples (case C11)."""
    h = 0.1
    for d, limit in enumerate([2.0, 1.0, 0.6180339887, 0.4450418679]):
        A = np.diag(np.ones(d), 1) if d else np.zeros((1, 1))
        A[0, 0] = 1.0
        if d:
            A[0, 1] = h
        B = np.eye(d + 1)[:, [-1]] * (1.0 if d else h)
        loop = open_loop(ct.ss(A, B, np.eye(1, d + 1), [[0.0]], h))
        first = critical_gains(loop)[0]
        np.testing.assert_allclose(first.gain * h, limit, rtol=1e-8)
        np.testing.assert_allclose(first.omega * h, 2 * np.pi / (2 * (2 * d + 1)), rtol=1e-8)


def test_gains_are_checked():
    loop = open_loop(plant([[1.0]], [[1.0]], [[1.0]], [[1.0]]))
    for bad in ([2.0, 1.0], [-1.0, 1.0], [np.nan]):
        with pytest.raises(StructureError, match="ascending"):
            root_locus(loop, bad)


def test_an_integrators_pole_at_rest_takes_no_gains_and_crosses_nothing():
    """Its eigenvalue trembles by rounding; L(0) is infinite, so no gain brings a pole there."""
    effects = (fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(alpha=0.002, beta=1e-4))
    linear = fc.linearize(fc.assemble(bridge_crane(elements=1), effects))
    loop = open_loop(linear, ct.tf([60.0, 10.0], [0.1, 1.0]), "left_torque", "travel")
    assert len(root_locus(loop).gains) < 250
    (critical,) = root_locus(loop, np.geomspace(3e-14, 8e12, 50)).critical
    assert critical.omega > 1.0
    assert abs(1 + critical.gain * loop.at(np.array([critical.omega]))[0]) < 1e-9


def unstable(loop, gain: float) -> int:
    """Closed-loop poles beyond the boundary."""
    poles = loop.closed_poles(gain)
    return int(np.count_nonzero(abs(poles) > 1 + 1e-9 if loop.dt else poles.real > 1e-9))


@pytest.mark.parametrize("gains", [[1, 4, 7, 9, 20], [1, 4, 8, 10, 20], [1, 4, 8.0000000001, 10], [1.0, 8.0]])
def test_a_gain_of_ones_own_on_the_boundary_hides_no_crossing(gains):
    """1/(s + 1)³ is critical at k = 8, whether that is among the gains or not."""
    (found,) = root_locus(open_loop(ct.ss(*tf2ss([1.0], [1, 3, 3, 1]))), gains).critical
    np.testing.assert_allclose([found.gain, found.omega], [8.0, np.sqrt(3)], rtol=1e-9)
    assert found.unstable_above


@pytest.mark.parametrize("gains", [[0.1, 0.5, 0.6, 0.7, 5.0], [0.1, 2 / 3, 5.0], None])
def test_a_real_pole_through_the_origin_is_found_whatever_the_gains(gains):
    """(s + 1.5)/((s² − 1)(s/100 + 1)): L(0) = −1.5, and s > 0 leaves as k passes 2/3."""
    loop = open_loop(ct.ss(ct.tf([1.0], [1, 0, -1])), ct.tf([1, 1.5], [0.01, 1]))
    first = root_locus(loop, gains).critical[0]
    np.testing.assert_allclose([first.gain, first.omega], [2 / 3, 0.0], atol=1e-9)
    assert not first.unstable_above


LOOPS = [  # by scipy: what python-control makes of a transfer function depends on SLICOT, and is wrong for the third
    open_loop(ct.ss(*tf2ss([1.0], [1, 3, 3, 1])), ct.tf([1, 0.1], [0.01, 1])),
    open_loop(ct.ss(*tf2ss([1.0], [1, 0.02, 1, 0])), ct.tf([1, 0.1], [0.01, 1])),
    open_loop(ct.ss(*tf2ss([25.0], [1, 0.1, 16, 0, 0])), ct.tf([1, 0.1], [0.01, 1])),
    open_loop(ct.ss(*tf2ss([1.0, 3.0], np.poly([-1e-5, 1e-5, -100, -200]) / 2e4))),  # nearly at rest: L grows to 3e10
    open_loop(chain(4, beta=0.02), ct.tf([5, 1], [1e-4, 0.02, 1]), "force", "x1"),
    open_loop(chain(3, beta=0.02), ct.sample_system(ct.tf([5, 1], [0.05, 1]), 0.1, "tustin"), "force", "x1"),
    open_loop(ct.sample_system(ct.ss(ct.tf([1.0], [1, 0.02, 1])), 0.1), ct.tf([2, -1.8], [1, 0.2], 0.1)),
]


@pytest.mark.parametrize("loop", LOOPS, ids=range(len(LOOPS)))
def test_critical_gains_are_where_the_number_of_unstable_poles_changes(loop):
    """Counted from eigenvalues at gains over ten decades: as many changes, at these gains; every one is a margin."""
    found = critical_gains(loop)
    edges = np.geomspace(1e-3, 1e7, 400)
    counts = [unstable(loop, k) for k in edges]
    changes = [(a, b) for a, b, i, j in zip(edges, edges[1:], counts, counts[1:], strict=False) if i != j]
    assert changes
    for a, b in changes:
        assert any(a * (1 - 1e-6) <= c.gain <= b * (1 + 1e-6) for c in found)
    for c in found:
        more = unstable(loop, c.gain * (1 + 1e-4)) - unstable(loop, c.gain * (1 - 1e-4))
        assert np.sign(more) == (1 if c.unstable_above else -1)
    factors = [p.margin for p in margins(loop).phase_crossings]
    for c in found:
        assert c.omega == 0.0 or min(abs(c.gain / k - 1) for k in factors) < 1e-6


def test_the_picture_of_an_undamped_loop_does_not_enlarge_round_off():
    """m ẍ + k x = u under a spring: poles stay on the imaginary axis, at ±(ω, …), real parts of 1e-16."""
    ax = fc.plot_root_locus(root_locus(open_loop(ct.ss(ct.tf([1.0], [1, 0, 4])))))
    low, high = ax.get_xlim()
    assert high - low >= 0.02 * ax.get_ylim()[1]
