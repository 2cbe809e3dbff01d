"""``python -m flexctrl``."""

from __future__ import annotations

import sys

from flexctrl.cli.program import main

sys.exit(main())
