"""One BLAS thread a worker: many small solves, several workers."""

import os
import sys
from collections.abc import Iterator

import pytest

for _threads in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_threads, "1")
os.environ.setdefault("MPLBACKEND", "Agg")

pytest_plugins = ("recording",)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that rewrites the pages of docs/validation; see tests/recorder.py."""
    parser.addoption("--validation-pages", action="store_true", help="rewrite docs/validation from the cases that run")


@pytest.fixture(autouse=True)
def _closed_figures() -> Iterator[None]:
    """Pictures of one test are not those that python-control draws into in the next."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
