"""The smallest set of effects that keeps an answer, and is no dearer than a larger one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from flexctrl.study.omissions import Omission
from flexctrl.study.trials import Bench, Refused, Trial

__all__ = ["Choice", "all_kept", "smallest"]

DEARER, SAVES_NOTHING = "dearer without it", "as much to compute without it"
_CHEAPER = 0.95


@dataclass
class Choice:
    """What is left out, and the run without it.

    Attributes
    ----------
    gone : list of Omission
    trial : Trial
    cheapest : Trial
        Of all that were gone over to: small steps up may not add up.
    stays : dict of str to str
        Why an effect stays that the answer could do without.
    """

    gone: list[Omission]
    trial: Trial
    cheapest: Trial
    stays: dict[str, str] = field(default_factory=dict)

    @property
    def names(self) -> frozenset[str]:
        """Of what is left out."""
        return frozenset(o.name for o in self.gone)


def smallest(bench: Bench, items: Sequence[Omission], exact: bool) -> Choice:
    """Return what can be left out together.

    From the full scene, or the one that is linear if that is quicker, what keeps the answer alone is left out
    together, first what there is less to compute without: all of it, or halves of it where it does more together. Then
    everything that is left is tried once more, one by one, until none can go: one may undo what another does. At last
    everything that is gone is put back, one by one, where the run is cheaper with it, until nothing more changes: what
    went with others may cost more than they save.

    Parameters
    ----------
    bench : Bench
    items : sequence of Omission
    exact : bool
        Whether linear equations are integrated exactly, or by the scene's own method.

    Returns
    -------
    Choice
    """
    return _Search(bench, items, exact).found()


def all_kept(bench: Bench, items: Sequence[Omission], choice: Choice) -> Choice:
    """Return the full set in the place of one that is no faster, with why there stays what the answer could do without.

    Parameters
    ----------
    bench : Bench
    items : sequence of Omission
    choice : Choice
        The set that is no faster.

    Returns
    -------
    Choice
    """
    search = _Search(bench, items, exact=False)
    known = choice.stays | dict.fromkeys(choice.names, DEARER)
    alone = {o.name: DEARER if o.spares else SAVES_NOTHING for o in items if search.bears(o)}
    return Choice([], bench.full, bench.full, alone | known)


class _Search:
    def __init__(self, bench: Bench, items: Sequence[Omission], exact: bool) -> None:
        self.bench, self.items, self.exact = bench, items, exact
        self.undone: set[frozenset[str]] = set()

    def found(self) -> Choice:
        choice = self._start()
        alone = {o.name: self._excess(o) for o in self.items}
        order = sorted(self.items, key=lambda o: (not self._saves(o), alone[o.name]))
        can_go = [o for o in order if alone[o.name] <= 1.0 and o.spares]
        self._extend(choice, [o for o in can_go if self._saves(o)])
        self._extend(choice, can_go)
        while True:
            while sum(self._goes(choice, o) for o in order):
                pass  # one may go now that another has
            if not sum(self._comes_back(choice, o) for o in tuple(choice.gone)):
                return choice

    def _start(self) -> Choice:
        """The full scene, or the one with the fewest left out that is linear, whichever is quicker."""
        full = self.bench.holding([], self.exact) or self.bench.full
        found = Choice([], full, full)
        if not self.exact or found.trial.modes is not None:
            return found
        for gone in [self._bundle(o, ()) for o in self.items]:
            if not self.bench.linear(gone):
                continue
            trial = self.bench.holding(gone, self.exact)
            if trial is not None and not self.bench.cheaper(found.trial, trial):
                found = Choice(gone, trial, trial)
        return found

    def _excess(self, omission: Omission) -> float:
        trial = self.bench.without(self._bundle(omission, ()))
        return float("inf") if isinstance(trial, Refused) else self.bench.excess(trial)

    def bears(self, omission: Omission) -> bool:
        """Whether the full answer can do without one thing alone."""
        return self._excess(omission) <= 1.0

    def _saves(self, omission: Omission) -> bool:
        """Whether there is less to compute without it alone."""
        trial = self.bench.without(self._bundle(omission, ()))
        return not isinstance(trial, Refused) and _cheaper(trial, self.bench.full)

    def _bundle(self, omission: Omission, gone: Sequence[Omission]) -> list[Omission]:
        """One more to leave out, and before it what cannot be without it."""
        names = {o.name for o in gone}
        before = [o for o in self.items if o.name in omission.first and o.name not in names]
        return [*gone, *before, *([] if omission.name in names else [omission])]

    def _extend(self, choice: Choice, some: Sequence[Omission]) -> None:
        """Leave out all of some, or as many of each half as can go."""
        some = [o for o in some if o.name not in choice.names]
        gone = choice.gone
        for omission in some:
            gone = self._bundle(omission, gone)
        if not some or self._taken(choice, gone) or len(some) == 1:
            return
        half = (len(some) + 1) // 2
        self._extend(choice, some[:half])
        self._extend(choice, some[half:])

    def _goes(self, choice: Choice, omission: Omission) -> bool:
        """Leave out one more, if it can go and is worth it; note why not, if it can."""
        if omission.name in choice.names or not omission.is_in(choice.trial.scene):
            return False
        gone = self._bundle(omission, choice.gone)
        trial = self.bench.holding(gone, self.exact)
        if trial is None:
            choice.stays.pop(omission.name, None)
            return False
        if not omission.spares and not _cheaper(trial, choice.trial):
            choice.stays[omission.name] = SAVES_NOTHING
            return False
        if self._taken(choice, gone):
            return True
        choice.stays[omission.name] = DEARER
        return False

    def _taken(self, choice: Choice, gone: list[Omission]) -> bool:
        """Go over to a larger set of what is left out, if it holds and is not dearer."""
        trial = self.bench.holding(gone, self.exact)
        if trial is None or frozenset(o.name for o in gone) in self.undone:
            return False
        if self.bench.cheaper(choice.cheapest, trial):
            return False
        self._go_over(choice, gone, trial)
        for name in choice.names:
            choice.stays.pop(name, None)
        return True

    def _comes_back(self, choice: Choice, omission: Omission) -> bool:
        """Put back what has gone, and what cannot go before it, if the run is cheaper with it."""
        gone = [o for o in choice.gone if o is not omission and omission.name not in o.first]
        if omission.name not in choice.names or not omission.is_in(self.bench.scene(gone)):
            return False
        trial = self.bench.holding(gone, self.exact)
        if trial is None or not self.bench.cheaper(trial, choice.trial):
            return False
        before = choice.names
        self.undone.add(before)
        self._go_over(choice, gone, trial)
        choice.stays |= dict.fromkeys(before - choice.names, DEARER)
        return True

    def _go_over(self, choice: Choice, gone: list[Omission], trial: Trial) -> None:
        choice.gone, choice.trial = gone, trial
        if self.bench.cheaper(trial, choice.cheapest):
            choice.cheapest = trial


def _cheaper(trial: Trial, other: Trial) -> bool:
    """By what is counted."""
    if trial.modes is not None and other.modes is not None:
        return trial.modes < other.modes
    return trial.size.work < _CHEAPER * other.size.work
