"""A load that crosses a simply supported beam at constant speed, for B11 and D21; L = EI = μ = 1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import flexctrl as fc

LOAD = 1e-2
"""Weight of what crosses: the beam sags by 2e-4 of its length."""

INERTIA = 100.0
"""Of the motor [kg]: the load, which pushes it with 1e-5 N along the beam, does not slow it."""

SECTION = fc.Section(EA=1e4, EI_y=1.0, EI_z=1.0, GJ=1.0, rhoA=1.0, rhoJ=1e-3)


@dataclass(frozen=True)
class Crossing:
    """A trolley under a dead load, driven by a motor too heavy to be slowed.

    Attributes
    ----------
    alpha : float
        Speed over (π/L) √(EI/μ).
    mass : float
        Over that of the beam.
    elements : int
    """

    alpha: float
    mass: float
    elements: int

    @property
    def speed(self) -> float:
        return self.alpha * np.pi

    @property
    def model(self) -> fc.Model:
        beam = fc.Beam("beam", (0, 0, 0), (1, 0, 0), SECTION, self.elements)
        trolley = fc.Trolley("trolley", beam, at=0.0, mass=self.mass)
        drive = fc.LinearDrive("drive", trolley.travel, direction="x", radius=1.0, stiffness=1.0, inertia=INERTIA)
        machine = fc.Structure(
            [beam, trolley],
            [fc.Support(beam.start, "u w"), fc.Support(beam.end, "w")],
            [drive],
            inputs=[fc.Force("load", trolley.node, "-z")],
            outputs=[
                fc.Position("middle", beam.node(self.elements // 2), "z"),
                fc.Position("under", trolley.node, "z"),
                fc.Position("s", trolley.travel, "x"),
            ],
        )
        return fc.assemble(fc.planar(machine, "y"), [fc.LargeRotation(), fc.BeamFlexibility()])

    def run(self, steps: int, rho: float = 0.9, share: float = 1.0) -> tuple[fc.Model, fc.Run]:
        """The passage, or its first part."""
        model = self.model
        v = np.zeros(model.n)
        v[model.coordinate("trolley_slide")] = self.speed
        method = fc.GeneralizedAlpha(1.0 / self.speed / steps, rho)
        start, until = model.rest.with_(v=v), share / self.speed
        how = {"inputs": {"load": LOAD}, "method": method, "tolerance": fc.Tolerance(1e-7, 1e-9)}
        return model, fc.simulate(model, until=until, start=start, **how)

    @staticmethod
    def contact(model: fc.Model, state: fc.State) -> float:
        """Force of the trolley on the beam over the weight."""
        return float(-fc.rail_force(model, state, "trolley", {"load": LOAD})[2]) / LOAD
