"""Pictures of linear models that can be read: no curve twice the same, no label cut or on a mark."""

from __future__ import annotations

import control as ct
import matplotlib as mpl
import numpy as np
import pytest

import flexctrl as fc
from flexctrl.study.loop import open_loop

mpl.use("Agg")


@pytest.fixture(scope="module")
def mast() -> fc.LinearModel:
    beam = fc.Beam("mast", (0, 0, 0), (0, 0, 3), fc.Section.circular(fc.STEEL, 0.03), 4)
    structure = fc.Structure(
        [beam],
        [fc.Support(beam.start)],
        inputs=[fc.Force("push", beam.end, "x")],
        outputs=[fc.Position("top", beam.end, "x")],
        name="mast",
    )
    effects = [fc.Flexible(), fc.RayleighDamping(beta=1e-4)]
    return fc.linearize(fc.assemble(fc.planar(structure, "y"), effects))


def test_every_reduction_has_a_line_of_its_own(mast):
    ax = fc.plot_reduction({f"{n} modes": mast.reduce(fc.ModalTruncation(n)) for n in range(1, 11)})
    styles = [(line.get_color(), line.get_linestyle(), line.get_linewidth()) for line in ax.lines]
    assert len(set(styles)) == len(styles) == 11
    widths = [line.get_linewidth() for line in ax.lines[1:]]
    assert widths == sorted(widths, reverse=True), "what is drawn later must not hide what is below"
    assert len({line.get_color() for line in ax.lines[1:9]}) == 8


def test_nichols_labels_stay_clear_of_the_frame(mast):
    lag = ct.tf([2e4], [0.05, 1.0])
    ax = fc.plot_nichols({"mast": open_loop(mast, lag)})
    ax.figure.canvas.draw()
    frame = ax.get_window_extent()
    labels = [text for text in ax.texts if text.get_visible() and "dB" in text.get_text()]
    assert labels
    for text in labels:
        box = text.get_window_extent()
        assert frame.x0 < box.x0 < box.x1 < frame.x1
        assert frame.y0 < box.y0 < box.y1 < frame.y1


def test_a_critical_gain_is_written_beside_its_cross(mast):
    loop = open_loop(mast, ct.tf([2e3], [0.01, 1.0]))
    figure = fc.root_locus(loop).plot()
    ax = figure.axes[0]
    figure.canvas.draw()
    notes = [text for text in ax.texts if text.get_text().startswith("k = ")]
    assert notes
    for note in notes:
        mark = ax.transData.transform(note.xy)
        box = mpl.text.Text.get_window_extent(note)
        gap = np.array([box.x0, box.y0]) - mark
        assert gap.max() > 6.0 * figure.dpi / 100.0
        assert gap.min() > 4.0 * figure.dpi / 100.0
