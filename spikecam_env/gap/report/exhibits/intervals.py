"""Intervals by length."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from spikecam_env.gap.observe.conditions import STEADY
from spikecam_env.gap.report.panels import Curves, PlotPanel, largest, scaled_by_twins, takes
from spikecam_env.gap.result import Evidence

TITLE = "Lengths of intervals"
CAPTION = "Share of intervals of each length, less the model's."


def panels(evidence: Evidence, frame_rate_hz: float) -> Iterator[PlotPanel]:
    """Intervals by length, and how their shares differ."""
    made = []
    for t in takes(evidence, STEADY):
        total = [max(float(o.lengths.sum()), 1.0) if o else 1.0 for o in (t.measured, t.before, t.after)]
        if min(total[:2]) < 100:
            continue
        both = t.measured.lengths + t.before.lengths
        shown = np.flatnonzero(both > 0)
        shown = np.arange(shown[0], shown[-1] + 1)
        measured, before = t.measured.lengths[shown] / total[0], t.before.lengths[shown] / total[1]
        after = t.after.lengths[shown] / total[2] if t.after else None
        sd = np.sqrt(np.maximum(measured, 1 / total[0]) / total[0] + np.maximum(before, 1 / total[1]) / total[1])
        sd = scaled_by_twins(sd, t.again.lengths[shown] / max(t.again.lengths.sum(), 1) - before if t.again else None)
        title, ylabel = f"Intervals by length, {t.shown.name}", "share, less the model's [%]"
        curves = Curves(measured, before, after, sd).less_model(100)
        made.append(PlotPanel(title, "length [frames]", ylabel, shown + 1.0, *curves))
    yield from largest(made, 3)
