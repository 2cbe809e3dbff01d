"""Sampled loops that grow as steps do not see: carts on a spring against the exponential of their own matrices."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import scipy.linalg as la

import flexctrl as fc
from flexctrl.design import MinimumJerk, pd
from flexctrl.dynamics.feed import feed_of
from flexctrl.dynamics.notes.law_slopes import law_slopes
from flexctrl.dynamics.notes.sampled_growth import _counts, _limited, _loop, _missed, _samples

NEAR, FAR, OMEGA, ZETA = 1.79, 1.76, 83.46, 0.0057
SAMPLE, KP, KD = 1.49 / 83.46, 46.2, 13.5
MU = NEAR * FAR / (NEAR + FAR)
STIFFNESS, DAMPING = MU * OMEGA**2, 2.0 * ZETA * OMEGA * MU


def carts() -> fc.Model:
    a, b = fc.PointMass("a", (0, 0, 0), NEAR), fc.PointMass("b", (1, 0, 0), FAR)
    spring = fc.Spring("spring", (0, 0, 0), (1, 0, 0), stiffness=STIFFNESS, damping=DAMPING)
    joints = [fc.Support(a.node, "v w"), fc.Support(b.node, "v w"), fc.Pin(a.node, spring.start)]
    outputs = [fc.Position("near", a.node, "x"), fc.Position("far", b.node, "x"), fc.Velocity("rate", a.node, "x")]
    plan = fc.Structure(
        [a, b, spring],
        [*joints, fc.Pin(b.node, spring.end)],
        inputs=[fc.Force("push", a.node, "x")],
        outputs=outputs,
    )
    return fc.assemble(plan, [fc.LargeRotation()])


def law(delay: int, sent: bool = False, sample: float = SAMPLE) -> fc.design.Controller:
    own = pd(KP, KD, measured="near", rate="rate", command="push")
    move = MinimumJerk(distance=1.0, duration=6.9)
    whole = fc.Sampled(fc.Tracking(own, {"near": move, "rate": move.derivative}) if sent else own, sample)
    return fc.Delayed(whole, delay) if delay else whole


def by_hand(delay: int, sample: float = SAMPLE) -> np.ndarray:
    """Poles of (places, rates, commands under way) from sample to sample."""
    A, k, c = np.zeros((5, 5)), STIFFNESS, DAMPING
    A[:2, 2:4] = np.eye(2)
    A[2], A[3] = np.array([-k, k, -c, c, 1.0]) / NEAR, np.array([k, -k, c, -c, 0.0]) / FAR
    moved, gain = la.expm(sample * A), np.array([-KP, 0.0, -KD, 0.0])
    Z = np.zeros((4 + delay, 4 + delay))
    Z[:4, :4] = moved[:4, :4]
    if not delay:
        Z[:4, :4] += np.outer(moved[:4, 4], gain)
        return np.linalg.eigvals(Z)
    Z[:4, 4], Z[-1, :4] = moved[:4, 4], gain
    Z[range(4, 3 + delay), range(5, 4 + delay)] = 1.0
    return np.linalg.eigvals(Z)


def loop(delay: int, sample: float = SAMPLE):
    model = carts()
    feed = feed_of(model, law(delay, sample=sample), np.zeros(1))
    answers = law_slopes(feed, model.rest, np.asarray(feed.controller.initial()))
    assert answers is not None
    return _loop(feed, model.rest, np.zeros(1), answers)


@pytest.mark.parametrize("delay", [0, 1, 2])
@pytest.mark.parametrize("share", [0.3, 1.0, 1.7])
def test_poles_from_sample_to_sample_are_those_by_hand(delay, share):
    wanted = by_hand(delay, share * SAMPLE)
    found = loop(delay, share * SAMPLE).poles(1.0)
    wanted = wanted[abs(wanted) > 1.0]
    assert len(found) == len(wanted)
    assert all(abs(found - z).min() < 1e-6 * abs(z) for z in wanted)


@pytest.mark.parametrize("rho", [0.6, 0.9, 1.0])
@pytest.mark.parametrize("count", [3, 8])
def test_steps_grow_as_their_poles_say(count, rho):
    """Late in a run the growing pole is all that is left: by so much is each sample larger than the one before."""
    model, z = carts(), loop(1).stepped(rho, count, 1.0)
    start = model.rest.with_(v=np.array([0.1, -0.1]))
    how = {"until": 300 * SAMPLE, "start": start, "every": SAMPLE}
    run = fc.simulate(model, law(1), method=fc.Unchecked(fc.GeneralizedAlpha(SAMPLE / count, rho)), **how)
    stretch = run["far"] - run["near"] - 1.0
    late = np.array([stretch[i : i + 3] for i in range(240, 298)])
    a, b = np.linalg.lstsq(late[:, :2], late[:, 2], rcond=None)[0]
    assert np.sort(abs(np.roots([1.0, -b, -a]))) == pytest.approx(np.sort(abs(z)), rel=1e-4)


@pytest.mark.parametrize(
    "method",
    [
        fc.AdaptiveAlpha(),
        fc.GeneralizedAlpha(SAMPLE),
        fc.ConservingMidpoint(SAMPLE),
        fc.Checked(fc.AdaptiveAlpha()),
    ],
    ids=repr,
)
def test_growth_that_steps_damp_fails_the_run(method):
    """All were at rest, and said to be right to a ten-thousandth."""
    run = fc.simulate(carts(), law(1, sent=True), until=22.2, every=SAMPLE, method=method)
    assert np.ptp((run["far"] - run["near"])[-40:]) < 1e-3
    assert run.status is fc.Status.FAILED
    grows = 22.2 / SAMPLE * np.log(abs(by_hand(1)).max())
    assert f"grows by e^{grows:.3g} over the run" in run.report.message


def test_the_steps_it_names_see_it():
    """A remedy that leaves it unsaid, beside an explicit method that follows the growth."""
    coarse = fc.simulate(carts(), law(1, sent=True), until=22.2, method=fc.GeneralizedAlpha(SAMPLE))
    step = float(coarse.report.message.split("take steps of ")[1].split()[0])
    for method in (fc.GeneralizedAlpha(step), fc.Unchecked(fc.ExplicitRungeKutta())):
        run = fc.simulate(carts(), law(1, sent=True), until=22.2, method=method, every=SAMPLE)
        assert run.status is fc.Status.FINISHED
        assert np.ptp((run["far"] - run["near"])[-40:]) > 0.3
        assert not any("of which steps" in note and "sampled loop" in note for note in run.report.notes)
        grows = 22.2 / SAMPLE * np.log(abs(by_hand(1)).max())
        told = [note for note in run.report.notes if "the sampled loop is unstable" in note]
        if isinstance(method, fc.GeneralizedAlpha):  # what is not checked is not told of
            assert f"grows by e^{grows:.3g} over the run, and what steps err by with it" in told[0]


@pytest.mark.parametrize("limit", [None, 0.05])
@pytest.mark.parametrize("method", [fc.AdaptiveAlpha(), fc.Checked(fc.ExplicitRungeKutta())])
def test_a_law_of_the_wrong_sign_is_said_to_be_unstable(method, limit):
    """Its numbers show it, all right; with limits it drives the machine off at full force."""
    own = fc.Sampled(pd(-4.0, -1.0, measured="near", rate="rate", command="push"), SAMPLE)
    wrong = fc.Saturated(own, {"push": limit}) if limit else own
    start = carts().rest.with_(v=np.array([0.01, 0.0]))
    run = fc.simulate(carts(), wrong, until=10.0, start=start, method=method)
    assert run.status is fc.Status.FINISHED
    said = [note for note in run.report.notes if "the sampled loop is unstable" in note]
    assert [("limits" in note, "its end" in note) for note in said] == [(limit is not None, limit is None)]


@pytest.mark.parametrize("share", [0.02, 0.3])
def test_stable_loops_are_not_told_of(share):
    own = fc.Sampled(pd(4.0, 4.0, measured="near", rate="rate", command="push"), share * SAMPLE)
    for method in (fc.AdaptiveAlpha(), fc.GeneralizedAlpha(share * SAMPLE)):
        start = carts().rest.with_(v=np.array([0.1, 0.0]))
        run = fc.simulate(carts(), own, until=2.0, start=start, method=fc.Checked(method))
        assert run.status is fc.Status.FINISHED
        assert not any("sampled loop" in note for note in run.report.notes)


@pytest.mark.parametrize("inertia", [0.0, 4e-3])
def test_an_arm_behind_a_gear_is_that_of_its_linear_model(inertia):
    """The README's arm, sampled so slowly that its motor flutters; without inertia the motor follows at once."""
    tube = fc.Section.tube(fc.STEEL, radius=0.03, thickness=0.002)
    arm = fc.Beam("arm", (0, 0, 0), (2, 0, 0), tube, elements=2)
    motor = fc.RotaryDrive("motor", arm.start, axis="z", stiffness=2.0, ratio=100, inertia=inertia, damping=1e-3)
    plan = fc.Structure(
        [arm],
        [fc.Support(arm.start, "u v w rx ry")],
        [motor],
        [fc.MotorTorque("torque", motor)],
        [fc.DriveAngle("angle", motor), fc.DriveSpeed("speed", motor)],
    )
    model = fc.assemble(plan, [fc.Flexible(), fc.LargeRotation(), fc.RayleighDamping(beta=1e-3)])
    own = pd(kp=8.0, kd=0.4 if inertia else 0.0, measured="angle", rate="speed", command="torque")
    feed = feed_of(model, fc.Sampled(own, 0.02), np.zeros(1))
    answers = law_slopes(feed, model.rest, np.zeros(0))
    assert answers is not None
    found = _loop(feed, model.rest, np.zeros(1), answers).poles(1.0)
    plant = fc.linearize(model).to_ss()
    n = plant.nstates
    moved = la.expm(0.02 * np.block([[plant.A, plant.B], [np.zeros((1, n + 1))]]))
    gain = -np.array([[8.0, 0.4 if inertia else 0.0]])
    Z = np.block([[moved[:n, :n] + moved[:n, n:] @ gain @ plant.C, moved[:n, n:] @ gain @ plant.D]])
    Z = np.vstack([Z, np.hstack([gain @ plant.C, gain @ plant.D])])
    wanted = np.linalg.eigvals(Z)
    wanted = wanted[abs(wanted) > 1.0 + 1e-7]
    assert wanted.size
    assert len(found) == len(wanted)
    assert all(abs(found - z).min() < 1e-5 * abs(z) for z in wanted)


@pytest.mark.parametrize(("seen", "lost"), [(1.45, False), (1.0, True)])
def test_growth_that_steps_see_and_limits_hold_is_no_failure(seen, lost):
    """A slewing crane that hunted within its limits was right to 3 %, and FAILED: of e^104 its steps saw e^88."""
    loop = SimpleNamespace(
        sample=0.05, poles=lambda growth: np.array([1.6 + 0j]), stepped=lambda rho, count, share: np.array([seen + 0j])
    )
    journey = SimpleNamespace(
        point=SimpleNamespace(state=SimpleNamespace(t=14.0)),
        origin=SimpleNamespace(state=SimpleNamespace(t=0.0)),
        plan=SimpleNamespace(method=fc.AdaptiveAlpha()),
        mark=SimpleNamespace(steps=700),
    )
    found = _missed(loop, _samples(loop, journey), _counts(loop, journey), 0.8)
    assert "the sampled loop is unstable" in found.said()
    assert found.lost is lost


@pytest.mark.parametrize(("steep", "limited"), [(0.0, False), (1e-4, True)])
def test_a_law_that_answers_little_to_much_holds_what_grows(steep, limited):
    """Friction made up for by a steep tanh: loops that grew about rest alone ended as failed, right to 1e-5."""

    def told(t, x, y):
        return [-50.0 * y[0] - 13.5 * y[1] + (0.5 * np.tanh(y[1] / steep) if steep else 0.0)], x

    state, t = np.zeros(2), np.linspace(0.0, 3.0, 50)
    feed = SimpleNamespace(reads=np.arange(2), told=told, measured=lambda _: state)
    run = SimpleNamespace(y=np.column_stack([0.2 * np.sin(t), 0.2 * np.cos(t)]))
    assert _limited(run, SimpleNamespace(t=3.0), np.zeros(0), feed) is limited


PERIOD = 0.005


def lagging(time_constant: float) -> fc.Model:
    """A rotor on an elastic shaft, whose motor's torque takes time to build up."""
    rotor = fc.RigidBody("rotor", (0, 0, 0), 1.0, (0.1, 0.1, 0.1))
    motor = fc.RotaryDrive("m", rotor.node, axis="z", stiffness=50.0, ratio=1.0, inertia=0.01, damping=0.05)
    plan = fc.Structure(
        [rotor],
        [fc.Support(rotor.node, "u v w rx ry")],
        [motor],
        [fc.MotorTorque("tq", motor)],
        [fc.DriveAngle("a", motor), fc.DriveSpeed("s", motor), fc.Rotation("r", rotor.node, "z")],
    )
    return fc.assemble(plan, [fc.LargeRotation(), fc.ShaftElasticity(), fc.MotorLag({"m": time_constant})])


def held(kp: float, kd: float) -> fc.design.Controller:
    return fc.Sampled(pd(kp, kd, measured="a", rate="s", command="tq"), PERIOD)


@pytest.mark.parametrize(("count", "rho"), [(1, 0.9), (2, 0.6), (3, 0.0), (5, 1.0)])
@pytest.mark.parametrize(("lag", "kd"), [(0.02, 4.0), (1e-4, 4.2)])
def test_steps_grow_as_their_poles_say_behind_motors_that_lag(lag, kd, count, rho):
    """Torques begin to build up anew at each sample, whether steps see that or not."""
    model, law = lagging(lag), held(10.0, kd)
    feed = feed_of(model, law, np.zeros(1))
    answers = law_slopes(feed, model.rest, np.zeros(0))
    assert answers is not None
    poles = _loop(feed, model.rest, np.zeros(1), answers).stepped(rho, count, 1.0 + 1e-6)
    assert poles.size
    start = model.displace({"rotor_0_rz": 1e-9, "m_source": 1e-9})
    method = fc.Unchecked(fc.GeneralizedAlpha(PERIOD / count, rho))
    run = fc.simulate(model, law, until=150 * PERIOD, start=start, every=PERIOD, method=method)
    late = np.array([run[k][i : i + 6] for k in ("a", "r") for i in range(51, 145)])
    shares = np.linalg.lstsq(late[:, :5], late[:, 5], rcond=1e-13)[0]
    seen = np.roots([1.0, *-shares[::-1]])
    assert all(abs(seen - z).min() < 1e-5 for z in poles)


@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(PERIOD / 20)])
def test_growth_behind_a_motor_that_lags_is_seen(method):
    """Right to a percent, it ended as failed: of e^10 steps saw nothing, it was said."""
    model, start = lagging(0.02), {"rotor_0_rz": 1e-4, "m_source": 1e-4}
    run = fc.simulate(model, held(20.0, 4.0), until=3.06, start=model.displace(start), every=PERIOD, method=method)
    assert run.status is fc.Status.FINISHED
    assert any("about its start and its end the sampled loop is unstable" in note for note in run.report.notes)
    assert not any("of which steps" in note for note in run.report.notes)


def upright() -> fc.Model:
    """A bar of 1 kg that stands on a shaft, with a motor to balance it."""
    bar = fc.RigidBody("bar", (0, 0, 0.5), 1.0, (0.1, 0.1, 1e-3), {"foot": (0, 0, 0)})
    motor = fc.RotaryDrive("m", bar.point("foot"), axis="y", stiffness=4e4, ratio=1.0, inertia=0.02, damping=8.0)
    plan = fc.Structure(
        [bar],
        [fc.Support(bar.point("foot"), "u v w rx rz")],
        [motor],
        [fc.MotorTorque("tq", motor)],
        [fc.DriveAngle("a", motor), fc.DriveSpeed("s", motor)],
    )
    return fc.assemble(fc.planar(plan, "y"), [fc.Gravity(), fc.LargeRotation()])


COUNTS = [{"a": 2 * np.pi / 256}, {"a": 2 * np.pi / 4096, "s": 0.02}, {"tq": 0.05}, {"a": 1e-5, "s": 1e-3, "tq": 1e-2}]


@pytest.mark.parametrize("counts", COUNTS, ids=str)
def test_laws_that_round_have_the_slopes_of_what_they_round(counts):
    model, law = upright(), fc.Sampled(pd(40.0, 6.0, measured="a", rate="s", command="tq"), 0.01)
    plain, rounded = (
        law_slopes(feed_of(model, own, np.zeros(1)), model.rest, np.zeros(0))
        for own in (law, fc.Quantised(law, counts))
    )
    assert plain.u_y == pytest.approx(np.array([[-40.0, -6.0]]), rel=1e-6)
    assert rounded.u_y == pytest.approx(plain.u_y, rel=0.03)


@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(0.01)], ids=repr)
@pytest.mark.parametrize(("kd", "stands"), [(6.0, True), (-0.4, False)])
@pytest.mark.parametrize("counts", COUNTS, ids=str)
def test_only_loops_that_grow_are_told_of_where_laws_round(counts, kd, stands, method):
    """Within a count a law does nothing, and the bar would fall; it stands. Driven to and fro, it swings ever more."""
    law = fc.Quantised(fc.Sampled(pd(40.0, kd, measured="a", rate="s", command="tq"), 0.01), counts)
    model = upright()
    run = fc.simulate(model, law, until=8.0, start=model.displace({"bar_0_ry": 0.05}), every=0.01, method=method)
    assert run.status is fc.Status.FINISHED
    assert (np.ptp(run["a"][-100:]) < 0.1) == stands
    assert any("the sampled loop is unstable" in note for note in run.report.notes) == (not stands)
