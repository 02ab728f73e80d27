"""The array's rate through a recording."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from spikecam_env.gap.observe.conditions import STEADY
from spikecam_env.gap.report.panels import PlotPanel, largest, over_pixels, takes
from spikecam_env.gap.result import Evidence

TITLE = "Through the recording"
CAPTION = "The array's rate in sixteen parts of a recording, less the model's."


def panels(evidence: Evidence, frame_rate_hz: float) -> Iterator[PlotPanel]:
    """The rate of the array in sixteen parts of a recording."""
    made = []
    for t in takes(evidence, STEADY):
        if t.before.blocks.sum() < 100:
            continue
        curves = over_pixels(t, lambda o: o.blocks / max(o.blocks.mean(), 1e-9))
        parts = len(curves.measured)
        x = (np.arange(parts) + 0.5) * (t.measured.frames / parts) * 1e3 / frame_rate_hz
        title, ylabel = f"Rate through {t.shown.name}", "rate over its mean, less 1 [%]"
        made.append(PlotPanel(title, "time [ms]", ylabel, x, *curves.less_model(100)))
    yield from largest(made, 2)
