"""Made-up rates on a straight line, but for one recording: the audit of its label."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from spikecam_env.gap.baseline.label_audit import wrong_label
from spikecam_env.gap.settings import DiagnosisSettings

LEVELS = {"dark": 0.0, "flat-1": 0.05, "flat-2": 0.1, "flat-3": 0.2, "flat-4": 0.3, "flat-5": 0.45, "flat-6": 0.6}
PIXELS = 2001
DARK = 0.01
SPREAD = np.sqrt(3.0) * np.linspace(-1.0, 1.0, PIXELS)
"""Of pixels: even, with half of the middle 68 % of them 0.68 sqrt(3)."""


def wrong_labels(
    which: str, off: float, spread: float = 0.0, irregular: float = 0.0, settings: DiagnosisSettings | None = None
) -> list[str]:
    """Names of wrong labels, where the rates of `which` are off by a share, differently in pixels, with irregular
    intervals as a share of all."""
    conditions = [SimpleNamespace(name=n, kind="flat" if x else "dark", level=x) for n, x in LEVELS.items()]
    observations = []
    for c in conditions:
        share = off * (1.0 + spread * SPREAD / (0.68 * np.sqrt(3.0))) if c.name == which else np.zeros(PIXELS)
        count = np.full(PIXELS, 1000)
        odd = np.full(PIXELS, 1000 * irregular if c.name == which else 0.0)
        rate = (c.level + DARK) * (1.0 + share)
        times = SimpleNamespace(count=count)
        observations.append(SimpleNamespace(rate=rate, times=times, short=odd, long=np.zeros(PIXELS)))
    base = SimpleNamespace(live=np.ones(PIXELS, bool), gain=np.ones(PIXELS), dark=np.full(PIXELS, DARK))
    case = SimpleNamespace(conditions=conditions, observations=observations, base=base,
                           settings=settings or DiagnosisSettings())  # fmt: skip
    return [name for c in wrong_label(case, set()) for name in c.recordings]
