"""Continuous laws in Python, asked from within compiled steps: the runs of plain steps, for a few answers a step."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexctrl as fc
from flexctrl.design import pd
from flexctrl.dynamics.alpha import method as alpha
from flexctrl.dynamics.checkpoint import load_checkpoint

METHODS = [fc.GeneralizedAlpha(2e-3), fc.AdaptiveAlpha()]
NAMES = [type(method).__name__ for method in METHODS]
CALM = fc.Tolerance(1e-5, 1e-8)


class Law:
    """A law without states: what a function of time and measurements says."""

    inputs, outputs, sample_time = ("x", "v"), ("force",), 0.0

    def __init__(self, said):
        self.said, self.count = said, 0

    def initial(self):
        return np.zeros(0)

    def command(self, t, x, y):
        self.count += 1
        return np.array([self.said(t, *y)])


class Integrating(Law):
    """One with a state, the integral of x."""

    def initial(self):
        return np.zeros(1)

    def command(self, t, x, y):
        return np.array([self.said(t, *y) - 20.0 * x[0]])

    def rate(self, t, x, y):
        return np.array([y[0] - 0.2])


def crane() -> fc.Model:
    """A trolley of 20 kg with 5 kg on a rope of 2 m."""
    trolley = fc.PointMass("trolley", (0, 0, 0), 20.0)
    rope = fc.Rope("rope", (0, 0, 0), (0, 0, -2), EA=1e5)
    load = fc.PointMass("load", rope.end, 5.0)
    structure = fc.Structure(
        [trolley, rope, load],
        [fc.Support(trolley.node, "v w"), fc.Pin(rope.start, trolley.node), fc.Pin(rope.end, load.node)],
        inputs=[fc.Force("force", trolley.node, "x")],
        outputs=[
            fc.Position("x", trolley.node, "x"),
            fc.Velocity("v", trolley.node, "x"),
            fc.Position("far", load.node, "x"),
        ],
    )
    return fc.assemble(structure, [fc.LargeRotation(), fc.Gravity()])


def held(t: float, x: float, v: float) -> float:
    return 100.0 * (0.2 - x) - 60.0 * v


def plainly(monkeypatch) -> None:
    """Take plain steps."""
    monkeypatch.setattr(alpha, "_quickest", lambda plain: plain)


@pytest.mark.parametrize("method", METHODS, ids=NAMES)
@pytest.mark.parametrize("law", [Law(held), Integrating(held)], ids=["feedback", "integral"])
def test_a_run_is_what_it_is_by_plain_steps(law, method, monkeypatch):
    model, how = crane(), {"until": 3.0, "every": 0.05, "method": fc.Unchecked(method), "tolerance": CALM}
    quick = fc.simulate(model, law, **how)
    plainly(monkeypatch)
    slow = fc.simulate(model, law, **how)
    assert quick.status is slow.status is fc.Status.FINISHED
    far = {name: np.abs(quick[name] - slow[name]).max() for name in ("x", "v", "far", "force")}
    share = 1e-6 if isinstance(method, fc.GeneralizedAlpha) else 2e-4  # steps of its own choice
    assert far["x"] < share * 0.2, far
    assert far["far"] < share * 0.2, far
    assert far["v"] < share, far
    assert far["force"] < 100.0 * share, far


@pytest.mark.parametrize("method", METHODS, ids=NAMES)
def test_a_law_written_in_python_and_one_of_the_house_move_alike(method):
    model, how = crane(), {"until": 3.0, "every": 0.05, "method": fc.Unchecked(method), "tolerance": CALM}
    own = fc.simulate(
        model, Law(lambda t, x, v: -100.0 * x - 60.0 * v), start=model.displace({"trolley_0_u": 0.1}), **how
    )
    house = pd(kp=100.0, kd=60.0, measured="x", rate="v", command="force")
    other = fc.simulate(model, house, start=model.displace({"trolley_0_u": 0.1}), **how)
    assert np.abs(own["x"] - other["x"]).max() < (1e-9 if isinstance(method, fc.GeneralizedAlpha) else 1e-4)


def test_a_step_costs_a_few_answers():
    law = Law(held)
    run = fc.simulate(crane(), law, until=10.0, every=0.1, method=fc.Unchecked(fc.GeneralizedAlpha(1e-3)))
    assert run.status is fc.Status.FINISHED
    assert law.count < 10 * run.report.steps, law.count / run.report.steps


@pytest.mark.parametrize("method", METHODS, ids=NAMES)
def test_a_buffer_written_as_a_law_throws_back_what_hits_it(method):
    model = cart()
    buffer = Law(lambda t, x, v: -2e4 * max(0.0, x - 1.0))
    start = model.displace({}).with_(v=np.array([0.5]))
    run = fc.simulate(model, buffer, until=4.0, every=0.05, start=start, method=method)
    assert run.status is fc.Status.FINISHED
    assert run["v"][-1] == pytest.approx(-0.5, rel=0.01)


@pytest.mark.parametrize("method", METHODS, ids=NAMES)
def test_a_jump_in_time_that_nobody_has_told_is_where_it_is(method):
    def said(t, x, v):
        return held(t, x, v) + (50.0 if t >= 1.2345 else 0.0)

    model = crane()
    run = fc.simulate(model, Law(said), until=3.0, every=0.01, method=method, tolerance=CALM)

    def swing(t, s):  # a rigid rope: x, θ
        x, th, v, w = s
        c, n = np.cos(th), np.sin(th)
        M = np.array([[25.0, 5.0 * 2.0 * c], [5.0 * 2.0 * c, 5.0 * 4.0]])
        f = np.array([said(t, x, v) + 5.0 * 2.0 * w * w * n, -5.0 * 9.80665 * 2.0 * n])
        return [v, w, *np.linalg.solve(M, f)]

    true = solve_ivp(swing, (0, 3.0), np.zeros(4), rtol=1e-10, atol=1e-12, max_step=1e-3, t_eval=run.t)
    assert np.abs(run["x"] - true.y[0]).max() < 1e-3 * np.ptp(true.y[0])


@pytest.mark.parametrize("method", METHODS, ids=NAMES)
@pytest.mark.parametrize("law", [Law(held), Integrating(held)], ids=["feedback", "integral"])
def test_a_run_goes_on_bit_for_bit(law, method, tmp_path):
    model, how = crane(), {"every": 0.05, "method": fc.Unchecked(method)}
    whole = fc.simulate(model, law, until=2.0, **how)
    for cut in (0.31, 1.0, 1.977):
        first = fc.simulate(model, law, until=cut, **how)
        first.checkpoint.save(tmp_path / "run.npz")
        rest = fc.simulate(model, law, until=2.0, start=load_checkpoint(tmp_path / "run.npz"), **how)
        assert rest.final.q.tolist() == whole.final.q.tolist(), cut
        assert rest.final.v.tolist() == whole.final.v.tolist(), cut


@pytest.mark.parametrize("method", METHODS, ids=NAMES)
def test_a_law_that_raises_ends_the_run_where_it_does_and_one_beyond_the_end_does_not(method):
    def until(last):
        def said(t, x, v):
            if t > last:
                raise ZeroDivisionError("no reference any more")
            return held(t, x, v)

        return Law(said)

    run = fc.simulate(crane(), until(1.0), until=2.0, every=0.05, method=method)
    assert run.status is fc.Status.FAILED
    assert "no reference any more" in run.report.message
    assert 0.9 < run.final.t <= 1.0 + 2e-3
    assert np.isfinite(run.y).all()
    run = fc.simulate(crane(), until(2.0), until=2.0, every=0.05, method=method)
    assert run.status is fc.Status.FINISHED


@pytest.mark.parametrize("method", METHODS, ids=NAMES)
def test_ctrl_c_in_a_law_keeps_the_run_and_it_goes_on(method):
    def said(t, x, v):
        if t > 1.0 and pressed:
            pressed.clear()
            raise KeyboardInterrupt
        return held(t, x, v)

    pressed = [True]
    how = {"until": 2.0, "every": 0.05, "method": fc.Unchecked(method)}
    run = fc.simulate(crane(), Law(said), **how)
    assert run.status is fc.Status.INTERRUPTED
    assert 0.5 < run.final.t <= 1.1
    rest = fc.simulate(crane(), Law(held), start=run.checkpoint, **how)
    whole = fc.simulate(crane(), Law(held), **how)
    assert rest.status is fc.Status.FINISHED
    assert np.abs(rest.final.q - whole.final.q).max() < 1e-6


@pytest.mark.parametrize("method", METHODS, ids=NAMES)
def test_states_on_the_way_are_those_of_the_run_wherever_the_law_has_jumped_since(method):
    def said(t, x, v):
        return held(t, x, v) + (80.0 if 0.7 < t < 0.72 or 1.4 < t < 1.42 else 0.0)

    model = crane()
    run = fc.simulate(model, Law(said), until=2.0, every=0.01, method=fc.Unchecked(method))
    assert run.status is fc.Status.FINISHED
    places = np.array([run.at(t)["x"] for t in run.t])
    assert np.abs(places - run["x"]).max() < 1e-6 * np.ptp(run["x"])


def cart() -> fc.Model:
    point = fc.PointMass("cart", (0, 0, 0), 2.0)
    structure = fc.Structure(
        [point],
        [fc.Support(point.node, "v w")],
        inputs=[fc.Force("force", point.node, "x")],
        outputs=[fc.Position("x", point.node, "x"), fc.Velocity("v", point.node, "x")],
    )
    return fc.assemble(structure, [fc.LargeRotation()])


class Filtered(Law):
    """Force s − 6 v, and ṡ is what it says less 2 s."""

    def initial(self):
        return np.zeros(1)

    def command(self, t, x, y):
        return np.array([x[0] - 6.0 * y[1]])

    def rate(self, t, x, y):
        return np.array([self.said(t, *y) - 2.0 * x[0]])


@pytest.mark.parametrize("method", [None, fc.GeneralizedAlpha(5e-3), fc.Unchecked(fc.AdaptiveAlpha())], ids=str)
@pytest.mark.parametrize("width", [0.002, 0.01, 0.2])
def test_a_pulse_of_a_state_s_rate_is_felt(width, method):
    first, last = 2.003, 2.003 + width
    law, y = Filtered(lambda t, x, v: 10.0 if first < t < last else 0.0), np.zeros(3)
    run = fc.simulate(cart(), law, until=4.0, every=0.1, method=method)
    for span, pushed in (((first, last), 10.0), ((last, 4.0), 0.0)):
        y = solve_ivp(moved, span, y, args=(pushed,), rtol=1e-10, atol=1e-14).y[:, -1]
    assert run["x"][-1] == pytest.approx(y[0], rel=3e-3)


def moved(t: float, y: np.ndarray, pushed: float) -> list[float]:
    return [y[1], 0.5 * (y[2] - 6.0 * y[1]), pushed - 2.0 * y[2]]


def test_a_law_used_again_says_what_is_under_its_commands_in_this_run():
    model, law = cart(), fc.OpenLoop({"force": lambda t: np.sin(3.0 * t) + (5.0 if t > 0.7 else 0.0)})
    own = 0.5 * (2.0 / 3.0 - np.sin(6.0) / 9.0) + 1.25 * 1.3**2
    for under in (0.0, 5.0, -5.0, 5.0, -5.0):
        run = fc.simulate(model, law, until=2.0, inputs={"force": under})
        assert run["x"][-1] == pytest.approx(under + own, rel=3e-3), under


@pytest.mark.parametrize("step", [5e-3, 1e-2])
def test_jumps_at_the_ends_of_steps_are_there(step):
    for k in (26, 97, 130, 171, 260):
        jump = k * 5e-3
        law = Law(lambda t, x, v, jump=jump: 4.0 if t >= jump else 0.0)
        run = fc.simulate(cart(), law, until=2.0, method=fc.Unchecked(fc.GeneralizedAlpha(step)))
        assert run["x"][-1] == pytest.approx((2.0 - jump) ** 2, rel=1e-5), jump
