"""The spillover certificate: against Routh, against the loop's own frequency response, against nonlinear runs."""

from __future__ import annotations

from dataclasses import replace

import control as ct
import matplotlib as mpl
import numpy as np
import pytest
import scipy.sparse as sp
from plants import chain, crane, plant

import flexctrl as fc
from flexctrl.design import ControllerError, pd
from flexctrl.errors import StructureError
from flexctrl.linear.model import LinearModel
from flexctrl.linear.parts import PartMatrices
from flexctrl.study.confirm import Confirmation
from flexctrl.study.gain_family import GainFamily, first_crossing, gain_family
from flexctrl.study.loop import open_loop
from flexctrl.study.root_locus import critical_gains
from flexctrl.study.spillover import Spillover, spillover

mpl.use("Agg")


def two_masses(m1=2.0, m2=1.0, c=0.05, k=40.0, ground=0.0) -> LinearModel:
    """A driven mass, a spring, and the mass whose place is measured; parts know their shares."""
    spring = np.array([[1.0, -1.0], [-1.0, 1.0]])
    linear = plant(
        np.diag([m1, m2]),
        k * spring + np.diag([ground, 0.0]),
        [[1.0], [0.0]],
        [[0.0, 1.0], [0.0, 0.0]],
        C=c * spring,
        Cv=[[0.0, 0.0], [0.0, 1.0]],
        outputs=("place", "speed"),
    )
    none = sp.csc_matrix((2, 2))
    parts = {
        "spring": PartMatrices(sp.csc_matrix(k * spring), none),
        "anchor": PartMatrices(sp.csc_matrix(np.diag([ground, 0.0])), none),
        "first": PartMatrices(none, sp.csc_matrix(np.diag([m1, 0.0]))),
        "second": PartMatrices(none, sp.csc_matrix(np.diag([0.0, m2]))),
    }
    return replace(linear, parts=parts)


def law(kp: float, kd: float) -> ct.StateSpace:
    return pd(kp, kd, measured="place", rate="speed", command="force")


def routh(m1: float, m2: float, c: float, k: float, kp: float, kd: float) -> float:
    """Critical factor of u = −g (kp + kd s) x₂ on two masses: a₁ (a₂ a₃ − a₁ a₄) = a₀ a₃² as a polynomial in g."""
    g = np.polynomial.Polynomial([0.0, 1.0])
    a4, a3 = m1 * m2, c * (m1 + m2)
    a2, a1, a0 = k * (m1 + m2) + g * c * kd, g * (k * kd + c * kp), g * k * kp
    roots = (a1 * (a2 * a3 - a1 * a4) - a0 * a3**2).roots()
    return float(min(r.real for r in roots if abs(r.imag) < 1e-9 and r.real > 1e-9))


@pytest.mark.parametrize(("kp", "kd", "c"), [(0.5, 0.02, 0.05), (1.0, 0.01, 0.2), (0.02, 0.001, 0.002)])
def test_two_masses_against_routh(kp, kd, c):
    found = spillover(two_masses(c=c), law(kp, kd))
    expected = routh(2.0, 1.0, c, 40.0, kp, kd)
    assert 1.0 < expected < 1e3
    assert found.gain == pytest.approx(expected, rel=1e-10)
    a1, a3 = expected * (40.0 * kd + c * kp), c * 3.0
    mode = found.mode
    assert mode.frequency_hz == pytest.approx(np.sqrt(a1 / a3) / (2 * np.pi), rel=1e-9)
    assert abs(mode.damping) < 1e-10
    assert mode.own_damping > 0.0
    assert found.stable


def test_shares_of_energy_by_hand():
    """At s = iω the first mass moves (m₂ s² + c s + k)/(c s + k) times the second."""
    m1, m2, c, k = 2.0, 1.0, 0.05, 40.0
    found = spillover(two_masses(m1, m2, c, k), law(0.5, 0.02))
    mode = found.mode
    s = 1j * 2 * np.pi * mode.frequency_hz
    ratio = (m2 * s**2 + c * s + k) / (c * s + k)
    assert mode.strain_shares["spring"] == pytest.approx(1.0)
    first = m1 * abs(ratio) ** 2
    assert mode.kinetic_shares["first"] == pytest.approx(first / (first + m2), rel=1e-8)
    assert sum(mode.kinetic_shares.values()) == pytest.approx(1.0)
    assert mode.lives_in == "spring"
    assert mode.origin.number == 2
    assert mode.origin.frequency_hz == pytest.approx(np.sqrt(k * (1 / m1 + 1 / m2)) / (2 * np.pi))
    assert mode.rate == pytest.approx(s * mode.shape)


def test_statement_reads():
    found = spillover(two_masses(), law(0.5, 0.02))
    text = str(found)
    assert f"goes unstable at {found.gain:.4g} × the controller's gain" in text
    assert "lives in spring (100 % of strain energy" in text
    assert "twin" not in text
    beyond = spillover(two_masses(), law(0.5 * 2 * found.gain, 0.02 * 2 * found.gain))
    assert not beyond.stable
    assert beyond.gain == pytest.approx(0.5, rel=1e-9)
    assert "is unstable: it bears only 0.5 ×" in str(beyond)


def test_collocated_rate_feedback_never_spills_over():
    linear = chain(8, beta=1e-3)
    damper = ct.ss([], [], [], [[-1.0]], inputs=["x1_rate"], outputs=["force"])
    seen = replace(linear, Cq=0 * linear.Cq[:1], Cv=linear.Cq[:1], D=linear.D[:1], outputs=("x1_rate",))
    found = spillover(seen, damper)
    assert found.gain == np.inf
    assert found.mode is None
    assert "stays stable up to 1000 ×" in str(found)


def test_wrong_sign_is_unstable_at_every_gain():
    found = spillover(two_masses(ground=5.0, c=0.0), law(-0.5, -0.02))
    assert found.gain == 0.0
    assert found.mode.pole.real > 0.0
    assert "unstable at every gain from 0.001 to 1000 ×" in str(found)


def test_mode_that_is_unstable_over_a_short_range_of_gains_is_not_missed():
    """Two frequencies that meet as the gain grows flutter for 0.495 < k < 0.505 only; scan steps are 40 %."""
    b, c = 0.005, 1e-6
    K = np.array([[1.0, b], [-b, 1.5]])
    start = np.block([[np.zeros((2, 2)), np.eye(2)], [-K, -c * np.eye(2)]])
    slope = np.zeros((4, 4))
    slope[2, 0] = -1.0
    none = (np.zeros((0, 0)), np.zeros((0, 0)))
    family = GainFamily(start, slope, np.zeros(0, int), none, np.zeros((0, 4)), 0.0)
    assert family.at(0.4).stable
    assert family.at(0.6).stable
    found = first_crossing(family, 0.2, 2.0)
    assert found.gain == pytest.approx(0.5 - 2 * b, abs=1e-5)


@pytest.mark.parametrize("seed", range(12))
def test_first_crossing_is_that_of_the_open_loop(seed):
    """Random chains and lags: 1 + k L(iω) = 0, an independent route."""
    rng = np.random.default_rng(seed)
    linear = chain(int(rng.integers(2, 7)), stiffness=rng.uniform(1, 50), beta=rng.uniform(1e-4, 1e-2))
    output = linear.outputs[int(rng.integers(len(linear.outputs)))]
    lag = ct.tf([rng.uniform(0.001, 0.01)], [rng.uniform(0.01, 0.3), 1.0])
    loop = open_loop(linear, lag, "force", output)
    expected = [g.gain for g in critical_gains(loop) if g.unstable_above and g.gain > 1.0]
    feedback = ct.ss(-lag)
    feedback = ct.ss(*(getattr(feedback, m) for m in "ABCD"), inputs=[output], outputs=["force"])
    found = spillover(linear, feedback, most=1e5)
    if not loop.is_stable(1.0):
        assert found.gain < 1.0
    elif expected and expected[0] < 1e5:
        assert found.gain == pytest.approx(expected[0], rel=1e-6)
    else:
        assert found.gain == np.inf


@pytest.mark.parametrize("delay", range(4))
def test_sampled_integrator_with_delay(delay):
    """v̇ = u/m, u = −K v with d samples of delay: stable below K h/m = 2 sin(π/(2(2d + 1))) (case C11)."""
    h, gain = 0.1, 1.0
    cart = plant([[1.0]], [[0.0]], [[1.0]], [[0.0]], Cv=[[1.0]], outputs=("speed",))
    static = ct.ss([], [], [], [[-gain]], inputs=["speed"], outputs=["force"])
    found = spillover(cart, fc.Delayed(fc.Sampled(static, h), delay))
    assert found.gain * gain * h == pytest.approx(2 * np.sin(np.pi / (2 * (2 * delay + 1))), rel=1e-9)
    assert found.mode.frequency_hz == pytest.approx(1.0 / (2 * h * (2 * delay + 1)), rel=1e-9)


def test_fast_sampling_tends_to_the_continuous_loop():
    linear = two_masses()
    continuous = spillover(linear, law(0.5, 0.02))
    gaps = [spillover(linear, fc.Sampled(law(0.5, 0.02), h)).gain / continuous.gain - 1 for h in (1e-3, 5e-4)]
    assert 0.0 < abs(gaps[0]) < 0.05
    assert gaps[0] / gaps[1] == pytest.approx(2.0, rel=0.1)
    # energy shares of the sampled loop are means over time
    sampled = spillover(linear, fc.Sampled(law(0.5, 0.02), 1e-3)).mode
    assert sampled.kinetic_shares["first"] == pytest.approx(continuous.mode.kinetic_shares["first"], rel=1e-2)


def test_mode_above_half_the_sampling_rate_is_named_by_its_own_frequency():
    """A mode at 3.0 Hz under 4.3 samples a second shows at 1.3 Hz in the samples."""
    w = 2 * np.pi * 3.0
    linear = plant([[1.0]], [[w * w]], [[1.0]], [[1.0]], C=[[0.01]], outputs=("place",))
    gains = []
    for sign in (1.0, -1.0):
        static = ct.ss([], [], [], [[0.01 * sign]], inputs=["place"], outputs=["force"])
        found = spillover(linear, fc.Sampled(static, 1 / 4.3), most=1e5)
        gains.append((found.gain, found.mode.frequency_hz))
    assert min(gains)[1] == pytest.approx(3.0, rel=1e-3)


def test_what_the_controller_does_not_touch_stays_out():
    """An undamped mode that is not seen lies on the boundary at every gain; it moves along with the critical one."""
    linear = two_masses()
    M = np.diag([2.0, 1.0, 1.0])
    wide = plant(
        M,
        np.block([[linear.K.toarray(), np.zeros((2, 1))], [np.zeros((1, 2)), np.full((1, 1), 9.0)]]),
        [[1.0], [0.0], [1.0]],
        [[0.0, 1.0, 0.0], [0.0, 0.0, 0.0]],
        C=np.block([[linear.C.toarray(), np.zeros((2, 1))], [np.zeros((1, 3))]]),
        Cv=[[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        outputs=("place", "speed"),
    )
    reference, found = (spillover(p, law(0.5, 0.02)) for p in (linear, wide))
    assert found.gain == pytest.approx(reference.gain, rel=1e-9)
    s, x = found.mode.pole, found.mode.shape
    force = found.gain * -(0.5 + 0.02 * s) * x[1]
    assert x[2] == pytest.approx(force / (s * s + 9.0), rel=1e-8)
    assert len(gain_family(wide, found.law).states) == 4


def test_limits_and_references_play_no_part():
    inner = law(0.5, 0.02)
    wrapped = fc.Saturated(fc.Tracking(inner, {"place": fc.design.Step(1.0)}), {"force": 3.0})
    assert spillover(two_masses(), wrapped).gain == pytest.approx(spillover(two_masses(), inner).gain, rel=1e-12)


def test_refusals():
    with pytest.raises(StructureError, match="0 < least < 1 < most"):
        spillover(two_masses(), law(1, 1), least=2.0)
    with pytest.raises(ControllerError, match="no linear law"):
        spillover(two_masses(), _Bang())
    with pytest.raises(StructureError, match="not a signal"):
        spillover(crane(1.0, 1.0, 1.0), law(1, 1))
    direct = replace(two_masses(), D=np.array([[0.1], [0.0]]))
    with pytest.raises(StructureError, match="depends directly"):
        spillover(direct, law(1, 1))
    with pytest.raises(StructureError, match="give spillover the Model"):
        spillover(two_masses(), law(0.5, 0.02)).confirm()


class _Bang:
    inputs, outputs, sample_time = ("place",), ("force",), 0.0

    def initial(self):
        return np.zeros(0)

    def command(self, t, x, y):
        return -np.sign(y)

    def rate(self, t, x, y):
        return x

    def update(self, t, x, y):
        return x


def mast(elements: int = 1) -> fc.Model:
    """A cart on a rail with a slender mast; a motor moves the cart, the place of the mast's top is measured."""
    section = fc.Section(EA=1e6, EI_y=60.0, EI_z=60.0, GJ=40.0, rhoA=0.5, rhoJ=1e-3)
    beam = fc.Beam("mast", (0, 0, 0), (0, 0, 1.5), section, elements=elements)
    cart, top = fc.PointMass("cart", beam.start, 4.0), fc.PointMass("camera", beam.end, 1.0)
    structure = fc.Structure(
        [beam, cart, top],
        [fc.Support(beam.start, "w ry"), fc.Pin(beam.start, cart.node), fc.Pin(beam.end, top.node)],
        inputs=[fc.Force("push", cart.node, "x")],
        outputs=[fc.Position("top_x", top.node, "x"), fc.Velocity("top_speed", top.node, "x")],
        name="mast_on_a_cart",
    )
    effects = [fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(alpha=0.02, beta=1e-3)]
    return fc.assemble(fc.planar(structure, normal="y"), effects)


REGULATOR = {"kp": 6.0, "kd": 1.0, "measured": "top_x", "rate": "top_speed", "command": "push"}


@pytest.fixture(scope="module")
def certificate() -> tuple[Spillover, Confirmation]:
    found = spillover(mast(), pd(**REGULATOR))
    return found, found.confirm()


def check(found: Spillover, confirmed: Confirmation) -> None:
    assert found.mode.lives_in == "mast"
    assert confirmed.confirmed
    assert confirmed.gain == pytest.approx(found.gain, rel=2e-3)
    for growth in (confirmed.below, confirmed.above):
        assert growth.measured == pytest.approx(growth.predicted, rel=0.05)
    assert "confirmed by nonlinear simulation" in str(confirmed)
    assert "twin" in str(found)


def test_nonlinear_runs_confirm_the_gain(certificate):
    check(*certificate)
    assert certificate[0].rigid_gain == np.inf


def test_nonlinear_runs_confirm_the_gain_of_a_sampled_controller():
    found = spillover(mast(), fc.Delayed(fc.Sampled(pd(**REGULATOR), 0.02), 1))
    check(found, found.confirm())
    assert 5 * found.gain < found.rigid_gain < np.inf


def pendulum() -> fc.Model:
    """A bob on an elastic rod that stands on a cart."""
    rod = fc.Beam("rod", (0, 0, 0), (0, 0, 1), fc.Section.tube(fc.STEEL, 0.02, 0.002), 3)
    cart, bob = fc.PointMass("cart", rod.start, 5.0), fc.PointMass("bob", rod.end, 2.0)
    places = {"cart": cart.node, "bob": bob.node}
    structure = fc.Structure(
        [cart, rod, bob],
        [fc.Support(cart.node, "v w"), fc.Pin(cart.node, rod.start), fc.Pin(rod.end, bob.node)],
        inputs=[fc.Force("push", cart.node, "x")],
        outputs=[
            *(fc.Position(f"{name}_x", node, "x") for name, node in places.items()),
            *(fc.Velocity(f"{name}_rate", node, "x") for name, node in places.items()),
        ],
        name="inverted_pendulum",
    )
    effects = [fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(beta=1e-5)]
    return fc.assemble(fc.planar(structure, "y"), effects)


def state_feedback(model: fc.Model, dt: float = 0.0, gain: float = 1.0) -> ct.StateSpace:
    """LQR of the rigid twin on its four outputs."""
    twin = fc.linearize(fc.rigid(model)).to_ss()
    feedback = ct.lqr(twin.A, twin.B, twin.C.T @ twin.C, [[0.01]])[0] @ np.linalg.inv(twin.C)
    return ct.ss([], [], [], -gain * feedback, dt, inputs=list(model.outputs), outputs=["push"])


@pytest.mark.slow
def test_confirmation_resolves_what_rings_between_samples():
    """The critical mode alternates from sample to sample (50 Hz); the rod swings at 122 Hz. 96 steps: 2.6 % off."""
    model = pendulum()
    found = spillover(model, state_feedback(model, 0.01))
    confirmed = found.confirm()
    assert found.mode.frequency_hz == pytest.approx(50.0)
    assert found.gain == pytest.approx(19.453, abs=2e-3)  # largest |z| by matrix exponentials of 40 digits
    assert confirmed.confirmed
    assert confirmed.gain == pytest.approx(found.gain, rel=2e-3)
    assert confirmed.change < 1e-3


def test_a_machine_stable_between_two_gains_only_says_so():
    """Both ends against eigenvalues of the dense closed loop; the interval may also lie above the law's own gain."""
    model = pendulum()
    found = spillover(model, state_feedback(model))
    plain, law_ = fc.linearize(model).to_ss(fc.PhysicalForm()), state_feedback(model)

    def growth(gain: float) -> float:
        return float(np.linalg.eigvals(plain.A + gain * plain.B @ law_.D @ plain.C).real.max())

    assert 0.3 < found.lower < 1.0 < found.gain
    assert found.stable
    for end, inside in ((found.lower, 1.0), (found.gain, -1.0)):
        assert growth(end * (1 + 1e-4 * inside)) < 1e-6 < growth(end * (1 - 1e-4 * inside))
    assert f"below {found.lower:.4g} × it is unstable too" in str(found)
    weak = spillover(model, state_feedback(model, gain=0.3 * found.lower))
    assert not weak.stable
    assert (weak.lower, weak.gain) == pytest.approx((1 / 0.3, found.gain / found.lower / 0.3), rel=1e-6)
    assert "is unstable: it needs 3.333 × the controller's gain" in str(weak)


def test_picture(certificate):
    found, confirmed = certificate
    curve, bars, growth, shape = found.plot(confirmed).axes
    assert shape.get_title() == "the critical mode"
    assert curve.get_xlabel() == "gain over the controller's own"
    assert next(label.get_text() for label in bars.get_yticklabels()) == "mast"
    assert len(growth.lines) == 4
    still = spillover(mast(), pd(**REGULATOR | {"kp": 1e-6, "kd": 1e-6}), most=2.0)
    assert len(still.plot().axes) == 1


def raised_arm() -> fc.Model:
    """A flexible arm that its motor holds against gravity."""
    tube = fc.Section.tube(fc.STEEL, radius=0.03, thickness=0.002)
    beam = fc.Beam("arm", (0, 0, 0), (2, 0, 0), tube, elements=4)
    tip = fc.PointMass("tip", beam.end, 10.0)
    motor = fc.RotaryDrive("motor", beam.start, axis="-y", stiffness=20.0, ratio=100, inertia=4e-3)
    structure = fc.Structure(
        [beam, tip],
        [fc.Support(beam.start, "u v w rx rz"), fc.Pin(beam.end, tip.node)],
        [motor],
        [fc.MotorTorque("torque", motor)],
        [fc.DriveAngle("angle", motor), fc.DriveSpeed("speed", motor)],
    )
    effects = [fc.Gravity(), fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(beta=1e-3)]
    return fc.assemble(structure, effects)


def test_a_motor_that_the_equilibrium_holds_is_let_go_of_and_its_law_acts():
    model = raised_arm()
    held = fc.equilibrium(model, hold={"motor_source": 0.0})
    torque = {"torque": held.holding["motor_source"]}
    law = fc.Delayed(fc.Sampled(pd(8.0, 0.4, measured="angle", rate="speed", command="torque"), 0.004), 1)
    gain = spillover(fc.linearize(model, at=held.state, inputs=torque), law).gain
    assert 2.0 < gain < 3.0
    borne = fc.equilibrium(model, hold={"motor_source": 0.0}, inputs=torque)
    for rest in (held, borne, fc.equilibrium(model, inputs=torque, start=held.state)):
        found = spillover(model, law, at=rest)
        assert found.gain == pytest.approx(gain, rel=1e-9)
        assert found.rigid_gain == pytest.approx(5.2297, rel=1e-3)
    assert spillover(model, law, at=held).confirm().confirmed


def test_the_twin_of_a_hoist_hangs_from_its_motor_where_the_rope_is_stretched():
    trolley, load = fc.PointMass("trolley", (0, 0, 40), mass=50e3), fc.PointMass("load", (0, 0, 10), mass=30e3)
    winch = fc.Winch("hoist", load.node, trolley.node, EA=5e7, damping=30e3, radius=0.75, ratio=30.0, inertia=30.0)
    structure = fc.Structure(
        [trolley, load],
        [fc.Support(trolley.node, "v w"), fc.Support(load.node, "v")],
        [winch],
        [fc.MotorTorque("torque", winch)],
        [fc.DriveAngle("angle", winch), fc.DriveSpeed("speed", winch)],
    )
    model = fc.assemble(structure, [fc.LargeRotation(), fc.Gravity(), fc.RopeStretch()])
    held = fc.equilibrium(model, hold={"hoist_source": 0.0})
    borne = fc.equilibrium(model, inputs={"torque": held.holding["hoist_source"]}, start=held.state)
    hold = fc.Delayed(fc.Sampled(pd(200.0, 400.0, measured="angle", rate="speed", command="torque"), 0.01), 1)
    gains = [(found.gain, found.rigid_gain) for rest in (held, borne) if (found := spillover(model, hold, at=rest))]
    assert gains[0] == pytest.approx(gains[1], rel=1e-6)
    # the load pulls on the motor's inertia: J + m (r/R)², z² − 2 z + 1 + …, one sample late
    inertia, h = 30.0 + 30e3 * (0.75 / 30.0) ** 2, 0.01
    k = gains[0][1]
    steps = np.array([[0.5 * h**2], [h]]) / inertia
    loop = np.block([[np.array([[1.0, h], [0.0, 1.0]]), steps], [-k * np.array([[200.0, 400.0]]), np.zeros((1, 1))]])
    assert np.abs(np.linalg.eigvals(loop)).max() == pytest.approx(1.0, abs=1e-6)


def test_a_law_that_acts_on_nothing_but_what_is_held_is_refused():
    bar = fc.Beam("bar", (0, 0, 0), (1, 0, 0), fc.Section.tube(fc.STEEL, radius=0.03, thickness=0.002))
    other = fc.PointMass("other", (0, 0, 1), 1.0)
    structure = fc.Structure(
        [bar, other],
        [fc.Support(bar.start, "u v rx rz"), fc.Support(other.node, "v w")],
        inputs=[fc.Force("push", bar.end, "z")],
        outputs=[fc.Position("place", bar.end, "z"), fc.Velocity("speed", bar.end, "z")],
    )
    model = fc.rigid(fc.assemble(structure, [fc.LargeRotation()]))
    held = fc.equilibrium(model, hold={"bar_0_w": 0.0, "bar_0_ry": 0.0})
    controller = pd(8.0, 0.4, measured="place", rate="speed", command="push")
    with pytest.raises(StructureError, match="holds all that the controller's push acts on"):
        spillover(model, controller, at=held)
