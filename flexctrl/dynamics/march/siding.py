"""Steps that end on the other side of a corner than their tangent was made on, in compiled loops; see `alpha.steps`.

What a correction by a stiff flank's tangent leaves in the gap beside it is small, and says nothing. Steps solved with
the mass alone have no tangent.
"""

from __future__ import annotations

from flexctrl.dynamics.march.books import reach
from flexctrl.dynamics.march.corners import over_a_jump
from flexctrl.dynamics.march.record import DONE, EVALUATE, FAILED, FRESH, WANTS_TANGENT, March
from flexctrl.dynamics.march.step import newton, step
from flexctrl.kernels.native import seldom
from flexctrl.model.flat.flat import clear
from flexctrl.model.flat.solving import copy_on

__all__ = ["decided"]


@seldom
def decided(m: March) -> int:
    """Iterate on, with tangents made anew, in a step that is solved while forces jump between these and its end.

    Where that fails, the step is tried from its start with such tangents, as any other that fails. Nodes are where it
    ends.
    """
    status = iterated(m)
    if status == FAILED and m.asking == 0:
        m.attempt = 1
        status = step(m)
        if status == DONE:
            reach(m)
            status = iterated(m)
    return status


@seldom
def iterated(m: March) -> int:
    """Iterate on until forces do not jump between where the last tangent was made and where the step ends."""
    status = DONE
    while status == DONE and m.swift != 1 and over_a_jump(m.corners, m.flat):
        set_back(m)
        m.attempt = 1
        m.phase = EVALUATE
        m.iteration += 1
        status = newton(m)
        if status == DONE:
            reach(m)
    if status != WANTS_TANGENT:
        m.attempt = 0
        m.phase = FRESH
    return status


@seldom
def set_back(m: March) -> None:
    """Put nodes where the step starts; forces of whole machines are those of a step from there."""
    if m.whole == 1:
        f = m.flat
        copy_on(f.padded, f.step, m.corners.step)
        clear(f.padded, f.step)
        reach(m)
        copy_on(f.padded, m.corners.step, f.step)
