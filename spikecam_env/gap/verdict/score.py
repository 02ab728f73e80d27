"""The score of an effect: a number of a campaign that the effect makes larger, and its distribution with the effect.

A score is linear in the statistics, along the change by the effect at a large strength.  Campaigns with the effect at a
weaker strength give the mean and the scatter of the score.

A strength with RULE_OF_THREE expected events (false spikes, hot pixels) or fewer is never refuted: one campaign in
twenty has none.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy

from spikecam_env.gap.candidates.strength import MOST_EXTRAPOLATED, with_effect
from spikecam_env.gap.candidates.table import candidate, expected_events
from spikecam_env.gap.compare.distance import CLEAR, in_noise
from spikecam_env.gap.compare.prediction import Null, Prediction, pair_noise_share, pooled
from spikecam_env.gap.compare.step import is_clear
from spikecam_env.gap.fit.candidate import MOST_TRIES
from spikecam_env.gap.fit.gauss_newton import Probe, at_settled_unit
from spikecam_env.gap.fit.predict import predict_by_twins, with_drawn_pattern
from spikecam_env.gap.fit.problem import OF_RANDOM_COURSE, recordings_affected, twins_of
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.unit.indirect_inference import extrapolated_unit
from spikecam_env.gap.unit.refit import BaseFit, constrained_refit
from spikecam_env.sensor import CATALOGUE, SensorModel
from spikecam_env.types import Floats

Parameters = dict[str, float]

CONFIDENCE = 0.95
"""Share of campaigns with an effect of the stated strength that score higher than the measurement."""

RULE_OF_THREE = -float(np.log(1.0 - CONFIDENCE))
"""Events expected, 3.0, of which there are none by chance of 1 - CONFIDENCE."""


RESOLUTION = 0.6
"""Least strength that would be refuted, over a simulated bound; a choice, stated on the page."""


@dataclass(frozen=True)
class Score:
    """One number of a campaign that an effect makes larger."""

    of: Callable[[Floats], float]
    """(S,) statistics -> score."""
    without: Floats
    """(n,) scores of campaigns without the effect."""
    error: float
    """Error of the score by the accuracy of labels and laws."""
    parameters: Parameters
    """Parameters at which the score was taken."""
    rise: float
    """Score at `parameters` less that without the effect."""
    bare: BaseFit | None = None
    """The unit at `parameters` before it settled."""
    unit: BaseFit | None = None
    """The unit at `parameters` after it settled."""

    @property
    def mean(self) -> float:
        """Mean score without the effect."""
        return float(np.mean(self.without))

    @property
    def sd(self) -> float:
        """Standard deviation of a campaign's score without the effect, beside that mean."""
        n = len(self.without)
        return float(np.sqrt(np.var(self.without, ddof=1) * (1 + 1 / n) + self.error**2))

    @property
    def likely_sds(self) -> float:
        """Standard deviations by which a refuted strength is likely to lie above the measurement.

        Student's quantile of CONFIDENCE for the campaigns without the effect, 1.8 for eleven.
        """
        return float(scipy.stats.t.ppf(CONFIDENCE, len(self.without) - 1))

    @property
    def effect_size(self) -> float:
        """Noises by which the effect shows at `parameters`."""
        return self.rise / self.sd


@dataclass(frozen=True)
class StrengthTest:
    """A strength that was simulated."""

    excess: float
    """Mean score of its campaigns less that without the effect."""
    sd: float
    """Standard deviation of a campaign's distance from that mean."""
    quantile: float
    """Quantile of that distance over `sd`: CONFIDENCE of campaigns are nearer or above."""
    events: float
    """Expected number of events of an effect of single events, infinite elsewhere."""

    def refuted_by(self, excess: float) -> bool:
        """Whether a campaign that scores so much scores too little for it."""
        return self.events > RULE_OF_THREE and excess < self.excess - self.quantile * self.sd


class EffectProbe:
    """A candidate on the campaign at hand, by simulation."""

    kind = "simulated"
    """`Bound.kind`."""
    needed = "longer recordings, or more of them; in these it hardly shows"
    """Needed for a bound where there is none."""
    most_tests = MOST_TRIES
    """Strengths that are tested at most."""
    safety = 1.0
    """Factor on the least strength that is refuted."""

    def __init__(self, case: Case, model: SensorModel, null: Null, name: str):
        self.case, self.model, self.null, self.name = case, model, null, name
        self.settings = case.settings
        self.resolution = RESOLUTION

    def events(self, parameters: Parameters) -> float:
        """Expected number of events of an effect of single events, infinite elsewhere."""
        return expected_events(self.name, parameters, self.case)

    def score(self, parameters: Parameters) -> Score | None:
        """The score by the statistics that the effect changes; None where it changes none."""
        raise NotImplementedError

    def refined(self, score: Score) -> Score:
        """A score whose statistics are no chance."""
        return score

    def test(self, score: Score, parameters: Parameters) -> StrengthTest:
        """Scores of campaigns with the effect at a strength."""
        raise NotImplementedError

    @staticmethod
    def score_variance(score: Score, scores: Floats, excess: float, events: float) -> float:
        """Variance of the score of a campaign with the effect.

        By few campaigns, and at least the variance without the effect and that of the number of events.

        Args:
            scores: (n,) scores of campaigns with the effect.
            excess: their mean less that without the effect.
            events: expected number of events.
        """
        by_chance = excess**2 / events
        return max(float(np.var(scores, ddof=1)), float(np.var(score.without, ddof=1)) + by_chance)


class TwinProbe(EffectProbe):
    """Scores of twins of the campaign.

    The last draws, with a strong effect, select the statistics.  The first show their change at a weak strength.
    """

    def __init__(self, case: Case, model: SensorModel, null: Null, measured: Floats, name: str):
        super().__init__(case, model, null, name)
        self.only = recordings_affected(case, [name], null, measured, np.full(len(null.keys), np.inf))
        used = {case.conditions[i].name for i in self.only}
        self.usable = np.array([k.group != "pattern" and k.recording in used for k in null.keys])
        self.random_course = candidate(name).random_course

    def score(self, parameters: Parameters, count: int = 1) -> Score | None:
        """The score by the statistics that the effect clearly changes at some strength; None where it changes none."""
        count = OF_RANDOM_COURSE if self.random_course else count
        count = min(count, len(self.null.draws) // 2)
        strong = with_effect(self.model, self.name, parameters)
        bare = constrained_refit(strong, constrained_refit(self.model, self.case.base))

        def predict(model: SensorModel, unit: BaseFit, count: int) -> Prediction:
            return predict_by_twins(self.case, model, unit, self.null, count, self.only)

        made, unit = at_settled_unit(Probe(predict, count), self.null, strong, bare, [])
        score = (self._scatter_score if self.random_course else self._change_score)(made, parameters)
        return replace(score, bare=bare, unit=unit) if score else None

    def refined(self, score: Score) -> Score:
        """The score of single events by more campaigns: in few, the statistics that change are chance."""
        if not candidate(self.name).share:
            return score
        return self.score(score.parameters, twins_of(self.name)) or score

    def _change_score(self, made: Prediction, parameters: Parameters) -> Score | None:
        null, count = self.null, len(made.draws)
        change = np.where(self.usable, np.nan_to_num(made.mean - null.mean), 0.0)
        own2 = (pair_noise_share(null.keys) * null.noise) ** 2 / count
        change = np.where(is_clear(change, np.maximum(own2, 1e-300)), change, 0.0)
        without = {d.number: d.values for d in null.draws}
        each = np.nan_to_num([d.values - without[d.number] for d in made.draws])
        scatter = each.std(axis=0, ddof=1) if count > 1 else 0.0
        return linear(null, change, [d.values for d in null.draws[:-count]], parameters, scatter)

    def _scatter_score(self, made: Prediction, parameters: Parameters) -> Score | None:
        null = self.null
        z2 = np.mean([in_noise(null, d.values) ** 2 for d in made.draws], axis=0)
        moves = np.where(self.usable, np.maximum(pooled(null.keys, z2) - 2.0, 0.0), 0.0)
        if not moves.any():
            return None
        weight = moves / (1.0 + moves)
        of = partial(log_mean_square, null, weight / weight.sum())
        without = np.array([of(d.values) for d in null.draws[: -len(made.draws)]])
        rise = float(np.mean([of(d.values) for d in made.draws]) - without.mean())
        return Score(of, without, 0.0, parameters, rise)

    def test(self, score: Score, parameters: Parameters) -> StrengthTest:
        """Scores of campaigns with the effect at a strength."""
        assert score.bare is not None and score.unit is not None
        key, events = strength_of(self.name), self.events(parameters)
        times = abs(parameters[key] / score.parameters[key]) ** power_of(self.name)
        count = min(OF_RANDOM_COURSE if self.random_course else self.settings.twins.in_the_end, len(score.without))
        null = replace(self.null, draws=self.null.draws[:count])
        unit = extrapolated_unit(score.bare, score.unit, min(times, 1.0), MOST_EXTRAPOLATED)
        made = predict_by_twins(self.case, with_effect(self.model, self.name, parameters), unit, null, count, self.only)
        scores, without = (np.array([score.of(d.values) for d in draws]) for draws in (made.draws, null.draws))
        if self.random_course:
            sd = float(scores.std(ddof=1)) * np.sqrt(1 + 1 / count)
            return StrengthTest(
                float(scores.mean()) - score.mean, sd, float(scipy.stats.t.ppf(CONFIDENCE, count - 1)), events
            )
        change, n = scores - without, len(score.without)
        excess = float(change.mean())
        own2 = self.score_variance(score, scores, excess, events)
        sd = float(np.sqrt(own2 * (1 + 1 / n) + np.var(change, ddof=1) / count + score.error**2))
        return StrengthTest(excess, sd, float(scipy.stats.t.ppf(CONFIDENCE, n - 1)), events)


class UnitProbe(EffectProbe):
    """Scores of drawn units, which differ by the model's pattern and by the effect's."""

    def __init__(self, case: Case, model: SensorModel, null: Null, name: str):
        super().__init__(case, model, null, name)
        self.without = self._units(model)

    def score(self, parameters: Parameters) -> Score | None:
        """The score by the statistics of the pattern that the effect changes; None where it changes none."""
        units = self._units(with_effect(self.model, self.name, parameters))
        change = np.nan_to_num((units - self.without).mean(axis=0))
        return linear(self.null, change, self.without, parameters)

    def test(self, score: Score, parameters: Parameters) -> StrengthTest:
        """Scores of units with the effect at a strength."""
        units, events = self._units(with_effect(self.model, self.name, parameters)), self.events(parameters)
        scores = np.array([score.of(v) for v in units])
        excess, n = float(scores.mean()) - score.mean, len(units)
        sd = float(np.sqrt(self.score_variance(score, scores, excess, events) * (1 + 1 / n) + score.error**2))
        return StrengthTest(excess, sd, float(scipy.stats.t.ppf(CONFIDENCE, n - 1)), events)

    def _units(self, model: SensorModel) -> Floats:
        units = with_drawn_pattern(self.case, model, self.null, self.null.prediction).units
        assert units is not None
        return units


def linear(
    null: Null,
    change: Floats,
    without: Sequence[Floats] | Floats,
    parameters: Parameters,
    scatter: Floats | float = 0.0,
) -> Score | None:
    """The score along the change by an effect; None where it changes nothing.

    Statistics of unknown noise do not count, such as those of a pattern in the dark without a spike.

    Args:
        change: (S,) change of the statistics at `parameters`.
        without: statistics (S,) of campaigns without the effect.
        parameters: parameters of the effect.
        scatter: (S,) standard deviation of the change over campaigns; a change by few events is known poorly.
    """
    most = CLEAR  # one false spike in a quiet pixel is a hundred noises
    deviates = np.clip(np.nan_to_num(change / null.noise), -most, most)
    weight = null.weight * deviates / (1.0 + np.minimum(np.nan_to_num(scatter / null.noise), most) ** 2)
    if not weight.any():
        return None
    of = partial(linear_score, null, weight)
    error = float(np.sqrt(np.nansum((weight * null.floor / null.noise) ** 2)))
    return Score(of, np.array([of(v) for v in without]), error, parameters, float(weight @ deviates))


def linear_score(null: Null, weight: Floats, values: Floats) -> float:
    """Score of statistics (S,) along a change; unknown statistics do not count."""
    most = CLEAR
    return float(weight @ np.clip(in_noise(null, values), -most, most))


def log_mean_square(null: Null, weight: Floats, values: Floats) -> float:
    """Score of statistics (S,) that an effect scatters both ways equally: the logarithm of their mean square."""
    square = float(weight @ in_noise(null, values) ** 2)
    return float(np.log(max(square, 1e-12)))


def strength_of(name: str) -> str:
    """The parameter that is an effect's strength."""
    return CATALOGUE[name].strength


def power_of(name: str) -> float:
    """The power of the strength to which the change of the statistics is proportional."""
    return candidate(name).power
