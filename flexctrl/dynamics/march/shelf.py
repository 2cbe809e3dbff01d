"""States that loops have written down, row by row; see `flexctrl.dynamics.march.books.shelve`."""

from __future__ import annotations

import numpy as np

from flexctrl.model.flat.flattening import Flattened
from flexctrl.model.state import Dry, State

__all__ = ["row_of", "states_of", "width_of"]


def width_of(F: Flattened) -> int:
    """Return the length of a row: poses, degrees of freedom, rates, driven coordinates, angles of outputs, time."""
    f = F.flat
    return 12 * f.nodes + 2 * f.padded + f.drives + F.gauges.turning + 1


def states_of(F: Flattened, table: np.ndarray, dry: Dry) -> list[State]:
    """Return the states of rows, with contacts that do the same in all of them."""
    f, count, width = F.flat, *table.shape
    n, nodes = f.n, 12 * f.nodes
    poses = table[:, :nodes].reshape(count, -1, 12)
    x, R = poses[:, :, :3].copy(), poses[:, :, 3:].copy().reshape(count, -1, 3, 3)
    q, v = np.empty((2, count, n))
    q[:, F.plan.order] = table[:, nodes : nodes + n]
    v[:, F.plan.order] = table[:, nodes + f.padded : nodes + f.padded + n]
    driven, shown = np.split(table[:, nodes + 2 * f.padded : width - 1].copy(), [f.drives], axis=1)
    t = table[:, width - 1].tolist()
    return [State(x[i], R[i], q[i], v[i], driven[i], t[i], dry, shown[i]) for i in range(count)]


def row_of(F: Flattened, state: State) -> np.ndarray:
    """Return the row of a state."""
    pose = np.hstack([state.x, state.R.reshape(-1, 9)]).ravel()
    own = F.ordered(state.q), F.ordered(state.v), state.driven
    return np.concatenate([pose, *own, state.shown[: F.gauges.turning], [state.t]])
