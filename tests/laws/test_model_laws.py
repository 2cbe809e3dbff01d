"""Laws that every machine obeys, on random ones: slopes, power, motion and its forces, signals, the frame.

Every expected value is a difference quotient of something else, or follows from a symmetry.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from machines import bridle, double_girder, four_bar, machine
from scipy.spatial.transform import Rotation

import flexctrl as fc

SPIN = fc.RotatingFrame((0.15, -0.3, -1.35), (0.5, -0.2, 0.3))
COMMON = [fc.Gravity((1.0, -2.0, -9.0)), fc.LargeRotation(), fc.RayleighDamping(0.1, 0.02)]
EFFECTS = {
    "flexible": [*COMMON, fc.Flexible()],
    "rigid": COMMON,
    "beams": [*COMMON, fc.BeamFlexibility()],
    "shafts": [*COMMON, fc.ShaftElasticity()],
    "spinning": [*COMMON, fc.Flexible(), SPIN],
    "rigid_spinning": [*COMMON, SPIN],
}
FEW = [("flexible", s) for s in (1, 2, 4, 6, 15)] + [("rigid", s) for s in (1, 2, 3, 4, 6, 15, 23)]
FEW += [("beams", 10), ("shafts", 7), ("spinning", 4), ("spinning", 15), ("rigid_spinning", 6), ("rigid_spinning", 23)]
LOOPS = {"four_bar": four_bar, "bridle": bridle, "double_girder": double_girder}
MANY = [(kind, s) for s in range(24, 60) for kind in ("flexible", "rigid")]
CASES = [(*case, s % 3 > 0) for case in FEW for s in case[1:]]
CASES += [(kind, name, True) for name in LOOPS for kind in ("rigid", "shafts", "beams")]
CASES += [pytest.param((*case, case[1] % 2 > 0), marks=pytest.mark.slow) for case in MANY]


@dataclass
class Subject:
    """A machine somewhere far from rest, with inputs on, rates and accelerations."""

    model: fc.Model
    state: fc.State
    u: np.ndarray
    v: np.ndarray
    a: np.ndarray

    @property
    def still(self) -> np.ndarray:
        return np.zeros(self.model.n)

    def step(self, d: np.ndarray) -> fc.State:
        return self.model.advance(self.state, d, self.v, 0.0)

    def along(self, h: float) -> fc.State:
        """The state a time h later, right to second order."""
        return self.model.advance(self.state, h * self.v + 0.5 * h * h * self.a, self.v + h * self.a, h)


@pytest.fixture(scope="module", params=CASES, ids=lambda c: f"{c[0]}-{c[1]}")
def subject(request):
    kind, which, supported = request.param
    seed = len(which) if which in LOOPS else which
    rng = np.random.default_rng(seed)
    structure = LOOPS[which]() if which in LOOPS else machine(seed, 3 + seed % 4, supported)
    model = fc.assemble(structure, EFFECTS[kind], fc.CasadiVM())
    far = 0.15 if which in LOOPS else 0.3
    steps, (v, a) = far * rng.normal(size=(2, model.n)), rng.normal(size=(2, model.n))
    state = displaced(model, steps, v)
    return Subject(model, state, rng.normal(size=len(model.inputs)), v, a)


def displaced(model: fc.Model, steps: np.ndarray, v: np.ndarray) -> fc.State:
    """Two steps from rest, in halves where they turn an element by more than it can be."""
    state = model.rest
    for step in steps:
        state = model.advance(state, step, v, 0.0)
    return state if np.isfinite(model.energy(state)).all() else displaced(model, 0.5 * steps, v)


def differences(f, n: int, h: float = 1e-6) -> np.ndarray:
    columns = [(f(h * e) - f(-h * e)) / (2 * h) for e in np.eye(n)]
    return np.array(columns).reshape(n, -1).T


def close(found, expected, tolerance=2e-6):
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    assert np.abs(found - expected).max(initial=0.0) < tolerance * (1.0 + np.abs(expected).max(initial=0.0))


def raw_change(model: fc.Model, before: fc.State, after: fc.State) -> np.ndarray:
    """Displacements, rotation vectors and source angles from one state to another, over all raw freedoms."""
    turn = Rotation.from_matrix(after.R @ np.swapaxes(before.R, 1, 2)).as_rotvec()
    nodes = np.hstack([after.x - before.x, turn]).ravel()
    return np.append(nodes, [sources(model, after) - sources(model, before)])


def sources(model: fc.Model, state: fc.State) -> np.ndarray:
    own = dict(zip(model.coordinates, state.q, strict=True))
    pairs = zip(model.structure.drives, state.driven, strict=True)
    return np.array([own.get(f"{d.name}_source", d.effective_ratio * s) for d, s in pairs])


def test_the_motion_of_nodes_is_the_slope_of_their_places(subject):
    s, model = subject, subject.model
    T = model.motion.jacobian(s.state).toarray()
    h = 1e-6
    columns = [raw_change(model, s.step(-h * e), s.step(h * e)) / (2 * h) for e in np.eye(model.n)]
    close(T, np.array(columns).reshape(model.n, -1).T)
    close(model.motion.rates(s.state, s.v), T @ s.v, 1e-12)


def test_rates_and_accelerations_are_those_of_the_motion(subject):
    """Quasi-velocities change along curved paths: the terms of second order count."""
    s, model, h = subject, subject.model, 1e-5
    before, after = s.along(-h), s.along(h)
    close(model.motion.rates(s.state, s.v), raw_change(model, before, after) / (2 * h))
    rate = (model.motion.rates(after, after.v) - model.motion.rates(before, before.v)) / (2 * h)
    found = model.motion.accelerations(s.state, s.v, s.a)
    close(found, rate)
    h = 1e-4
    bend = (s.along(h).x - 2.0 * s.state.x + s.along(-h).x) / h**2
    close(found[: s.state.x.size * 2].reshape(-1, 6)[:, :3], bend, 1e-5)


def test_forces_come_back_by_the_transpose(subject):
    s, motion = subject, subject.model.motion
    F = np.random.default_rng(0).normal(size=motion.raw)
    given = F.copy()
    close(motion.collect(s.state, F), motion.jacobian(s.state).T @ F, 1e-12)
    assert np.array_equal(F, given)


def test_stiffness_is_the_slope_of_balance_and_loads(subject):
    s, model = subject, subject.model

    def force(d):
        state = s.step(d)
        return model.balance(state, s.still, s.still) + model.loads(state, s.u)

    close(model.slope(s.state, s.still, s.still, (1.0, 0.0, 0.0), s.u).toarray(), differences(force, model.n))


def test_damping_is_the_slope_over_the_rates(subject):
    s, model = subject, subject.model
    found = model.slope(s.state, s.still, s.still, (0.0, 1.0, 0.0), s.u).toarray()
    close(found, differences(lambda v: model.balance(s.state, v, s.still), model.n))


def test_slope_in_motion_is_that_of_place_rates_and_accelerations_together(subject):
    """What an integrator's tangent mixes, levers that turn included."""
    s, model, seeds = subject, subject.model, (0.7, 1.3, 0.4)

    def force(d):
        state = s.step(seeds[0] * d)
        return model.balance(state, s.v + seeds[1] * d, s.a + seeds[2] * d) + model.loads(state, s.u)

    close(model.slope(s.state, s.v, s.a, seeds, s.u).toarray(), differences(force, model.n))


def test_mass_is_the_slope_over_the_accelerations_symmetric_and_positive(subject):
    s, model = subject, subject.model
    M = -model.slope(s.state, s.v, s.a, (0.0, 0.0, 1.0), s.u).toarray()
    close(-M, differences(lambda a: model.balance(s.state, s.v, s.a + a), model.n, 1e-2), 1e-9)
    close(M, M.T, 1e-13)
    assert np.linalg.eigvalsh(0.5 * (M + M.T)).min(initial=1.0) > 0.0


def test_mass_at_rest_is_the_assembled_one(subject):
    """The kernels' M is the one assembled from the textbook's element matrices, followers and drives included."""
    s, model = subject, subject.model
    M = -model.slope(model.rest, s.still, s.still, (0.0, 0.0, 1.0), 0.0 * s.u)
    close(M.toarray(), model.mass().toarray(), 1e-12)


def test_power_in_is_energy_stored_and_dissipated(subject):
    """d/dt (kinetic + stored) = input power − dissipated power, along the exact accelerations."""
    s, model = subject, subject.model
    force = model.balance(s.state, s.v, s.still) + model.loads(s.state, s.u)
    M = -model.slope(s.state, s.v, s.still, (0.0, 0.0, 1.0), s.u).toarray()
    a = np.linalg.solve(M, force)
    left, terms = model.balance(s.state, s.v, a) + model.loads(s.state, s.u), np.abs(M) @ np.abs(a)
    assert (np.abs(left) < 1e-9 + 1e-14 * terms).all()
    exact = Subject(model, s.state, s.u, s.v, a)

    def energy(h):
        return sum(model.energy(exact.along(h))[:2])

    h = 1e-3 / (10.0 + np.abs(a).max(initial=0.0)) ** 0.75
    rate = (8.0 * (energy(h) - energy(-h)) - energy(2 * h) + energy(-2 * h)) / (12.0 * h)
    power_in, dissipated = model.loads(s.state, s.u) @ s.v, model.energy(s.state)[2]
    assert dissipated >= 0.0
    close(rate, power_in - dissipated, 1e-6 * (1.0 + abs(power_in) + dissipated))


def test_outputs_have_the_slopes_they_say(subject):
    s, model = subject, subject.model
    rates = model.motion.rates(s.state, s.v)
    on_place, on_rates = model.signals.slopes(s.state, rates, model.motion.raw)
    T = model.motion.jacobian(s.state)
    close((on_place @ T).toarray(), differences(lambda d: model.signals.outputs(s.step(d), rates), model.n))
    close(on_rates.toarray(), differences(lambda r: model.signals.outputs(s.state, rates + r), model.motion.raw))


def test_loops_stay_closed(subject):
    s = subject
    assert s.model.motion.closure_error(s.state) < 1e-12
    assert s.model.motion.closure_error(s.along(0.1)) < 1e-12


def test_measured_speeds_are_the_rates_of_measured_angles(subject):
    """Motor angles, and the plain speed of a position."""
    s, model, h = subject, subject.model, 1e-5
    now = dict(zip(model.outputs, model.measure(s.state), strict=True))
    rate = (model.measure(s.along(h)) - model.measure(s.along(-h))) / (2 * h)
    rates = dict(zip(model.outputs, rate, strict=True))
    pairs = [(f"{d.name}_angle", f"{d.name}_speed") for d in model.structure.drives]
    for angle, speed in pairs:
        close(now[speed], rates[angle], 1e-6)
