"""The gap: mean square distance of held-out statistics from a model, in noise, and what chance alone makes of it."""

from __future__ import annotations

import numpy as np

from spikecam_env.gap.compare.prediction import Null, Prediction
from spikecam_env.gap.result import CHANCE, Gap
from spikecam_env.gap.twins.case import Case
from spikecam_env.types import Floats


def gap_of(case: Case, null: Null, values: Floats, given: Floats, after: Prediction, floor: float = CHANCE) -> Gap:
    """The gap of the model as given, whose predictions are (S,) `given`, and of one after; each in its own noise."""
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
    """The floor of a gap, from that of two halves (`halves_floor.floor_of_halves`), which is NaN where not known.

    At most that of chance: where halves differ by more, the camera changes with time, and the floor would hold what is
    to be found.
    """
    return min(halves, CHANCE) if np.isfinite(halves) else CHANCE
