"""The alarm: whether a campaign and a model disagree at all, and in which recordings that is looked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.compare.distance import adjusted, deviates, of_all_recordings
from spikecam_env.gap.compare.prediction import Null
from spikecam_env.gap.twins.case import Case

Array = NDArray[np.float64]

ALARM = 0.02
"""Adjusted p-value below which there is a discrepancy at all."""


def rings(null: Null, values: Array) -> bool:
    """Whether statistics (S,), NaN where they take no part, are not what the model gives."""
    z = deviates(null, values)
    return bool(adjusted(np.append(z, of_all_recordings(null.keys, z, "intervals"))).min() < ALARM)


def lent(case: Case) -> Case:
    """The case with its recordings in motion to be fitted, those held out among them; the unit rests on none of these.

    Where recordings to fit agree with the model and those held out do not, what is missing shows in nothing else.  The
    case itself where nothing in motion is held out.
    """
    if not any(c.moves and c.use == "holdout" for c in case.conditions):
        return case
    return replace(case, conditions=tuple(replace(c, use="fit") if c.moves else c for c in case.conditions))
