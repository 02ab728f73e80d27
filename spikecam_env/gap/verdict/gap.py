"""The gap: mean square distance of held-out statistics from a model, in noise, and its floor by chance alone."""

from __future__ import annotations

import numpy as np

from spikecam_env.gap.compare.prediction import Null, Prediction
from spikecam_env.gap.result import CHANCE, Gap
from spikecam_env.gap.twins.case import Case
from spikecam_env.types import Floats


def gap_of(case: Case, null: Null, values: Floats, given: Floats, after: Prediction, floor: float = CHANCE) -> Gap:
    """The gap of the model as given, and of the model with the effects; each in its own noise.

    Args:
        values: (S,) measured statistics.
        given: (S,) predictions of the model as given.
        after: prediction of the model with the effects.
        floor: gap by chance.
    """
    held = case.held_out(null.keys)
    wider = np.sqrt(np.maximum(after.spread**2 - null.sd**2, 0.0) + null.noise**2)
    b, a = (np.nan_to_num((values - mean) / sd) ** 2 for mean, sd in ((given, null.noise), (after.mean, wider)))
    by_recording = {}
    for c in case.conditions:
        own = np.array([k.recording == c.name for k in null.keys])
        if np.any(own):
            by_recording[c.name] = float(b[own].mean()), float(a[own].mean())
    return Gap.of(float(b[held].mean()), float(a[held].mean()), by_recording, floor)


def usable_floor(halves: float) -> float:
    """The floor of a gap by two halves (`halves_floor.floor_of_halves`, NaN where not known), at most that of chance.

    Where halves differ by more, the camera changes with time, and the floor would contain the effect.
    """
    return min(halves, CHANCE) if np.isfinite(halves) else CHANCE
