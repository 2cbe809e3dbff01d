"""What each of several contacts bears that hold the same motion.

Where slip directions depend on each other, the equations of motion tell what contacts bear together, not their shares
λ. Contacts of rigid parts break loose when no shares are left that all of them bear, as plastic hinges do (lower bound
theorem: W. Prager, P. G. Hodge (1951): Theory of Perfectly Plastic Solids). So their shares are those of which the
largest |λ| / F is least, with F what a contact bears: of one freedom, contacts bear the sum of what they bear alone.
"""

from __future__ import annotations

import numpy as np

__all__ = ["evened", "led", "spare", "tied"]

_SAME = 1e-13
_TIED = 1e-9
_EDGES = 16


def spare(felt: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Tell which contacts slip only where stronger ones do.

    Parameters
    ----------
    felt : numpy.ndarray, shape (contacts, n)
        Slip directions, in motions measured by the mass of each degree of freedom.
    most : numpy.ndarray, shape (contacts,)
        What each bears [N or N m].

    Returns
    -------
    numpy.ndarray of bool, shape (contacts,)
    """
    sizes = np.linalg.norm(felt, axis=1)
    found, held = np.zeros(len(felt), dtype=bool), np.zeros((0, felt.shape[1]))
    for k in np.argsort(-most * sizes, kind="stable"):
        left = felt[k] / sizes[k] if sizes[k] > 0.0 else felt[k]
        for _ in range(2):
            left = left - held.T @ (held @ left)
        size = float(np.linalg.norm(left))
        if size <= _SAME:
            found[k] = True
        else:
            held = np.vstack([held, left / size])
    return found


def evened(felt: np.ndarray, borne: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Return what contacts bear, shared out so that the one that bears most of what it can bears least.

    Parameters
    ----------
    felt : numpy.ndarray, shape (contacts, n)
        As of `spare`.
    borne, most : numpy.ndarray, shape (contacts,)
        What they bear, shared out anyhow, and what each can [N or N m].

    Returns
    -------
    numpy.ndarray, shape (contacts,)
    """
    if len(felt) < 2:
        return borne
    felt = np.asarray(np.linalg.qr(felt.T, mode="r")).T  # as lengths and angles are, in few numbers
    borne = borne.copy()
    label = tied(felt)
    for group in (np.flatnonzero(label == g) for g in np.flatnonzero(np.bincount(label) > 1)):
        borne[group] = most[group] * _used(felt[group], borne[group], most[group])
    return borne


def tied(felt: np.ndarray) -> np.ndarray:
    """Return a number of each contact that is the same for those that share what they bear.

    Parameters
    ----------
    felt : numpy.ndarray, shape (contacts, n)
        As of `spare`.

    Returns
    -------
    numpy.ndarray of int, shape (contacts,)
        Which is the first of them.
    """
    across, _, rank = _directions(felt)
    others = across[:, rank:]  # what else they could bear to the same end
    beside = np.abs(others @ others.T) > _TIED
    return np.linalg.matrix_power(beside | np.eye(len(felt), dtype=bool), len(felt)).argmax(axis=1)  # over any number


def led(held: np.ndarray, felt: np.ndarray) -> np.ndarray:
    """Tell which contacts cannot slip where others do not.

    Parameters
    ----------
    held, felt : numpy.ndarray, shapes (others, n) and (contacts, n)
        As of `spare`.

    Returns
    -------
    numpy.ndarray of bool, shape (contacts,)
    """
    _, along, rank = _directions(held)
    left = felt - (felt @ along[:rank].T) @ along[:rank]
    return np.linalg.norm(left, axis=1) <= _TIED * np.linalg.norm(felt, axis=1)


def _directions(felt: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Singular vectors of slip directions of length one, and how many of these are independent."""
    sizes = np.linalg.norm(felt, axis=1)
    across, lengths, along = np.linalg.svd(felt / np.where(sizes > 0.0, sizes, 1.0)[:, None])
    return across, along, int((lengths > _SAME * len(felt)).sum())


def _used(felt: np.ndarray, borne: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Return which share of what it can each contact of a group bears: the largest of them is least."""
    _, along, rank = _directions(felt)
    along = along[:rank]
    q, r = np.linalg.qr(most[:, None] * (felt @ along.T), mode="complete")
    return _least(q[:, :rank] @ np.linalg.solve(r[:rank].T, along @ (felt.T @ borne)), q[:, rank:])


def _least(x: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """Return x + ways y with the least largest entry, the columns of ``ways`` being orthonormal.

    The largest is followed down where it falls most steeply, from one of its edges to the next, to where none goes on.
    """
    sizes, slopes = np.append(x, -x), np.vstack([ways, -ways])
    for _ in range(_EDGES * len(x)):
        largest = sizes.max()
        most = sizes >= (1.0 - _SAME) * largest
        change = slopes @ _down(slopes[most])
        ahead = ~most & (change > -1.0)
        if not change.any() or not ahead.any():
            break
        sizes = sizes + change * ((largest - sizes[ahead]) / (1.0 + change[ahead])).min()
    return sizes[: len(x)]


def _down(slopes: np.ndarray) -> np.ndarray:
    """Return the shortest y with slopes @ y <= -1, or zero if there is none.

    C. L. Lawson, R. J. Hanson (1974): Solving Least Squares Problems, ch. 23, least distance programming.
    """
    from scipy.optimize import nnls

    rows, one = np.vstack([-slopes.T, np.ones(len(slopes))]), np.append(np.zeros(slopes.shape[1]), 1.0)
    left = one - rows @ nnls(rows, one)[0]
    return -left[:-1] / left[-1] if np.linalg.norm(left) > _SAME else np.zeros(left.size - 1)
