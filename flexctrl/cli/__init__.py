"""The command line: ``flexctrl table|run|modes|bode|rlocus|compare SCENE``."""

from __future__ import annotations

from flexctrl.cli.program import main

__all__ = ["main"]
