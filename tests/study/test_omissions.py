"""What the ledger leaves out has the names that scenes give it."""

from __future__ import annotations

import pytest

from flexctrl.scene.physics import EFFECTS
from flexctrl.study.omissions import snake


@pytest.mark.parametrize("name", EFFECTS)
def test_effects_have_one_name(name):
    assert snake(EFFECTS[name].make) == name
