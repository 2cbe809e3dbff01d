"""The command line: ``flexctrl COMMAND SCENE``."""

from __future__ import annotations

import os

# many small solves follow one another: BLAS threads would only get in each other's way
for _threads in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_threads, "1")

from flexctrl.cli.program import main  # noqa: E402

__all__ = ["main"]
