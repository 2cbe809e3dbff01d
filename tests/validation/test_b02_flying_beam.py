"""B2, a beam thrown into free flight by a force and a couple on one end.

In the plane, EA = GA = 1e4 N, with so much rotary inertia that its sections turn apart from its axis. Stiff in bending
(EI = 500 N m²): 30 elements, generalised alpha of 20 ms, ρ = 0.7; soft (EI = 100): 80 elements, as the error falls with
the square of their length. The reference beams of 12 and 20 elements agree to 2e-3 (stiff) and 1e-2 (soft).
`ConservingMidpoint` (8 elements, 5 ms under the push, then 1.8 ms) keeps both momenta to round-off; its energy
oscillates with the square of the step and does not drift. How much of it the throw has left takes a fine mesh: the
couple acts on a point, and is taken away amidst the waves it has made (stiff: 92.8, 93.6, 89.1, 89.9, 90.1 J with 10,
20, 40, 80, 160 elements).
"""

from __future__ import annotations

import numpy as np
import pytest
from recorder import Absolute

import flexctrl as fc
from flexctrl.design import Step, Sum

PAGE = "dynamics"
SOURCE = "12 and 20 cubic geometrically exact elements"
STIFF = {
    2.5: (4.4301, -0.7851, 5.9453, 8.9708),
    5.0: (5.6202, 4.7642, 15.4085, 4.2644),
    7.5: (15.5414, 8.9948, 15.7556, -0.9721),
    10.0: (25.4088, 4.7903, 15.6245, 4.1514),
}
SOFT = {
    2.5: (4.9630, 4.4759, 3.5833, 6.1118),
    5.0: (9.7836, 8.2040, 8.0747, 1.7585),
    7.5: (16.268, -0.283, 17.239, 8.253),
}
PUSH = fc.OpenLoop({"push": Sum((Step(8.0), Step(-8.0, at=2.5))), "couple": Sum((Step(80.0), Step(-80.0, at=2.5)))})


def flying(EI: float, elements: int) -> fc.Model:
    section = fc.Section(
        EA=1e4, EI_y=EI, EI_z=EI, GJ=EI, rhoA=1.0, rhoJ=20.0, rhoI_y=10.0, rhoI_z=10.0, GA_y=1e4, GA_z=1e4
    )
    beam = fc.Beam("beam", (6, 0, 0), (0, 8, 0), section, elements)
    inputs = [fc.Force("push", beam.start, "x"), fc.Torque("couple", beam.start, "-z")]
    outputs = [
        fc.Position(f"{end}_{axis}", node, axis)
        for end, node in zip("ab", beam.nodes[::elements], strict=True)
        for axis in "xy"
    ]
    return fc.assemble(
        fc.planar(fc.Structure([beam], inputs=inputs, outputs=outputs)), [fc.LargeRotation(), fc.Flexible()]
    )


def momenta(model: fc.Model, state: fc.State) -> tuple[float, float, float]:
    """Linear momentum in x and y, and angular momentum about the origin."""
    still = np.zeros(model.n)
    p = -model.slope(state, still, still, (0.0, 0.0, 1.0), np.zeros(2)) @ state.v
    place = {axis: np.array([name.endswith(f"_{axis}") for name in model.coordinates]) for axis in ("u", "v", "rz")}
    x, y = state.x[:-1, 0], state.x[:-1, 1]
    turning = x @ p[place["v"]] - y @ p[place["u"]] + p[place["rz"]].sum()
    return p[place["u"]].sum(), p[place["v"]].sum(), turning


@pytest.mark.slow
@pytest.mark.parametrize(("EI", "elements", "reference", "tolerance"), [(500, 30, STIFF, 1e-2), (100, 80, SOFT, 3e-2)])
def test_ends(record, EI, elements, reference, tolerance):
    run = fc.simulate(
        flying(EI, elements), PUSH, until=max(reference), method=fc.GeneralizedAlpha(0.02, 0.7), every=0.5
    )
    for t, places in reference.items():
        record(
            f"B2 flying beam, EI = {EI}, loaded and free end at {t:g} s [m]",
            ours=run.y[np.argmin(np.abs(run.t - t))],
            reference=places,
            source=SOURCE,
            tolerance=Absolute(tolerance),
        )


@pytest.mark.slow
def test_momenta_and_energy_in_flight(record):
    """8 N for 2.5 s: 20 N s; from then on nothing acts."""
    model = flying(500, 8)
    thrown = fc.simulate(model, PUSH, until=2.5, method=fc.ConservingMidpoint(5e-3)).final
    flight = fc.simulate(model, until=2.5, start=thrown, method=fc.ConservingMidpoint(1.8e-3))
    p = np.array([momenta(model, state) for state in (thrown, *flight.frames[::12], flight.final)])
    record(
        "B2 linear momentum in flight, largest and smallest in x, in y [N s]",
        ours=[p[:, 0].max(), p[:, 0].min(), p[:, 1].max(), p[:, 1].min()],
        reference=[20.0, 20.0, 0.0, 0.0],
        source="impulse of the push",
        tolerance=Absolute(1e-10),
    )
    record(
        "B2 angular momentum in flight, largest change over its value",
        ours=np.ptp(p[:, 2]) / np.abs(p[0, 2]),
        reference=0.0,
        source="conserved",
        tolerance=Absolute(1e-9),
    )
    energy = [sum(model.energy(state)[:2]) for state in (thrown, *flight.frames, flight.final)]
    record(
        "B2 energy in flight, largest change over its value",
        ours=np.ptp(energy) / energy[0],
        reference=0.0,
        source="conserved",
        tolerance=Absolute(1e-6),
    )
    assert p[0, 2] == pytest.approx(-189.27, abs=0.3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("EI", "energy", "within", "turning"), [(500, 90.25, 0.6, -189.27), (100, 379.8, 0.6, -229.52)]
)
def test_where_the_throw_leaves_it(record, EI, energy, within, turning):
    """The centre of mass goes as a mass point under 8 N; its trapezoids along the axis are right to 1/n²."""
    elements = 80
    model = flying(EI, elements)
    thrown = fc.simulate(model, PUSH, until=2.5, method=fc.ConservingMidpoint(5e-3)).final
    record(
        f"B2 flying beam, EI = {EI}, middle of the axis at 2.5 s [m]",
        ours=np.trapezoid(thrown.x[:-1, :2], axis=0) / elements,
        reference=[5.5, 4.0],
        source="8 N on 10 kg for 2.5 s",
        tolerance=Absolute(1e-3),
    )
    record(
        f"B2 flying beam, EI = {EI}, energy after the throw [J]",
        ours=sum(model.energy(thrown)[:2]),
        reference=energy,
        source=SOURCE,
        tolerance=Absolute(within),
    )
    record(
        f"B2 flying beam, EI = {EI}, angular momentum about the origin after the throw [N m s]",
        ours=momenta(model, thrown)[2],
        reference=turning,
        source=SOURCE,
        tolerance=1e-4,
    )
