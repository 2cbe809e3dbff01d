"""The ceiling crane of the paper: a girder that travels at both ends, with a chain of three links."""

from __future__ import annotations

import math

from flexctrl.structure.beams import Beam
from flexctrl.structure.inputs import Force
from flexctrl.structure.joints import Pin, Support
from flexctrl.structure.outputs import Position
from flexctrl.structure.sections import Section
from flexctrl.structure.structure import Structure

MEMBER = Section(EA=2e5 * math.pi, EI_y=157.0, EI_z=157.0, GJ=157.0, rhoA=1.0, rhoJ=1e-4)
"""Every member (Table 5): 1 kg/m, EA = 2π·10⁵ N, EI = GJ = 157 N m².

The table's moment of inertia, 0.33 kg m², is that of a 1 m rod of 1 kg about its end: it fixes the
length and is no further parameter. EA is that of a steel wire of 1 mm radius, whose EI would be
0.157 N m²; 157 is used as printed. The rotary inertia about the axis is not given; 1e-4 kg m
stands for it, which the travelling motion does not feel.
"""


def ceiling_crane(elements: int = 1) -> Structure:
    """Return the paper's ceiling crane (its Fig. 10 and Tables 4 and 5).

    The girder lies along y with its middle (node 4) at the origin; its ends travel in x only and are
    free to turn. Three chain links of 1 m hang from the middle down −z on pins.

    Parameters
    ----------
    elements : int
        Elements per 1 m member; with 1 the join table is the paper's Table 4.

    Returns
    -------
    Structure
        Input ``push`` [N] on both ends along x; outputs ``x1_minus_x4`` [m], the end ahead of the
        middle (Fig. 11), ``load_z`` [m], the height of the chain's end, −3 as drawn (Fig. 12), and
        ``travel`` [m] of the end.
    """
    girder = Beam("girder", (0, -3, 0), (0, 3, 0), MEMBER, elements=6 * elements)
    links = [Beam(f"link{k}", (0, 0, 1 - k), (0, 0, -k), MEMBER, elements=elements) for k in (1, 2, 3)]
    middle = girder.node(3 * elements)
    hung = zip((middle, links[0].end, links[1].end), links, strict=True)
    return Structure(
        elements=[girder, *links],
        joints=[
            Support(girder.start, held="v w"),
            Support(girder.end, held="v w"),
            *(Pin(above, link.start) for above, link in hung),
        ],
        inputs=[Force("push", at=(girder.start, girder.end), direction="x")],
        outputs=[
            Position("x1_minus_x4", at=girder.start, direction="x", minus=middle),
            Position("load_z", at=links[2].end, direction="z"),
            Position("travel", at=girder.start, direction="x"),
        ],
        name="ceiling_crane",
    )


__all__ = ["MEMBER", "ceiling_crane"]
