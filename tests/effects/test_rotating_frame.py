"""A turning frame: the same motion as seen from outside, by other accelerations; what it conserves; what it refuses."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flexctrl as fc
from flexctrl.errors import StructureError

E = fc.Section(EA=2e4, EI_y=157, EI_z=90, GJ=60, rhoA=1.5, rhoJ=0.02, rhoI_y=0.01)
MOVING = [fc.LargeRotation(), fc.Flexible()]
SPIN, CENTER = np.array([0.4, -0.7, 1.5]), np.array([0.3, 0.1, -0.2])
FRAME = fc.RotatingFrame(SPIN, CENTER)


def floating() -> fc.Structure:
    """Nothing touches the ground, and every freedom is one of a node's."""
    beam = fc.Beam("beam", (0, 0, 0), (1, 0.5, 0), E, elements=2)
    body = fc.RigidBody("body", (1, 0.5, 0.3), 2.0, [[0.3, 0.02, 0.0], [0.02, 0.2, 0.01], [0.0, 0.01, 0.4]])
    line = fc.Spring("line", beam.start, (0, -0.5, -1.0), stiffness=700.0)
    load = fc.PointMass("load", line.end, 1.5)
    spring = fc.Spring("spring", beam.end, body.node, stiffness=300.0)
    joints = [fc.Pin(beam.start, line.start), fc.Pin(line.end, load.node)]
    joints += [fc.Pin(beam.end, spring.start), fc.Pin(body.node, spring.end)]
    return fc.Structure([beam, body, line, load, spring], joints)


def bar(elements: int) -> fc.Structure:
    beam = fc.Beam("bar", (0, 0, 0), (1, 0.5, 0), E, elements=elements)
    load = fc.PointMass("load", beam.end, 1.5)
    return fc.Structure([beam, load], [fc.Pin(beam.end, load.node)])


def from_outside(model: fc.Model, state: fc.State, v: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rates and accelerations of the same motion seen by who does not turn, at the moment when the axes coincide."""
    T = model.motion.jacobian(state)
    v_raw, a_raw = (np.asarray(T @ r)[: model.motion.source_base].reshape(-1, 6) for r in (v, a))
    carried = np.cross(SPIN, state.x - CENTER)
    speed, spin = v_raw[:, :3] + carried, v_raw[:, 3:] + SPIN
    pull = a_raw[:, :3] + 2 * np.cross(SPIN, v_raw[:, :3]) + np.cross(SPIN, carried)
    turn = a_raw[:, 3:] + np.cross(SPIN, v_raw[:, 3:])
    nodes = [f"{node.part}_{node.index}" for node in model.structure.nodes]
    places = [name.rsplit("_", 1) for name in model.coordinates]
    pick = [6 * nodes.index(node) + ["u", "v", "w", "rx", "ry", "rz"].index(freedom) for node, freedom in places]
    return np.hstack([speed, spin]).ravel()[pick], np.hstack([pull, turn]).ravel()[pick]


def gap(structure: fc.Structure, effects: list[fc.Effect], step: float) -> float:
    """Farthest that a node is from itself after the same motion of 0.1 s, seen from inside and from outside."""
    runs = []
    for frame in ([FRAME], []):
        model = fc.assemble(structure, [*effects, *frame], fc.CasadiVM())
        v = 0.2 * np.ones(model.n)
        v = v if frame else from_outside(model, model.rest, v, 0.0 * v)[0]
        method = fc.GeneralizedAlpha(step=step, rho=1.0)
        runs.append(fc.simulate(model, until=0.1, start=model.rest.with_(v=v), method=method).final.x[:-1])
    back = Rotation.from_rotvec(-0.1 * SPIN).as_matrix()
    return float(np.abs((runs[1] - CENTER) @ back.T + CENTER - runs[0]).max())


def test_forces_are_those_of_the_same_motion_seen_from_outside():
    for structure, effects in ((floating(), [fc.LargeRotation()]), (bar(2), MOVING)):
        turning, outside = (fc.assemble(structure, [*effects, *e], fc.CasadiVM()) for e in ([FRAME], []))
        rng = np.random.default_rng(3)
        state = turning.displace(0.3 * rng.normal(size=turning.n))
        v, a = rng.normal(size=(2, turning.n))
        expected = outside.balance(state, *from_outside(turning, state, v, a))
        assert np.allclose(turning.balance(state, v, a), expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def test_a_run_in_the_turning_frame_is_the_run_outside():
    """Up to the square of the step, rigid or bending, however few the elements."""
    for structure, effects in ((floating(), [fc.LargeRotation()]), (bar(1), MOVING), (bar(4), MOVING)):
        gaps = [gap(structure, effects, step) for step in (4e-3, 2e-3)]
        assert gaps[1] < 1e-5
        assert np.log2(gaps[0] / gaps[1]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("effects", [MOVING, [fc.LargeRotation()]], ids=["flexible", "rigid"])
def test_the_jacobi_integral_is_kept(effects):
    """Kinetic energy of what is seen, plus the stored one with the centrifugal potential: up to h²."""
    model = fc.assemble(floating(), [*effects, FRAME])
    start = model.rest.with_(v=np.random.default_rng(0).normal(size=model.n))
    kinetic, stored, _ = model.energy(start)
    missed = []
    for step in (1e-3, 6.25e-5):
        method, tight = fc.GeneralizedAlpha(step=step, rho=1.0), fc.Tolerance(absolute=1e-11)
        run = fc.simulate(model, until=0.2, start=start, method=method, tolerance=tight)
        energies = np.array([model.energy(run.at(t).state) for t in np.linspace(2e-3, 0.2, 100)])
        missed.append(np.abs(energies[:, 0] + energies[:, 1] - kinetic - stored).max() / kinetic)
    assert np.log2(missed[0] / missed[1]) / 4.0 == pytest.approx(2.0, abs=0.1)
    assert missed[0] < 2e-4
    assert np.ptp(energies[:, 0]) > 0.02 * kinetic


def test_a_point_on_springs_has_its_frequency_up_and_down_by_the_spin():
    """Foucault: ω₀ ± Ω for whoever turns, also beyond Ω = ω₀, where K alone would be unstable."""
    for spin in (0.0, 1.0, 2.5):
        load = fc.PointMass("load", (0, 0, 0), 2.0)
        springs = [
            fc.Spring(f"spring_{i}", load.node, p, stiffness=4.0)
            for i, p in enumerate([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)])
        ]
        joints = [fc.Pin(load.node, s.start) for s in springs] + [fc.Support(s.end) for s in springs]
        joints.append(fc.Support(load.node, "w"))
        effects = [fc.LargeRotation(), fc.RotatingFrame((0, 0, spin))]
        linear = fc.linearize(fc.assemble(fc.Structure([load, *springs], joints), effects, fc.CasadiVM()))
        poles = linear.damped_poles()
        expected = sorted([abs(2.0 - spin)] * 2 + [2.0 + spin] * 2)
        assert sorted(np.abs(poles)) == pytest.approx(expected, abs=1e-12)
        assert np.abs(poles.real).max() < 1e-12
        assert linear.C.toarray() == pytest.approx(np.array([[0, -4.0], [4.0, 0]]) * spin, abs=1e-14)


def test_a_spinning_rod_stretches_as_it_should():
    """u(L) = L (tan x/x − 1) with x = ΩL √(ρA/EA), for every point of the axis and direction of the rod."""
    L, EA, spin = 10.0, 2.8e7, 60.0
    s = fc.Section(EA=EA, EI_y=1.4e4, EI_z=1.4e4, GJ=1e4, rhoA=1.2, rhoJ=1e-3)
    rod = fc.Beam("rod", (2, 1, 5), (2, 1 + L, 5), s, elements=8)
    structure = fc.Structure([rod], [fc.Support(rod.start)], outputs=[fc.Position("tip", rod.end, "y")])
    effects = [*MOVING, fc.RotatingFrame((0, 0, spin), (2, 1, -7))]
    rest = fc.equilibrium(fc.assemble(structure, effects, fc.CasadiVM()))
    x = spin * L * np.sqrt(1.2 / EA)
    assert rest.outputs["tip"] - (1 + L) == pytest.approx(L * (np.tan(x) / x - 1), rel=2e-3)


@pytest.mark.parametrize(
    ("effects", "message"),
    [
        ([fc.Flexible()], "RotatingFrame: needs LargeRotation"),
        ([*MOVING, fc.Gravity()], "gravity .* would turn in a frame"),
    ],
)
def test_what_makes_no_sense_in_a_turning_frame_is_refused(effects, message):
    with pytest.raises(StructureError, match=message):
        fc.assemble(floating(), [*effects, FRAME])


def test_gravity_along_the_axis_and_a_frame_at_rest_are_welcome():
    fc.assemble(floating(), [*MOVING, fc.Gravity(), fc.RotatingFrame((0, 0, -3.0))])
    fc.assemble(floating(), [fc.Gravity(), fc.RotatingFrame((0, 0, 0))])


@pytest.mark.parametrize("vectors", [(3.0,), ((0, 0, np.nan),), ((0, 0, 1), "xyz")])
def test_frames_that_cannot_be_are_refused(vectors):
    with pytest.raises(StructureError, match=r"RotatingFrame: (rate|center)"):
        fc.RotatingFrame(*vectors)


def test_small_motion_of_a_spinning_blade_has_the_same_poles():
    """`GeometricStiffness` in the place of `LargeRotation`: the Coriolis terms come along."""
    blade = fc.Beam("blade", (0.2, 0, 0), (1.2, 0, 0), E, elements=2)
    structure = fc.Structure([blade], [fc.Support(blade.start)])
    spin = fc.RotatingFrame((0, 0, 8.0))
    large, small = (
        fc.linearize(fc.assemble(structure, [fc.Flexible(), e, spin], fc.CasadiVM()))
        for e in (fc.LargeRotation(), fc.GeometricStiffness())
    )
    assert abs(small.C).max() > 1.0
    np.testing.assert_allclose(small.damped_poles().imag, large.damped_poles().imag, rtol=1e-9, atol=1e-9)


def test_certificate_tells_coriolis_forces_from_dampers():
    blade = fc.Beam("blade", (0.2, 0, 0), (1.2, 0, 0), E, elements=2)
    structure = fc.Structure([blade], [fc.Support(blade.start)])
    damping, spin = fc.RayleighDamping(0.5, 1e-3), fc.RotatingFrame((0, 0, 8.0))
    shares = []
    for effects in ([], [damping], [spin], [spin, damping]):
        certificate = fc.linearize(fc.assemble(structure, [*MOVING, *effects], fc.CasadiVM())).certificate
        shares.append(certificate.gyroscopic)
        assert ("skew" in str(certificate)) == (spin in effects)
    assert shares[:3] == [0.0, 0.0, pytest.approx(1.0)]
    assert 0.0 < shares[3] < 1.0


def test_coriolis_forces_are_in_every_export():
    """Poles, response and state space of a spinning blade against dense solutions with its M, C and K."""
    blade = fc.Beam("blade", (0.2, 0, 0), (1.2, 0.2, 0), E, elements=3)
    push, tip = fc.Force("push", blade.end, "y"), fc.Position("tip", blade.end, "x")
    structure = fc.Structure([blade], [fc.Support(blade.start)], inputs=[push], outputs=[tip])
    effects = [*MOVING, fc.RotatingFrame((0, 0, 8.0)), fc.RayleighDamping(0.0, 1e-4)]
    linear = fc.linearize(fc.assemble(structure, effects, fc.CasadiVM()))
    M, C, K = (A.toarray() for A in (linear.M, linear.C, linear.K))
    A = np.block([[0 * M, np.eye(len(M))], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    np.testing.assert_allclose(np.sort(np.abs(linear.damped_poles())), np.sort(np.abs(np.linalg.eigvals(A))), rtol=1e-9)
    omega = np.array([1.0, 40.0, 300.0])
    exact = [(linear.Cq @ np.linalg.solve(K + 1j * w * C - w * w * M, linear.B))[0, 0] for w in omega]
    plant = linear.to_ss()
    np.testing.assert_allclose(linear.frequency_response(omega).values[0, 0], exact, rtol=1e-10)
    np.testing.assert_allclose([plant(1j * w) for w in omega], exact, rtol=1e-10)


def tethered(*more: fc.Effect, stretch: bool = True) -> fc.Model:
    """A bob on a rope whose mass counts, in the x-y plane."""
    rope = fc.Rope("rope", (0, 0, 0), (1, 0, 0), EA=2e3, rhoA=0.3, damping=3.0, elements=2)
    bob = fc.PointMass("bob", rope.end, 1.0)
    outputs = [fc.Position(axis, bob.node, axis) for axis in "xyz"]
    structure = fc.Structure([rope, bob], [fc.Support(rope.start), fc.Pin(rope.end, bob.node)], outputs=outputs)
    effects = [fc.LargeRotation(), fc.RopeMass(), *([fc.RopeStretch()] if stretch else []), *more]
    return fc.assemble(structure, effects, fc.CasadiVM())


@pytest.mark.parametrize("stretch", [True, False], ids=["elastic", "links"])
def test_the_centrifugal_potential_of_a_rope_is_that_of_its_mass_matrix(stretch):
    """What holds it at rest is the slope of what is stored."""
    model = tethered(fc.Gravity(), fc.RotatingFrame((0, 0, 3.0), (0.1, -0.2, 0.0)), stretch=stretch)
    state, still = model.displace(0.1 * np.random.default_rng(0).normal(size=model.n)), np.zeros(model.n)
    slope = [
        (model.energy(model.advance(state, e, still, 0.0))[1] - model.energy(model.advance(state, -e, still, 0.0))[1])
        / 2e-5
        for e in 1e-5 * np.eye(model.n)
    ]
    force = model.balance(state, still, still)
    assert force == pytest.approx(-np.array(slope), rel=1e-6, abs=1e-7 * np.abs(force).max())


def test_the_air_does_not_turn_with_the_frame():
    """A bob let go in the frame meets the air as one that is thrown with its speed outside; the books hold."""
    spin, wind = 3.0, fc.Wind({"bob": 0.3}, speed=(0, 0, 2.0))
    rotation = Rotation.from_rotvec((0, 0, -0.2 * spin)).as_matrix()
    inside = tethered(fc.Gravity(), wind, fc.RotatingFrame((0, 0, spin)))
    outside = tethered(fc.Gravity(), wind)
    carried = outside.rest.x[:, 0] * spin
    v = np.array([carried[outside.structure.number(node)] if f == "v" else 0.0 for node, f in moving(outside)])
    gaps, residuals = [], []
    for step in (4e-3, 2e-3):
        method = fc.GeneralizedAlpha(step, rho=1.0)
        here, there = (
            fc.simulate(m, until=0.2, start=s, method=method)
            for m, s in ((inside, inside.rest), (outside, outside.rest.with_(v=v)))
        )
        gaps.append(np.abs(here.y[-1] - rotation @ there.y[-1]).max())
        residuals.append(here.report.energy_residual)
    assert gaps[1] < 0.3 * gaps[0] < 1e-5
    assert residuals[1] < 0.3 * residuals[0] < 1e-4
    calm = fc.simulate(tethered(fc.Gravity(), fc.RotatingFrame((0, 0, spin))), until=0.2, method=method)
    assert np.abs(here.y[-1] - calm.y[-1]).max() > 0.02


def moving(model: fc.Model) -> list[tuple[fc.Node, str]]:
    """Node and freedom of each coordinate."""
    names = {f"{node.part}_{node.index}": node for node in model.structure.nodes}
    return [(names[name.rsplit("_", 1)[0]], name.rsplit("_", 1)[1]) for name in model.coordinates]


def test_drag_in_a_turning_frame_in_linear_models():
    """A point on springs in still air: K is unsymmetric by the drag of its own way round, and says why."""
    load = fc.PointMass("load", (2, 0, 0), 2.0)
    springs = [fc.Spring(f"spring_{i}", load.node, p, stiffness=50.0) for i, p in enumerate([(0, 0, 0), (2, 1, 0)])]
    joints = [j for s in springs for j in (fc.Pin(load.node, s.start), fc.Support(s.end))]
    joints.append(fc.Support(load.node, "w"))
    effects = [fc.LargeRotation(), fc.RotatingFrame((0, 0, 1.5)), fc.Wind({"load": 0.5})]
    linear = fc.linearize(fc.assemble(fc.Structure([load, *springs], joints), effects, fc.CasadiVM()))
    assert linear.certificate.loads == ("Wind",)
    assert linear.certificate.taylor_slope > 1.9
    assert abs(linear.K - linear.K.T).max() > 0.1


@pytest.mark.parametrize(
    ("speed", "more", "message"),
    [
        ((1, 0, 0), fc.LargeRotation(), r"Wind: speed \(1.0, 0.0, 0.0\) would turn in a frame"),
        ((0, 0, 1), fc.GeometricStiffness(), "Wind: in a RotatingFrame it needs LargeRotation"),
    ],
)
def test_wind_that_would_turn_is_refused(speed, more, message):
    with pytest.raises(StructureError, match=message):
        fc.assemble(floating(), [more, fc.RotatingFrame((0, 0, 2.0)), fc.Wind({"load": 1.0}, speed)])
