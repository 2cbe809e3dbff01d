"""A16: Géradin and Cardona's cantilever under a tip load.

L = 5, EA = 4.8e8, GA = 3.231e8, GJ = 1e6, EI = 9.346e6, 600 kN downward (also a test of SHARPy).
"""

from __future__ import annotations

from statics import cantilever

import flexctrl as fc

PAGE = "statics"


def test_tip(record):
    section = fc.Section(4.8e8, 9.346e6, 9.346e6, 1e6, rhoA=1.0, rhoJ=1.0, GA_y=3.231e8, GA_z=3.231e8)
    model = cantilever(section, 5.0, 20, [lambda beam: fc.Force("load", beam.end, "-y")])
    out = fc.equilibrium(model, inputs={"load": 600e3}).outputs
    record(
        "Cantilever of Géradin & Cardona, 20 elements: deflection, shortening, angle",
        ours=(-out["y"], 5.0 - out["x"], -out["turn"]),
        reference=(2.15969389, 0.59647127, 0.67200606),
        source="rod shooting; SHARPy 2.159, 0.596, 0.6720",
        tolerance=1e-4,
    )
