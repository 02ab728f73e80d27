"""Moving light: the film less that of the refitted unit, projected on the features of `film`.

The expected film x is the integral of gain L(t) + dark, at most a spike a frame; its features are in `film`.
"""

from __future__ import annotations

import numpy as np

from spikecam_env.gap.observe.observation import BIN
from spikecam_env.gap.statistics.film import FEATURES
from spikecam_env.gap.statistics.reading import CampaignReading


def statistics(reading: CampaignReading, i: int) -> dict[str, float]:
    """The measured film less the expected one, by features.

    Returns:
        level, square, ...: share of a feature in the difference, over the feature's own size.
        left: log rms of the rest.
    """
    condition = reading.conditions[i]
    counts = reading.observations[i].film
    film = reading.films.get(condition.name)
    if film is None or counts is None:
        return {}
    base = reading.base
    expected = film.light * base.gain.astype(np.float32) + np.float32(BIN) * base.dark.astype(np.float32)
    left = counts - np.minimum(expected, np.float32(BIN))
    flat = left.reshape(-1)
    share = film.basis @ flat
    rest = flat - share @ film.basis
    values = {name: float(s / n) for name, s, n in zip(FEATURES, share, film.size, strict=True) if n > 1e-6}
    values["left"] = float(np.log(max(float(np.sqrt(np.mean(rest**2))), 1e-9)))
    return values
