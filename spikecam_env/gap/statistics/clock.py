"""Whether spikes of a scene follow the array's clock, band by band of rows: pixels whose interval is nearly whole.

In a camera whose pixels integrate freely, light alone puts pixels near a whole interval.  Their noise is that of the
others, and a spike comes a frame late as often as early.  A threshold disturbed at one moment of the array's frame
gathers pixels in every row; rows that are read at that moment show it as late and early spikes, the others only by the
gathering (clock_feedthrough with readout_skew).  Rows pooled hide it.  A reset coupled to the
read-out (synchronous_reset in small shares) looks the same in all rows.  A_k at several k, away from whole intervals:
noise that is not drawn anew for each spike.  Only scenes have every interval in them; flats have too few.
"""

from __future__ import annotations

import numpy as np

from spikecam_env.calibration.spike_times import ideal_second_difference
from spikecam_env.gap.observe.bit_passes import BESIDE_WHOLE
from spikecam_env.gap.observe.observation import DIFFERENCES, ObservedRecording
from spikecam_env.gap.statistics.reading import CampaignReading, root
from spikecam_env.types import Floats, Masks

AT_WHOLE = 0.005
"""Distance of a mean interval from a whole number, up to which a pixel is counted [frames]."""

LEAST_DIFFERENCES = 5_000
"""Second differences, at least, that a mean is taken of: its standard error is then some 2 % of the value."""

BAND = 1.2e6
"""Pixels times frames of a band of rows, at least: at an interval of 5 frames, 8 % of its 240 000 spikes are of pixels
within BESIDE_WHOLE, 10 000 on either side of a whole interval."""

MOST_BANDS = 10
"""Bands at most: a disturbance that decays in a quarter of a frame is in two or three of ten."""


def statistics(reading: CampaignReading, i: int) -> dict[str, float]:
    """Statistics of pixels near a whole interval, by band b of rows, 0 at the top.

    Returns:
        whole b: pixels within AT_WHOLE of a whole mean interval, counted.
        late b, early b: spikes a frame late (early) with the next one on time, counted, of pixels within BESIDE_WHOLE.
        A_1 below b, A_1 above b: mean of A_1 less that of an ideal pixel of the same interval, over 2 [1e-3 frames^2],
            of pixels within BESIDE_WHOLE of a whole interval on either side.
        A_k between: the same of all others, over 2 k.
    """
    if reading.conditions[i].kind != "unknown":
        return {}
    o = reading.observations[i]
    good = reading.base.live & (o.times.count > 8) & (o.times.rate < 0.8)
    interval = 1.0 / np.where(good, o.times.rate, 1.0)
    off = np.where(good, interval - np.round(interval), np.inf)
    ideal = ideal_second_difference(np.array(DIFFERENCES), interval[:, None])
    excess = o.times.square - o.times.terms * ideal
    values = {}
    for b, band in enumerate(bands(o.shape, o.frames)):
        values[f"whole {b}"] = root(float((band & (np.abs(off) < AT_WHOLE)).sum()))
        late, early = o.flips[band & good].sum(axis=0)
        values[f"late {b}"], values[f"early {b}"] = root(float(late)), root(float(early))
        parts = {"below": (off < 0) & (off > -BESIDE_WHOLE), "above": (off >= 0) & (off < BESIDE_WHOLE)}
        for name, part in parts.items():
            values |= _mean(o, excess, band & part, 0, f"A_{DIFFERENCES[0]} {name} {b}")
    for j, k in enumerate(DIFFERENCES):
        values |= _mean(o, excess, good & (np.abs(off) >= BESIDE_WHOLE), j, f"A_{k} between")
    return values


def bands(shape: tuple[int, int], frames: int) -> list[Masks]:
    """(P,) pixels of each band, by equal numbers of rows: as many as BAND allows, MOST_BANDS at most."""
    rows, columns = shape
    count = int(np.clip(rows * columns * frames // BAND, 1, min(MOST_BANDS, rows)))
    band = np.repeat(np.arange(rows) * count // rows, columns)
    return [band == b for b in range(count)]


def _mean(o: ObservedRecording, excess: Floats, part: Masks, j: int, name: str) -> dict[str, float]:
    terms = o.times.terms[part, j].sum()
    if terms < LEAST_DIFFERENCES:
        return {}
    return {name: 1e3 * float(excess[part, j].sum() / terms) / (2 * DIFFERENCES[j])}
