"""Large motion."""

from __future__ import annotations

from flexctrl.effects.effect import Effect
from flexctrl.frozen import frozen


@frozen
class LargeRotation(Effect):
    """Parts may move and turn as far as they like: element frames ride along (Crisfield, Galvanetto & Jelenić 1997).

    Without it the model is the linear one about the shape at rest, without prestress: K stays as
    assembled (a hanging chain then has no pendulum stiffness; linearise a large-rotation model for that).
    """
