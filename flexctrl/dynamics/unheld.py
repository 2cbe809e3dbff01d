"""What is said of a freedom that neither mass nor force holds."""

from __future__ import annotations

from flexctrl.model.model import Model
from flexctrl.model.plant import Plant

__all__ = ["bare", "needed"]


def bare(model: Plant, freedom: int) -> str:
    """Return the name of the drive whose motor a freedom is, if that has no inertia; else nothing.

    Parameters
    ----------
    model : Plant
    freedom : int

    Returns
    -------
    str
    """
    drives = model.structure.drives if isinstance(model, Model) else ()
    motors = {f"{drive.name}_source": drive.name for drive in drives if drive.inertia == 0.0}
    return motors.get(model.coordinates[freedom], "")


def needed(model: Plant, freedom: int) -> str:
    """Return what to do about a freedom with neither mass nor stiffness.

    Parameters
    ----------
    model : Plant
    freedom : int

    Returns
    -------
    str
    """
    if drive := bare(model, freedom):
        return (
            f"nothing holds the motor of {drive!r} where its shaft or rope bears nothing: give the drive its inertia="
        )
    return "hold it with a Support, or give the part rotary inertia (rhoJ, rhoI) or mass"
