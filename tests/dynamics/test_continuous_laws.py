"""Runs under continuous laws that compiled loops ask are those of plain steps, which ask them in Python."""

from __future__ import annotations

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc
from flexctrl.design import AntiWindup, FeedForward, FilteredRate, MinimumJerk, OpenLoop, Ramp, Shaped, Step, pid, zvd
from flexctrl.design.answers import answering
from flexctrl.dynamics.alpha.steps import Stepper

pytest.importorskip("llvmlite")

PACES = {"fixed": fc.GeneralizedAlpha(1e-3), "controlled": fc.AdaptiveAlpha(first_step=1e-3)}


def crane() -> fc.Model:
    return fc.assemble(fc.cranes.ceiling_crane(), [fc.Gravity(), fc.Flexible(), fc.LargeRotation()])


def follow(command: str = "push") -> fc.Tracking:
    """A law with states that follows a shaped path."""
    inner = pid(900.0, 200.0, 30.0, measured="travel", rate=FilteredRate(0.01), command=command)
    return fc.Tracking(inner, {"travel": Shaped(MinimumJerk(0.3, 0.2, at=0.02), zvd(40.0))})


def wound() -> fc.Tracking:
    inner = pid(900.0, 2000.0, 30.0, measured="travel", rate=FilteredRate(0.01), command="push")
    return fc.Tracking(AntiWindup(inner, {"push": 40.0}), {"travel": Step(0.2, at=0.013)})


LAWS = {
    "states and a shaped path": follow,
    "limits": lambda: fc.Saturated(follow(), {"push": 60.0}),
    "integrators that stop": wound,
    "open loop": lambda: OpenLoop({"push": Ramp(200.0, 0.05, at=0.01)}),
    "stiff filter": lambda: fc.Tracking(
        pid(900.0, 0.0, 30.0, measured="travel", rate=FilteredRate(1e-6), command="push"), {"travel": Ramp(0.5)}
    ),
}


def both(model: fc.Model, monkeypatch: pytest.MonkeyPatch, **how) -> tuple[fc.Run, fc.Run, int]:
    """A run in loops, the same in plain steps, and how many of the first were plain."""
    plain = []
    with monkeypatch.context() as patch:
        step = Stepper.step
        patch.setattr(Stepper, "step", lambda self, point, h: plain.append(h) or step(self, point, h))
        told = fc.simulate(model, **how)
    with monkeypatch.context() as patch:
        patch.setattr("flexctrl.design.answers.answering", lambda law: None)
        return told, fc.simulate(model, **how), len(plain)


def alike(a: fc.Run, b: fc.Run, tolerance: float) -> None:
    assert (a.status, a.report.steps, a.report.rejected_steps) == (b.status, b.report.steps, b.report.rejected_steps)
    assert np.allclose(a.t, b.t, rtol=1e-5, atol=0.0)
    assert a.report.energy_residual == pytest.approx(b.report.energy_residual, rel=0.05, abs=1e-6)
    alike_in_rows(a, b, tolerance)


def alike_in_rows(a: fc.Run, b: fc.Run, tolerance: float) -> None:
    for mine, theirs in ((a.y, b.y), (a.u, b.u)):
        assert np.abs(mine - theirs).max() <= tolerance * np.abs(theirs).max()
    assert np.abs(a.final.q - b.final.q).max() <= tolerance * (1.0 + np.abs(b.final.q).max())
    assert a.report.energy.work == pytest.approx(b.report.energy.work, rel=tolerance)
    assert len(a.frames) == len(b.frames)


@pytest.mark.parametrize("every", [None, 3.1e-3, 4e-3])
@pytest.mark.parametrize("pace", PACES)
@pytest.mark.parametrize("law", LAWS)
def test_who_asks_makes_no_difference(law, pace, every, monkeypatch):
    how = {"controller": LAWS[law](), "until": 0.25, "method": PACES[pace], "every": every}
    a, b, plain = both(crane(), monkeypatch, **how)
    if law == "integrators that stop" and pace == "controlled":
        # what is tried of a step across the corner of a limit, and how often, hangs on the last digits of its error
        assert a.status is b.status
        assert a.report.steps == pytest.approx(b.report.steps, rel=0.02)
        if every:
            alike_in_rows(a, b, 2e-3)
        return
    # the law that stops feels what Newton's method leaves of a step's error, which is 0.07 of its command
    alike(a, b, 1e-3 if law == "integrators that stop" else 2e-4)
    assert plain <= 0.02 * a.report.steps + 2
    for t in (0.0, 0.0123, 0.1, 0.2487, 0.25):
        assert np.allclose(a.at(t).state.x, b.at(t).state.x, rtol=0.0, atol=1e-5)
        assert a.at(t)["push"] == pytest.approx(b.at(t)["push"], rel=1e-4, abs=1e-3)


@pytest.mark.parametrize("pace", PACES)
def test_cut_anywhere_they_go_on_with_the_same_bits(pace, tmp_path):
    model, how = crane(), {"controller": follow(), "method": PACES[pace], "every": 4e-3}
    whole = fc.simulate(model, until=0.2, **how)
    for cut in (0.0333, 0.02, 0.15):
        half = fc.simulate(model, until=cut, **how)
        half.checkpoint.save(tmp_path / "stopped")
        rest = fc.simulate(model, until=0.2, start=fc.load_checkpoint(tmp_path / "stopped"), **how)
        for part in ("q", "v", "x"):
            assert np.array_equal(getattr(rest.final, part), getattr(whole.final, part))
        assert np.array_equal(rest.y[-8:], whole.y[-8:])
        assert np.array_equal(rest.u[-8:], whole.u[-8:])
        assert rest.report.steps == whole.report.steps


@pytest.mark.parametrize("method", [fc.GeneralizedAlpha(4e-3), fc.AdaptiveAlpha()], ids=["fixed", "controlled"])
def test_second_order_against_an_independent_solution(method):
    """A cart on a rail under an observer and its feedback: plain differential equations beside it."""
    mass, load, length = 5.0, 2.0, 1.5
    cart = fc.PointMass("cart", (0, 0, 0), mass)
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -length), EA=1e6)
    hung = fc.PointMass("load", (0, 0, -length), load)
    structure = fc.Structure(
        [cart, rope, hung],
        [fc.Support(cart.node, "v w"), fc.Pin(cart.node, rope.start), fc.Pin(rope.end, hung.node)],
        inputs=[fc.Force("push", cart.node, "x")],
        outputs=[fc.Position("x", cart.node, "x"), fc.Velocity("speed", cart.node, "x")],
    )
    model = fc.assemble(structure, [fc.Gravity(), fc.LargeRotation()])
    A = np.array([[-4.0, 1.0], [-9.0, -3.0]])
    B, C = np.array([[1.0, 0.5], [0.0, 2.0]]), np.array([[-20.0, -6.0]])
    law = control.StateSpace(A, B, C, [[-40.0, -10.0]], inputs=["x", "speed"], outputs=["push"])
    path = Ramp(0.5)

    def slope(t: float, z: np.ndarray) -> np.ndarray:
        (x, angle, speed, rate), own = z[:4], z[4:]
        y = np.array([x - path(t), speed])
        u = (C @ own)[0] - 40.0 * y[0] - 10.0 * y[1]
        sine, cosine = np.sin(angle), np.cos(angle)
        matrix = [[mass + load, load * length * cosine], [cosine, length]]
        a = np.linalg.solve(matrix, [u + load * length * rate**2 * sine, -9.81 * sine])
        return np.concatenate([[speed, rate], a, A @ own + B @ y])

    def push(z: np.ndarray) -> float:
        return float(C[0] @ z[4:] - 40.0 * (z[0] - path(4.0)) - 10.0 * z[2])

    exact = solve_ivp(slope, (0.0, 4.0), np.zeros(6), method="DOP853", rtol=1e-11, atol=1e-12)
    how = {"controller": fc.Tracking(law, {"x": path}), "until": 4.0, "start": model.rest}
    if isinstance(method, fc.GeneralizedAlpha):
        errors = []
        for h in (method.step, 0.5 * method.step):
            run = fc.simulate(model, method=fc.GeneralizedAlpha(h), **how)
            errors.append(abs(run["x"][-1] - exact.y[0, -1]) + abs(run["push"][-1] - push(exact.y[:, -1])))
        assert 3.7 < errors[0] / errors[1] < 4.3
        return
    run = fc.simulate(model, method=method, tolerance=fc.Tolerance(1e-7, 1e-9), **how)
    assert run["x"][-1] == pytest.approx(exact.y[0, -1], abs=2e-5)
    assert run.report.energy_residual < 1e-4


def test_steps_land_where_a_rope_goes_slack(monkeypatch):
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -1), EA=1e4)
    load = fc.PointMass("load", (0, 0, -1), 10.0)
    structure = fc.Structure(
        [rope, load],
        [fc.Support(rope.start, "u v w"), fc.Pin(rope.end, load.node)],
        inputs=[fc.Force("lift", load.node, "z")],
        outputs=[fc.Position("z", load.node, "z"), fc.Tension("tension", rope)],
    )
    model = fc.assemble(structure, [fc.Gravity(), fc.RopeStretch(), fc.LargeRotation()])
    law = fc.Saturated(pid(0.0, 0.0, 0.0, measured="z", rate=FilteredRate(0.01), command="lift"), {"lift": 500.0})
    law = FeedForward(law, {"lift": Ramp(150.0, 1.0)})
    a, b, _ = both(model, monkeypatch, controller=law, until=1.5, method=fc.AdaptiveAlpha())
    alike(a, b, 1e-4)
    assert a["tension"].min() >= -1e-6 * a["tension"].max()
    assert [e.name for e in a.events] == [e.name for e in b.events] != []


def test_a_law_that_says_no_number_is_told():
    law = control.StateSpace([[3000.0]], [[1.0]], [[1.0]], [[0.0]], inputs=["travel"], outputs=["push"])
    model = crane()
    run = fc.simulate(model, controller=fc.Tracking(law, {"travel": Step(1.0)}), until=5.0, start=model.rest)
    assert run.status is fc.Status.FAILED
    assert run.report.message
    assert len(run.t) > 1
    assert np.isfinite(run.y).all()
    assert np.isfinite(run.u).all()


@pytest.mark.parametrize("law", LAWS)
def test_the_kernels_say_what_the_law_does(law):
    """Command, rate and slope; the latter against differences of the law's own rate."""
    given = LAWS[law]()
    found = answering(given)
    rng, t, n = np.random.default_rng(0), 0.05, len(given.initial())
    y, x = rng.normal(size=len(given.inputs)), 1e-3 * rng.normal(size=n)
    told = np.concatenate([y, x, [clock(t) for clock in found.clocks]])
    command, rate = np.split(np.array(found.kernel.function()(told, found.values)).ravel(), [found.commands])
    assert np.allclose(command, given.command(t, x, y), rtol=1e-10, atol=1e-12)
    if not n:
        return
    assert np.allclose(rate, given.rate(t, x, y), rtol=1e-8, atol=1e-10)
    slope = found.slopes.copy()
    if found.slope is not None:
        slope[found.places] = np.array(found.slope.function()(told, found.values)).ravel()
    d = 1e-6
    differences = [(given.rate(t, x + e, y) - given.rate(t, x - e, y)) / (2 * d) for e in d * np.eye(n)]
    assert np.allclose(slope.reshape(n, n), differences, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("pace", PACES)
@pytest.mark.parametrize("states", [16, 40, 75])
def test_laws_of_many_states_are_asked_in_the_loops(states, pace, monkeypatch):
    """An observer of many modes: filters from 5 to 300 rad/s that do not keep to axes of their own."""
    rng = np.random.default_rng(states)
    turned = np.linalg.qr(rng.normal(size=(states, states)))[0]
    rates = np.linspace(5.0, 300.0, states)
    A, B, C = -turned * rates @ turned.T, turned @ rates[:, None], np.full((1, states), -900.0 / states) @ turned.T
    law = control.StateSpace(A, B, C, [[-300.0]], inputs=["travel"], outputs=["push"])
    told = fc.Tracking(law, {"travel": Shaped(MinimumJerk(0.3, 0.2, at=0.02), zvd(40.0))})
    a, b, plain = both(crane(), monkeypatch, controller=told, until=0.05, method=PACES[pace])
    alike(a, b, 2e-4)
    assert plain <= 2


@pytest.mark.parametrize("method", [fc.GeneralizedAlpha(2e-3), fc.Richardson(fc.GeneralizedAlpha(2e-3))], ids=str)
def test_a_law_of_more_states_is_told_of(method):
    """150 filters beside a gain: plain steps, and a note that names the law's size and what to do."""
    n = 150
    law = control.StateSpace(
        -10.0 * np.eye(n), np.ones((n, 1)), np.full((1, n), -100.0 / n), [[-300.0]], inputs=["travel"], outputs=["push"]
    )
    how = {"until": 0.01, "method": fc.Unchecked(method)}
    a, b = (fc.simulate(crane(), one, **how).report.notes for one in (law, fc.Sampled(law, 2e-3)))
    (note,) = (one for one in a if "150 states" in one)
    assert "Sampled" in note
    assert not any("states" in one for one in b)


def test_stopped_integrators_among_many_states_are_asked_in_the_loops(monkeypatch):
    """Entries of the slope that come and go beside those that stay: an integrator beside 14 filters."""
    rates = np.concatenate([[0.0], np.linspace(5.0, 300.0, 14)])
    B, C = np.where(rates, rates, 1.0)[:, None], np.concatenate([[-2000.0], np.full(14, -60.0)])[None]
    law = control.StateSpace(-np.diag(rates), B, C, [[-300.0]], inputs=["travel"], outputs=["push"])
    told = fc.Tracking(AntiWindup(law, {"push": 40.0}), {"travel": Step(0.2, at=0.013)})
    found = answering(told)
    assert 0 < found.places.size <= 15
    a, b, plain = both(crane(), monkeypatch, controller=told, until=0.2, method=PACES["fixed"])
    alike(a, b, 1e-3)
    assert np.abs(a["push"]).max() == pytest.approx(40.0)
    assert plain <= 2


WRAPPERS = {
    "without sampling": lambda law: fc.Sampled(law, 0.0),
    "without rounding": lambda law: fc.Quantised(law, {"travel": 0.0, "push": 0.0}),
    "both": lambda law: fc.Quantised(fc.Sampled(law, 0.0), {"travel": 0.0}),
    "within limits that are far": lambda law: fc.Saturated(fc.Quantised(fc.Sampled(law, 0.0)), {"push": 1e9}),
}


@pytest.mark.parametrize("wrapped", WRAPPERS)
def test_wrappers_of_no_strength_change_no_bit(wrapped):
    law = follow()
    bare, other = (
        fc.simulate(crane(), told, until=0.1, method=PACES["controlled"]) for told in (law, WRAPPERS[wrapped](law))
    )
    assert (bare.t == other.t).all()
    assert (bare.y == other.y).all()


def test_a_wrapper_of_no_strength_leaves_a_linear_law_linear():
    """`Exact` closes its loop without a step's error."""
    machine, law = (
        fc.linearize(crane()),
        pid(900.0, 200.0, 30.0, measured="travel", rate=FilteredRate(0.01), command="push"),
    )
    start = {"until": 0.1, "inputs": {"push": 10.0}, "method": fc.Exact(0.02)}
    bare, wrapped = (fc.simulate(machine, told, **start) for told in (law, fc.Sampled(fc.Quantised(law), 0.0)))
    assert (bare.y == wrapped.y).all()
