"""Lines so stiff that steps do not see them give way: how steps over them are solved, and how well they can be.

The force of such a line hangs on the last digits of places. Solved for a step by Newton's method, it is what balances
accelerations; but with a tangent made elsewhere, a correction along where the line pointed then leaves a share of that
force across it: (h ω/2)² times the angle between, of the correction itself. So each iteration has a tangent of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from flexctrl.dynamics.alpha.newton import small_enough
from flexctrl.dynamics.scales import once
from flexctrl.model.model import Model
from flexctrl.model.plant import Plant
from flexctrl.model.rounding import DIGITS
from flexctrl.model.state import State
from flexctrl.structure.drives import LinearDrive, RotaryDrive, Winch
from flexctrl.structure.lines import Rope, Spring

__all__ = [
    "SHORT",
    "STIFF",
    "SURE",
    "TURNING",
    "Caution",
    "firmest",
    "firmest_freedom",
    "firmest_shaft",
    "frequency_of",
    "noise",
    "stiffest",
    "told_by_differences",
]

STIFF = 10.0
"""Radians of its vibration against the masses at its ends in a step that a line is stiff from on."""
SURE = 1e-11
"""Size of the last correction of steps over such lines."""

_HEAVY = 5e5
"""Mass that a load moves with along a rigid rope over that across it: from where on lines are stiff as ropes are, and
up to where differences of forces, right to eight digits, make a tangent."""

TURNING, SHORT = 0.5, 1.0 / 64.0
"""Corrections that shrink by no more than this go back and forth, between a slack rope and a taut one, and are
shortened by that share from then on."""

Line = Rope | Spring | Winch


@dataclass
class Caution:
    """How Newton's iterations over stiff lines go; the compiled loops do the same.

    Attributes
    ----------
    enough : float
        Size of the last correction.
    exact : bool
        Whether the step is solved to the last digits.
    short : float
        By what share corrections are shortened.
    """

    enough: float
    exact: bool = False
    short: float = 0.0

    def over(self, size: float, contraction: float, iteration: int) -> bool:
        """Tell whether a correction was the last; that is never a short one.

        What goes back and forth between a slack rope and a taut one goes a little less far from then on.
        """
        if small_enough(size, contraction, self.enough, self.exact):
            last = not self.short
            self.short = 0.0
            return last
        if contraction > TURNING and iteration > 1:
            self.short = SHORT
        return False


def firmest(model: Plant) -> float:
    """Return the highest frequency of a line against the masses at its ends [rad/s]; 0 where none turns.

    Infinite where a rigid rope hangs from a motor beside whose inertia its load is nothing.

    Parameters
    ----------
    model : Plant

    Returns
    -------
    float
    """
    wall = np.inf if once(model, _spreads).max(initial=0.0) > _HEAVY else 0.0
    return float(max(once(model, frequencies).max(initial=0.0), wall))


def firmest_shaft(model: Plant) -> float:
    """Return the highest frequency of a drive's shaft against what turns at its ends [rad/s]; 0 where none gives way.

    Parameters
    ----------
    model : Plant

    Returns
    -------
    float
    """
    return float(once(model, _shafts).max(initial=0.0))


def firmest_freedom(model: Plant) -> float:
    """Return the highest frequency of a degree of freedom as if all others were held [rad/s].

    Parameters
    ----------
    model : Plant

    Returns
    -------
    float
    """
    return float(once(model, _freedoms).max(initial=0.0))


def frequency_of(model: Model, name: str) -> float:
    """Return the frequency of one line [rad/s]; 0 where it does not give way.

    Parameters
    ----------
    model : Model
    name : str

    Returns
    -------
    float
    """
    found = dict(zip([line.name for line in giving_way(model)], once(model, own_frequencies).tolist(), strict=True))
    return float(found.get(name, 0.0))


def told_by_differences(model: Plant) -> bool:
    """Tell whether differences of forces make tangents for loads beside the inertia of motors that they hang from.

    Parameters
    ----------
    model : Plant

    Returns
    -------
    bool
    """
    return bool(once(model, _spreads).max(initial=0.0) <= _HEAVY)


def _spreads(model: Plant) -> np.ndarray:
    """The mass with which a rigid rope's end moves along it over that across, for each winch, shape (winches,)."""
    if not (isinstance(model, Model) and model.large):
        return np.zeros(0)
    winches = [d for d in model.structure.drives if isinstance(d, Winch) and not model.bends(d)]
    if not winches:
        return np.zeros(0)
    still = np.zeros(model.n)
    mass = -model.slope(model.rest, still, still, (0.0, 0.0, 1.0), np.zeros(len(model.inputs)))
    moves, found = sp.csr_matrix(model.motion.jacobian(model.rest)), []
    for winch in winches:
        first = 6 * model.structure.number(winch.node)
        own = np.unique(moves[first : first + 3].indices)
        spread = np.linalg.eigvalsh(mass[own][:, own].toarray()) if own.size else np.ones(1)
        found.append(spread[-1] / max(spread[0], spread[-1] / np.finfo(float).max))
    return np.array(found)


def frequencies(model: Plant) -> np.ndarray:
    """Frequencies of the lines as drawn, each as if the others let go, shape (lines,)."""
    return own_frequencies(model) if _lines(model) else np.zeros(0)


def own_frequencies(model: Plant) -> np.ndarray:
    """The same, also where they do not turn."""
    if not (isinstance(model, Model) and (lines := giving_way(model))):
        return np.zeros(0)
    return _alone(model, pulls_of(model, lines, model.rest), [_stiffness(line) for line in lines])


def _shafts(model: Plant) -> np.ndarray:
    """Frequencies of the shafts as drawn, each as if nothing else held their ends, shape (shafts,)."""
    if not isinstance(model, Model):
        return np.zeros(0)
    drives = [d for d in model.structure.drives if isinstance(d, RotaryDrive | LinearDrive) and model.bends(d)]
    return _alone(model, _twists(model, drives), [d.stiffness for d in drives]) if drives else np.zeros(0)


def _freedoms(model: Plant) -> np.ndarray:
    """Frequencies of the degrees of freedom at rest, each alone, shape (n,); 0 of what has no mass."""
    still = np.zeros(model.n)
    slope = model.slope(model.rest, still, still, (1.0, 0.0, 0.0), np.zeros(len(model.inputs)))
    return np.sqrt(np.maximum(-slope.diagonal(), 0.0) * mobility(model))


def _alone(model: Model, moves: sp.csr_matrix, stiffness: Sequence[float]) -> np.ndarray:
    """Frequencies of springs that raw coordinates lengthen, against the masses that they move."""
    return np.sqrt((moves @ model.motion.jacobian(model.rest)).power(2) @ mobility(model) * stiffness)


def mobility(model: Plant) -> np.ndarray:
    """One over the mass of each degree of freedom at rest, shape (n,); 0 of what has none."""
    still = np.zeros(model.n)
    mass = -model.slope(model.rest, still, still, (0.0, 0.0, 1.0), np.zeros(len(model.inputs))).diagonal()
    light = mass <= model.dust
    return np.where(light, 0.0, 1.0 / np.where(light, 1.0, mass))


def _lines(model: Plant) -> tuple[Line, ...]:
    """What pulls along a line between two nodes and turns with it: nothing in small motion."""
    return giving_way(model) if isinstance(model, Model) and model.large else ()


def giving_way(model: Model) -> tuple[Line, ...]:
    """What pulls along a line between two nodes that may part."""
    parts = (*model.structure.elements, *model.structure.drives)
    return tuple(p for p in parts if isinstance(p, Spring) or (isinstance(p, Rope | Winch) and model.bends(p)))


def _stiffness(line: Line) -> float:
    """Stiffness as drawn [N/m]."""
    return line.stiffness if isinstance(line, Rope | Spring) else line.EA / line.length


def pulls_of(model: Model, lines: tuple[Line, ...], state: State) -> sp.csr_matrix:
    """How each raw coordinate lengthens each line in a state, shape (lines, raw)."""
    rows, columns, values = [], [], []
    for i, line in enumerate(lines):
        first, second = ends_of(model, line)
        arm = state.x[second] - state.x[first]
        arm = arm / max(float(np.linalg.norm(arm)), np.finfo(float).tiny)
        columns += [6 * end + k for end in (second, first) for k in range(3)]
        values += [*arm.tolist(), *(-arm).tolist()]
        if isinstance(line, Winch):
            columns.append(model.motion.source_base + model.structure.drives.index(line))
            values.append(-1.0 / line.effective_ratio)
        rows += [i] * (7 if isinstance(line, Winch) else 6)
    return sp.csr_matrix((values, (rows, columns)), shape=(len(lines), model.motion.raw))


def ends_of(model: Model, line: Line) -> tuple[int, int]:
    """The numbers of the nodes that a line is between."""
    nodes = (line.against, line.node) if isinstance(line, Winch) else line.nodes
    first, second = (model.structure.number(node) for node in nodes)
    return first, second


def _twists(model: Model, drives: Sequence[RotaryDrive | LinearDrive]) -> sp.csr_matrix:
    """How each raw coordinate twists each shaft, on the motor's side, shape (drives, raw)."""
    found = sp.lil_matrix((len(drives), model.motion.raw))
    for i, drive in enumerate(drives):
        for node, sign in ((drive.node, 1.0), (drive.against, -1.0)):
            if node is not None:
                first = 6 * model.structure.number(node) + drive.column
                found[i, first : first + 3] = sign * drive.effective_ratio * np.asarray(drive.direction)
        found[i, model.motion.source_base + model.structure.drives.index(drive)] = -1.0
    return found.tocsr()


def stiffest(model: Plant) -> tuple[str, float]:
    """Return the name and the stiffness [N/m] of the stiffest line; 0 for none.

    Parameters
    ----------
    model : Plant

    Returns
    -------
    str, float
    """
    return max(((p.name, _stiffness(p)) for p in _lines(model)), key=lambda found: found[1], default=("", 0.0))


def noise(model: Plant) -> float:
    """Return what force the last digits of places make in the stiffest line [N].

    Parameters
    ----------
    model : Plant

    Returns
    -------
    float
    """
    reach = max(model.structure.size, float(np.abs(model.rest.x).max(initial=0.0)))
    return DIGITS * stiffest(model)[1] * reach
