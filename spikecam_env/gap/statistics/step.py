"""The response to steps of uniform light, frame by frame after each edge.

Reveals photodiode_lag (tails), incomplete_reset (the first intervals), readout_skew (rows late by different times).
"""

from __future__ import annotations

import itertools

import numpy as np

from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.statistics.reading import CampaignReading, slope
from spikecam_env.sensor.between_keys import frame_means
from spikecam_env.types import Floats

EDGES = (0, 1, 2, 4, 8, 16, 32, 64, 128, 256)
"""Lags after an edge [frames], ends of the windows."""


def uniform_light(condition: Condition) -> Floats:
    """(F,) mean radiance of every frame."""
    light = condition.light
    assert light is not None
    return frame_means(light.frame, light.radiance[:, 0, 0].astype(np.float64), condition.frames)


def edges_of(level: Floats) -> list[tuple[int, float]]:
    """(frame, height) where light has changed by most of the recording's range within two frames."""
    change = level[2:] - level[:-2]
    least = 0.5 * (level.max() - level.min())
    found: list[tuple[int, float]] = []
    for t in np.flatnonzero(np.abs(change) > least):
        if not found or t - found[-1][0] > 8:
            found.append((int(t), float(change[t])))
    return [(t + 1, h) for t, h in found]


def statistics(reading: CampaignReading, i: int) -> dict[str, float]:
    """Spikes after edges of light.

    Returns:
        up a-b, down a-b: spikes missing or over, a to b frames after an edge, in frames of the step's height.
        row up, row down: the same of the first 4 frames, as a slope from the first row to the last.
    """
    condition = reading.conditions[i]
    if condition.kind != "step":
        return {}
    o = reading.observations[i]
    level = uniform_light(condition)
    rows = o.shape[0]
    gain = reading.base.gain.reshape(o.shape).sum(axis=1)
    dark = reading.base.dark.reshape(o.shape).sum(axis=1)
    left = o.row - (level[:, None] * gain + dark)
    edges = edges_of(level)
    found: dict[str, float] = {}
    for name, sign in (("up", 1), ("down", -1)):
        at = [(t, h) for t, h in edges if h * sign > 0 and t + EDGES[-1] < o.frames]
        if not at:
            continue
        for a, b in itertools.pairwise(EDGES):
            windows = [left[t + a : t + b].sum() / (abs(h) * gain.sum()) for t, h in at]
            found[f"{name} {a}-{b}"] = float(np.mean(windows))
        late = np.mean([left[t - 1 : t + 4].sum(axis=0) / (h * gain) for t, h in at], axis=0)
        found[f"row {name}"] = slope(late, np.linspace(-0.5, 0.5, rows))
    return found
