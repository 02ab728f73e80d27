"""Before torch is imported: its threads must not spin while they wait, tests share their cores with other work."""

from __future__ import annotations

import os

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
