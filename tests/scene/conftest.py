"""Scene files written for a test."""

from __future__ import annotations

import pytest
from scenes import TROLLEY

from flexctrl.scene import load_scene


@pytest.fixture
def written(tmp_path):
    def write(text: str, name: str = "scene.toml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.fixture
def trolley(written):
    return load_scene(written(TROLLEY))
