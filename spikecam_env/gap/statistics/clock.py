"""Whether spikes of a scene follow the read-out's clock: pixels whose interval is nearly a whole number of frames.

A camera whose pixels integrate freely knows nothing of frames: as many pixels fall near a whole interval as light puts
there, and their noise is that of the others.  Reveals resets and comparators that are coupled to the read-out
(synchronous_reset in small shares) and, by A_k at several k, noise that is not drawn anew for each spike.  Only scenes
have every interval in them; flats have too few.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spikecam_env.calibration.real import ideal_second_difference
from spikecam_env.gap.observe.observation import STEPS
from spikecam_env.gap.statistics.reading import Reading, root

NEAR = 0.005
"""Distance from a whole interval [frames] at which pixels are counted."""

BESIDE = 0.04
"""Distance up to which pixels are beside a whole interval, below or above."""

FEWEST = 20_000
"""Second differences from which their mean is worth a statistic."""


def statistics(reading: Reading, i: int) -> dict[str, float]:
    """whole: pixels within NEAR of a whole mean interval, counted.

    A_k below / above / between: mean of A_k less that of an ideal pixel of the same interval, over 2 k [1e-3 frames^2],
    of pixels BESIDE a whole interval on either side, and of all others.
    """
    if reading.conditions[i].kind != "unknown":
        return {}
    o = reading.observations[i]
    good = reading.base.live & (o.times.count > 8) & (o.times.rate < 0.8)
    interval = 1.0 / o.times.rate[good]
    off = interval - np.round(interval)
    found = {"whole": root(float((np.abs(off) < NEAR).sum()))}
    parts: dict[str, NDArray[np.bool_]] = {
        "below": (off < 0) & (off > -BESIDE), "above": (off >= 0) & (off < BESIDE), "between": np.abs(off) >= BESIDE
    }  # fmt: skip
    for j, k in enumerate(STEPS):
        terms = o.times.terms[good, j]
        excess = o.times.square[good, j] - terms * ideal_second_difference(np.array(k), interval)
        for name, part in parts.items():
            if terms[part].sum() > FEWEST:
                found[f"A_{k} {name}"] = 1e3 * float(excess[part].sum() / terms[part].sum()) / (2 * k)
    return found
