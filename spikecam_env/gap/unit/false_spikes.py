"""False spikes in a drawn unit: they change the rates that are read of its slowest pixels.

A rate is read between a pixel's first spike and its last.  Where one of only two spikes is false, the rate is that of
their distance: few units have such a pixel, and it lies far out in the pattern.
"""

from __future__ import annotations

import numpy as np

from spikecam_env.sensor import SensorModel
from spikecam_env.sensor.effects.spurious_spikes import SpuriousSpikes
from spikecam_env.types import Floats


def false_spikes_of(model: SensorModel) -> SpuriousSpikes | None:
    """The model's spurious spikes, or None."""
    return next((e for e in model.effects if isinstance(e, SpuriousSpikes)), None)


def read_with_false_spikes(
    model: SensorModel, read: Floats, rate: Floats, phase: Floats, frames: int, rng: np.random.Generator
) -> Floats:
    """(P,) rates as read from a recording with the spurious spikes that a model adds.

    Args:
        model: with or without spurious spikes.
        read: (P,) rates as read without them.
        rate: (P,) spikes a frame.
        phase: (P,) share of an interval that had passed when the recording began.
        frames: length of the recording.
        rng: of the spurious spikes.
    """
    spurious = false_spikes_of(model)
    if spurious is None:
        return read
    false = rng.poisson(spurious.probability * frames, rate.size)
    at = np.flatnonzero(false)
    more, rate, phase = false[at], np.maximum(rate[at], 1e-12), phase[at]
    lowest = frames * (1.0 - rng.random(at.size) ** (1.0 / more))
    others = (frames - lowest) * rng.random(at.size) ** (1.0 / np.maximum(more - 1, 1))
    highest = lowest + np.where(more > 1, others, 0.0)
    count = np.floor(rate * frames + phase)
    first, last = (1.0 - phase) / rate, (count - phase) / rate
    own = count > 0
    span = np.where(own, np.maximum(last, highest), highest) - np.where(own, np.minimum(first, lowest), lowest)
    count = count + more
    out = read.copy()
    out[at] = np.minimum(np.where(count > 1, (count - 1.0) / np.maximum(span, 1.0), count / frames), 1.0)
    return np.asarray(out)
