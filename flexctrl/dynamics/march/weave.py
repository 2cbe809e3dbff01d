"""Rows between the steps of a march, in compiled loops: the curves of `flexctrl.dynamics.records.dense.Hermite`."""

from __future__ import annotations

import math
from dataclasses import dataclass

from flexctrl.kernels.native import Reals, Wholes
from flexctrl.model.flat.flat import clear, drive, place
from flexctrl.model.flat.workspace import Flat
from flexctrl.model.gauges import Gauges, read
from flexctrl.model.laws.kinds import NODE_SLOT
from flexctrl.model.turned import face

__all__ = ["Weave", "weave"]

_POSE, _PLACE = 12, 3
_SPIN = 15
_STRAIGHT = 1e-3
_ALIGNED = 1e-6
_WHOLE = 1e-4  # as in `flexctrl.model.linkages.chart`


@dataclass
class Weave:
    """Rows that are due within steps whose ends are known.

    Coordinates are those of `dynamics.methods.local.Local`: the degrees of freedom in the order of elimination, then
    angles about held axes, about which rotations wander.

    Attributes
    ----------
    flat : Flat
        A workspace of its own; ``spare``, behind it, holds the further coordinates.
    gauges : Gauges
    wide : int
        Number of coordinates, those of the degrees of freedom filled up.
    turns : Wholes
        Nodes that turn about several axes, and their three coordinates (−1: computed by a loop).
    leans, lean_axes : Wholes, Reals
        Rigid ropes that lean two ways: node and two coordinates; body axes along the rope and across (9).
    hinges, hinge_axes, slides, slide_axes : Wholes, Reals
        Turns about a master's axis and slides along it: master and coordinate; that axis in the body.
    first, states : Reals
        The state before the first step, and those after each, as `flexctrl.dynamics.march.books.shelve` writes them.
    steps, times : Wholes, Reals
        In which step each row is, and when.
    ends : Wholes
        1 for a row that is a state after a step: nothing is to be found but the state for drawing.
    rows, drawn : Reals
        Time and outputs of each row; the states that are due for drawing.
    place0, coordinates, onward, arriving, turning : Reals
        Degrees of freedom at the start of the step in work, coordinates at its end, their rates over the step at both
        ends, and what rates of degrees of freedom have beside these.
    pair : Reals
        Room for two rotation vectors and what becomes of them.
    width, nodes : int
    wanted, kept : int
    due, spacing : float
        When the next state for drawing is due, and their spacing.
    """

    flat: Flat
    gauges: Gauges
    wide: int
    spare: Reals
    turned: int
    turns: Wholes
    leaning: int
    leans: Wholes
    lean_axes: Reals
    hinged: int
    hinges: Wholes
    hinge_axes: Reals
    slid: int
    slides: Wholes
    slide_axes: Reals
    first: Reals
    states: Reals
    steps: Wholes
    times: Reals
    ends: Wholes
    rows: Reals
    drawn: Reals
    place0: Reals
    coordinates: Reals
    onward: Reals
    arriving: Reals
    turning: Reals
    pair: Reals
    width: int
    nodes: int
    wanted: int = 0
    kept: int = 0
    due: float = 0.0
    spacing: float = 0.0


def weave(w: Weave) -> int:
    """Find all rows wanted; return 0."""
    step = -1
    w.kept = 0
    for k in range(w.wanted):
        if w.ends[k] == 1:
            if w.times[k] >= w.due:
                draw_end(w, w.states[w.width * w.steps[k] :])
        else:
            if w.steps[k] != step:
                step = w.steps[k]
                if step == 0:
                    span(w, w.first, w.states)
                else:
                    span(w, w.states[w.width * (step - 1) :], w.states[w.width * step :])
            row_within(w, k, step)
    return 0


def span(w: Weave, before: Reals, after: Reals) -> None:
    """Set out on a step between two states: coordinates at its end, and their rates at both ends."""
    f = w.flat
    n = f.padded
    h = after[w.width - 1] - before[w.width - 1]
    for i in range(w.nodes * _POSE):
        f.pose[i] = before[i]
    for i in range(w.nodes):
        for j in range(_POSE):
            f.z[NODE_SLOT * i + j] = after[_POSE * i + j]
    q0 = before[_POSE * w.nodes :]
    q1 = after[_POSE * w.nodes :]
    for i in range(n):
        f.q[i] = q0[i]
        w.place0[i] = q0[i]
        w.coordinates[i] = q1[i] - q0[i]
        f.v[i] = q1[n + i]
        w.onward[i] = h * q0[n + i]
        w.arriving[i] = q1[n + i]
    for i in range(n, w.wide):
        w.coordinates[i] = 0.0
        w.onward[i] = 0.0
        w.arriving[i] = 0.0
    for i in range(f.drives):
        f.driven[i] = q0[2 * n + i]
    recall_angles(w, q0[2 * n + f.drives :])
    clear(n, f.step)
    clear(n, f.rate)
    if w.turned + w.leaning + w.hinged + w.slid > 0:
        drive(f)
        arrive(w)
    for i in range(n):
        w.turning[i] = q1[n + i] - w.arriving[i]
    for i in range(w.wide):
        w.arriving[i] = h * w.arriving[i]


def recall_angles(w: Weave, shown: Reals) -> None:
    """Take up the angles that outputs showed, and what tells their whole turns."""
    g = w.gauges
    pose = w.flat.pose
    for k in range(g.turning):
        at = _POSE * ((g.turns[4 * k + 1] - _PLACE) // NODE_SLOT) + _PLACE
        base = _POSE * ((g.turns[4 * k + 2] - _PLACE) // NODE_SLOT) + _PLACE
        face(pose[at:], pose[base:], g.faced[4 * k :])
        i = g.turns[4 * k + 3]
        total = 0.0
        for j in range(g.starts[i], g.starts[i + 1]):
            total += g.weights[j] * w.flat.z[g.cells[j]]
        g.shown[k] = shown[k]
        g.summed[k] = total


def row_within(w: Weave, k: int, step: int) -> None:
    """Find a row, and keep its state if one is due for drawing."""
    f = w.flat
    t0 = w.states[w.width * step - 1] if step > 0 else w.first[w.width - 1]
    h = w.states[w.width * step + w.width - 1] - t0
    s = (w.times[k] - t0) / h
    for i in range(w.wide):
        bend = 3.0 * w.coordinates[i] - 2.0 * w.onward[i] - w.arriving[i]
        twist = w.onward[i] + w.arriving[i] - 2.0 * w.coordinates[i]
        place_now = s * (w.onward[i] + s * (bend + s * twist))
        if i < f.padded:
            f.step[i] = place_now
            f.v[i] = (w.onward[i] + s * (2.0 * bend + s * 3.0 * twist)) / h + s * s * w.turning[i]
        else:
            w.spare[i - f.padded] = place_now
    for i in range(f.padded):
        f.q[i] = w.place0[i]
    place(f)
    for i in range(f.padded):
        f.q[i] = w.place0[i] + f.step[i]
    if w.gauges.moving == 1:
        drive(f)
    row = w.rows[(1 + w.gauges.outputs) * k :]
    row[0] = w.times[k]
    read(w.gauges, f.z, row[1:])
    if w.times[k] >= w.due:
        draw_now(w, w.times[k])


def draw_end(w: Weave, state: Reals) -> None:
    """Keep a state after a step for drawing."""
    kept = w.drawn[w.width * w.kept :]
    for i in range(w.width):
        kept[i] = state[i]
    w.kept += 1
    w.due = state[w.width - 1] + w.spacing


def draw_now(w: Weave, t: float) -> None:
    """Keep the state of a row for drawing."""
    f = w.flat
    kept = w.drawn[w.width * w.kept :]
    for i in range(w.nodes):
        for j in range(_POSE):
            kept[_POSE * i + j] = f.z[NODE_SLOT * i + j]
    rest = kept[_POSE * w.nodes :]
    for i in range(f.padded):
        rest[i] = f.q[i]
        rest[f.padded + i] = f.v[i]
    for i in range(f.drives):
        rest[2 * f.padded + i] = f.found[i]
    for i in range(w.gauges.turning):
        rest[2 * f.padded + f.drives + i] = w.gauges.shown[i]
    kept[w.width - 1] = t
    w.kept += 1
    w.due = t + w.spacing


def arrive(w: Weave) -> None:
    """Find the rates of the coordinates at the end, where these are not those of the degrees of freedom.

    As `flexctrl.model.linkages.chart.Chart.rate` does, about the shape at the start of the step.
    """
    for k in range(w.turned):
        turn_on(w, w.turns[4 * k :])
    for k in range(w.leaning):
        lean_on(w, w.leans[3 * k :], w.lean_axes[9 * k :])
    for k in range(w.hinged):
        hinge_on(w, w.hinges[2 * k], w.hinges[2 * k + 1], w.hinge_axes[3 * k :])
    for k in range(w.slid):
        slide_on(w, w.slides[2 * k], w.slides[2 * k + 1], w.slide_axes[3 * k :])


def turn_on(w: Weave, turn: Wholes) -> None:
    """A node that turns about several axes."""
    node = turn[0]
    theta = w.pair
    since(w, node, theta)
    wanders = turn[1] >= w.flat.padded or turn[2] >= w.flat.padded or turn[3] >= w.flat.padded
    known = turn[1] >= 0 and turn[2] >= 0 and turn[3] >= 0
    for j in range(3):
        c = turn[1 + j]
        if known:
            if wanders:
                w.coordinates[c] = theta[j]
            else:
                theta[j] = w.coordinates[c]
    out = w.pair[6:]
    unspun(theta, w.flat.z[NODE_SLOT * node + _SPIN :], out)
    for j in range(3):
        c = turn[1 + j]
        if c >= 0:
            w.arriving[c] = out[j]


def lean_on(w: Weave, lean: Wholes, axes: Reals) -> None:
    """A rigid rope: its twist about itself is left out."""
    R = w.flat.pose[_POSE * lean[0] + 3 :]
    along = w.pair[9:]
    one = w.pair[12:]
    two = w.pair[15:]
    carried(R, axes, along)
    carried(R, axes[3:], one)
    carried(R, axes[6:], two)
    theta = w.pair
    x = w.coordinates[lean[1]]
    y = w.coordinates[lean[2]]
    square = 0.0
    for j in range(3):
        theta[j] = x * one[j] + y * two[j]
        square += theta[j] * theta[j]
    angle = math.sqrt(square)
    share = math.sin(angle) / angle if angle > _ALIGNED else 1.0
    points = w.pair[3:]
    crossed(theta, along, points)
    for j in range(3):
        points[j] = math.cos(angle) * along[j] + share * points[j]
    spin = w.pair[18:]
    twist = w.pair[21:]
    unspun(theta, w.flat.z[NODE_SLOT * lean[0] + _SPIN :], spin)
    unspun(theta, points, twist)
    ratio = dotted(along, spin) / dotted(along, twist)
    w.arriving[lean[1]] = dotted(one, spin) - ratio * dotted(one, twist)
    w.arriving[lean[2]] = dotted(two, spin) - ratio * dotted(two, twist)


def hinge_on(w: Weave, master: int, own: int, axis: Reals) -> None:
    """A turn about an axis of a master that turns itself."""
    f = w.flat
    theta = w.pair
    turned = w.pair[6:]
    before = w.pair[9:]
    after = w.pair[12:]
    spin = f.z[NODE_SLOT * master + _SPIN :]
    since(w, master, theta)
    unspun(theta, spin, turned)
    carried(f.pose[_POSE * master + 3 :], axis, before)
    carried(f.z[NODE_SLOT * master + 3 :], axis, after)
    w.arriving[own] += dotted(before, turned) - dotted(after, spin)


def slide_on(w: Weave, master: int, own: int, axis: Reals) -> None:
    """A slide along an axis of a master that turns."""
    f = w.flat
    now = w.pair
    mean = w.pair[3:]
    bent = w.pair[6:]
    slot = f.z[NODE_SLOT * master :]
    carried(slot[3:], axis, now)
    carried(f.pose[_POSE * master + 3 :], axis, mean)
    for j in range(3):
        mean[j] += now[j]
    size = math.sqrt(dotted(mean, mean))
    crossed(slot[_SPIN:], now, bent)
    change = 0.0
    along = dotted(mean, bent) / size
    for j in range(3):
        mean[j] = mean[j] / size
        moved = slot[j] - f.pose[_POSE * master + j]
        change += (mean[j] - now[j]) * slot[_POSE + j] + moved * (bent[j] - mean[j] * along) / size
    w.arriving[own] += change


def since(w: Weave, node: int, theta: Reals) -> None:
    """Find the rotation vector of a node over the step."""
    a = w.flat.z[NODE_SLOT * node + 3 :]
    b = w.flat.pose[_POSE * node + 3 :]
    cosine = -0.5
    for i in range(3):
        j = i + 1 if i < 2 else 0
        k = 3 - i - j
        sine = 0.0
        for m in range(3):
            cosine += 0.5 * a[3 * i + m] * b[3 * i + m]
            sine += a[3 * k + m] * b[3 * j + m] - a[3 * j + m] * b[3 * k + m]
        theta[i] = 0.5 * sine
    size = math.sqrt(dotted(theta, theta))
    share = math.atan2(size, cosine) / size if size > 1e-8 else 1.0
    for i in range(3):
        theta[i] = share * theta[i]


def unspun(theta: Reals, spin: Reals, out: Reals) -> None:
    """Find the rate of a rotation vector from a spin: as `flexctrl.model.linkages.chart.inverse_tangents` does."""
    square = dotted(theta, theta)
    eta = 1.0 / 12.0 + square * (1.0 / 720.0 + square * (1.0 / 30240.0 + square / 1209600.0))
    if square >= _STRAIGHT:
        half = 0.5 * math.sqrt(square)
        tangent = math.tan(half)
        if abs(tangent) < _WHOLE * half:
            tangent = _WHOLE * half if tangent > 0.0 else -_WHOLE * half
        eta = (1.0 - half / tangent) / square
    for i in range(3):
        j = i + 1 if i < 2 else 0
        k = 3 - i - j
        # crossed twice: after a whole turn η has no end, and is to meet nothing where the axis stays
        turned = theta[j] * spin[k] - theta[k] * spin[j]
        ahead = theta[k] * spin[i] - theta[i] * spin[k]
        behind = theta[i] * spin[j] - theta[j] * spin[i]
        out[i] = spin[i] - 0.5 * turned + eta * (theta[j] * behind - theta[k] * ahead)


def crossed(a: Reals, b: Reals, out: Reals) -> None:
    """Write a × b."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


def dotted(a: Reals, b: Reals) -> float:
    """Return a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def carried(R: Reals, axis: Reals, out: Reals) -> None:
    """Write R axis."""
    for i in range(3):
        out[i] = dotted(R[3 * i :], axis)
