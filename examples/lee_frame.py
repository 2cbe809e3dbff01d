"""Lee's frame: a load on a hinged frame is followed through snap-through and snap-back.

Two legs of 120 on hinges carry a dead load 24 from their corner. Under load control the frame gives way at 18.6e3;
the path of equilibria goes on past the limit, back to negative loads, and up again.

    python examples/lee_frame.py --out results

prints both limit points and what load control says, and draws ``lee_frame.png``.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import flexctrl as fc
from flexctrl.errors import EquilibriumError

STRIP = fc.Section(EA=7.2e6 * 6.0, EI_y=7.2e6 * 2.0, EI_z=7.2e6 * 2.0, GJ=7.2e6 * 2.0, rhoA=1.0, rhoJ=1.0)
LEG, ARM = 120.0, 24.0

column = fc.Beam("column", (0, 0, 0), (0, 0, LEG), STRIP, elements=10)
near = fc.Beam("near", (0, 0, LEG), (ARM, 0, LEG), STRIP, elements=2)
far = fc.Beam("far", (ARM, 0, LEG), (LEG, 0, LEG), STRIP, elements=8)
inner = (*column.nodes[1:], *near.nodes[1:], *far.nodes[1:-1])
frame = fc.Structure(
    elements=[column, near, far],
    joints=[
        fc.Support(column.start, held="u v w rx rz"),
        fc.Support(far.end, held="u v w rx rz"),
        fc.Weld(column.end, near.start),
        fc.Weld(near.end, far.start),
        *[fc.Support(node, held="v rx rz") for node in inner],  # in its plane
    ],
    inputs=[fc.Force("load", near.end, "-z")],
    outputs=[fc.Position("height", near.end, "z"), fc.Position("along", near.end, "x")],
)
model = fc.assemble(frame, [fc.Flexible(), fc.LargeRotation()])

path = fc.equilibrium_path(model, load={"load": 1.0}, until={"height": LEG - 94.0})
print(path)
for limit in path.limits:
    print(f"limit at {limit.factor:9.2f}: drop {LEG - limit.outputs['height']:.3f}")

try:
    fc.equilibrium(model, inputs={"load": 1.02 * path.limits[0].factor})
except EquilibriumError as error:
    print(str(error).split(" (")[0])

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="A frame that snaps through and back.")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="directory for the picture")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    path.plot("height").savefig(out / "lee_frame.png", dpi=120)
