"""Upper bounds: strengths of an effect that were simulated on the campaign at hand, and that it refutes.

A score, linear in the statistics, is taken along what the effect changes where it is strong.  Campaigns with the effect
at a weaker strength say how large the score then is, and how widely it scatters.  A strength is refuted where 95 of 100
such campaigns would score higher than the measurement did.  The least that is refuted is the bound.

Of what is counted (false spikes, hot pixels) a strength that lets expect EVENTS of them or fewer is never refuted:
one campaign in twenty has none.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from spikecam_env.gap.candidates.strength import bounded, with_effect
from spikecam_env.gap.candidates.table import candidate, expected_events
from spikecam_env.gap.compare.prediction import Null, Prediction, pair_noise_share, pooled
from spikecam_env.gap.compare.step import is_clear
from spikecam_env.gap.fit.gauss_newton import at_settled_unit
from spikecam_env.gap.fit.predict import predict_by_twins, with_drawn_pattern
from spikecam_env.gap.fit.recordings import TWINS_OF_RANDOM_COURSE, recordings_affected, twins_of
from spikecam_env.gap.result import Bound
from spikecam_env.gap.screen.templates import Templates
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.twins.fresh_units import DRAWN_UNITS
from spikecam_env.gap.unit.indirect_inference import shifted
from spikecam_env.gap.unit.refit import BaseFit, within
from spikecam_env.sensor import CATALOGUE, SensorModel

Array = NDArray[np.float64]
Parameters = dict[str, float]

CERTAIN = 0.95
"""Share of campaigns with an effect of the stated strength that score higher than the measurement."""

EVENTS = -float(np.log(1.0 - CERTAIN))
"""Events expected, 3.0, of which there are none by chance of 1 - CERTAIN."""

SHOWS, TOO_LOUD, AIM = 6.0, 25.0, 12.0
"""Noises by which an effect has to show, and may at most, for its score, and is made to: what it changes there is clear
of chance, and like what it changes at its bound."""

FARTHEST = 5.0
"""Noises at which a statistic counts as no farther off: one false spike in a quiet pixel is a hundred noises."""

LOOKS, TRIES, TESTED = 5, 5, 4
"""Strengths at which an effect is looked at for its score, and tried to be refuted, at most; campaigns a try."""

LIKELY = 1.8
"""Standard deviations of the score by which a refuted strength is likely to be above what is seen."""

NEAR, FARTHER = 0.6, 1.2
"""A bound is at most 1 / NEAR times the least strength that would be refuted; the first that is tried is FARTHER times
what the score lets expect."""

COST = 150
"""Campaigns that the bounds of all candidates take, by and large."""

LONGER = "longer recordings, or more of them: in these it would hardly show"
MORE_EFFORT = "a larger --effort: enough had been simulated"
"""What is needed for a bound."""


@dataclass(frozen=True)
class Score:
    """One number of a campaign that an effect makes larger.

    of: (S,) statistics -> score.  without: (n,) of campaigns without the effect.  error: of the score, by what labels
    and laws are not known to.  shows_by: how much more it is at `parameters`, where the unit `bare` settled as `unit`.
    """

    of: Callable[[Array], float]
    without: Array
    error: float
    parameters: Parameters
    shows_by: float
    bare: BaseFit | None = None
    unit: BaseFit | None = None

    @property
    def middle(self) -> float:
        """Mean score without the effect."""
        return float(np.mean(self.without))

    @property
    def sd(self) -> float:
        """Standard deviation of a campaign's score without the effect, beside that mean."""
        n = len(self.without)
        return float(np.sqrt(np.var(self.without, ddof=1) * (1 + 1 / n) + self.error**2))

    @property
    def shows(self) -> float:
        """Noises by which the effect shows."""
        return self.shows_by / self.sd


@dataclass(frozen=True)
class Tried:
    """A strength that was simulated.  more: mean score of its campaigns, beyond that without the effect; sd: of the
    distance of a campaign from that mean; quantile: of that distance, CERTAIN of campaigns are nearer or above.

    events: expected of what can be counted, infinite elsewhere.
    """

    more: float
    sd: float
    quantile: float
    events: float

    def refuted_by(self, more: float) -> bool:
        """Whether a campaign that scores so much scores too little for it."""
        return self.events > EVENTS and more < self.more - self.quantile * self.sd


def bounds(
    case: Case, model: SensorModel, null: Null, measured: Array, names: Sequence[str], templates: Templates
) -> tuple[list[Bound], list[tuple[str, str]]]:
    """(upper bounds of effects that were not found, names of those that have none with what would give one).

    model, null: what explains the campaign.  measured: (S,) its statistics.  templates: say where to begin.  Of an
    effect of several shapes the bound is of the one that shows least; of one of either sign, of its size.
    """
    starts = [(e.name, p) for e in templates.weakest if e.name in names for p in _both_signs(e.name, e.parameters)]
    by_name = dict.fromkeys(name for name, _ in starts)
    if not case.budget.allows("upper bounds", COST * len(case.conditions)):
        return [], [(name, MORE_EFFORT) for name in by_name]

    def look(start: tuple[str, Parameters]) -> Look:
        name, parameters = start
        return looked_at(_OfUnits(case, model, null, name) if candidate(name).is_pattern else
                         _OfTwins(case, model, null, measured, name), measured, parameters)  # fmt: skip

    with ThreadPoolExecutor(case.jobs) as pool:
        looks = list(pool.map(look, starts))
        worst = [max((k for k in looks if k.probe.name == name), key=lambda k: k.expected) for name in by_name]
        found = list(pool.map(partial(bound_of, measured), worst))
    kept = [bound for bound in found if isinstance(bound, Bound)]
    return sorted(kept, key=lambda b: b.name), sorted(b for b in found if not isinstance(b, Bound))


def _both_signs(name: str, parameters: Parameters) -> list[Parameters]:
    key = _key(name)
    return [parameters, {**parameters, key: -parameters[key]}] if candidate(name).may_be_negative else [parameters]


@dataclass(frozen=True)
class Look:
    """A candidate of one shape, as it was looked at.  score: None where it does not show.

    more: what the measurement scores beyond what is usual without the effect; 0 where that is less, since a campaign
    that happens to score little tells no more.
    """

    probe: _OfTwins | _OfUnits
    score: Score | None
    more: float

    @property
    def expected(self) -> float:
        """Strength at which the bound is expected, infinite where the effect does not show."""
        if self.score is None or self.score.shows < 0.5 * SHOWS:
            return np.inf
        factor = ((self.more + LIKELY * self.score.sd) / self.score.shows_by) ** (1 / _power(self.probe.name))
        return float(abs(self.score.parameters[_key(self.probe.name)]) * factor)


def looked_at(probe: _OfTwins | _OfUnits, measured: Array, start: Parameters) -> Look:
    """A candidate at a strength where it shows well, from a start."""
    name, score = probe.name, None
    parameters = bounded(name, start)
    for _ in range(LOOKS):
        score = probe.score(parameters) or score
        shows = score.shows if score else 0.0
        factor = float(np.clip(AIM / max(shows, 0.3), 1 / 40, 40.0)) ** (1 / _power(name))
        louder = bounded(name, {**parameters, _key(name): parameters[_key(name)] * factor})
        if SHOWS <= shows <= TOO_LOUD or louder == parameters:
            break
        parameters = louder
    return Look(probe, score, more_of(score, measured))


def more_of(score: Score | None, measured: Array) -> float:
    """What a measurement scores beyond what is usual, at least 0."""
    return max(score.of(measured) - score.middle, 0.0) if score else 0.0


def bound_of(measured: Array, look: Look) -> Bound | tuple[str, str]:
    """The least strength that was refuted and has none above it that was not; or the name, with what is needed."""
    probe, name, key = look.probe, look.probe.name, _key(look.probe.name)
    if look.score is None or not np.isfinite(look.expected) or probe.events(look.score.parameters) <= 0:
        return name, LONGER
    score = probe.surer(look.score)
    more = more_of(score, measured)
    at = first_tried(look)
    least, most_open = np.inf, 0.0
    for _ in range(TRIES):
        size, tried = abs(at[key]), probe.tried(score, at)
        wanted = more + tried.quantile * tried.sd
        ratio = float(np.clip(wanted / max(tried.more, 0.1 * wanted), 0.1, 10.0)) ** (1 / _power(name))
        if tried.refuted_by(more):
            least = size
            if ratio > NEAR or most_open > NEAR * size:
                break
        else:
            most_open = size
            ratio = max(ratio, FARTHER)
        between = most_open and np.isfinite(least)
        then = float(np.sqrt(most_open * least)) if between else FARTHER * ratio * size
        then_at = bounded(name, {**at, key: np.sign(at[key]) * then})
        if then_at == at:
            break
        at = then_at
    if not np.isfinite(least):
        return name, LONGER
    unit = CATALOGUE[name].__dataclass_fields__[key].metadata["unit"]
    return Bound(name, key, unit, float(least), {k: v for k, v in at.items() if k != key})


def first_tried(look: Look) -> Parameters:
    """The parameters at a strength that is likely to be refuted: above where the bound is expected, and of what is
    counted twice EVENTS at least, where more of the strength makes them more."""
    assert look.score is not None
    name, key, at = look.probe.name, _key(look.probe.name), dict(look.score.parameters)
    at[key] *= FARTHER * look.expected / abs(at[key])
    share = candidate(name).share
    if share and share[0] == key:
        at[key] *= max(2 * EVENTS / look.probe.events(at), 1.0)
    return bounded(name, at)


def _key(name: str) -> str:
    return CATALOGUE[name].strength


def _power(name: str) -> float:
    return candidate(name).power


class _Probe:
    """A candidate on the campaign at hand."""

    def __init__(self, case: Case, model: SensorModel, null: Null, name: str):
        self.case, self.model, self.null, self.name = case, model, null, name

    def events(self, parameters: Parameters) -> float:
        """Expected of what can be counted; infinite elsewhere."""
        return expected_events(self.name, parameters, self.case.conditions, self.case.observations)

    @staticmethod
    def variance(score: Score, scores: Array, more: float, events: float) -> float:
        """Of a campaign's score with the effect, which scores `more`: what few campaigns show, and at least what there
        is without it and what so few events make."""
        by_chance = more**2 / events
        return max(float(np.var(scores, ddof=1)), float(np.var(score.without, ddof=1)) + by_chance)


class _OfTwins(_Probe):
    """Scores of twins of the campaign.  The last draws, with the effect where it is strong, say what to look at; the
    first what that is where the effect is weak."""

    def __init__(self, case: Case, model: SensorModel, null: Null, measured: Array, name: str):
        super().__init__(case, model, null, name)
        self.only = recordings_affected(case, [name], null, measured, np.full(len(null.keys), np.inf))
        used = {case.conditions[i].name for i in self.only}
        self.there = np.array([k.group != "pattern" and k.recording in used for k in null.keys])
        self.wanders = candidate(name).random_course

    def score(self, parameters: Parameters, count: int = 1) -> Score | None:
        """The score by the statistics that the effect clearly changes at some strength; None where it changes none."""
        count = min(TWINS_OF_RANDOM_COURSE if self.wanders else count, len(self.null.draws) // 2)
        there = with_effect(self.model, self.name, parameters)
        bare = within(there, within(self.model, self.case.base))

        def probe(model: SensorModel, unit: BaseFit) -> Prediction:
            return predict_by_twins(self.case, model, unit, self.null, count, self.only)

        made, unit = at_settled_unit(probe, self.null, there, bare, [])
        found = (self._scatter if self.wanders else self._change)(made, parameters)
        return replace(found, bare=bare, unit=unit) if found else None

    def surer(self, score: Score) -> Score:
        """The score of single events by more campaigns: of few, which statistics they change is chance."""
        if not candidate(self.name).share:
            return score
        return self.score(score.parameters, twins_of(self.name)) or score

    def _change(self, made: Prediction, parameters: Parameters) -> Score | None:
        null, count = self.null, len(made.draws)
        change = np.where(self.there, np.nan_to_num(made.mean - null.mean), 0.0)
        own2 = (pair_noise_share(null.keys) * null.noise) ** 2 / count
        change = np.where(is_clear(change, np.maximum(own2, 1e-300)), change, 0.0)
        without = {d.number: d.values for d in null.draws}
        each = np.nan_to_num([d.values - without[d.number] for d in made.draws])
        scatter = each.std(axis=0, ddof=1) if count > 1 else 0.0
        return _linear(null, change, [d.values for d in null.draws[:-count]], parameters, scatter)

    def _scatter(self, made: Prediction, parameters: Parameters) -> Score | None:
        null = self.null
        z2 = np.mean([np.nan_to_num((d.values - null.mean) / null.noise) ** 2 for d in made.draws], axis=0)
        moves = np.where(self.there, np.maximum(pooled(null.keys, z2) - 2.0, 0.0), 0.0)
        if not moves.any():
            return None
        weight = moves / (1.0 + moves)
        of = partial(_log_scatter, null, weight / weight.sum())
        without = np.array([of(d.values) for d in null.draws[: -len(made.draws)]])
        shows_by = float(np.mean([of(d.values) for d in made.draws]) - without.mean())
        return Score(of, without, 0.0, parameters, shows_by)

    def tried(self, score: Score, parameters: Parameters) -> Tried:
        """What campaigns with the effect at a strength score."""
        assert score.bare is not None and score.unit is not None
        key, events = _key(self.name), self.events(parameters)
        times = abs(parameters[key] / score.parameters[key]) ** _power(self.name)
        count = min(TWINS_OF_RANDOM_COURSE if self.wanders else TESTED, len(score.without))
        null = replace(self.null, draws=self.null.draws[:count])
        unit = shifted(score.bare, score.unit, min(times, 1.0))
        made = predict_by_twins(self.case, with_effect(self.model, self.name, parameters), unit, null, count, self.only)
        scores, without = (np.array([score.of(d.values) for d in draws]) for draws in (made.draws, null.draws))
        if self.wanders:
            sd = float(scores.std(ddof=1)) * np.sqrt(1 + 1 / count)
            return Tried(float(scores.mean()) - score.middle, sd, float(stats.t.ppf(CERTAIN, count - 1)), events)
        change, n = scores - without, len(score.without)
        more = float(change.mean())
        own2 = self.variance(score, scores, more, events)
        sd = float(np.sqrt(own2 * (1 + 1 / n) + np.var(change, ddof=1) / count + score.error**2))
        return Tried(more, sd, float(stats.t.ppf(CERTAIN, n - 1)), events)


class _OfUnits(_Probe):
    """Scores of drawn units, which differ by the model's pattern and by the effect's."""

    def __init__(self, case: Case, model: SensorModel, null: Null, name: str):
        super().__init__(case, model, null, name)
        self.without = self._units(model)

    def score(self, parameters: Parameters) -> Score | None:
        """The score by the statistics of the pattern that the effect changes; None where it changes none."""
        units = self._units(with_effect(self.model, self.name, parameters))
        change = np.nan_to_num((units - self.without).mean(axis=0))
        return _linear(self.null, change, self.without, parameters)

    def surer(self, score: Score) -> Score:
        """The same: units are many."""
        return score

    def tried(self, score: Score, parameters: Parameters) -> Tried:
        """What units with the effect at a strength score."""
        units, events = self._units(with_effect(self.model, self.name, parameters)), self.events(parameters)
        scores = np.array([score.of(v) for v in units])
        more = float(scores.mean()) - score.middle
        sd = float(np.sqrt(self.variance(score, scores, more, events) * (1 + 1 / DRAWN_UNITS) + score.error**2))
        return Tried(more, sd, float(stats.t.ppf(CERTAIN, DRAWN_UNITS - 1)), events)

    def _units(self, model: SensorModel) -> Array:
        units = with_drawn_pattern(self.case, model, self.null, self.null.prediction).units
        assert units is not None
        return units


def _linear(
    null: Null, change: Array, without: Sequence[Array] | Array, parameters: Parameters, scatter: Array | float = 0.0
) -> Score | None:
    """The score along what an effect changes (S,) at some strength; None where it changes nothing.

    scatter: (S,) by which that differs from campaign to campaign: what few events change by much tells little.
    """
    shows = np.clip(change / null.noise, -FARTHEST, FARTHEST)
    weight = null.weight * shows / (1.0 + np.minimum(scatter / null.noise, FARTHEST) ** 2)
    if not weight.any():
        return None
    of = partial(_along, null, weight)
    error = float(np.sqrt(np.sum((weight * null.floor / null.noise) ** 2)))
    return Score(of, np.array([of(v) for v in without]), error, parameters, float(weight @ shows))


def _along(null: Null, weight: Array, values: Array) -> float:
    """Score of statistics (S,) along a change; what is unknown says nothing."""
    return float(weight @ np.clip(np.nan_to_num((values - null.mean) / null.noise), -FARTHEST, FARTHEST))


def _log_scatter(null: Null, weight: Array, values: Array) -> float:
    """Score of statistics (S,) that an effect scatters, each way alike: the logarithm of their mean square."""
    square = float(weight @ np.nan_to_num((values - null.mean) / null.noise) ** 2)
    return float(np.log(max(square, 1e-12)))
