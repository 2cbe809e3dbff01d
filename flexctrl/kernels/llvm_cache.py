"""Object code kept between processes, in the user's cache directory.

A file is named by the hash of everything its code depends on: the whole assembly text, the versions
of llvmlite and LLVM, the processor. So an entry is never out of date, only unused. A file that cannot
be read, or whose contents do not match their own hash, is written anew; without a writable directory
code is compiled in every process.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

_KEPT = 256


def cache_directory() -> Path:
    """Return where object code is kept: ``kernels`` under flexctrl's part of the user's cache."""
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local"
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "flexctrl" / "kernels"


def stored(key: str, make: Callable[[], bytes]) -> bytes:
    """Return the object code kept for ``key``, or make it and keep it.

    Parameters
    ----------
    key : str
        All that the code depends on.
    make : callable
        Compiles it.
    """
    try:
        path = cache_directory() / hashlib.sha256(key.encode()).hexdigest()
    except RuntimeError:  # no home directory
        return make()
    image = _read(path)
    if not image:
        image = make()
        with suppress(OSError):
            _write(path, image)
    return image


def _read(path: Path) -> bytes:
    """Contents of a sound file of this user, else nothing."""
    try:
        if hasattr(os, "getuid") and path.stat().st_uid != os.getuid():
            return b""
        contents = path.read_bytes()
    except OSError:
        return b""
    digest, image = contents[:32], contents[32:]
    return image if hashlib.sha256(image).digest() == digest else b""


def _write(path: Path, image: bytes) -> None:
    """Write aside and rename, so that no reader sees half a file; drop the oldest above a number."""
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=path.parent, prefix=".", delete=False) as file:
        file.write(hashlib.sha256(image).digest() + image)
    os.replace(file.name, path)
    files = sorted(path.parent.iterdir(), key=lambda f: f.stat().st_mtime)
    for old in files[:-_KEPT]:
        old.unlink()
