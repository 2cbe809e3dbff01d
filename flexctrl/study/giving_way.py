"""Whether a machine still bears a load, and the load at which it stops to."""

from __future__ import annotations

import numpy as np

from flexctrl.errors import EquilibriumError, LinearizationError
from flexctrl.linear.growth import growing
from flexctrl.model.equilibrium import Rest, equilibrium
from flexctrl.model.linearize import linearize
from flexctrl.model.paths.path import equilibrium_path
from flexctrl.structure.inputs import FollowerForce, FollowerTorque
from flexctrl.study.amplitudes import Case

__all__ = ["gives_way", "giving_way_between", "loaded"]

_SYMMETRIC = 1e-9


def loaded(case: Case, u: np.ndarray) -> Rest:
    """Return the equilibrium under additional inputs.

    Parameters
    ----------
    case : Case
    u : numpy.ndarray, shape (inputs,)

    Returns
    -------
    Rest
    """
    return equilibrium(case.model, inputs=_named(case, case.inputs + u), start=case.rest)


def gives_way(case: Case, rest: Rest, u: np.ndarray) -> bool:
    """Tell whether a loaded equilibrium is one that the machine leaves, though it stays in that without the load.

    It buckles where its stiffness has more negative directions than without the load. Under loads that follow it
    the stiffness is not symmetric, and it may flutter before: there its poles tell.

    Parameters
    ----------
    case : Case
    rest : Rest
        From `loaded`.
    u : numpy.ndarray, shape (inputs,)

    Returns
    -------
    bool
    """
    if not _follows(case, u) and rest.unstable <= loaded(case, 0.0 * u).unstable:
        return False
    try:
        now = linearize(case.model, at=rest)
    except LinearizationError:
        return True
    if abs(now.K - now.K.T).max() <= _SYMMETRIC * abs(now.K).max():
        return now.modes().unstable > case.linear.modes().unstable
    return growing(now) > growing(case.linear)


def _follows(case: Case, u: np.ndarray) -> bool:
    inputs = case.model.structure.inputs
    return any(
        value and isinstance(load, FollowerForce | FollowerTorque) for load, value in zip(inputs, u, strict=False)
    )


def giving_way_between(case: Case, u: np.ndarray) -> float:
    """Return the share of a load at which the machine, loaded gradually from rest, gives way first.

    Parameters
    ----------
    case : Case
    u : numpy.ndarray, shape (inputs,)

    Returns
    -------
    float
        Infinite if no limit or branch point is found up to the whole load, or if the load follows the machine: its
        path does not tell where that flutters.
    """
    if _follows(case, u):
        return np.inf
    try:
        path = equilibrium_path(case.model, _named(case, u), 1.0, _named(case, case.inputs), start=case.rest)
    except EquilibriumError:
        return np.inf
    return min((point.factor for point in (*path.limits, *path.branchings)), default=np.inf)


def _named(case: Case, u: np.ndarray) -> dict[str, float]:
    return dict(zip(case.model.inputs, u.tolist(), strict=True))
