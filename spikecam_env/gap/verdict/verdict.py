"""The verdict: whether the effects explain the campaign, and the description of the rest where they do not."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import reduce
from typing import Any

import numpy as np

from spikecam_env.gap.baseline.off_nominal import OffNominal, off_nominal, spreads_off, with_strengths
from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.distance import adjusted, deviates, residual
from spikecam_env.gap.fit.candidate import WORTH
from spikecam_env.gap.fit.confirm import confirmed
from spikecam_env.gap.fit.hypothesis import Fit, Hypothesis
from spikecam_env.gap.result import (
    EXPLAINS_ALL,
    EXPLAINS_NEARLY_ALL,
    LARGEST,
    UNKNOWN,
    Conclusion,
    NamedEffect,
    Statistic,
    notes_of,
)
from spikecam_env.gap.search.forward import CAMPAIGNS_PER_EFFECT, SECOND
from spikecam_env.gap.search.round import Round
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.unit.refit import BaseFit
from spikecam_env.gap.verdict.comparison import Comparison, gap_of, usable_floor
from spikecam_env.gap.verdict.degree import Explanation, explanation_of
from spikecam_env.gap.verdict.named_effects import kept, named_by_refit, named_by_search, patched_model
from spikecam_env.gap.verdict.ranking import ranking
from spikecam_env.gap.verdict.remainder import remainder_of, squares_left
from spikecam_env.gap.verdict.structure import structure
from spikecam_env.gap.verdict.where_and_when import when, where
from spikecam_env.sensor import SensorModel
from spikecam_env.types import Floats

NEARLY = (EXPLAINS_ALL, EXPLAINS_NEARLY_ALL)
"""Degrees of a model that leaves little."""


def conclude(comparison: Comparison, rounds: Sequence[Round], floor: float) -> Conclusion:
    """The verdict by the rounds of a search.

    Args:
        comparison: the measurement beside the null model.
        rounds: rounds of the search; none without an alarm.
        floor: floor of the gap, by two halves of the measurement.
    """
    case, null = comparison.case, comparison.null
    last = rounds[-1].start.prediction if rounds else null.prediction
    left = residual(null, comparison.values, last)
    kept_fits = kept(comparison, rounds)
    by_chance = not rounds or may_be_chance(comparison, kept_fits)
    explained = Explanation(EXPLAINS_ALL) if by_chance else explanation_of(null, comparison.values, rounds)
    is_clean = explained.degree == EXPLAINS_ALL
    off = parameters_off(comparison, rounds) if is_clean or case.rates_only else {}
    verdict = verdict_of(comparison, rounds, kept_fits, explained.degree) or ("parameter" if off else "none")
    model = patched_model(comparison, rounds)
    return Conclusion(
        verdict=verdict,
        degree={"named": explained.degree, "class": explained.degree, "unknown": UNKNOWN}.get(verdict),
        effects=() if verdict == "unknown" else named(comparison, kept_fits, explained),
        stand_ins=tuple(f.name for f, _ in kept_fits if verdict == "unknown" or f.name not in explained.names),
        unknown=described(comparison, kept_fits, explained) if verdict == "unknown" else None,
        class_=tied(kept_fits) if verdict == "class" else None,
        parameters=off,
        data=(*(c.text for c in comparison.contradictions), *notes_of([r for _, r in kept_fits])),
        gap=gap_of(case, null, comparison.values, comparison.given, last, usable_floor(floor)),
        statistics=statistics_rows(comparison, last.mean, left),
        ranking=ranking(rounds, kept_fits, null.settings.deviance.accept),
        not_testable=comparison.not_testable,
        patched=with_strengths(model, off),
        remainder=remainder_of(case, null, comparison.values, last) if verdict == "named" and not is_clean else None,
    )


def verdict_of(
    comparison: Comparison,
    rounds: Sequence[Round],
    kept_fits: Sequence[tuple[Fit, Round]],
    degree: str,
) -> str:
    """The verdict on effects; "" if none is missing.

    If several effects explain as much and something is left, the verdict is `unknown`: none of them is shown to be the
    right name of a slightly different law.

    Args:
        comparison: the measurement beside the null model.
        kept_fits: effects that were kept, with their rounds.
        degree: one of `DEGREES`.
    """
    enough = kept_fits and degree != UNKNOWN and not second_left_out(comparison.case)
    if comparison.contradictions:
        return "data"
    unexplained = kept_fits or degree != EXPLAINS_ALL
    if rounds and unexplained and not may_be_chance(comparison, kept_fits) and not enough:
        return "unknown"
    if any(r.rivals for _, r in kept_fits) and not comparison.missing:
        return "class" if degree == EXPLAINS_ALL else "unknown"
    return "named" if kept_fits or comparison.missing else ""


def parameters_off(comparison: Comparison, rounds: Sequence[Round]) -> dict[str, dict[str, float]]:
    """Effects of the tested model that the unit has in another amount.

    They are judged by the last unit of the search, beside the patterns that it added.  A parameter that the added
    effects scatter by more than it is off is not among them.

    Args:
        comparison: the measurement beside the null model.

    Returns:
        {effect: {measured, nominal, ratio}}, in the unit of the effect's strength.
    """
    if not rounds or comparison.missing:
        return comparison.off.parameters
    case, tested, last = comparison.case, comparison.tested, rounds[-1].start
    if case.rates_only:
        return spreads_off(case, tested, last.model)
    off = off_beside(case, tested, last, last.base).parameters
    refits = [d.refit for d in last.prediction.draws if d.refit is not None]
    as_read = [off_beside(case, tested, last, refit).parameters for refit in refits[-1:]] if off else []
    return {name: row for name, row in off.items() if not any(is_scattered(name, row, read) for read in as_read)}


def is_scattered(name: str, unit: Mapping[str, float], as_read: Mapping[str, Mapping[str, float]]) -> bool:
    """Whether effects move the refit of a parameter by more than the unit's own value is off.

    Rare false spikes add a hundred times a unit's jitter; a small error of that is as much as the model has.

    Args:
        name: of the parameter's effect.
        unit: its row of the unit itself.
        as_read: rows of the refit of the unit's twin with the effects; a row that is missing is nominal.
    """
    read = as_read[name]["ratio"] if name in as_read else 1.0
    return abs(math.log(read / unit["ratio"])) >= abs(math.log(unit["ratio"]))


def off_beside(case: Case, tested: SensorModel, last: Hypothesis, unit: BaseFit) -> OffNominal:
    """Parameters of the tested model that a unit has in another amount, beside the patterns that the search added.

    The added patterns, and not the model's own spreads, explain how pixels differ.

    Args:
        tested: the model under test.
    """
    patterns = (e for e in last.model.effects if candidate(e.name).is_pattern)
    return off_nominal(case, reduce(SensorModel.with_effect, patterns, tested), unit)


def may_be_chance(comparison: Comparison, kept_fits: Sequence[tuple[Fit, Round]]) -> bool:
    """Whether nothing was found, and the alarm was a weak one."""
    return not kept_fits and comparison.smallest_p > comparison.null.settings.judging.chance_p


def second_left_out(case: Case) -> bool:
    """Whether a second effect was not looked for, to save time."""
    return SECOND in case.budget.left_out


def up_to_named(comparison: Comparison, rounds: Sequence[Round]) -> list[Round]:
    """The rounds up to the one whose effects are named.

    That is the last of those that explain all or nearly all and take most of the earlier remainder: a round that takes
    less stands for details of the earlier law.  Otherwise it is the one with most names that are shown to be right,
    and fewest others.  If there is none either, the rounds end at the smallest held-out gap: an empirical patch has to
    be of use in recordings that took no part.
    """
    case, null, values = comparison.case, comparison.null, comparison.values
    *before, last = rounds
    ends = [(r, explanation_of(null, values, rounds[: n + 1])) for n, r in enumerate(rounds) if n > 0]
    explaining = [r for r, made in ends if made.degree in NEARLY]
    right = [(r, made) for r, made in ends if made.degree == LARGEST]
    if explaining:
        end, little = explaining[0], 1.0 - WORTH
        for later in explaining[1:]:
            then, now = (squares_left(null, values, r.start.prediction) for r in (end, later))
            end = later if now <= little * then else end
    elif right:
        end = max(right, key=lambda one: (len(one[1].names), -len(one[0].start.effects)))[0]
    else:
        gaps = [gap_of(case, null, values, null.mean, r.start.prediction).after for r in rounds]
        end = rounds[int(np.argmin(gaps))]
    return list(rounds) if end is last else [*before, replace(end, fits=())]


def with_given_parameters(comparison: Comparison, rounds: Sequence[Round]) -> list[Round]:
    """The rounds with the tested model's nominal parameters in the last unit, where these explain the data as well.

    The fitted ones stay where they take more than half of the nominal ones' remainder.  An effect whose law differs in
    details moves the statistics by which a parameter is known.
    """
    *before, end = rounds
    problem, tested = comparison.problem, comparison.tested
    null, values, last = problem.null, problem.values, end.start
    if (
        comparison.missing
        or last.effects <= {e.name for e in tested.effects}
        or explanation_of(null, values, rounds).degree not in NEARLY
    ):
        return list(rounds)
    off = off_beside(problem.case, tested, last, last.base)
    count = problem.settings.twins.in_the_end
    cost = count * len(problem.case.conditions)
    if not off.parameters or not problem.allows("parameters as given", cost, needed=True):
        return list(rounds)
    given = confirmed(problem, problem.fit_of("", {}, last.model, off.nominal, last.prediction), count)
    left = squares_left(null, values, given.prediction)
    most = squares_left(null, values, last.prediction) <= (1.0 - WORTH) * left
    if explanation_of(null, values, [*before, Round(given)]).degree not in NEARLY or (left > 0.0 and most):
        return list(rounds)
    return [*before, Round(given)]


def named(
    comparison: Comparison, kept_fits: Sequence[tuple[Fit, Round]], explained: Explanation
) -> tuple[NamedEffect, ...]:
    """Effects that the refit found missing, if names are right, and those of the search that have a margin."""
    place, time = where(comparison.case), when(comparison.case)
    by_search = tuple(named_by_search(comparison, f, r, place, time) for f, r in kept_fits if f.name in explained.names)
    if explained.degree != UNKNOWN:
        return (*(named_by_refit(m) for m in comparison.missing), *by_search)
    return by_search


def described(comparison: Comparison, kept_fits: Sequence[tuple[Fit, Round]], explained: Explanation) -> dict[str, Any]:
    """The structure of an unknown discrepancy, the nearest candidate and its faults, and the search left out."""
    case = comparison.case
    about = structure(case, comparison.null, comparison.residuals)
    about["best_candidate"] = kept_fits[0][0].name if kept_fits else None
    if kept_fits:
        about["not_named"] = explained.fault(case.settings.concluding)
    if second_left_out(case):
        about |= {"not_looked_for": SECOND, "effort": enough_effort(case)}
    return about


def enough_effort(case: Case) -> int:
    """Budget with which another effect would have been searched for, in tens."""
    return 10 * math.ceil((case.budget.simulated / len(case.conditions) + CAMPAIGNS_PER_EFFECT + 1) / 10)


def tied(kept_fits: Sequence[tuple[Fit, Round]]) -> dict[str, Any]:
    """The candidates of the first tie, and the experiment that separates them."""
    members = next([f.name, *r.rivals] for f, r in kept_fits if r.rivals)
    return {"members": members, "experiment": candidate(members[0]).experiment}


def statistics_rows(comparison: Comparison, after: Floats, left: Floats) -> tuple[Statistic, ...]:
    """Every statistic under the model as given, and with the effects.

    Args:
        comparison: the measurement beside the null model.
        after: (S,) means of the model with the effects.
        left: (S,) residuals of that model, in noise.
    """
    case, null, values, given = comparison.case, comparison.null, comparison.values, comparison.given
    z = deviates(replace(null, mean=given), values)
    p = adjusted(z)
    return tuple(
        Statistic(f"{k.group}: {k.name}", k.group, (k.recording,), float(values[j]), float(given[j]),
                  float(after[j]), float(null.noise[j]), float(z[j]), float(left[j]), float(p[j]),
                  case.use(k.recording) == "holdout")
        for j, k in enumerate(null.keys)
    )  # fmt: skip
