"""Mode shapes drawn on the machine; what a mode is made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from flexctrl.linear.modes import Modes
from flexctrl.linear.place import Place
from flexctrl.mechanics.rotation import exponential
from flexctrl.plots.machine import add_machine_axes, best_plane, draw_deformed
from flexctrl.plots.pose import Drawn, bent_of
from flexctrl.plots.style import CYCLE, INK, PALE, new_figure, tidy

_MOST_PARTS = 8
_SPINS = 1e-4
"""Below this share of what it turns, what a mode displaces is round-off: parts spin about their own axes."""


def mode_pose(place: Place, shape: np.ndarray, fraction: float = 0.12) -> Drawn:
    """Return the machine displaced by a mode shape, enlarged to be seen.

    Parameters
    ----------
    place : Place
        The machine and its equilibrium.
    shape : numpy.ndarray, shape (n,)
        In the linear model's coordinates.
    fraction : float
        Largest displacement over the size of the machine.

    Returns
    -------
    Drawn
    """
    model, at = place.model, place.state
    v = place.basis @ shape
    moved = model.rates(at.with_(v=v))[: model.motion.source_base].reshape(-1, 6)
    bent = bent_of(model.structure, model.coordinates, v)
    swings = [np.abs(moved[:, :3]).max(initial=0.0), *(np.abs(a).max(initial=0.0) for a in bent.values())]
    turned = np.abs(moved[:, 3:]).max(initial=0.0) * model.structure.size
    largest = max(swings) if max(swings) > _SPINS * turned else turned
    scale = fraction * model.structure.size / largest if largest else 0.0
    turn = scale * moved[:, 3:]
    turn /= np.maximum(1.0, np.linalg.norm(turn, axis=1, keepdims=True))  # node by node, or none fits its chord
    still = bent_of(model.structure, model.coordinates, at.q)
    bent = {name: still[name] + scale * swing for name, swing in bent.items()}
    return Drawn(at.x + scale * moved[:, :3], exponential(turn) @ at.R, bent)


def mode_label(modes: Modes, k: int) -> str:
    """Return what a mode is called: its number, frequency and the part that moves most."""
    kind, part = modes.kinds[k], modes.dominant_part(k) or modes.dominant_coordinate(k)
    speed = f"{modes.frequencies[k]:.4g} Hz" if kind == "flexible" else kind
    return f"{k + 1}: {speed} · {part}"


def modes_figure(figure: Figure, place: Place, modes: Modes, chosen: Sequence[int]) -> list[Axes]:
    """Draw mode shapes side by side.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Empty; it is sized for them.
    place : Place
        The machine and its equilibrium.
    modes : Modes
    chosen : sequence of int
        Mode numbers from 0.

    Returns
    -------
    list of matplotlib.axes.Axes
    """
    poses = [mode_pose(place, modes.shapes[:, k]) for k in chosen]
    columns = min(3, max(1, len(poses)))
    rows = -(-len(poses) // columns)
    figure.set_layout_engine(None)
    figure.set_size_inches(4.2 * columns, 3.6 * max(rows, 1))
    axes, plane = [], best_plane(place.model.structure, poses)
    for i, (k, pose) in enumerate(zip(chosen, poses, strict=True)):
        ax = add_machine_axes(figure, place.model.structure, poses, (rows, columns, i + 1))
        draw_deformed(ax, place.model.structure, pose, CYCLE[i % len(CYCLE)], label=mode_label(modes, k), plane=plane)
        axes.append(ax)
    figure.subplots_adjust(left=0.04, right=0.96, bottom=0.06, top=0.93, wspace=0.15, hspace=0.25)
    return axes


def modes_picture(modes: Modes, count: int = 6) -> Figure:
    """Draw the lowest modes in a new figure: shapes on the machine, or frequencies and shares where there is none.

    Parameters
    ----------
    modes : Modes
    count : int
        Unstable modes come first, then flexible ones; rigid-body modes only where there is room.

    Returns
    -------
    matplotlib.figure.Figure
    """
    rigid = range(modes.unstable, modes.unstable + modes.rigid)
    order = [k for k in range(len(modes)) if k not in rigid] + list(rigid)
    chosen = sorted(order[:count])
    if modes.place is not None:
        figure = new_figure(8.0, 4.0)
        modes_figure(figure, modes.place, modes, chosen)
        return figure
    return _chart(modes, sorted(order[: 4 * count]))


def _chart(modes: Modes, chosen: Sequence[int]) -> Figure:
    """Frequencies over the mode's number, and in which parts or coordinates each one lives."""
    figure = new_figure(9.0, 5.6)
    above, below = figure.subplots(2, 1, sharex=True)
    numbers = [k + 1 for k in chosen]
    for kind, color in (("flexible", CYCLE[0]), ("rigid", PALE), ("unstable", CYCLE[1])):
        of = [k for k in chosen if modes.kinds[k] == kind]
        speed = (modes.growth if kind == "unstable" else modes.omega)[of] / (2.0 * np.pi)
        if of:
            label = kind if kind != "unstable" else "unstable (growth / 2π)"
            above.plot([k + 1 for k in of], speed, "o", color=color, label=label)
    tidy(above).set_ylabel("frequency (Hz)")
    if len(set(modes.kinds)) > 1:
        above.legend(frameon=False, fontsize="small")
    base = np.zeros(len(chosen))
    for i, (name, share) in enumerate(_largest(modes, chosen).items()):
        color = CYCLE[i % len(CYCLE)] if name != "others" else PALE
        below.bar(numbers, 100.0 * share, bottom=100.0 * base, color=color, label=name, width=0.8)
        base = base + share
    below.xaxis.set_major_locator(MaxNLocator(integer=True))
    what = "energy by part (%)" if modes.strain_shares else "amplitude by coordinate (%)"
    tidy(below).set(xlabel="mode", ylabel=what)
    figure.legend(*below.get_legend_handles_labels(), loc="outside right upper", frameon=False, fontsize="small")
    above.set_title(f"{len(modes)} modes", fontsize=10, color=INK)
    return figure


def _largest(modes: Modes, chosen: Sequence[int]) -> Mapping[str, np.ndarray]:
    """Shares of the parts (strain; kinetic where nothing is strained), else of the coordinates, in the modes."""
    if modes.strain_shares:
        rigid = np.array([modes.kinds[k] == "rigid" for k in chosen])
        shares = {
            name: np.where(rigid, modes.kinetic_shares[name][chosen], strain[chosen])
            for name, strain in modes.strain_shares.items()
        }
    else:
        size = modes.shapes[:, chosen] ** 2
        parts = size / np.maximum(size.sum(axis=0), 1e-300)
        shares = dict(zip(modes.coordinates, parts, strict=True))
    order = sorted(shares, key=lambda name: -float(shares[name].max(initial=0.0)))
    found = {name: shares[name] for name in order[:_MOST_PARTS]}
    if len(order) > _MOST_PARTS:
        found["others"] = np.sum([shares[name] for name in order[_MOST_PARTS:]], axis=0)
    return found


__all__ = ["mode_label", "mode_pose", "modes_figure", "modes_picture"]
