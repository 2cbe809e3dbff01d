"""Ctrl-C during one run of a study: no other run of it begins."""

from __future__ import annotations

from flexctrl.dynamics.run import Run, Status

__all__ = ["unstopped"]


def unstopped(run: Run) -> Run:
    """Return a run that was not stopped.

    Parameters
    ----------
    run : Run

    Returns
    -------
    Run

    Raises
    ------
    KeyboardInterrupt
        If it was: what is run next would take what there is of it for all of it.
    """
    if run.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    return run
