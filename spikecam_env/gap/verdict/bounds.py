"""Upper bounds: strengths of an effect that the campaign at hand refutes, by simulation.

A strength is refuted where 95 of 100 campaigns with the effect would score higher (`score`) than the measurement did.
The least that is refuted is the bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from spikecam_env.gap.baseline.null_model import unit_under
from spikecam_env.gap.candidates.strength import bounded
from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.distance import SHOWS
from spikecam_env.gap.compare.prediction import Null
from spikecam_env.gap.fit.candidate import MOST_TRIES
from spikecam_env.gap.result import Bound
from spikecam_env.gap.screen.templates import Templates
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.verdict.score import (
    RULE_OF_THREE,
    Parameters,
    Score,
    TwinProbe,
    UnitProbe,
    power_of,
    strength_of,
)
from spikecam_env.sensor import CATALOGUE, SensorModel
from spikecam_env.types import Floats

MOST_EFFECT_SIZE = 25.0
"""Noises by which an effect shows at most for its score: what it changes there is like what it changes at its bound."""

OVERSHOOT = 1.2
"""The first strength that is tested, over what is expected."""

LARGEST_SCALING = 40.0
"""Factor by which statistics are made larger or smaller at once, on the way to a score."""

LONGER_RECORDINGS = "longer recordings, or more of them; in these it hardly shows"
MORE_EFFORT = "a larger --effort: the budget was spent"
"""Needed for a bound."""


def bounds(
    case: Case, model: SensorModel, null: Null, measured: Floats, names: Sequence[str], templates: Templates
) -> tuple[list[Bound], list[tuple[str, str]]]:
    """Upper bounds of effects that were not found.

    The bound of an effect of several shapes is that of the shape that shows least; of an effect of either sign, that
    of its size.

    Args:
        model: the model that explains it.
        null: the prediction of that model.
        measured: (S,) statistics.
        names: names of the effects.
        templates: strengths to begin from.

    Returns:
        (bounds; names of effects without a bound, each with the means to get one).
    """
    if case.scenes_only:
        case = replace(case, base=unit_under(case, model))
    starts = [(e.name, p) for e in templates.weakest if e.name in names for p in _both_signs(e.name, e.parameters)]
    by_name = dict.fromkeys(name for name, _ in starts)
    if not case.budget.allows("upper bounds", case.settings.bounding.campaigns * len(case.conditions)):
        return [], [(name, MORE_EFFORT) for name in by_name]

    def scored(start: tuple[str, Parameters]) -> ScoredShape:
        name, parameters = start
        of_units = candidate(name).is_pattern
        probe = UnitProbe(case, model, null, name) if of_units else TwinProbe(case, model, null, measured, name)
        return scored_shape(probe, measured, parameters)

    with ThreadPoolExecutor(case.jobs) as pool:
        shapes = list(pool.map(scored, starts))
        worst = [max((k for k in shapes if k.probe.name == name), key=lambda k: k.expected) for name in by_name]
        each = list(pool.map(partial(bound_of, measured), worst))
    known = [bound for bound in each if isinstance(bound, Bound)]
    return sorted(known, key=lambda b: b.name), sorted(b for b in each if not isinstance(b, Bound))


def _both_signs(name: str, parameters: Parameters) -> list[Parameters]:
    key = strength_of(name)
    return [parameters, {**parameters, key: -parameters[key]}] if candidate(name).may_be_negative else [parameters]


@dataclass(frozen=True)
class ScoredShape:
    """A candidate of one shape with its score."""

    probe: TwinProbe | UnitProbe
    score: Score | None
    """None where the effect does not show."""
    excess: float
    """Score of the measurement less the mean score without the effect, at least 0: chance makes no bound smaller."""

    @property
    def expected(self) -> float:
        """Strength at which the bound is expected, infinite where the effect does not show."""
        if self.score is None or self.score.effect_size < 0.5 * SHOWS:
            return np.inf
        beyond = self.excess + self.score.likely_sds * self.score.sd
        factor = (beyond / self.score.rise) ** (1 / power_of(self.probe.name))
        return float(abs(self.score.parameters[strength_of(self.probe.name)]) * factor)


def scored_shape(probe: TwinProbe | UnitProbe, measured: Floats, start: Parameters) -> ScoredShape:
    """A candidate at a strength where it shows well, from a start."""
    name, score = probe.name, None
    power = power_of(name)
    parameters = bounded(name, start)
    for _ in range(MOST_TRIES):
        score = probe.score(parameters) or score
        effect_size = score.effect_size if score else 0.0
        larger = np.clip(2 * SHOWS / max(effect_size, 1e-9), 1 / LARGEST_SCALING, LARGEST_SCALING)
        factor = float(larger) ** (1 / power)
        stronger = bounded(name, {**parameters, strength_of(name): parameters[strength_of(name)] * factor})
        if SHOWS <= effect_size <= MOST_EFFECT_SIZE or stronger == parameters:
            break
        parameters = stronger
    return ScoredShape(probe, score, excess_of(score, measured))


def excess_of(score: Score | None, measured: Floats) -> float:
    """Score of a measurement less the mean score without the effect, at least 0."""
    return max(score.of(measured) - score.mean, 0.0) if score else 0.0


def bound_of(measured: Floats, shape: ScoredShape) -> Bound | tuple[str, str]:
    """The least refuted strength above which no tested strength is open; without one (name, the means to get one)."""
    probe, name, key = shape.probe, shape.probe.name, strength_of(shape.probe.name)
    resolution = probe.settings.bounding.resolution
    if shape.score is None or not np.isfinite(shape.expected) or probe.events(shape.score.parameters) <= 0:
        return name, LONGER_RECORDINGS
    score = probe.refined(shape.score)
    excess = excess_of(score, measured)
    at = first_strength(shape)
    least, most_open = np.inf, 0.0
    for _ in range(MOST_TRIES):
        size, test = abs(at[key]), probe.test(score, at)
        wanted = excess + test.quantile * test.sd
        ratio = float(np.clip(wanted / max(test.excess, 0.1 * wanted), 0.1, 10.0)) ** (1 / power_of(name))
        if test.refuted_by(excess):
            least = size
            if ratio > resolution or most_open > resolution * size:
                break
        else:
            most_open = size
            ratio = max(ratio, OVERSHOOT)
        bracketed = most_open and np.isfinite(least)
        following = float(np.sqrt(most_open * least)) if bracketed else OVERSHOOT * ratio * size
        following_at = bounded(name, {**at, key: np.sign(at[key]) * following})
        if following_at == at:
            break
        at = following_at
    if not np.isfinite(least):
        return name, LONGER_RECORDINGS
    unit = CATALOGUE[name].__dataclass_fields__[key].metadata["unit"]
    return Bound(name, key, unit, float(least), {k: v for k, v in at.items() if k != key})


def first_strength(shape: ScoredShape) -> Parameters:
    """The parameters at a strength that is likely to be refuted, above the expected bound.

    At least twice RULE_OF_THREE events are expected at it, if their number grows with the strength.
    """
    assert shape.score is not None
    name, key, at = shape.probe.name, strength_of(shape.probe.name), dict(shape.score.parameters)
    at[key] *= OVERSHOOT * shape.expected / abs(at[key])
    share = candidate(name).share
    if share and share[0] == key:
        at[key] *= max(2 * RULE_OF_THREE / shape.probe.events(at), 1.0)
    return bounded(name, at)
