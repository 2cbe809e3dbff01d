"""Sequences of states that are made when they are looked at: most runs are never drawn."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import overload

import numpy as np

from flexctrl.model.state import State

__all__ = ["Frames", "Later", "times"]


class _Made(Sequence[State]):
    """States of which nothing but their number is known before one of them is looked at."""

    @abstractmethod
    def made(self) -> list[State]:
        """Make them."""

    @cached_property
    def _states(self) -> list[State]:
        return self.made()

    def __reduce__(self) -> tuple[type[tuple[State, ...]], tuple[list[State]]]:
        return tuple, (list(self),)

    @overload
    def __getitem__(self, at: int) -> State: ...

    @overload
    def __getitem__(self, at: slice) -> list[State]: ...

    def __getitem__(self, at: int | slice) -> State | list[State]:
        return self._states[at]

    def __iter__(self) -> Iterator[State]:
        return iter(self._states)


class Later(_Made):
    """States still to be made.

    Parameters
    ----------
    table : numpy.ndarray, shape (states, numbers)
        A row of each; the last number is its time [s].
    make : callable
        Makes the states of rows.
    """

    def __init__(self, table: np.ndarray, make: Callable[[np.ndarray], list[State]]) -> None:
        self.table, self.make = table, make

    @classmethod
    def joined(cls, parts: Sequence[Later]) -> Later:
        """Return them as one: the states of one machine whose contacts do the same in all of them."""
        return parts[0] if len(parts) == 1 else cls(np.concatenate([part.table for part in parts]), parts[0].make)

    def __len__(self) -> int:
        return len(self.table)

    @overload
    def __getitem__(self, at: int) -> State: ...

    @overload
    def __getitem__(self, at: slice) -> list[State]: ...

    def __getitem__(self, at: int | slice) -> State | list[State]:
        if isinstance(at, slice) or "_states" in vars(self):
            return super().__getitem__(at)
        return self.make(self.table[at][None])[0]  # one of many alone

    @property
    def times(self) -> np.ndarray:
        """Of all of them [s]."""
        return self.table[:, -1]

    @property
    def last(self) -> float:
        """Time of the last one [s]."""
        return float(self.table[-1, -1])

    @cached_property
    def newest(self) -> State:
        """The last one, without all others."""
        return self.make(self.table[-1:])[0]

    def picked(self, which: slice | np.ndarray) -> Later:
        """Return some of them."""
        return Later(self.table[which], self.make)

    def made(self) -> list[State]:
        """Make them."""
        return self.make(self.table)


class Frames(_Made):
    """Some states of a run, in parts."""

    def __init__(self) -> None:
        self.parts: list[Sequence[State]] = []
        self.last = -float("inf")

    def append(self, state: State) -> None:
        """Take up a state."""
        self.take((state,))

    def take(self, states: Sequence[State]) -> None:
        """Take up states."""
        if len(states):
            self.parts.append(states)
            self.last = states.last if isinstance(states, Later) else states[-1].t
            self.__dict__.pop("_states", None)

    def __len__(self) -> int:
        return sum(map(len, self.parts))

    def made(self) -> list[State]:
        """Put the parts together."""
        return [state for part in self.parts for state in part]


def times(states: Sequence[State]) -> Sequence[float]:
    """Return the times of states, which need not be made for that [s]."""
    return states.times.tolist() if isinstance(states, Later) else [state.t for state in states]
