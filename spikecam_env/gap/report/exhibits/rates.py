"""Mean rates: off each pixel's straight line, and off the model's."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from spikecam_env.gap.observe.conditions import STEADY
from spikecam_env.gap.report.panels import PlotPanel, by_recording, error_known, mean_known, panel_by_recording, takes
from spikecam_env.gap.result import Evidence

TITLE = "Rates and levels"
CAPTION = (
    "Distance of mean rates from a straight line through each pixel's own levels (a camera that saturates bends down "
    "at high levels), and the array's rate relative to the model's, by recording."
)


def panels(evidence: Evidence, frame_rate_hz: float) -> Iterator[PlotPanel]:
    """How far rates are off the line of each pixel, and off the model's."""
    static = [c for c in evidence.conditions if c.kind in ("dark", "flat", "picture")]
    lit = np.array([c.level > 0 for c in static])
    bases = (evidence.free_refit, evidence.before_base, evidence.after_base)
    if lit.sum() > 1 and all(b is None or len(b.residual) == len(static) for b in bases):
        level = np.array([c.level for c in static])[lit]
        order = np.argsort(level)
        measured, before, after = (
            None if b is None else 100 * np.where(b.live, b.residual, np.nan)[lit][order] for b in bases
        )
        assert measured is not None and before is not None
        known = np.isfinite(measured - before)
        usable = known.sum(axis=1) > 1
        yield PlotPanel(
            "Rate off each pixel's line", evidence.light, "rate off the line [%]", level[order][usable],
            mean_known(measured, known)[usable], mean_known(before, known)[usable],
            None if after is None else mean_known(after, np.isfinite(after))[usable],
            error_known(measured - before, known)[usable], log="x",
        )  # fmt: skip
    shown = [t for t in takes(evidence, (*STEADY, "step", "moving")) if t.before.rate.mean() > 0]
    if shown:
        rates = by_recording(shown, lambda o: o.rate)
        title, ylabel = "Rate of the array, recording by recording", "rate over the model's, less 1 [%]"
        yield panel_by_recording(title, ylabel, shown, rates.less_model(100 / rates.before))
