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

from spikecam_env.gap.candidates import candidate, expected_events, is_pattern
from spikecam_env.gap.case import Case
from spikecam_env.gap.compare import Null, Prediction, is_clear, of_a_pair, pooled
from spikecam_env.gap.descent import settled_there
from spikecam_env.gap.fit import UNITS, WANDER, concerned, predict, twins_of, with_pattern
from spikecam_env.gap.refit import BaseFit, within
from spikecam_env.gap.result import Bound
from spikecam_env.gap.settle import shifted
from spikecam_env.gap.strength import bounded, may_be_negative, with_effect
from spikecam_env.gap.templates import Templates
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

NEAR, FARTHER = 0.6, 1.2
"""A bound is at most 1 / NEAR times the least strength that would be refuted; the first that is tried is FARTHER times
what the score lets expect."""

COST = 100
"""Campaigns that the bounds of all candidates take, by and large."""

LONGER, MORE_EFFORT = "longer recordings, or more of them: even the strongest would hardly show", "a larger --effort"
"""What is needed for a bound."""


@dataclass(frozen=True)
class Score:
    """One number of a campaign that an effect makes larger.

    of: (S,) statistics -> score.  without: (n,) of campaigns without the effect.  error: of the score, what labels and
    laws are not known to.  shows_by: score at `parameters`, the mean without it 0.
    """

    of: Callable[[Array], float]
    without: Array
    error: float
    parameters: Parameters
    shows_by: float

    @property
    def middle(self) -> float:
        """Mean score without the effect."""
        return float(np.mean(self.without))

    @property
    def sd(self) -> float:
        """Standard deviation of a campaign's score without the effect, beside the mean of these."""
        n = len(self.without)
        return float(np.sqrt(np.var(self.without, ddof=1) * (1 + 1 / n) + self.error**2))


@dataclass(frozen=True)
class Tried:
    """A strength that was simulated.  score: mean of its campaigns'; sd: of the distance of one from that mean.

    events: expected of what can be counted, infinite elsewhere.
    """

    score: float
    sd: float
    events: float
    quantile: float

    def refuted_by(self, seen: float) -> bool:
        """Whether a campaign scores too little for it."""
        return self.events > EVENTS and seen < self.score - self.quantile * self.sd


def bounds(
    case: Case, model: SensorModel, null: Null, measured: Array, names: Sequence[str], templates: Templates
) -> tuple[list[Bound], list[tuple[str, str]]]:
    """(upper bounds of effects that were not found, names of those that have none with what would give one).

    model, null: what explains the campaign.  measured: (S,) its statistics.  templates: say where to begin.  Of an
    effect of several shapes the bound is of the one that shows least; of one of either sign, of its size.
    """
    starts = [(e.name, p) for e in templates.weakest if e.name in names for p in _both_signs(e.name, e.parameters)]
    by_name = dict.fromkeys(name for name, _ in starts)
    if not case.effort.allows("upper bounds", COST * len(case.conditions)):
        return [], [(name, MORE_EFFORT) for name in by_name]
    with ThreadPoolExecutor(case.jobs) as pool:
        looks = list(pool.map(lambda start: _look(case, model, null, measured, *start), starts))
        worst = {name: max((look for look in looks if look.name == name), key=lambda look: look.expected) for name in by_name}
        found = list(pool.map(_bound, worst.values()))
    kept = [bound for bound in found if isinstance(bound, Bound)]
    return sorted(kept, key=lambda b: b.name), sorted(b for b in found if not isinstance(b, Bound))


def _both_signs(name: str, parameters: Parameters) -> list[Parameters]:
    key = CATALOGUE[name].strength
    return [parameters, {**parameters, key: -parameters[key]}] if may_be_negative(name) else [parameters]


@dataclass(frozen=True)
class _Look:
    """A candidate of one shape, as it was looked at.  score: None where it does not show.  seen: the measurement's,
    or what is usual without the effect where that is more: a campaign that happens to score little tells no more."""

    name: str
    probe: _OfTwins | _OfUnits
    score: Score | None
    seen: float

    @property
    def expected(self) -> float:
        """Strength at which the bound is expected, infinite where the effect does not show."""
        if self.score is None or self.score.shows_by < 0.5 * SHOWS * self.score.sd:
            return np.inf
        wanted = self.seen - self.score.middle + 1.8 * self.score.sd
        return abs(self.score.parameters[_key(self.name)]) * (wanted / self.score.shows_by) ** (1 / _power(self.name))


def _look(case: Case, model: SensorModel, null: Null, measured: Array, name: str, start: Parameters) -> _Look:
    probe = _OfUnits(case, model, null, name) if is_pattern(name) else _OfTwins(case, model, null, measured, name)
    score, parameters = None, bounded(name, start)
    for _ in range(LOOKS):
        score = probe.score(parameters) or score
        shows = score.shows_by / score.sd if score else 0.0
        factor = float(np.clip(AIM / max(shows, 0.3), 1 / 40, 40.0)) ** (1 / _power(name))
        louder = bounded(name, {**parameters, _key(name): parameters[_key(name)] * factor})
        if SHOWS <= shows <= TOO_LOUD or louder == parameters:
            break
        parameters = louder
    return _Look(name, probe, score, max(score.of(measured), score.middle) if score else 0.0)


def _bound(look: _Look) -> Bound | tuple[str, str]:
    """The least of the strengths that were tried above which none is open; or the name, with what is needed."""
    if look.score is None or not np.isfinite(look.expected):
        return look.name, LONGER
    key, metadata = _key(look.name), CATALOGUE[look.name].__dataclass_fields__[_key(look.name)].metadata
    at = dict(look.score.parameters)
    at[key] *= FARTHER * look.expected / abs(at[key])
    if (events := look.probe.events(at)) < 2 * EVENTS:
        at[key] *= 2 * EVENTS / max(events, 1e-9) if look.probe.events({**at, key: 2 * at[key]}) > events else 1.0
    least, most_open = np.inf, 0.0
    for _ in range(TRIES):
        at = bounded(look.name, at)
        size, tried = abs(at[key]), look.probe.tried(look.score, at)
        wanted = look.seen - look.score.middle + tried.quantile * tried.sd
        ratio = float(np.clip(wanted / max(tried.score - look.score.middle, 0.1 * wanted), 0.1, 10.0)) ** (1 / _power(look.name))
        if tried.events <= EVENTS:
            ratio = max(ratio, EVENTS / tried.events)
        if tried.refuted_by(look.seen):
            least = size
            if ratio > NEAR or most_open > NEAR * size:
                break
            step = FARTHER * ratio
        else:
            most_open = size
            step = FARTHER * max(ratio, FARTHER)
        between = np.sqrt(most_open * least) if most_open and np.isfinite(least) else size * step
        if between * step == size:
            break
        at = {**at, key: np.sign(at[key]) * between}
    if not np.isfinite(least):
        return look.name, LONGER
    others = {k: v for k, v in at.items() if k != key}
    return Bound(look.name, key, metadata["unit"], float(least), others)


def _key(name: str) -> str:
    return CATALOGUE[name].strength


def _power(name: str) -> float:
    return candidate(name).power


class _OfTwins:
    """Scores of twins of the campaign: of those with the effect, where it is strong, the last draws; the first say what
    it scores where it is weak."""

    def __init__(self, case: Case, model: SensorModel, null: Null, measured: Array, name: str):
        self.case, self.model, self.null, self.name = case, model, null, name
        everywhere = np.full(len(null.keys), np.inf)
        self.only = concerned(case, [name], null, measured, everywhere)
        used = {case.conditions[i].name for i in self.only}
        self.there = np.array([k.group != "pattern" and k.recording in used for k in null.keys])
        what = candidate(name)
        several = WANDER if what.wanders else twins_of(name) if what.share else 1
        self.looked = min(several, len(null.draws) // 2)
        self.base: BaseFit | None = None
        self.bare: BaseFit | None = None

    def score(self, parameters: Parameters) -> Score | None:
        """The score by the statistics that the effect clearly changes at some strength; None where it changes none."""
        there = with_effect(self.model, self.name, parameters)
        self.bare = within(there, within(self.model, self.case.base))
        probe = partial(predict, self.case, null=self.null, count=self.looked, only=self.only)
        made, self.base = settled_there(lambda m, b: probe(m, b), self.null, there, self.bare, [])
        return self._score(made, parameters)

    def _score(self, made: Prediction, parameters: Parameters) -> Score | None:
        null, known = self.null, self.there
        change = np.where(known, np.nan_to_num(made.mean - null.mean), 0.0)
        draws = [d.values for d in null.draws[: -self.looked]]
        if candidate(self.name).wanders:
            z2 = np.mean([np.nan_to_num((d.values - null.mean) / null.noise) ** 2 for d in made.draws], axis=0)
            moves = np.where(known, np.maximum(pooled(null.keys, z2) - 2.0, 0.0), 0.0)
            if not moves.any():
                return None
            weight = moves / (1.0 + moves)
            of = partial(_scatter, null, weight / weight.sum())
        else:
            own2 = (of_a_pair(null.keys) * null.noise) ** 2 / len(made.draws)
            clear = is_clear(change, np.maximum(own2, 1e-300))
            return _linear(null, np.where(clear, change, 0.0), draws, parameters, self._own_sd(made))
        without = np.array([of(v) for v in draws])
        shows_by = float(np.mean([of(d.values) for d in made.draws]) - without.mean())
        return Score(of, without, 0.0, parameters, shows_by)

    def events(self, parameters: Parameters) -> float:
        """Expected of what can be counted; infinite elsewhere."""
        return expected_events(self.name, parameters, self.case.conditions, self.case.observations)

    def _own_sd(self, made: Prediction) -> Array:
        """(S,) standard deviation of what the effect changes, where several campaigns tell, beyond that of pairs."""
        without = {d.number: d.values for d in self.null.draws}
        changes = np.nan_to_num([d.values - without[d.number] for d in made.draws])
        return changes.std(axis=0, ddof=1) if len(changes) > 1 else np.zeros(len(self.null.keys))

    def tried(self, score: Score, parameters: Parameters) -> Tried:
        """What campaigns with the effect at a strength score."""
        key, power = CATALOGUE[self.name].strength, candidate(self.name).power
        assert self.bare is not None and self.base is not None
        there = with_effect(self.model, self.name, parameters)
        times = abs(parameters[key] / score.parameters[key]) ** power
        wanders = candidate(self.name).wanders
        count = min(WANDER if wanders else TESTED, len(self.null.draws) - self.looked)
        null = replace(self.null, draws=self.null.draws[:count])
        made = predict(self.case, there, shifted(self.bare, self.base, min(times, 1.0)), null, count, self.only)
        scores = np.array([score.of(d.values) for d in made.draws])
        without = np.array([score.of(d.values) for d in null.draws])
        events = self.events(parameters)
        if wanders:
            sd, quantile = scores.std(ddof=1) * np.sqrt(1 + 1 / count), stats.t.ppf(CERTAIN, count - 1)
            return Tried(float(scores.mean()), float(sd), events, float(quantile))
        change = scores - without
        mean = float(change.mean()) + float(score.without.mean())
        own2 = max(float(np.var(scores, ddof=1)), float(np.var(score.without, ddof=1)) + change.mean() ** 2 / events)
        sd = np.sqrt(own2 * (1 + 1 / len(score.without)) + np.var(change, ddof=1) / count + score.error**2)
        return Tried(mean, float(sd), events, float(stats.t.ppf(CERTAIN, len(score.without) - 1)))


class _OfUnits:
    """Scores of drawn units, which differ by the model's pattern and by the effect's."""

    def __init__(self, case: Case, model: SensorModel, null: Null, name: str):
        self.case, self.model, self.null, self.name = case, model, null, name
        self.without = with_pattern(case, model, null, null.prediction).units

    def score(self, parameters: Parameters) -> Score | None:
        """The score by the statistics of the pattern that the effect changes; None where it changes none."""
        assert self.without is not None
        change = np.nan_to_num((self._units(parameters) - self.without).mean(axis=0))
        return _linear(self.null, change, self.without, parameters)

    def tried(self, score: Score, parameters: Parameters) -> Tried:
        """What units with the effect at a strength score."""
        scores = np.array([score.of(v) for v in self._units(parameters)])
        events = self.events(parameters)
        change = scores.mean() - score.without.mean()
        own2 = max(float(np.var(scores, ddof=1)), float(np.var(score.without, ddof=1)) + change**2 / events)
        sd = float(np.sqrt(own2 * (1 + 1 / UNITS) + score.error**2))
        return Tried(float(scores.mean()), sd, events, float(stats.t.ppf(CERTAIN, UNITS - 1)))

    def events(self, parameters: Parameters) -> float:
        """Expected of what can be counted; infinite elsewhere."""
        return expected_events(self.name, parameters, self.case.conditions, self.case.observations)

    def _units(self, parameters: Parameters) -> Array:
        there = with_effect(self.model, self.name, parameters)
        units = with_pattern(self.case, there, self.null, self.null.prediction).units
        assert units is not None
        return units


def _linear(
    null: Null, change: Array, without: Sequence[Array] | Array, parameters: Parameters, own_sd: Array | float = 0.0
) -> Score | None:
    """The score along what an effect changes (S,) at some strength; None where it changes nothing.

    own_sd: (S,) by which that differs from campaign to campaign: what few events change by much tells little.
    """
    shows = np.clip(change / null.noise, -FARTHEST, FARTHEST)
    own2 = np.minimum(own_sd / null.noise, FARTHEST) ** 2
    weight = null.weight * shows / (1.0 + own2)
    if not weight.any():
        return None
    of = partial(_along, null, weight)
    error = float(np.sqrt(np.sum((weight * null.floor / null.noise) ** 2)))
    return Score(of, np.array([of(v) for v in without]), error, parameters, float(weight @ shows))


def _along(null: Null, weight: Array, values: Array) -> float:
    """Score of statistics (S,) along a change; what is unknown says nothing."""
    return float(weight @ np.clip(np.nan_to_num((values - null.mean) / null.noise), -FARTHEST, FARTHEST))


def _scatter(null: Null, weight: Array, values: Array) -> float:
    """Score of statistics (S,) that an effect scatters, each way alike: the logarithm of their mean square."""
    return float(np.log(weight @ np.nan_to_num((values - null.mean) / null.noise) ** 2))
