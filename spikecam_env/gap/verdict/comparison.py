"""A measurement beside a model, before any search: what the rooms up to the baseline hand to those after them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spikecam_env.gap.baseline.alarm import is_discrepant
from spikecam_env.gap.baseline.contradiction import Contradiction
from spikecam_env.gap.baseline.missing_from_refit import Missing
from spikecam_env.gap.baseline.off_nominal import OffNominal
from spikecam_env.gap.compare.distance import adjusted, deviates, residual
from spikecam_env.gap.compare.prediction import Null
from spikecam_env.gap.fit.problem import values_to_fit
from spikecam_env.gap.twins.case import Case
from spikecam_env.sensor import SensorModel
from spikecam_env.types import Floats


@dataclass(frozen=True)
class Comparison:
    """case: the measurement.  tested: the model under test.  model: the null model, which is the tested one with what
    the refit found missing.

    null: the null model's prediction of the statistics.  values: (S,) as measured.  given: (S,) as the tested model
    predicts them.  missing, off, contradictions: found by refit and audit, without a search.  names: of candidates
    that these recordings can show; not_testable: of the others, with what they need.
    """

    case: Case
    tested: SensorModel
    model: SensorModel
    null: Null
    values: Floats
    given: Floats
    missing: tuple[Missing, ...]
    off: OffNominal
    contradictions: tuple[Contradiction, ...]
    names: tuple[str, ...] = ()
    not_testable: tuple[tuple[str, str], ...] = ()

    @property
    def residuals(self) -> Floats:
        """(S,) measured less the null model's mean, in noise."""
        return residual(self.null, self.values, self.null.prediction)

    @property
    def disagrees(self) -> bool:
        """Whether the recordings to fit, or all together, are not what the null model gives."""
        return is_discrepant(self.null, values_to_fit(self.case, self.null, self.values)) or is_discrepant(
            self.null, self.values
        )

    @property
    def smallest_p(self) -> float:
        """Of all statistics against the null model, adjusted for their number."""
        return float(adjusted(deviates(self.null, self.values)).min())


def aligned_mean(other: Null, null: Null) -> Floats:
    """(S,) predictions of another model for the statistics of `null`; where it has none, those of `null`."""
    known = dict(zip(other.keys, other.mean, strict=True))
    return np.array([known.get(k, m) for k, m in zip(null.keys, null.mean, strict=True)])
