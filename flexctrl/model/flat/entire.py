"""Machines of few freedoms as a few kernels: accelerations of all of it at once, and where all of it ends up.

Beams in a few modes are stiff for most steps, so of machines with such the forces are drawn up, not the accelerations;
and only where nodes follow others, which is done one after the other, while pieces are computed side by side.

The kernels are drawn up by running the flat model once more on symbols: on the workspace as casadi expressions, with
pieces and levers that write down what they compute. What is 0 or ±1 in every pose (a girder that only yaws tilts no
axis) is such a number then, and whatever is multiplied by it falls away. Mass matrix and the forces beside it follow
by differentiation; it is eliminated in place.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from flexctrl.frozen import frozen
from flexctrl.kernels.kernel import Kernel, Run
from flexctrl.model.flat.flat import clear, drive, energy, load, place, pull, push
from flexctrl.model.flat.tiles import NO_TILES
from flexctrl.model.flat.workspace import HIDDEN, Flat
from flexctrl.model.laws.kinds import DRIVE_SLOT, NODE_SLOT

if TYPE_CHECKING:
    import casadi as ca

    from flexctrl.model.flat.layout import Layout

__all__ = ["Entire", "entire_of"]

_Drawn = tuple[Kernel, np.ndarray, np.ndarray, np.ndarray]
"""A kernel, what it reads, its parameters, and where it writes."""

_FREEDOMS, _BENDING = 12, 24
_LARGE, _MOST = 10000, 5000
"""Instructions of pieces and levers; of the kernel of accelerations: beyond, there is nothing to be gained."""
_TURN = 2.0 * np.pi
_MARKED = (0.0, 1.0, -1.0)
_SOUND = 1e-9
"""Least pivot of the mass matrix over the diagonal."""


@frozen(eq=False)
class Entire:
    """The kernels of a machine.

    Attributes
    ----------
    runs : tuple of Run
        Accelerations (or forces) from the pose at the start of a step, the step, and rates at its end; slots of nodes
        and drives at the end of a step; forces of the inputs, energies, and the dissipated power alone, from slots.
        None: the machine is no such one.
    cells : numpy.ndarray of int
        Entries of poses that never change.
    values : numpy.ndarray
        What they are.
    pressing : bool
        Whether the first kernel gives forces.
    """

    runs: tuple[Run, ...]
    cells: np.ndarray
    values: np.ndarray
    pressing: bool = False


_NONE = Entire((), np.zeros(0, dtype=int), np.zeros(0))


def entire_of(layout: Layout) -> Entire:
    """Return the kernels of a model; none if it is large, bends but in component modes, or has others of first order.

    Parameters
    ----------
    layout : Layout

    Returns
    -------
    Entire
    """
    model, motion = layout.model, layout.motion
    modal = bool(motion.inner.size) and all(i.order == 2 for i in motion.effects)
    if not model.large or not 0 < motion.n <= (_BENDING if modal else _FREEDOMS):
        return _NONE
    apt = (
        not motion.plain
        and not layout.long
        and not (motion.linkage.loops if modal else motion.inner.size or motion.flows.size)
    )
    if not apt:
        return _NONE
    pieces = sum(f.count * f.kernels.force.instructions for f in model.forces.families)
    if pieces + motion.linkage.kernels[0].instructions > _LARGE:
        return _NONE
    drawing = _Drawing(layout)
    return drawing.made(modal) if modal or drawing.sound() else _NONE


@frozen(eq=False)
class _Piece:
    """A kernel that writes down what it computes."""

    kernel: Kernel
    gather: np.ndarray
    params: np.ndarray
    scatter: np.ndarray

    def __call__(self, z: np.ndarray, r: np.ndarray) -> None:
        import casadi as ca

        function = self.kernel.function()
        for cells, p, goals in zip(self.gather, self.params, self.scatter, strict=True):
            found = ca.vertsplit(function(ca.vertcat(*z[cells]), ca.vertcat(ca.SX(0, 1), *p)))
            for goal, value in zip(goals, found, strict=True):
                r[goal] = value if self.kernel.replaces or _nothing(r[goal]) else r[goal] + value


class _Pieces:
    """A backend whose runs write down what they compute; parameters are symbols, but for those that are 0 or ±1."""

    def __init__(self) -> None:
        self.symbols: list[ca.SX] = []
        self.values: list[float] = []

    def bind(self, kernel: Kernel, gather: np.ndarray, params: np.ndarray, scatter: np.ndarray) -> _Piece:
        rows = [[self._symbol(float(value)) for value in row] for row in params]
        table = np.empty((len(gather), params.shape[1]), dtype=object)
        for i, row in enumerate(rows):
            table[i, :] = row
        return _Piece(kernel, np.asarray(gather), table, np.asarray(scatter))

    def _symbol(self, value: float) -> Any:
        import casadi as ca

        if value in _MARKED:
            return value
        self.symbols.append(ca.SX.sym(f"p{len(self.symbols)}"))
        self.values.append(value)
        return self.symbols[-1]


class _Drawing:
    """The flat model on symbols."""

    def __init__(self, layout: Layout) -> None:
        import casadi as ca

        self.layout, self.pieces = layout, _Pieces()
        drawn: Any = copy(layout)
        drawn.backend = self.pieces
        drawn.__dict__.pop("runs", None)
        self.runs: dict[str, Any] = drawn.runs
        self.cells = [ca.SX.sym(f"z{i}") for i in range(layout.length)]
        self.blank = np.empty(layout.length, dtype=object)
        for i, cell in enumerate(self.cells):
            self.blank[i] = cell
        self.numbers = {k: self._plain(v) for k, v in (layout.numbers | layout.tables).items()}
        rest = np.hstack([layout.model.rest.x, layout.model.rest.R.reshape(-1, 9)]).ravel()
        self.moving: frozenset[int] = frozenset()
        self.fixed = self._lasting({i: float(value) for i, value in enumerate(rest) if value in _MARKED})

    @staticmethod
    def _plain(value: Any) -> Any:
        """Numbers that do not draw symbols into arrays."""
        is_real = isinstance(value, np.ndarray) and value.dtype.kind == "f"
        return np.array(value.tolist(), dtype=object) if is_real else value

    def workspace(self, fixed: dict[int, float], nodes_placed: bool) -> Flat:
        """A workspace of symbols; slots hold the poses at the start, or, once placed, symbols of their own."""
        layout = self.layout
        z = self.blank.copy()
        start, nodes = layout.starts["pose"], layout.numbers["nodes"]
        for i in range(12 * nodes):
            slot = NODE_SLOT * (i // 12) + i % 12
            z[start + i] = fixed.get(i, z[start + i])
            z[slot] = fixed.get(i, z[slot]) if nodes_placed else z[start + i]
        for i in range(nodes):
            for k in range(NODE_SLOT * i + 12, NODE_SLOT * (i + 1)):
                z[k] = z[k] if nodes_placed and k in self.moving else 0.0
        part: dict[str, Any] = {
            name: z[s : s + layout.sizes[name]] for name, s in layout.starts.items() if name not in HIDDEN
        }
        return Flat(z=z, **part, **self.numbers, **self.runs, tiles=NO_TILES)

    def _lasting(self, fixed: dict[int, float]) -> dict[int, float]:
        """Those entries of poses that stay what they are wherever the machine goes."""
        while True:
            f = self.workspace(fixed, False)
            self.placed(f)
            kept = {i: value for i, value in fixed.items() if _is(f.z[NODE_SLOT * (i // 12) + i % 12], value)}
            if len(kept) == len(fixed):
                return fixed
            fixed = kept

    def placed(self, f: Flat) -> None:
        """Place nodes and drives."""
        import casadi as ca

        place(replace(f, drives=0))
        clear(f.drives, f.found)
        clear(f.drives, f.about)
        for run in f.winding:
            run(f.z, f.z)
        for i in range(f.drives):
            slot = f.z[f.drive_base + DRIVE_SLOT * i :]
            slot[3] = 0.0
            if f.rotary[i]:
                turns = (f.driven[i] + f.about[i] - f.found[i]) / _TURN
                f.found[i] = f.found[i] + _TURN * ca.floor(turns + 0.5)
                slot[3] = ca.floor(f.found[i] / _TURN + 0.5)
            own = f.q[f.shafts[i]] + f.step[f.shafts[i]]
            slot[0] = f.ratios[i] * f.found[i] if f.rigid[i] else own
        for i in range(f.drives, f.drives + f.inner):
            f.z[f.drive_base + DRIVE_SLOT * i] = f.q[f.shafts[i]] + f.step[f.shafts[i]]

    def made(self, pressing: bool) -> Entire:
        """The kernels, bound, the first of them giving accelerations or forces; none if they are too large."""
        first = self._pressing() if pressing else self._accelerating()
        if first[0].instructions > _MOST:
            return _NONE
        arriving = self._arriving()
        start = self.layout.starts["pose"]
        cells = np.array(sorted(self.fixed), dtype=int)
        found = (first, arriving, self._pulling(), self._booking(range(3)), self._booking([2]))
        runs = tuple(self.layout.model.backend.bind(*one) for one in found)
        return Entire(runs, start + cells, np.array([self.fixed[int(i)] for i in cells]), pressing)

    def _pressed(self) -> Flat:
        """All forces at the end of a step."""
        f = self.workspace(self.fixed, False)
        if f.linking:
            first: Any = f.placing[0]
            f = replace(f, placing=(replace(first, kernel=self.layout.motion.linkage.freely),))
        load(f)
        self.placed(f)
        drive(f)
        push(f)
        return f

    def balance(self) -> tuple[ca.SX, ca.SX]:
        """Mass matrix, and the forces without accelerations."""
        import casadi as ca

        n, start = self.layout.motion.n, self.layout.starts["rate"]
        rates = ca.vertcat(*self.cells[start : start + n])
        moving = ca.vertcat(*self._pressed().force[:n])
        return -ca.jacobian(moving, rates), ca.substitute(moving, rates, ca.SX.zeros(n))

    def sound(self) -> bool:
        """Tell whether every freedom has mass, at rest."""
        import casadi as ca

        self.mass, self.still = self.balance()
        inputs = ca.symvar(self.mass)
        values = self._values_at_rest()
        given = [values[s.name()] for s in inputs]
        M = np.array(ca.Function("mass", inputs, [self.mass]).call(given)[0], dtype=float)
        if not (np.isfinite(M).all() and (np.diag(M) > 0.0).all()):
            return False
        scale = 1.0 / np.sqrt(np.diag(M))
        return bool(np.linalg.eigvalsh(0.5 * (M + M.T) * np.outer(scale, scale)).min() > _SOUND)

    def _values_at_rest(self) -> dict[str, float]:
        layout, rest = self.layout, self.layout.model.rest
        z = np.zeros(layout.length)
        start = layout.starts["pose"]
        pose = np.hstack([rest.x, rest.R.reshape(-1, 9)]).ravel()
        z[start : start + pose.size] = pose
        named = {s.name(): float(v) for s, v in zip(self.cells, z, strict=True)}
        return named | {s.name(): v for s, v in zip(self.pieces.symbols, self.pieces.values, strict=True)}

    def _accelerating(self) -> _Drawn:
        start = self.layout.starts["answer"]
        rates = _eliminated(self.mass, self.still)
        return self._drawn("accelerating", [(start + i, rates[i]) for i in range(rates.numel())])

    def _pressing(self) -> _Drawn:
        start, force = self.layout.starts["force"], self._pressed().force
        return self._drawn("pressing", [(start + i, force[i]) for i in range(self.layout.motion.n)])

    def _arriving(self) -> _Drawn:
        f = self.workspace(self.fixed, False)
        before = f.z.copy()
        self.placed(f)
        drive(f)
        node = [NODE_SLOT * i + k for i in range(f.nodes) for k in range(18 if not self._closes else NODE_SLOT)]
        drives = [f.drive_base + DRIVE_SLOT * i + k for i in range(f.drives + f.inner) for k in (0, 1, 3)]
        found = [self.layout.starts["found"] + i for i in range(f.drives)]
        changed = [c for c in (*node, *drives, *found) if _changed(f.z[c], before[c])]
        self.moving = frozenset(changed)
        return self._drawn("arriving", [(c, f.z[c]) for c in changed])

    @property
    def _closes(self) -> bool:
        """Whether loops are closed, whose accelerations are looked at."""
        return bool(self.layout.motion.linkage.loops)

    def _pulling(self) -> _Drawn:
        f = self.workspace(self.fixed, True)
        load(f)
        pull(f)
        start = self.layout.starts["force"]
        return self._drawn("pulling", [(start + i, f.force[i]) for i in range(f.n)])

    def _booking(self, entries: Sequence[int]) -> _Drawn:
        f = self.workspace(self.fixed, True)
        energy(f)
        start = self.layout.starts["books"]
        return self._drawn("booking", [(start + i, f.books[i]) for i in entries])

    def _drawn(self, name: str, results: Sequence[tuple[int, Any]]) -> _Drawn:
        """A kernel of what is found, on the symbols it takes, and its tables."""
        import casadi as ca

        outputs = ca.vertcat(ca.SX(0, 1), *[value for _, value in results])
        used = {s.name() for s in ca.symvar(outputs)}
        cells = [i for i, s in enumerate(self.cells) if s.name() in used]
        known = [k for k, s in enumerate(self.pieces.symbols) if s.name() in used]
        inputs = ca.vertcat(ca.SX(0, 1), *[self.cells[i] for i in cells])
        params = ca.vertcat(ca.SX(0, 1), *[self.pieces.symbols[k] for k in known])
        kernel = Kernel(name, inputs, params, outputs, replaces=True)
        values = np.array([[self.pieces.values[k] for k in known]]).reshape(1, len(known))
        goals = np.array([[goal for goal, _ in results]], dtype=int)
        return kernel, np.array([cells], dtype=int), values, goals


def _is(expression: Any, value: float) -> bool:
    """Tell whether an expression is a number, whatever its symbols are."""
    if isinstance(expression, float | int):
        return expression == value
    return bool(expression.is_constant() and float(expression) == value)


def _changed(after: Any, before: Any) -> bool:
    """Tell whether an entry has been written anew."""
    import casadi as ca

    if after is before:
        return False
    return not _is(after, before) if isinstance(before, float) else not ca.is_equal(ca.SX(after), before, 2)


def _nothing(expression: Any) -> bool:
    return isinstance(expression, float) and expression == 0.0


def _eliminated(mass: ca.SX, force: ca.SX) -> ca.SX:
    """Solve with a symmetric matrix, by L D Lᵀ without exchange of rows."""
    import casadi as ca

    n = force.numel()
    L = [[ca.SX(mass[i, j]) for j in range(n)] for i in range(n)]
    x = [ca.SX(force[i]) for i in range(n)]
    pivots = []
    for k in range(n):
        inverse = 1.0 / L[k][k]
        pivots.append(inverse)
        for i in range(k + 1, n):
            if _is(L[i][k], 0.0):
                continue
            share = L[i][k] * inverse
            for j in range(k + 1, i + 1):
                L[i][j] = L[i][j] - share * L[j][k]
            x[i] = x[i] - share * x[k]
    for k in reversed(range(n)):
        x[k] = (x[k] - sum((L[i][k] * x[i] for i in range(k + 1, n)), ca.SX(0))) * pivots[k]
    return ca.vertcat(*x)
