"""Before torch is imported: its threads must not spin long while they wait, tests share their cores with other work."""

from __future__ import annotations

import os

os.environ.setdefault("GOMP_SPINCOUNT", "10000")
