"""Free play in drives and springs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

from flexctrl.effects.effect import Effect
from flexctrl.effects.places import by_place, check_large, not_negative
from flexctrl.errors import StructureError, did_you_mean
from flexctrl.frozen import frozen
from flexctrl.structure.drives import Winch
from flexctrl.structure.lines import Spring
from flexctrl.structure.structure import Structure


@frozen
class Backlash(Effect):
    """Gears and springs with play: V = ½ k dz(ε)² with dz(ε) what the strain ε goes beyond ± half the gap.

    Within the gap neither stiffness nor damping acts; in contact the damper does not hold the sides together. The
    strain of a drive is that of its shaft, R θ_rel − θ_d: play of b at the joint is a gap of R b. It needs
    `LargeRotation`. A linear model is that of where the machine rests: pressed to one flank by its loads it
    contains the whole stiffness, within the gap none. A drive with a rigid shaft has no play, `Model.notes` says so.

    Parameters
    ----------
    gaps : mapping of str to float
        Drive → total gap ≥ 0 [rad of the motor]; spring → total gap [m]. Zero: no play, as if it were not named.

    Raises
    ------
    StructureError
        For a gap below zero; when the model is assembled, for a drive or spring that there is not.
    """

    gaps: tuple[tuple[str, float], ...]
    apart: ClassVar[bool] = True

    def __init__(self, gaps: Mapping[str, float]) -> None:
        object.__setattr__(self, "gaps", by_place(gaps, "Backlash", "gap", not_negative))

    def check_on(self, structure: Structure) -> None:
        """Look for every drive and spring."""
        gears = (d.name for d in structure.drives if not isinstance(d, Winch))
        springs = (p.name for p in structure.elements if isinstance(p, Spring))
        known = (*gears, *springs)
        for name, _ in self.gaps:
            if name not in known:
                raise StructureError(f"Backlash: there is no drive or spring {name!r}{did_you_mean(name, known)}")

    def left_out(self, structure: Structure, beside: Sequence[Effect]) -> tuple[str, ...]:
        """Play of drives with rigid shafts."""
        stiff = {d.name for d in structure.drives if not any(e.bends(d) for e in beside)}
        names = ", ".join(name for name, gap in self.gaps if gap and name in stiff)
        return (f"backlash of {names} is left out: a rigid shaft has no play",) if names else ()

    def check_beside(self, others: Sequence[Effect]) -> None:
        """A linear model has no gap."""
        if any(gap for _, gap in self.gaps):
            check_large(others, "Backlash")


def gaps_of(effects: Sequence[Effect]) -> dict[str, float]:
    """Return the gap of each drive and spring that has one."""
    return {name: gap for e in effects if isinstance(e, Backlash) for name, gap in e.gaps}


__all__ = ["Backlash", "gaps_of"]
