"""Upper bounds: strengths of an effect that the campaign at hand refutes.

A strength is refuted where 95 of 100 campaigns with the effect would score higher than the measurement did.  The least
that is refuted is the bound.  Scores are by simulation of the effect (`score`), or by its template (`linear_response`).
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
from spikecam_env.gap.fit.simulated_templates import template_parameters
from spikecam_env.gap.fit.standard_templates import is_lacking
from spikecam_env.gap.result import Bound
from spikecam_env.gap.screen.templates import Template, Templates
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.verdict.linear_response import TemplateProbe
from spikecam_env.gap.verdict.score import (
    RULE_OF_THREE,
    EffectProbe,
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

CAMPAIGNS_FOR_BOUNDS = 150
"""Cost of all simulated bounds [campaigns], by which the budget allows them; measured."""

MORE_EFFORT = "a larger --effort: the budget was spent"
NO_TEMPLATE = "--bounds simulated: there is no template of it on these recordings"
"""Needed for a bound."""


def bounds(
    case: Case,
    model: SensorModel,
    null: Null,
    measured: Floats,
    names: Sequence[str],
    templates: Templates,
    kind: str = "simulated",
) -> tuple[list[Bound], list[tuple[str, str]]]:
    """Upper bounds of effects that were not found.

    The bound of an effect of several shapes is that of the shape that shows least; of an effect of either sign, that
    of its size.

    Args:
        case: the measurement.
        model: the model that explains it.
        null: the prediction of that model.
        measured: (S,) statistics.
        names: names of the effects.
        templates: of the effects; their strengths are those to begin from.
        kind: simulated, or linear: by templates of the present laws, for campaigns with known light.

    Returns:
        (bounds; names of effects without a bound, each with the means to get one).
    """
    lacking = [n for n in names if kind == "linear" and template_parameters(n) and not _is_linear(case, templates, n)]
    starts = [
        (e, p)
        for e in templates.weakest
        if e.name in names and e.name not in lacking
        for p in _both_signs(e.name, e.parameters)
    ]
    by_name = dict.fromkeys(e.name for e, _ in starts)
    expense = CAMPAIGNS_FOR_BOUNDS * len(case.conditions)
    if kind == "simulated" and not case.budget.allows("upper bounds", expense):
        return [], [(name, MORE_EFFORT) for name in by_name]
    if case.scenes_only and starts:
        case = replace(case, base=unit_under(case, model))

    def scored(start: tuple[Template, Parameters]) -> ScoredShape:
        entry, parameters = start
        if kind == "linear":
            return scored_shape(TemplateProbe(case, model, null, templates, entry), measured, parameters)
        of_units = candidate(entry.name).is_pattern
        probe = UnitProbe if of_units else partial(TwinProbe, measured=measured)
        return scored_shape(probe(case, model, null, name=entry.name), measured, parameters)

    with ThreadPoolExecutor(case.jobs) as pool:
        shapes = list(pool.map(scored, starts))
        worst = [max((k for k in shapes if k.probe.name == name), key=lambda k: k.expected) for name in by_name]
        each = [*pool.map(partial(bound_of, measured), worst), *((name, NO_TEMPLATE) for name in lacking)]
    known = [bound for bound in each if isinstance(bound, Bound)]
    return sorted(known, key=lambda b: b.name), sorted(b for b in each if not isinstance(b, Bound))


def _is_linear(case: Case, templates: Templates, name: str) -> bool:
    """Whether a template of an effect's present law says how statistics of a case respond to it."""
    return not case.scenes_only and not is_lacking(name, templates)


def _both_signs(name: str, parameters: Parameters) -> list[Parameters]:
    key = strength_of(name)
    return [parameters, {**parameters, key: -parameters[key]}] if candidate(name).may_be_negative else [parameters]


@dataclass(frozen=True)
class ScoredShape:
    """A candidate of one shape with its score."""

    probe: EffectProbe
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


def scored_shape(probe: EffectProbe, measured: Floats, start: Parameters) -> ScoredShape:
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
    if shape.score is None or not np.isfinite(shape.expected) or probe.events(shape.score.parameters) <= 0:
        return name, probe.needed
    score = probe.refined(shape.score)
    excess = excess_of(score, measured)
    at = first_strength(shape)
    least, most_open = np.inf, 0.0
    for _ in range(probe.most_tests):
        size, test = abs(at[key]), probe.test(score, at)
        wanted = excess + test.quantile * test.sd
        ratio = float(np.clip(wanted / max(test.excess, 0.1 * wanted), 0.1, 10.0)) ** (1 / power_of(name))
        if test.refuted_by(excess):
            least = size
            if ratio > probe.resolution or most_open > probe.resolution * size:
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
    below = probe.safety * float(least)
    if not np.isfinite(below) or bounded(name, {key: below})[key] < below:
        return name, probe.needed
    unit = CATALOGUE[name].__dataclass_fields__[key].metadata["unit"]
    return Bound(name, key, unit, below, {k: v for k, v in at.items() if k != key}, probe.kind)


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
