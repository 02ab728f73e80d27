"""A measurement beside a model, before any search, and the gap between them.

The gap is the mean square distance of held-out statistics from a model, in noise; its floor is that by chance alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.gap.baseline.alarm import is_discrepant
from spikecam_env.gap.baseline.missing_from_refit import Missing
from spikecam_env.gap.baseline.off_nominal import OffNominal
from spikecam_env.gap.check.contradiction import Contradiction
from spikecam_env.gap.compare.distance import adjusted, deviates, residual
from spikecam_env.gap.compare.prediction import Null, Prediction
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.result import CHANCE, Gap
from spikecam_env.gap.twins.case import Case
from spikecam_env.sensor import SensorModel
from spikecam_env.types import Floats


@dataclass(frozen=True)
class Comparison:
    """A measurement beside the null model."""

    case: Case
    """The measurement."""
    tested: SensorModel
    """The model under test."""
    model: SensorModel
    """The null model: the tested one with the effects that the refit showed to be missing."""
    null: Null
    """The null model's prediction of the statistics."""
    values: Floats
    """(S,) measured statistics."""
    given: Floats
    """(S,) predictions of the tested model."""
    missing: tuple[Missing, ...]
    """Effects of the base pixel that the refit shows and the tested model lacks."""
    off: OffNominal
    """Parameters of the tested model that the unit has in another amount."""
    contradictions: tuple[Contradiction, ...]
    """Labels that contradict the recordings."""
    names: tuple[str, ...] = ()
    """Candidates that these recordings can show."""
    not_testable: tuple[tuple[str, str], ...] = ()
    """Names of the others, each with the recording that it needs."""

    @property
    def problem(self) -> Problem:
        """The search among the candidates, from the null model on."""
        return Problem.of(self.case, self.model, self.null, self.values)

    @property
    def residuals(self) -> Floats:
        """(S,) measured less the null model's mean, in noise."""
        return residual(self.null, self.values, self.null.prediction)

    @property
    def disagrees(self) -> bool:
        """Whether the null model disagrees with the recordings to fit, or with all together."""
        return is_discrepant(self.null, self.problem.seen) or is_discrepant(self.null, self.values)

    @property
    def smallest_p(self) -> float:
        """Smallest p of all statistics against the null model, adjusted for their number."""
        return float(adjusted(deviates(self.null, self.values)).min())


def aligned_mean(other: Null, null: Null) -> Floats:
    """(S,) predictions of another model for the statistics of `null`; where it has none, those of `null`."""
    known = dict(zip(other.keys, other.mean, strict=True))
    return np.array([known.get(k, m) for k, m in zip(null.keys, null.mean, strict=True)])


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
