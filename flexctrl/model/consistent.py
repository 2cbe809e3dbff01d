"""Whether a state is one that its machine can be in: ties hold, loops close, rotations are rotations."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from flexctrl.errors import StructureError, shortened
from flexctrl.model.motion import Motion
from flexctrl.model.state import Dry, State
from flexctrl.structure.relations import Copy, Turn

if TYPE_CHECKING:
    from flexctrl.model.model import Model

__all__ = ["Breach", "admitted", "breaches", "extent", "off_rails", "same_freedoms"]

_FAR = 1e15
_ALLOWED = 1e-8


class Breach(NamedTuple):
    """How far a state is from one the machine can be in: ``gap`` over its size [1], or rad; ``what`` says where."""

    gap: float
    what: str


def admitted(model: Model, state: State, owner: str) -> State:
    """Return a state if a machine can be in it, with the dry contacts that the machine has.

    Parameters
    ----------
    model : Model
    state : State
    owner : str
        Who asks, for the message.

    Returns
    -------
    State
        A brake that the state knows nothing of is loose in it: what it does is found as a run begins.

    Raises
    ------
    StructureError
        For a state of another machine, what is no finite number, and nodes out of the places that joints, supports
        and rigid parts leave them.
    """
    for name, shape in _shapes(model).items():
        found = np.shape(getattr(state, name))
        if found != shape:
            raise StructureError(
                f"{owner}: the state's {name} has the shape {found}, this machine's has {shape}: it is of another "
                "machine, or of the same under other effects"
            )
        if not np.isfinite(getattr(state, name)).all():
            raise StructureError(f"{owner}: the state's {name} holds what is no finite number")
        if (largest := np.abs(getattr(state, name)).max(initial=0.0)) >= _FAR:
            raise StructureError(
                f"{owner}: the state's {name} holds {largest:.3g}, outside any sensible range: numbers have 16 digits, "
                f"so nothing else of the machine would be seen beside it; expected values below {_FAR:g}"
            )
    same_freedoms(model, state, owner)
    worst = max(breaches(model, state), default=Breach(0.0, ""))
    if worst.gap > _ALLOWED:
        raise StructureError(
            f"{owner}: the machine cannot be in this state: {worst.what}; flexctrl.project(model, state) gives the "
            "nearest state it can be in and says what that changes"
        )
    count = model.rest.dry.phase.size
    return state if state.dry.phase.size == count else state.with_(dry=Dry.loose(count))


def same_freedoms(model: Model, state: State, owner: str) -> None:
    """Raise where a state is known to have other degrees of freedom than a machine, be they as many.

    Parameters
    ----------
    model : Model
    state : State
    owner : str
        Who asks, for the message.

    Raises
    ------
    StructureError
    """
    if state.freedoms and state.freedoms != model.coordinates:
        apart = shortened(sorted({*state.freedoms} ^ {*model.coordinates}) or ["their order"])
        raise StructureError(
            f"{owner}: the state's degrees of freedom are not this machine's ({apart} differ): it is of another "
            "machine, or of the same under other effects"
        )


def _shapes(model: Model) -> dict[str, tuple[int, ...]]:
    rest = model.rest
    return {name: np.shape(getattr(rest, name)) for name in ("x", "R", "q", "v", "driven")}


def breaches(model: Model, state: State) -> Iterator[Breach]:
    """Yield the worst breach of each kind of condition.

    Parameters
    ----------
    model : Model
    state : State

    Yields
    ------
    Breach
    """
    nodes, motion, size = model.structure.nodes, model.motion, extent(model, state)
    labels = [*map(str, nodes), "the ground"]
    off = np.abs(state.x - _expected(motion, state))
    yield _worst(off.max(axis=1) / size, lambda i: f"{labels[i]} is {off[i].max():.3g} m from where it is tied")
    skew = np.abs(np.einsum("nji,njk->nik", state.R, state.R) - np.eye(3)).max(axis=(1, 2))
    yield _worst(skew, lambda i: f"R of {labels[i]} is no rotation (Rᵀ R is off by {skew[i]:.3g})")
    turned = _turned(motion, state)
    yield _worst(turned, lambda i: f"{labels[i]} is turned by {turned[i]:.3g} rad against what it is tied to")
    yield from (Breach(gap / size, what) for gap, what in _beyond(model, state))
    if motion.drives and model.large:
        astray = np.abs(motion.unwound(state.x, state.R, state.driven) - state.driven)
        astray = astray / np.where(motion.rotary, 1.0, size)
        names = [d.name for d in motion.drives]
        yield _worst(astray, lambda i: f"drive {names[i]} is {astray[i]:.3g} from the coordinate it drives")
    if model.large and not motion.plain:
        yield from _linked(motion, state, labels, size)


def off_rails(model: Model, state: State) -> tuple[str, ...]:
    """Say which trolleys are beyond the ends of their rails.

    Parameters
    ----------
    model : Model
    state : State

    Returns
    -------
    tuple of str
    """
    allowed = _ALLOWED * extent(model, state)
    return tuple(what for gap, what in _beyond(model, state) if gap > allowed)


def _beyond(model: Model, state: State) -> Iterator[tuple[float, str]]:
    """How far each trolley is beyond the ends of its rail [m], in words too."""
    motion = model.motion
    for f in motion.tracks:
        place, length = float(state.x[motion.nodes[f.gauge], 0]), f.places[-1]
        gap, who = max(-place, place - length, 0.0), model.structure.nodes[motion.nodes[f.node]].part
        yield gap, f"{who} is {gap:.3g} m beyond an end of its rail, which is {length:g} m long"


def extent(model: Model, state: State) -> float:
    """Return what counts as the size of a machine in a state: itself, or how far it is from the origin [m].

    Parameters
    ----------
    model : Model
    state : State

    Returns
    -------
    float
    """
    return max(model.structure.size, float(np.abs(model.rest.x).max()), float(np.abs(state.x).max()))


def _worst(gaps: np.ndarray, say: Callable[[int], str]) -> Breach:
    worst = int(np.argmax(gaps))
    return Breach(float(gaps[worst]), say(worst))


def _free(motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Which nodal freedoms have a number of their own, and which are held, shape (nodes + 1, 6); kept with it."""
    found = motion.__dict__.get("_own_and_held")
    if found is None:
        found = motion.__dict__["_own_and_held"] = _own_and_held(motion)
    return found


def _own_and_held(motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    own = motion.place < motion.n
    held, linkage = ~own, motion.linkage
    closing = (linkage.cells >= linkage.free) & (linkage.cells < linkage.free + len(linkage.loops))
    held[motion.nodes] &= ~closing
    for f in linkage.follows:
        turns = isinstance(f, Turn) or (isinstance(f, Copy) and f.freedom == 3)
        written = slice(3, 6) if turns else slice(f.freedom, f.freedom + 1) if isinstance(f, Copy) else slice(0, 3)
        held[motion.nodes[f.node], written] = False
        own[motion.nodes[f.node], written] = False
    return own, held


def _expected(motion: Motion, state: State) -> np.ndarray:
    """Where the sums of the degrees of freedom put the nodes; where others do that, the place itself."""
    own, held = (mask[:, :3] for mask in _free(motion))
    moved = motion.rest.x + np.append(state.q - motion.rest.q, 0.0)[motion.place[:, :3]]
    return np.where(own | held, moved, state.x)


def _turned(motion: Motion, state: State) -> np.ndarray:
    """How far nodes are turned against those they share rotations with, or about an axis that is held."""
    own, held = (mask[:, 3:] for mask in _free(motion))
    first: dict[tuple[int, ...], int] = {}
    against = np.arange(len(own))
    for i in np.flatnonzero(own.all(axis=1)):
        against[i] = first.setdefault(tuple(motion.place[i, 3:].tolist()), int(i))
    gaps = np.abs(state.R - state.R[against]).max(axis=(1, 2))
    for axis in range(3):
        about = np.delete(held, axis, axis=1).all(axis=1)
        gaps[about] = np.maximum(gaps[about], np.abs(state.R[about][:, :, axis] - np.eye(3)[axis]).max(axis=1))
    return gaps


def _linked(motion: Motion, state: State, labels: list[str], size: float) -> Iterator[Breach]:
    """Followers against where their masters carry them, and loops."""
    pose = motion.pose(state)
    linkage, names = motion.linkage, [labels[n] for n in motion.nodes]
    gap = np.abs(linkage.gaps(pose)).max(initial=0.0) if linkage.loops else 0.0
    yield Breach(gap, f"loops of rigid parts are open by {gap:.3g} rad, or of what they span")
    off = np.abs(linkage.place(pose, np.zeros(linkage.free)) - pose.ravel()).reshape(-1, 12)
    off = np.nan_to_num(off, nan=0.0)
    off[:, :3] /= size
    yield _worst(
        off.max(axis=1),
        lambda i: (
            f"{names[i]} is not where the part that carries it holds it ({off[i].max():.3g} of the size of the machine)"
        ),
    )
