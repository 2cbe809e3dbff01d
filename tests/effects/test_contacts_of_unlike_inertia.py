"""Dry contacts side by side bear what they have to, whatever their inertias and units are (D11)."""

from __future__ import annotations

import numpy as np
import pytest
from units import OTHERS, SI, Units

import flexctrl as fc
from flexctrl.model.laws.holds import hold

LADDER = [*OTHERS.values(), Units(1e9, 1e21, 1e12), Units(1e-9, 1e-20, 1e-6)]
METHODS = {
    "adaptive alpha": lambda u: fc.AdaptiveAlpha(),
    "alpha": lambda u: fc.GeneralizedAlpha(5e-3 * u.time),
    "explicit": lambda u: fc.ExplicitRungeKutta(),
}


class Growing:
    """A push that grows, 20.1 N a second."""

    inputs, outputs = ("x",), ("push",)

    def __init__(self, u: Units) -> None:
        self.sample_time, self.units = 0.01 * u.time, u

    def initial(self) -> np.ndarray:
        return np.zeros(0)

    def command(self, t: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([20.1 * self.units.force * t / self.units.time])


def cart(
    u: Units = SI, mass: float = 5.0, inertia: float = 2e-3, backend: fc.CasadiVM | None = None, rigid: bool = False
) -> fc.Model:
    """A cart on dry ground against a buffer, and the dry motor that moves it through a shaft."""
    torque = u.force * u.length
    body = fc.PointMass("cart", (0, 0, 0), mass * u.mass)
    buffer = fc.Spring("buffer", (-u.length, 0, 0), (0, 0, 0), stiffness=30.0 * u.force / u.length)
    shaft = {"stiffness": 0.1 * torque, "inertia": inertia * u.mass * u.length**2}
    drive = fc.LinearDrive("drive", body.node, direction="x", radius=0.1 * u.length, ratio=10.0, **shaft)
    structure = fc.Structure(
        [body, buffer],
        [fc.Support(body.node, "v w"), fc.Support(buffer.start), fc.Pin(buffer.end, body.node)],
        drives=[drive],
        inputs=[fc.Force("push", body.node, "x"), fc.MotorTorque("torque", drive)],
        outputs=[fc.Position("x", body.node, "x"), fc.DriveAngle("angle", drive)],
    )
    rubs = fc.CoulombFriction({"cart.u": fc.Coulomb(4.0 * u.force, 6.0 * u.force), "drive": 0.05 * torque})
    return fc.assemble(structure, [fc.LargeRotation(), *([] if rigid else [fc.ShaftElasticity()]), rubs], backend)


def left(model: fc.Model, state: fc.State, u: np.ndarray) -> dict[str, float]:
    """The share of what each contact bears that is left."""
    return dict(zip(model.switches.names, model.switches.gaps(state, u).tolist(), strict=True))


@pytest.mark.parametrize("units", [SI, *LADDER], ids=str)
@pytest.mark.parametrize(("mass", "inertia"), [(5.0, 2e-3), (1e9, 1e-12), (1e-12, 1e9)])
def test_each_of_two_contacts_bears_its_own_load(mass, inertia, units):
    model = cart(units, mass, inertia)
    u = np.array([3.0 * units.force, 0.02 * units.force * units.length])
    state = model.switches.begin(model.rest, u)
    assert left(model, state, u) == pytest.approx({"cart.u": 0.5, "drive": 0.6}, abs=2e-10)


@pytest.mark.parametrize(
    ("method", "backend"),
    [("adaptive alpha", None), ("alpha", None), ("adaptive alpha", fc.CasadiVM()), ("explicit", None)],
    ids=["adaptive", "fixed", "plain", "explicit"],
)
@pytest.mark.parametrize("units", [OTHERS["µm, µg, ms"], LADDER[-1]], ids=str)
def test_two_contacts_of_unlike_inertia_break_loose_alike_in_any_units(units, method, backend):
    """The cart when its push has passed 6 N, the motor later on by its shaft; compiled and plain."""
    run, other = (pushed(u, method, backend) for u in (SI, units))
    assert other.status is run.status is fc.Status.FINISHED
    assert other.report.steps == run.report.steps
    assert [e.name for e in other.events] == [e.name for e in run.events] == ["cart.u", "drive"]
    assert run.events[0].t == pytest.approx(0.3, abs=1e-9)
    assert np.allclose([e.t / units.time for e in other.events], [e.t for e in run.events], rtol=1e-8, atol=0.0)
    assert np.allclose(other.y / [units.length, 1.0], run.y, rtol=0.0, atol=1e-8 * np.abs(run.y).max(axis=0))


def pushed(u: Units, method: str, backend: fc.CasadiVM | None) -> fc.Run:
    how = {"until": 0.48 * u.time, "every": 0.1 * u.time, "method": METHODS[method](u), "inputs": {"torque": 0.0}}
    return fc.simulate(cart(u, backend=backend), Growing(u), **how)


@pytest.mark.parametrize("units", [SI, *LADDER], ids=str)
def test_contacts_that_hold_the_same_motion_share_its_load(units):
    """A rigid shaft ties the motor to the cart, 100 rad a metre: of 6 N and 0.05 N m, 11 N in all, 1 N is a share."""
    model = cart(units, rigid=True)
    u = np.array([units.force, 0.0])
    state = model.switches.begin(model.rest, u)
    assert left(model, state, u) == pytest.approx({"cart.u": 10.0 / 11.0, "drive": 10.0 / 11.0}, abs=2e-10)


@pytest.mark.parametrize("ratio", [1.0, 1e-6, 1e-12])
def test_what_is_light_between_ground_and_what_is_heavy_is_held_by_both(ratio):
    """Contacts of a light part on the ground and on a heavy one: what pulls at this is borne by both."""
    W = np.array([[1.0, 0.0], [1.0, -1.0]])
    held = hold(W, np.array([1.0 / ratio, 1.0]))
    assert held.borne(np.array([0.0, 1.0])) == pytest.approx([1.0, -1.0], rel=1e-9)
    assert np.allclose(W @ held.back, np.eye(2), atol=1e-9)


def test_shares_of_contacts_that_hold_the_same_motion_are_least():
    """Twice the same contact, once counted in other units, beside one of another motion: as NumPy has it."""
    W, masses = np.array([[1.0, 2.0, 0.0], [10.0, 20.0, 0.0], [0.0, 0.0, 3.0]]), np.array([2.0, 5.0, 1e-9])
    held, force = hold(W, 1.0 / masses), np.array([1.0, 2.0, 4.0])
    sizes = np.sqrt((W**2 / masses).sum(axis=1))
    least = np.linalg.pinv(W.T / sizes) @ force / sizes
    assert held.borne(force) == pytest.approx(least, rel=1e-12)
    assert held.freed(force) == pytest.approx(np.zeros(3), abs=1e-14)
