"""The lateness of the array's spikes, frame by frame, against each pixel's own mean interval.

The mean lateness of many spikes measures a frame's time better than their number: pixels fire regularly, whatever
their phases.
Reveals common_threshold_noise and clock_jitter, which move all spikes of a frame together.
"""

from __future__ import annotations

import numpy as np

from spikecam_env.gap.observe.conditions import STEADY
from spikecam_env.gap.statistics.reading import CampaignReading, log

SLOWEST_INTERVAL = 1.5
"""Interval of the slowest pixels that count, over the mean interval; the statistic begins after so long."""


def statistics(reading: CampaignReading, i: int) -> dict[str, float]:
    """Lateness of pixels without irregular intervals, where these are most.

    It begins after SLOWEST_INTERVAL: in the first frames only short intervals have ended.

    Returns:
        late: log variance over frames of the mean lateness of their spikes, over that of spikes on their own.
        next: correlation of one frame's lateness with the next one's.
    """
    if reading.conditions[i].kind not in STEADY:
        return {}
    o = reading.observations[i]
    begins = min(
        int(np.ceil(SLOWEST_INTERVAL * o.shape[0] * o.shape[1] / max(float(o.frame.mean()), 1e-9))), o.frames // 4
    )
    enough = (o.timed >= 10) & (np.arange(o.frames) >= begins)
    if enough.sum() < 500 or o.timed.sum() < 0.5 * o.frame.sum():
        return {}
    late = np.where(enough, o.late / np.maximum(o.timed, 1), 0.0)
    own = o.scatter / np.maximum(o.timed, 1) ** 2
    ratio = float((late[enough] ** 2).sum() / max(own[enough].sum(), 1e-12))
    both = enough[1:] & enough[:-1]
    product = float((late[1:] * late[:-1])[both].mean()) if both.any() else 0.0
    return {"late": log(ratio), "next": product / max(float((late[enough] ** 2).mean()), 1e-12)}
