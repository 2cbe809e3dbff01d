"""Ready-made machines: the paper's ceiling crane, an overhead crane of real size, a robot arm."""

from __future__ import annotations

from flexctrl.cranes.bridge_crane import bridge_crane
from flexctrl.cranes.ceiling_crane import ceiling_crane
from flexctrl.cranes.flexible_arm import flexible_arm

__all__ = ["bridge_crane", "ceiling_crane", "flexible_arm"]
