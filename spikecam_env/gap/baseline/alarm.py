"""The alarm: whether a campaign and a model disagree at all; and held-out motion, where nothing else disagrees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from spikecam_env.gap.compare.distance import adjusted, deviates, of_all_recordings
from spikecam_env.gap.compare.prediction import Null
from spikecam_env.gap.twins.case import Case
from spikecam_env.types import Floats


def is_discrepant(null: Null, values: Floats) -> bool:
    """Whether statistics (S,), NaN where they take no part, differ from the null model beyond chance."""
    z = deviates(null, values)
    smallest = adjusted(np.append(z, of_all_recordings(null.keys, z, "intervals"))).min()
    return bool(smallest < null.settings.judging.alarm)


def with_held_out_motion(case: Case) -> Case:
    """The case with all recordings in motion to be fitted, the held-out ones too; the unit rests on none of these.

    It is for a discrepancy that shows in held-out motion and in nothing else.

    Args:
        case: stays as it is where no motion is held out.
    """
    if not any(c.moves and c.use == "holdout" for c in case.conditions):
        return case
    return replace(case, conditions=tuple(replace(c, use="fit") if c.moves else c for c in case.conditions))
