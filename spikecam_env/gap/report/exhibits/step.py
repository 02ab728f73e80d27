"""The array's rate around rises and falls of uniform light."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from spikecam_env.gap.observe.observation import ObservedRecording
from spikecam_env.gap.report.panels import Array, Curves, PlotPanel, takes
from spikecam_env.gap.result import Evidence
from spikecam_env.gap.statistics.step import edges_of, uniform_light

TITLE = "After a step of light"
CAPTION = "The array's rate around sudden changes of light. A tail after the step is lag; an offset is not."

_BIN, _BEFORE, _AFTER = 8, 64, 320
"""Frames: of a bin, and at most shown before and after an edge."""


def panels(evidence: Evidence, frame_rate_hz: float) -> Iterator[PlotPanel]:
    """The array's rate around rises and falls of uniform light, and the same less the model's."""
    for t in takes(evidence, ("step",)):
        edges = edges_of(uniform_light(t.shown))
        for name, sign in (("rise", 1), ("fall", -1)):
            mine = [frame for frame, height in edges if height * sign > 0]
            window = free_window([frame for frame, _ in edges], t.measured.frames)
            if not mine or window[1] < 4 * _BIN:
                continue
            x, measured = around(t.measured, mine, window)
            before = around(t.before, mine, window)[1]
            after = around(t.after, mine, window)[1].mean(axis=1) if t.after else None
            ms = x * 1e3 / frame_rate_hz
            sd = (measured - before).std(axis=1) / np.sqrt(measured.shape[1])
            rates = Curves(measured.mean(axis=1), before.mean(axis=1), after, sd)
            height = abs(rates.before[x > 0].mean() - rates.before[x < 0].mean())
            off = rates.less_model(100 / max(height, 1e-9))
            xlabel = f"time from the {name} [ms]"
            yield PlotPanel(f"Rate around a {name} ({t.shown.name})", xlabel, "rate [spikes/frame]", ms, *rates)
            yield PlotPanel(
                f"Residual after a {name} ({t.shown.name})", xlabel, "less the model's [% of step]", ms, *off
            )


def free_window(edges: Sequence[int], frames: int) -> tuple[int, int]:
    """Frames before and after an edge within which there is no other, whole bins."""
    gap = min((b - a for a, b in pairwise(edges)), default=frames) - 2
    return min(_BEFORE, gap // 2 // _BIN * _BIN), min(_AFTER, gap // _BIN * _BIN)


def around(observation: ObservedRecording, edges: Sequence[int], window: tuple[int, int]) -> tuple[Array, Array]:
    """The array's rate around edges.

    Args:
        observation: of the recording.
        edges: frames of the edges.
        window: frames before and after an edge.

    Returns:
        Middles of bins from an edge on [frames], and spikes a frame of a pixel (bins, columns), mean over edges.
    """
    bins = np.arange(-window[0], window[1], _BIN)
    total = np.zeros((bins.size, observation.shape[1]))
    seen = np.zeros((bins.size, 1))
    for edge in edges:
        for i, first in enumerate(edge + bins):
            if first >= 0 and first + _BIN <= observation.frames:
                total[i] += observation.column[first : first + _BIN].sum(axis=0)
                seen[i] += 1
    known = seen[:, 0] > 0
    per = seen[known] * _BIN * observation.shape[0]
    return bins[known] + _BIN / 2, total[known] / per
