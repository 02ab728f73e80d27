"""Whether spikes of a scene follow the read-out's clock: pixels whose interval is nearly a whole number of frames.

In a camera whose pixels integrate freely, as many pixels lie near a whole interval as light puts there, and their noise
is that of the others.  Reveals resets and comparators that are coupled to the read-out
(synchronous_reset in small shares) and, by A_k at several k, noise that is not drawn anew for each spike.  Only scenes
have every interval in them; flats have too few.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spikecam_env.calibration.real import ideal_second_difference
from spikecam_env.gap.observe.observation import DIFFERENCES
from spikecam_env.gap.statistics.reading import Reading, root

AT_WHOLE = 0.005
"""Distance of a mean interval from a whole number, up to which a pixel is counted [frames]."""

BESIDE_WHOLE = 0.04
"""Distance of a mean interval from a whole number, up to which a pixel is below or above it [frames]."""

LEAST_DIFFERENCES = 20_000
"""Second differences, at least, that a mean is taken of."""


def statistics(reading: Reading, i: int) -> dict[str, float]:
    """whole: pixels within AT_WHOLE of a whole mean interval, counted.

    A_k below / above / between: mean of A_k less that of an ideal pixel of the same interval, over 2 k [1e-3 frames^2],
    of pixels within BESIDE_WHOLE of a whole interval on either side, and of all others.
    """
    if reading.conditions[i].kind != "unknown":
        return {}
    o = reading.observations[i]
    good = reading.base.live & (o.times.count > 8) & (o.times.rate < 0.8)
    interval = 1.0 / o.times.rate[good]
    off = interval - np.round(interval)
    found = {"whole": root(float((np.abs(off) < AT_WHOLE).sum()))}
    parts: dict[str, NDArray[np.bool_]] = {
        "below": (off < 0) & (off > -BESIDE_WHOLE),
        "above": (off >= 0) & (off < BESIDE_WHOLE),
        "between": np.abs(off) >= BESIDE_WHOLE,
    }
    for j, k in enumerate(DIFFERENCES):
        terms = o.times.terms[good, j]
        excess = o.times.square[good, j] - terms * ideal_second_difference(np.array(k), interval)
        for name, part in parts.items():
            if terms[part].sum() > LEAST_DIFFERENCES:
                found[f"A_{k} {name}"] = 1e3 * float(excess[part].sum() / terms[part].sum()) / (2 * k)
    return found
