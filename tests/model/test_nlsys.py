"""The nonlinear model in python-control: against `simulate`, against plain mechanics, against the linear model."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest
from scipy.integrate import DOP853, Radau, solve_ivp

import flexctrl as fc
from flexctrl.design import ControllerError
from flexctrl.dynamics.sampled import sampled_response
from flexctrl.errors import ChartError, MechanismError, StructureError
from flexctrl.linear.statespace import PhysicalForm
from flexctrl.model.nlsys import equations_of

G = 9.81
RIGID = (fc.Gravity(), fc.LargeRotation())
FLEXIBLE = (fc.Gravity(), fc.Flexible(), fc.LargeRotation())
EXACT = {"method": DOP853, "rtol": 1e-9, "atol": 1e-11}
FINE = fc.Tolerance(1e-6, 1e-9)


def crane(guide: str = "v w") -> fc.Structure:
    """A cart of 5 kg with 3 kg on 2 m of rope."""
    cart, rope = fc.PointMass("cart", (0, 0, 0), 5.0), fc.Rope("rope", (0, 0, 0), (0, 0, -2), EA=1e4)
    load = fc.PointMass("load", rope.end, 3.0)
    return fc.Structure(
        [cart, rope, load],
        [fc.Support(cart.node, guide), fc.Pin(rope.start, cart.node), fc.Pin(rope.end, load.node)],
        inputs=[fc.Force("push", cart.node, "x")],
        outputs=[
            *(fc.Position(f"load_{axis}", load.node, axis) for axis in "xyz"),
            fc.Position("cart_x", cart.node, "x"),
            fc.Velocity("cart_speed", cart.node, "x"),
        ],
        name="crane",
    )


def pendulum(held: str = "u v w") -> fc.Structure:
    """A body of 2 kg on a ball joint."""
    body = fc.RigidBody("bob", (0.1, 0, -1), 2.0, (0.2, 0.3, 0.25), {"pin": (0, 0, 0)})
    outputs = [fc.Position(axis, body.node, axis) for axis in "xyz"]
    return fc.Structure([body], [fc.Support(body.point("pin"), held)], outputs=outputs, name="pendulum")


def arm(inertia: float = 0.02, rhoJ: float = 1e-2, held: str = "u v w rx ry") -> fc.Structure:
    """A soft arm turned by a geared motor on an elastic shaft."""
    section = fc.Section(EA=400.0, EI_y=8.0, EI_z=8.0, GJ=2.0, rhoA=1.0, rhoJ=rhoJ)
    beam = fc.Beam("arm", (0, 0, 0), (1, 0, 0), section)
    drive = fc.RotaryDrive("slew", beam.start, axis="z", stiffness=2.0, ratio=5.0, inertia=inertia, damping=0.01)
    return fc.Structure(
        [beam],
        [fc.Support(beam.start, held)],
        [drive],
        [fc.MotorTorque("torque", drive)],
        [fc.Position("tip_y", beam.end, "y"), fc.DriveAngle("motor", drive), fc.Rotation("root", beam.start, "z")],
        name="arm",
    )


def both(model: fc.Model, xi: np.ndarray, v: np.ndarray, until: float, inputs: dict[str, float] | None = None):
    """Outputs by python-control and by `simulate`, at the same 21 instants."""
    system, t = model.to_nlsys(), np.linspace(0.0, until, 21)
    u = np.repeat(model.input_vector(inputs or {})[:, None], 21, axis=1)
    extra = np.zeros(system.nstates - 2 * model.n)
    x = np.concatenate([xi, extra, v])
    found = ct.input_output_response(system, t, u, x, squeeze=False, solve_ivp_kwargs=EXACT).outputs
    start = model.advance(model.rest, np.asarray(xi, float), np.asarray(v, float), 0.0)
    run = fc.simulate(model, until=until, start=start, inputs=inputs, tolerance=FINE, every=until / 20)
    return found.reshape(-1, 21).T, run.y


def test_rope_on_a_cart_runs_as_simulated():
    model = fc.assemble(crane(), RIGID)
    assert model.to_nlsys().state_labels == [*model.coordinates, *(f"{name}_rate" for name in model.coordinates)]
    found, run = both(model, [0.2, 0.7, 0.4], [0.5, 0.3, 1.0], 2.0, {"push": 4.0})
    np.testing.assert_allclose(found, run, atol=4e-4)


@pytest.mark.parametrize("held", ["u v w", "u v w rz"])
def test_body_on_a_ball_joint_runs_as_simulated(held):
    """With the spin about z held, the body still wanders about z: one coordinate more."""
    model = fc.assemble(pendulum(held), RIGID)
    states = model.to_nlsys().nstates
    assert states == (6 if held == "u v w" else 5)
    found, run = both(model, [0.6, 0.4, 0.2][: model.n], [0.5, 1.2, 0.8][: model.n], 1.0)
    np.testing.assert_allclose(found, run, atol=2e-4)


def test_flexible_arm_with_a_drive_runs_as_simulated():
    model = fc.assemble(arm(), FLEXIBLE)
    xi, v = np.zeros(model.n), np.zeros(model.n)
    v[model.coordinate("slew_source")] = 5.0
    found, run = both(model, xi, v, 0.25, {"torque": 0.5})
    np.testing.assert_allclose(found, run, atol=1e-4)


def test_spherical_pendulum_against_plain_mechanics():
    """A point mass on two metres of rope: ẍ = g + λ x with |x| constant, integrated by itself."""
    line = fc.Rope("line", (0, 0, 0), (0, 0, -2), EA=1e4)
    load = fc.PointMass("load", line.end, 3.0)
    machine = fc.Structure(
        [line, load],
        [fc.Support(line.start, "u v w"), fc.Pin(line.end, load.node)],
        outputs=[fc.Position(axis, load.node, axis) for axis in "xyz"],
    )
    model = fc.assemble(machine, RIGID)
    x0, node = np.array([0.9, -0.4, 0.6, 1.4]), machine.number(load.node)
    state = equations_of(model).state(x0)

    def plain(t: float, z: np.ndarray) -> np.ndarray:
        x, v, weight = z[:3], z[3:], np.array([0.0, 0.0, -G])
        return np.concatenate([v, weight - x * (x @ weight + v @ v) / (x @ x)])

    t = np.linspace(0.0, 2.0, 11)
    z0 = np.concatenate([state.x[node], model.rates(state)[6 * node : 6 * node + 3]])
    reference = solve_ivp(plain, (0.0, 2.0), z0, t_eval=t, rtol=1e-11, atol=1e-12, method="DOP853").y[:3]
    found = ct.input_output_response(model.to_nlsys(), t, initial_state=x0, solve_ivp_kwargs=EXACT)
    np.testing.assert_allclose(found.outputs, reference, atol=1e-7)


def test_body_on_a_ball_joint_keeps_its_energy_and_its_spin_about_the_vertical():
    model = fc.assemble(pendulum(), RIGID)
    equations, x0 = equations_of(model), np.array([0.6, 0.4, 0.2, 0.5, 1.2, 0.8])
    t = np.linspace(0.0, 1.5, 7)
    found = ct.input_output_response(
        model.to_nlsys(), t, initial_state=x0, return_states=True, squeeze=False, solve_ivp_kwargs=EXACT
    )
    states = [equations.state(x) for x in found.states.reshape(6, -1).T]
    energy = [sum(model.energy(state)[:2]) for state in states]
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)
    still, up = np.zeros(3), np.array([0.0, 0.0, 1.0])
    momenta = [-up @ (model.slope(s, s.v, still, (0.0, 0.0, 1.0), np.zeros(0)) @ s.v) for s in states]
    np.testing.assert_allclose(momenta, momenta[0], rtol=1e-8)


def test_python_control_linearises_as_we_do():
    model = fc.assemble(crane(), RIGID)
    theirs, ours = ct.linearize(model.to_nlsys(), np.zeros(6), [0.0]), fc.linearize(model).to_ss(PhysicalForm())
    for name in "ABC":
        np.testing.assert_allclose(getattr(theirs, name), getattr(ours, name), atol=5e-6)
    model = fc.assemble(fc.cranes.bridge_crane(elements=2), FLEXIBLE)
    rest = fc.equilibrium(model, hold={"girder_0_u": 0.0})
    system, ours = model.to_nlsys(rest), fc.linearize(model, at=rest).to_ss(PhysicalForm())
    wandering = [name for name in system.state_labels if name not in ours.state_labels]
    assert wandering == ["girder_0_ry", "girder_2_ry"]
    theirs = ct.linearize(system, np.zeros(system.nstates), rest.inputs)
    kept = [system.state_labels.index(name) for name in ours.state_labels]
    size = np.abs(ours.A).max(axis=1, keepdims=True)
    np.testing.assert_allclose(theirs.A[np.ix_(kept, kept)] / size, ours.A / size, atol=2e-5)
    assert not theirs.A[[system.state_labels.index(name) for name in wandering]].any()


def test_small_motion_is_the_linear_model():
    """Without large rotations the system is linear: the response is that of the state space."""
    model = fc.assemble(arm(), (fc.Flexible(),))
    t = np.linspace(0.0, 0.25, 26)
    torque = np.sin(9.0 * t)
    found = ct.input_output_response(model.to_nlsys(), t, torque, solve_ivp_kwargs=EXACT)
    linear = ct.forced_response(fc.linearize(model).to_ss(), t, torque)
    np.testing.assert_allclose(found.outputs, linear.outputs, atol=2e-7)


@pytest.mark.filterwarnings("ignore:Unused output")
def test_interconnected_with_a_continuous_controller():
    model = fc.assemble(crane(), RIGID)
    law = ct.ss(
        [[-20.0]], [[1.0, 0.0]], [[-300.0]], [[-40.0, -25.0]], inputs=["cart_x", "cart_speed"], outputs=["push"]
    )
    closed = ct.interconnect(
        [model.to_nlsys(), law], inplist=[], inputs=[], outlist=["crane.load_x"], outputs=["load_x"], name="closed"
    )
    t, x = np.linspace(0.0, 2.0, 21), np.zeros(closed.nstates)
    x[0] = 0.5
    found = ct.input_output_response(closed, t, initial_state=x, solve_ivp_kwargs=EXACT)
    start = model.advance(model.rest, np.array([0.5, 0.0, 0.0]), np.zeros(3), 0.0)
    run = fc.simulate(model, law, until=2.0, start=start, tolerance=FINE, every=0.1)
    np.testing.assert_allclose(np.squeeze(found.outputs), run["load_x"], atol=5e-5)


def test_sampled_controller_stops_at_its_samples():
    model = fc.assemble(crane(), RIGID)
    lead = ct.ss([[-20.0]], [[1.0]], [[2400.0]], [[-160.0]], inputs=["cart_x"], outputs=["push"])
    law = fc.Saturated(fc.Delayed(fc.Sampled(lead, 0.05), 1), {"push": 20.0})
    x = np.array([0.5, 0.0, 0.4, 0.0, 0.0, 0.0])
    found = sampled_response(model.to_nlsys(), law, until=1.5, initial_state=x, points=2, method=DOP853, rtol=1e-8)
    start = model.advance(model.rest, x[:3], np.zeros(3), 0.0)
    run = fc.simulate(model, law, until=1.5, start=start, tolerance=fc.Tolerance(1e-7, 1e-10), every=0.025)
    np.testing.assert_allclose(found.time, run.t, atol=1e-12)
    np.testing.assert_allclose(found.outputs.T, run.y, atol=1e-4)
    np.testing.assert_allclose(found.inputs[0, :-1], run["push"][:-1], atol=2e-2)


def test_sampled_controller_on_a_linear_plant_is_the_exact_difference_equation():
    linear = fc.linearize(fc.assemble(crane("v w"), RIGID))
    plant, h = linear.to_ss(), 0.1
    law = ct.ss([], [], [], [[-30.0, -20.0]], h, inputs=["cart_x", "cart_speed"], outputs=["push"])
    x = np.zeros(plant.nstates)
    x[:2] = 0.3, 0.1
    found = sampled_response(plant, law, until=2.0, initial_state=x, points=1, method=DOP853, rtol=1e-9, atol=1e-12)
    sampled = linear.discretize(h)
    reads = [sampled.output_labels.index(name) for name in law.input_labels]
    for k in range(20):
        np.testing.assert_allclose(found.states[:, k], x, atol=1e-8)
        x = sampled.A @ x + sampled.B @ (law.D @ (sampled.C @ x)[reads])


def test_continuous_controller_is_sent_to_interconnect():
    plant = fc.linearize(fc.assemble(crane(), RIGID)).to_ss()
    law = ct.ss([], [], [], [[-1.0]], inputs=["cart_x"], outputs=["push"])
    with pytest.raises(ControllerError, match="interconnect"):
        sampled_response(plant, law, until=1.0)
    with pytest.raises(StructureError, match="did you mean 'push'"):
        sampled_response(plant, fc.Sampled(law, 0.1), until=1.0, inputs={"pusch": 1.0})
    with pytest.raises(StructureError, match="until = 0"):
        sampled_response(plant, fc.Sampled(law, 0.1), until=0.0)


def test_operating_point_is_the_equilibrium():
    """A soft arm under its weight."""
    section = fc.Section(EA=400.0, EI_y=20.0, EI_z=20.0, GJ=2.0, rhoA=1.0, rhoJ=0.01)
    beam = fc.Beam("arm", (0, 0, 0), (1, 0, 0), section, elements=2)
    machine = fc.Structure([beam], [fc.Support(beam.start)], outputs=[fc.Position("tip", beam.end, "z")])
    model = fc.assemble(machine, FLEXIBLE)
    system, expected = model.to_nlsys(), fc.equilibrium(model)
    found = ct.find_operating_point(system, np.zeros(system.nstates))
    assert expected.outputs["tip"] < -0.05
    np.testing.assert_allclose(found.outputs, expected.outputs["tip"], atol=1e-8)
    rest = model.to_nlsys(expected)
    np.testing.assert_allclose(rest.dynamics(0.0, np.zeros(rest.nstates), []), 0.0, atol=1e-5)
    np.testing.assert_allclose(rest.output(0.0, np.zeros(rest.nstates), []), found.outputs, atol=1e-8)


def test_many_turns_about_a_fixed_axis():
    model = fc.assemble(arm(), (fc.LargeRotation(),))
    system = model.to_nlsys()
    assert system.nstates == 2
    np.testing.assert_allclose(system.output(0.0, [20.0, 0.0], [0.0])[1:], [100.0, 20.0])


def test_what_is_held_stays_held():
    model = fc.assemble(crane(), RIGID)
    system = model.to_nlsys(fc.equilibrium(model, hold={"cart_0_u": 0.25}))
    assert system.state_labels == ["rope_0_rx", "rope_0_ry", "rope_0_rx_rate", "rope_0_ry_rate"]
    np.testing.assert_allclose(system.output(0.0, [0.0, 0.1, 0.0, 0.0], [7.0])[3], 0.25)
    # pendulum of fixed length: θ̈ = −(g/l) sin θ
    np.testing.assert_allclose(system.dynamics(0.0, [0.0, 0.1, 0.0, 0.0], [7.0])[3], -G / 2 * np.sin(0.1), rtol=1e-9)


def servo(*effects: fc.Effect) -> fc.Model:
    """A rotor on an elastic shaft behind a motor."""
    rotor = fc.RigidBody("rotor", (0, 0, 0), 1.0, (0.1, 0.1, 0.1))
    motor = fc.RotaryDrive("motor", rotor.node, axis="z", stiffness=50.0, inertia=0.01, damping=0.05)
    plan = fc.Structure(
        [rotor],
        [fc.Support(rotor.node, "u v w rx ry")],
        [motor],
        [fc.MotorTorque("torque", motor)],
        [fc.DriveAngle("angle", motor), fc.DriveSpeed("speed", motor), fc.Rotation("turn", rotor.node, "z")],
    )
    return fc.assemble(plan, [fc.LargeRotation(), fc.ShaftElasticity(), *effects])


def test_a_lagging_torque_is_one_state():
    """ẋ = A x + B u of rotor, motor and T τ̇ + τ = u, written down by hand; the lag's coordinate is τ over k."""
    k, c, J, big, T = 50.0, 0.05, 0.01, 0.1, 0.02
    system = servo(fc.MotorLag({"motor": T})).to_nlsys()
    assert system.state_labels == ["rotor_0_rz", "motor_source", "motor_lag", "rotor_0_rz_rate", "motor_source_rate"]
    A = np.zeros((5, 5))
    A[0, 3] = A[1, 4] = 1.0
    A[2, 2] = -1.0 / T
    A[3] = np.array([-k, k, 0.0, -c, c]) / big
    A[4] = np.array([k, -k, k, c, -c]) / J
    B = np.array([0.0, 0.0, 1.0 / (T * k), 0.0, 0.0])
    found = ct.linearize(system, np.zeros(5), [0.0])
    on_torque = np.diag([1.0, 1.0, found.A[4, 2] * J / k, 1.0, 1.0])  # whatever one of the lag's coordinate is
    np.testing.assert_allclose(on_torque @ found.A @ np.linalg.inv(on_torque), A, atol=1e-4)
    np.testing.assert_allclose((on_torque @ found.B).ravel(), B, atol=1e-6)


@pytest.mark.parametrize(
    "effect",
    [
        fc.MotorLag({"motor": 0.02}),
        fc.LuGreFriction({"motor": fc.LuGre(stiffness=200.0, kinetic=1.0, static=1.5, stribeck=1.0, damping=0.3)}),
    ],
)
def test_what_is_of_first_order_runs_as_simulated(effect):
    model, t = servo(effect), np.linspace(0.0, 0.5, 21)
    stiff = {"method": Radau, "rtol": 1e-8, "atol": 1e-10}
    found = ct.input_output_response(
        model.to_nlsys(), t, np.full((1, 21), 3.0), np.zeros(5), solve_ivp_kwargs=stiff
    ).outputs
    run = fc.simulate(model, until=0.5, inputs={"torque": 3.0}, every=0.025, tolerance=fc.Tolerance(1e-7, 1e-10))
    assert (abs(found.T - run.y).max(axis=0) < 1e-3 * np.ptp(run.y, axis=0)).all()


def test_freedoms_without_mass_are_refused_by_name():
    with pytest.raises(StructureError, match=r"no mass moves with slew_source;.*rigid shaft.*condenses"):
        fc.assemble(arm(inertia=0.0), FLEXIBLE).to_nlsys()
    with pytest.raises(StructureError, match=r"arm_1_rx;.*rhoJ"):
        fc.assemble(arm(rhoJ=0.0), FLEXIBLE).to_nlsys()
    with pytest.raises(MechanismError, match=r"in the motion of arm_._rx with arm_._rx: hold"):
        fc.assemble(arm(rhoJ=0.0, held="u v w ry"), FLEXIBLE).to_nlsys()
    assert fc.assemble(arm(inertia=0.0), RIGID).to_nlsys().nstates == 2


def test_coordinates_end_a_full_turn_away():
    system = fc.assemble(pendulum(), RIGID).to_nlsys()
    with pytest.raises(ChartError, match=r"bob_0_rx has turned by 6.2"):
        system.dynamics(0.0, [6.2, 0.0, 0.0, 0.0, 0.0, 0.0], [])
    system = fc.assemble(crane(), RIGID).to_nlsys()
    with pytest.raises(ChartError, match="half a turn"):
        system.dynamics(0.0, [0.0, 0.0, 3.1, 0.0, 0.0, 0.0], [0.0])


def test_stiff_machines_run_with_an_implicit_method():
    """A stiff rope's axial vibration, 40 rad/s and more, is no burden for Radau."""
    model = fc.assemble(crane("v w"), FLEXIBLE)
    rest = fc.equilibrium(model, hold={"cart_0_u": 0.0})
    system = model.to_nlsys(fc.Rest(rest.state, rest.residual, rest.outputs, rest.inputs, 0, model))
    t = np.linspace(0.0, 1.0, 11)
    found = ct.input_output_response(
        system, t, np.full(11, 4.0), solve_ivp_kwargs={"method": Radau, "rtol": 1e-6, "atol": 1e-9}
    )
    run = fc.simulate(model, until=1.0, start=rest.state, inputs={"push": 4.0}, tolerance=FINE, every=0.1)
    np.testing.assert_allclose(found.outputs.T, run.y, atol=1e-4)


@pytest.mark.parametrize(("fast", "saved"), [(2e4, 5.0), (20.0, 0.5)])
def test_the_integrator_fits_the_stiffest_motion(fast, saved):
    """Two oscillators, a slow one under held samples and a fast one hardly touched: exact by the matrix exponential."""
    from scipy.integrate import RK45
    from scipy.linalg import expm

    A = np.kron(np.diag([1.0, 0.0]), [[0.0, 1.0], [-9.0, -0.1]]) + np.kron(
        np.diag([0.0, 1.0]), [[0.0, fast], [-fast, -0.2 * fast]]
    )
    B = np.array([[0.0], [1.0], [0.0], [1e-3]])
    calls = [0]

    def rate(t, x, u, params):
        calls[0] += 1
        return A @ x + B @ np.atleast_1d(u)

    plant = ct.nlsys(rate, lambda t, x, u, params: x[:1], inputs=["u"], outputs=["y"], states=4)
    law = ct.ss([], [], [], [[-2.0]], 0.05, inputs=["y"], outputs=["u"])
    begin = np.array([1.0, 0.0, 0.0, 0.0])
    step = expm(0.05 * np.block([[A, B], [np.zeros((1, 5))]]))
    x = begin
    for _ in range(10):
        x = (step @ np.append(x, -2.0 * x[0]))[:4]
    counts = []
    for method in (None, RK45):
        calls[0] = 0
        found = sampled_response(plant, law, until=0.5, initial_state=begin, method=method)
        np.testing.assert_allclose(found.states[:2, -1], x[:2], atol=1e-5)
        counts.append(calls[0])
    assert counts[1] > saved * counts[0]
