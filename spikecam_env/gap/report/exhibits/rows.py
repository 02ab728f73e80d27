"""Noise that the pixels of a row or column have in common."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from spikecam_env.gap.observe.conditions import STEADY
from spikecam_env.gap.observe.observation import ObservedRecording
from spikecam_env.gap.report.panels import Array, PlotPanel, by_recording, largest, panel_by_recording, takes
from spikecam_env.gap.result import Evidence

TITLE = "Rows and columns in time"
CAPTION = "Variance in time of the spikes of a row or column, less what the whole array shares, over the model's."


def panels(evidence: Evidence, frame_rate_hz: float) -> Iterator[PlotPanel]:
    """Variance of rows and columns over the model's, recording by recording."""
    shown = [t for t in takes(evidence, STEADY) if t.before.frame.sum() > 500]
    made = []
    for name in ("row", "column") if shown else ():
        for frames in (1, 16):
            curves = by_recording(shown, partial(_line_variance_of, name, frames))
            title = f"Variance of {name}s in {frames} frame{'s' if frames > 1 else ''}"
            off = curves.less_model(100 / curves.before)
            made.append(panel_by_recording(title, "over the model's, less 1 [%]", shown, off))
    yield from largest(made, 3)


def _line_variance_of(name: str, frames: int, observation: ObservedRecording) -> Array:
    """(lines,) variance in time of the spikes of rows or columns in `frames` frames, less the mean over lines."""
    lines = observation.row if name == "row" else observation.column
    whole = len(lines) // frames * frames
    binned = lines[:whole].reshape(-1, frames, lines.shape[1]).sum(axis=1).astype(np.float64)
    binned -= binned.mean(axis=0)
    out: Array = ((binned - binned.mean(axis=1, keepdims=True)) ** 2).mean(axis=0)
    return out
