"""Neighbours that fire together."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from spikecam_env.gap.observe.conditions import STEADY
from spikecam_env.gap.report.panels import Curves, PlotPanel, largest, scaled_by_twins, takes
from spikecam_env.gap.result import Evidence

TITLE = "Neighbours"
CAPTION = (
    "Coincidences of a pixel and its neighbour, in the same frame (0) and one or two frames later, relative to the "
    "model's."
)


def panels(evidence: Evidence, frame_rate_hz: float) -> Iterator[PlotPanel]:
    """Spikes of a pixel with its neighbour's, in the same frame and one or two after."""
    made = []
    for t in takes(evidence, STEADY):
        measured, before = (o.coincidences.T.reshape(-1) for o in (t.measured, t.before))
        if min(measured.min(), before.min()) < 20:
            continue
        after = t.after.coincidences.T.reshape(-1) if t.after else None
        labels = tuple(f"{where}, {lag}" for where in ("in a row", "in a column") for lag in range(len(measured) // 2))
        again = t.again.coincidences.T.reshape(-1) if t.again else None
        # Every pair is counted both ways round.
        sd = scaled_by_twins(np.sqrt(2 / measured + 2 / before), None if again is None else again / before - 1)
        title, x = f"Coincidences of neighbours, {t.shown.name}", np.arange(len(labels), dtype=np.float64)
        curves = Curves(measured / before, np.ones(len(labels)), None if after is None else after / before, sd)
        made.append(PlotPanel(title, "", "over the model's, less 1 [%]", x, *curves.less_model(100), labels=labels))
    yield from largest(made, 2)
