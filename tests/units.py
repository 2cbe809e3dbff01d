"""Units other than those of SI, to tell that results do not depend on them."""

from __future__ import annotations

from dataclasses import dataclass

import flexctrl as fc

__all__ = ["OTHERS", "SI", "Units"]


@dataclass(frozen=True)
class Units:
    """How many of the unit make one of SI."""

    length: float
    mass: float
    time: float

    @property
    def force(self) -> float:
        return self.mass * self.length / self.time**2

    def section(self, EA: float, EI: float, GJ: float, rhoA: float, rhoJ: float) -> fc.Section:
        stiff, bent = self.force, self.force * self.length**2
        heavy, turned = self.mass / self.length, self.mass * self.length
        return fc.Section(EA * stiff, EI * bent, EI * bent, GJ * bent, rhoA * heavy, rhoJ * turned)

    def gravity(self) -> fc.Gravity:
        return fc.Gravity((0, 0, -9.81 * self.length / self.time**2))


SI = Units(1.0, 1.0, 1.0)
OTHERS = {"mm, t, s": Units(1e3, 1e-3, 1.0), "µm, µg, ms": Units(1e6, 1e9, 1e3)}
