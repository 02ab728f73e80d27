"""The verdict by a search among maps."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.distance import adjusted, deviates, is_significant, residual
from spikecam_env.gap.compare.prediction import Null
from spikecam_env.gap.fit.coordinates import interval_of
from spikecam_env.gap.maps.bank import MapCase, with_use
from spikecam_env.gap.maps.search import (
    FITTED_SPREADS,
    LINEAR_PARAMETERS,
    MapFit,
    PatternModel,
    fitted_parameters,
)
from spikecam_env.gap.result import (
    EXPLAINS_ALL,
    EXPLAINS_NEARLY_ALL,
    MOST_CONFIDENCE,
    UNKNOWN,
    Conclusion,
    Estimate,
    Gap,
    NamedEffect,
    Ranked,
    Statistic,
    why_rejected,
)
from spikecam_env.gap.unit.refit import unusual
from spikecam_env.sensor import CATALOGUE, SensorModel
from spikecam_env.types import Floats

LARGEST_SD = 0.5
"""Relative standard deviation of a strength up to which its effect is there: 2 standard deviations from 0."""

MOST_RELATIVE_SD = 10.0
"""Standard deviation of a parameter's logarithm from which no error is stated: of an effect that does nothing."""

LISTED = 6
"""Number of statistics that are listed of the remainder."""


def conclude_maps(
    case: MapCase,
    tested: SensorModel,
    null: Null,
    values: Floats,
    rounds: Sequence[Sequence[MapFit]],
    rejected: Sequence[MapFit],
    not_testable: Sequence[tuple[str, str]],
) -> Conclusion:
    """The verdict of a search.

    Args:
        tested: the model under test.
        null: its prediction.
        values: (S,) measured statistics.
        rounds: spreads alone, then the fits of each round, the best first.
        rejected: fits of the round that added none.
        not_testable: names of candidates that the maps cannot show, each with the recording that it needs.
    """
    last = rounds[-1][0] if rounds else None
    rho = last.rho if last else residual(null, values, null.prediction)
    predicted = last.predicted if last else null.mean
    left = share_left(null, values, predicted)
    is_left = is_significant(null, rho)
    explained = not rounds or not is_left or left < case.settings.maps.most_left
    parameters = spreads_off(case, last.state) if last else {}
    effects = significant_effects(case, null, values, rounds)
    by_effects = "named" if effects else "parameter" if parameters else "none"
    verdict = by_effects if explained else "unknown"
    beside = EXPLAINS_NEARLY_ALL if is_left else EXPLAINS_ALL
    return Conclusion(
        verdict=verdict,
        degree={"named": beside, "unknown": UNKNOWN}.get(verdict),
        effects=effects if explained else (),
        unknown=None if explained else maps_structure(null, rho, left, [e.name for e in effects]),
        class_=None,
        parameters=parameters,
        data=(note_on_remainder(null, rho, left),) if rounds and explained and is_left else (),
        gap=gap_of_maps(case, null, values, predicted),
        statistics=map_statistics(case, null, values, predicted, rho),
        ranking=map_ranking([*rounds, rejected], rejected, case.settings.deviance.accept_map),
        not_testable=tuple(not_testable),
        patched=patched_model(case, tested, last),
    )


def share_left(null: Null, values: Floats, predicted: Floats) -> float:
    """Share of the mean square distance beyond chance that a prediction (S,) leaves."""
    before, after = (float(np.mean(((values - mean) / null.noise) ** 2)) for mean in (null.mean, predicted))
    return (after - 1.0) / max(before - 1.0, 1e-9)


def map_ranking(rounds: Sequence[Sequence[MapFit]], rejected: Sequence[MapFit], accept: float) -> tuple[Ranked, ...]:
    """Rows of the fits of every round after the first.

    Args:
        rounds: fits of each round, the best first.
        rejected: the round that added none.
        accept: reduction in misfit that an effect has to make.
    """
    return tuple(
        ranked_fit(fit, before[0].misfit, fits[0].name, fit is fits[0] and fits is not rejected, accept)
        for before, fits in itertools.pairwise(rounds)
        for fit in fits
    )


def significant_effects(
    case: MapCase, null: Null, values: Floats, rounds: Sequence[Sequence[MapFit]]
) -> tuple[NamedEffect, ...]:
    """The best of each round after the first, where its strength is significant in the end."""
    effects = []
    for fits in rounds[1:]:
        if has_clear_strength(rounds[-1][0], fits[0].name, LARGEST_SD):
            instead = {f.name: gap_of_maps(case, null, values, f.predicted).removed for f in fits[1:]}
            effects.append(named_effect(fits, rounds[-1][0], instead))
    return tuple(effects)


def map_statistics(case: MapCase, null: Null, values: Floats, predicted: Floats, rho: Floats) -> tuple[Statistic, ...]:
    """Every statistic, measured, before and after; rho: (S,) residuals, in noise."""
    use, z = with_use(case, null.keys, "fit"), deviates(null, values)
    p = adjusted(z)
    return tuple(
        Statistic(f"{k.group}: {k.name}", k.group, (k.recording,), float(values[j]), float(null.mean[j]),
                  float(predicted[j]), float(null.noise[j]), float(z[j]), float(rho[j]), float(p[j]),
                  not bool(use[j]))
        for j, k in enumerate(null.keys)
    )  # fmt: skip


def patched_model(case: MapCase, tested: SensorModel, last: MapFit | None) -> SensorModel:
    """The fitted model without effects that are not significant in the end; the tested one where nothing was fitted."""
    if last is None:
        return tested
    patched = at_measured_dark(last.state, case)
    for name in (n for n in last.state.added if not has_clear_strength(last, n, LARGEST_SD)):
        patched = patched.without(name)
    return patched


def spreads_off(case: MapCase, state: PatternModel) -> dict[str, dict[str, float]]:
    """Spreads of the model that this unit has in another amount than units differ by: as `baseline.off_nominal`."""
    rows = {}
    for kind, factor in state.factors.items():
        if not unusual(factor, case.settings.unit.usual):
            continue
        for effect in state.model.effects:
            if effect.name in FITTED_SPREADS[kind]:
                key = FITTED_SPREADS[kind][effect.name]
                nominal = effect.parameters()[key]
                rows[effect.name] = {"measured": nominal * factor, "nominal": nominal, "ratio": factor}
    return rows


def named_effect(tried: Sequence[MapFit], last: MapFit, instead: dict[str, float]) -> NamedEffect:
    """The best of a round, with its last parameters; confidence and rivals are the round's.

    Args:
        tried: fits of the round, the best first.
        last: the last fit.
        instead: share of the gap that the others would remove.
    """
    best = tried[0]
    weights = [(t.name, float(np.exp(-max(t.misfit - best.misfit, 0.0) / 2))) for t in tried[1:]]
    total = 1.0 + sum(w for _, w in weights)
    return NamedEffect(
        best.name,
        candidate(best.name).family,
        min(1.0 / total, MOST_CONFIDENCE),
        fit_estimates(last, best.name),
        tuple((n, w / total) for n, w in weights),
        instead=instead,
    )


def has_clear_strength(last: MapFit, name: str, largest_sd: float) -> bool:
    """Whether an effect's last strength is known to a relative standard deviation: a later one may replace it."""
    return last.sd[f"{name}.{CATALOGUE[name].strength}"] < largest_sd


def fit_estimates(tried: MapFit, name: str) -> dict[str, Estimate]:
    """The parameters of an effect; errors of those that were fitted by their logarithm are relative."""
    values = next(e for e in tried.state.model.effects if e.name == name).parameters()
    sd = {p: tried.sd.get(f"{name}.{p}", np.nan) for p in fitted_parameters(name)}
    sd = {p: s if s < MOST_RELATIVE_SD else np.nan for p, s in sd.items()}
    return {p: _estimate(name, p, values[p], s) for p, s in sd.items()}


def _estimate(name: str, key: str, value: float, sd: float) -> Estimate:
    """sd: standard deviation of the value, where that was fitted, or of its logarithm."""
    linear = key in LINEAR_PARAMETERS
    own = sd * (1.0 if linear else value)
    return Estimate(value, own, interval_of(name, key, value, own, by_steps=linear))


def ranked_fit(t: MapFit, before: float, best: str, accepted: bool, accept: float) -> Ranked:
    """A row of the ranking.

    Args:
        t: the fit.
        before: misfit before its round.
        best: the best candidate of its round.
        accepted: whether it was added.
        accept: reduction in misfit that an effect has to make.
    """
    worst = float(np.abs(t.rho).max())
    against = why_rejected(t.misfit, before, best, accept)
    reason = f"leaves {worst:.1f} noises at worst" if accepted else against
    return Ranked(t.name, candidate(t.name).family, before, t.misfit, fit_estimates(t, t.name), accepted, reason)


def worst_left(null: Null, rho: Floats) -> list[str]:
    """The statistics with the largest deviates."""
    order = sorted(range(len(rho)), key=lambda j: -abs(rho[j]))[:LISTED]
    return [f"{null.keys[j].recording} {null.keys[j].name} ({rho[j]:+.1f})" for j in order]


def note_on_remainder(null: Null, rho: Floats, left: float) -> str:
    """A note on a name that does not explain everything."""
    return (
        f"the named effects leave {100 * left:.1f} % of the mean square distance, more than chance; "
        f"largest deviations, in noise: {', '.join(worst_left(null, rho))}"
    )


def maps_structure(null: Null, rho: Floats, left: float, found: list[str]) -> dict[str, Any]:
    """The structure of the difference that remains beside all effects that help."""
    return {
        "light": "rates alone: in the dark and in the light",
        "left": round(left, 3),
        "found": found,
        "worst": worst_left(null, rho),
        "patch": f"the effects that help ({', '.join(found)}), and fitted spreads" if found else "spreads as fitted",
    }


def gap_of_maps(case: MapCase, null: Null, values: Floats, predicted: Floats) -> Gap:
    """Mean squares in the null's noise: a fitted model of maps scatters as the null does."""
    b, a = (((values - mean) / null.noise) ** 2 for mean in (null.mean, predicted))
    by_recording = {}
    for m in case.maps:
        own = np.array([k.recording == m.shown.name for k in null.keys])
        by_recording[m.shown.name] = float(b[own].mean()), float(a[own].mean())
    held = with_use(case, null.keys, "holdout")
    held = held if held.any() else np.ones(len(held), bool)
    return Gap.of(float(b[held].mean()), float(a[held].mean()), by_recording)


def at_measured_dark(state: PatternModel, case: MapCase) -> SensorModel:
    """The fitted model, its dark level the measured one."""
    out = state.fitted
    level = next((e for e in out.effects if e.name == "dark_current"), None)
    middle = float(np.median(out.draw_unit(case.shape, case.seed).dark))
    if level is None or middle <= 0 or case.dark <= 0:
        return out
    return out.with_effect(replace(level, mean_pA=level.parameters()["mean_pA"] * case.dark / middle))  # type: ignore[call-arg]
