"""Effects as a diagnosis names them: those that a search kept, and those that the refit found missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import reduce

import numpy as np

from spikecam_env.gap.baseline.missing_from_refit import Missing
from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.fit.coordinates import interval_of
from spikecam_env.gap.fit.hypothesis import Fit
from spikecam_env.gap.result import Estimate, NamedEffect
from spikecam_env.gap.search.round import Round, absent, adding
from spikecam_env.gap.verdict.comparison import Comparison, gap_of
from spikecam_env.sensor import SensorModel

MOST_CONFIDENCE = 0.99
"""Confidence in a name without a rival: an effect outside of the catalogue may explain as much."""


def patched_model(comparison: Comparison, rounds: Sequence[Round]) -> SensorModel:
    """The last model of a search, without effects that do nothing beside the others."""
    if not rounds:
        return comparison.model
    last = rounds[-1].start.model
    return reduce(SensorModel.without, absent(comparison.case, comparison.model, last), last)


def kept(comparison: Comparison, rounds: Sequence[Round]) -> list[tuple[Fit, Round]]:
    """The best of each round whose effect is in the last model, with its parameters there, and the round."""
    last = {e.name: e.parameters() for e in patched_model(comparison, rounds).effects}
    best = [(r.fits[0], r) for r, _ in adding(rounds) if r.fits[0].name in last]
    return [(replace(f, parameters={k: last[f.name][k] for k in f.parameters}), r) for f, r in best]


def named_by_refit(missing: Missing) -> NamedEffect:
    """An effect of the base pixel, as the refit measured it."""
    effect = missing.effect
    key = type(effect).strength
    estimate = estimates(effect.name, {key: effect.parameters()[key]}, {key: missing.sd})
    share = MOST_CONFIDENCE / (1 + len(missing.also))
    rivals = tuple((name, share) for name in missing.also)
    return NamedEffect(effect.name, candidate(effect.name).family, share, estimate, rivals)


def named_by_search(comparison: Comparison, fit: Fit, turn: Round, place: str, time: str) -> NamedEffect:
    """A kept candidate with the others of its round, weighted by their likelihoods.

    Args:
        comparison: the measurement beside the null model.
        fit: the candidate's fit.
        turn: its round.
        place: part of the array in which it acts.
        time: part of the recordings in which it acts.
    """
    weights = [(f.name, relative_likelihood(f.misfit, fit.misfit)) for f in turn.fits if f.name != fit.name]
    total = 1.0 + sum(w for _, w in weights)
    return NamedEffect(
        fit.name,
        candidate(fit.name).family,
        min(1.0 / total, MOST_CONFIDENCE),
        estimates(fit.name, fit.parameters, fit.sd),
        tuple((name, w / total) for name, w in weights),
        where=place,
        when=time,
        instead=removed_instead(comparison, turn),
    )


def relative_likelihood(misfit: float, best: float) -> float:
    """Likelihood of a fit over that of the best, at most 1: misfits are deviances, twice a log likelihood."""
    return float(np.exp(-max(misfit - best, 0.0) / 2))


def removed_instead(comparison: Comparison, turn: Round) -> dict[str, float]:
    """Share of the gap that the others of a round would remove alone, if several twins confirmed them."""
    case, null, values, given = comparison.case, comparison.null, comparison.values, comparison.given
    confirmed = [f for f in turn.fits[1:] if len(f.prediction.draws) > 1]
    return {f.name: gap_of(case, null, values, given, f.prediction).removed for f in confirmed}


def estimates(name: str, parameters: Mapping[str, float], sd: Mapping[str, float]) -> dict[str, Estimate]:
    """An effect's parameters with their standard deviations, NaN where none is known, and intervals."""
    known = {k: sd.get(k, np.nan) for k in parameters}
    return {k: Estimate(v, known[k], interval_of(name, k, v, known[k])) for k, v in parameters.items()}
