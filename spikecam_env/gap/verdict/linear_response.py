"""Upper bounds without a simulation: scores of an effect by its template.

The change of the statistics by an effect is that of its template on this campaign (`screen.rescaled`).  The scatter of
a score is that of the null model's own twins.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.distance import in_noise
from spikecam_env.gap.compare.prediction import Null, pooled
from spikecam_env.gap.screen.rescaled import rescaled
from spikecam_env.gap.screen.templates import Template, Templates
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.verdict.score import (
    EffectProbe,
    Parameters,
    Score,
    StrengthTest,
    linear,
    log_mean_square,
    strength_of,
)
from spikecam_env.sensor import SensorModel
from spikecam_env.sensor.effects.identification import Response
from spikecam_env.types import Floats

SAFETY = 2.0
"""Factor on a bound by linear response: a campaign of another size responds a little otherwise than its template says.
Source: benchmarks/bound_coverage.py, cameras 2000 to 2005."""

SAFETY_OF_CHANCE = 3.0
"""The same of false, missed and trailing spikes, and of spreads over the array: events and units differ by chance.
Source: benchmarks/bound_coverage.py, cameras 1000 to 1005, of which a factor of 2 left 2 of 38 trials uncovered."""

FINE = 0.9
"""Least strength that would be refuted, over the bound before SAFETY; a choice, as a test costs no simulation."""

MOST_TESTS = 10
"""Strengths that are tested to come so near."""


class TemplateProbe(EffectProbe):
    """A candidate on the campaign at hand, by its template."""

    kind = "linear"
    needed = "longer recordings, or --bounds simulated; by its template it hardly shows in these"
    most_tests = MOST_TESTS

    def __init__(self, case: Case, model: SensorModel, null: Null, templates: Templates, entry: Template):
        super().__init__(case, model, null, entry.name)
        known = candidate(entry.name)
        by_chance = known.response is Response.EVENTS or (known.is_pattern and known.share is None)
        self.resolution, self.safety = FINE, SAFETY_OF_CHANCE if by_chance else SAFETY
        self.template = rescaled(templates, entry, null, case.conditions, case.shape)
        of_pattern = np.array([k.group == "pattern" for k in null.keys])
        self.usable = case.to_fit(null.keys) & (of_pattern == known.is_pattern)

    def score(self, parameters: Parameters) -> Score | None:
        """The score by the statistics that the template changes; None where it changes none."""
        null, change, draws = self.null, self._change(parameters), [d.values for d in self.null.draws]
        if not candidate(self.name).random_course:
            score = linear(null, change, draws, parameters)
        else:
            moves = in_noise(null, null.mean + change) ** 2
            weight = moves / (1.0 + moves)
            of = partial(log_mean_square, null, weight / max(weight.sum(), 1e-300))
            score = Score(of, np.array([of(v) for v in draws]), 0.0, parameters, 0.0) if moves.any() else None
        return replace(score, rise=self._excess(score, change)) if score else None

    def test(self, score: Score, parameters: Parameters) -> StrengthTest:
        """The score of campaigns with the effect at a strength."""
        excess, events = self._excess(score, self._change(parameters)), self.events(parameters)
        return StrengthTest(excess, float(np.hypot(score.sd, excess / np.sqrt(events))), score.likely_sds, events)

    def _change(self, parameters: Parameters) -> Floats:
        """(S,) change of the statistics; of random course the root of its mean square over all recordings."""
        change = np.where(self.usable, self.template.change(parameters[strength_of(self.name)]), 0.0)
        if not candidate(self.name).random_course:
            return change
        mean_square = pooled(self.null.keys, (change / self.null.noise) ** 2)
        return np.where(self.usable, np.sqrt(mean_square) * self.null.noise, 0.0)

    def _excess(self, score: Score, change: Floats) -> float:
        """Mean score with a change of the statistics, less that without it."""
        scored = score.of(self.null.mean + change)
        if candidate(self.name).random_course:  # logarithms of mean squares, which add up
            return float(np.log1p(np.exp(scored) / np.mean(np.exp(score.without))))
        return scored
