"""A lattice crane girder of any length: four chords, rings and diagonals of tube, welded."""

from __future__ import annotations

import flexctrl as fc

STEEL_TUBE = fc.Section(EA=2.5e8, EI_y=3.2e5, EI_z=3.2e5, GJ=2.4e5, rhoA=9.4, rhoJ=0.024)
SPAN = 20
CORNERS = ((-0.5, 0.0), (0.5, 0.0), (0.5, 1.0), (-0.5, 1.0))


def lattice_girder(bays: int) -> fc.Structure:
    """24 freedoms for each bay of 1 m; on supports every 20 m, pushed sideways and seen at its free end."""
    beams: list[fc.Beam] = []
    ends: dict[tuple[int, int], list[fc.Node]] = {}

    def member(name: str, first: tuple[int, int], last: tuple[int, int]) -> None:
        start, end = ((float(i), *CORNERS[c]) for i, c in (first, last))
        beam = fc.Beam(name, start=start, end=end, section=STEEL_TUBE)
        beams.append(beam)
        ends.setdefault(first, []).append(beam.start)
        ends.setdefault(last, []).append(beam.end)

    for i in range(bays + 1):
        for c in range(4):
            member(f"ring{i}_{c}", (i, c), (i, (c + 1) % 4))
            if i < bays:
                member(f"chord{i}_{c}", (i, c), (i + 1, c))
                member(f"diagonal{i}_{c}", (i, c), (i + 1, (c + 1) % 4))
    tip = ends[bays, 0][0]
    return fc.Structure(
        elements=beams,
        joints=[
            *(fc.Weld(first, other) for first, *others in ends.values() for other in others),
            *(
                fc.Support(ends[i, c][0], held="u v w" if i == 0 else "v w")
                for i in range(0, bays, SPAN)
                for c in (0, 1)
            ),
        ],
        inputs=[fc.Force("push", at=tip, direction="y")],
        outputs=[fc.Position("tip", at=tip, direction="y")],
    )


def girder(bays: int) -> fc.LinearModel:
    """Its linear model with Rayleigh damping."""
    return fc.linearize(fc.assemble(lattice_girder(bays), [fc.Flexible(), fc.RayleighDamping(0.05, 1e-5)]))
