"""From a search to a verdict: what is named, what is left, and the gap on recordings that were held out."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.baseline.label_audit import Contradiction
from spikecam_env.gap.baseline.missing_from_refit import Missing
from spikecam_env.gap.baseline.off_nominal import Off, with_strengths
from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.distance import adjusted, deviates, is_significant, residual, robust_squares
from spikecam_env.gap.compare.prediction import Null, Prediction
from spikecam_env.gap.fit.candidate import Fit
from spikecam_env.gap.result import Diagnosis, Estimate, Gap, NamedEffect, Ranked, Statistic
from spikecam_env.gap.search.forward import CAMPAIGNS_PER_EFFECT, SECOND
from spikecam_env.gap.search.round import Round
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.verdict.notes import HELD_OUT_ALONE, LENT
from spikecam_env.gap.verdict.structure import structure
from spikecam_env.gap.verdict.where_and_when import when, where
from spikecam_env.sensor import SensorModel

Array = NDArray[np.float64]

SURE = 0.002
"""Adjusted p-value below which a discrepancy is unknown where no candidate takes it up; above, it may be chance."""

UNEXPLAINED = 0.02
"""Share of the evidence that may stay unexplained when something is named."""

QUIET = 0.1
"""The loudest statistic that may be left, over the loudest before; the robust misfit hardly hears a single one."""


def explains(null: Null, before: Array, rho: Array, predicted: Prediction) -> bool:
    """Whether residuals `rho` of a prediction are chance; or, beside those of the model as given, little and quiet, and
    none that was not there, which would contradict what was added."""
    by_chance = float(np.sum(null.weight * np.ones(len(rho))))
    left = (robust_squares(rho, null.weight) - by_chance) / max(robust_squares(before, null.weight) - by_chance, 1.0)
    quiet = np.abs(rho).max() < QUIET * np.abs(before).max()
    contradicted = is_significant(null, np.where(np.abs(rho) > np.abs(before), rho, 0.0), predicted)
    return not is_significant(null, rho, predicted) or bool(left < UNEXPLAINED and quiet and not contradicted)


def harmless(case: Case, null: Null, values: Array, rounds: Sequence[Round]) -> list[Round]:
    """The rounds; where what they found does not explain the data, they end where they came nearest to recordings held
    out: a stand-in has to be of use where nobody looked."""
    *before, last = rounds
    given, rho = residual(null, values, null.prediction), residual(null, values, last.prediction)
    if explains(null, given, rho, last.prediction):
        return list(rounds)
    left = [gap_of(case, null, values, null.mean, r.prediction).after for r in rounds]
    return [*before, replace(rounds[int(np.argmin(left))], fits=())]


def concluded(
    case: Case,
    model: SensorModel,
    null: Null,
    given: Array,
    values: Array,
    lacking: Sequence[Missing],
    off: Off,
    rounds: Sequence[Round],
    contradictions: Sequence[Contradiction],
    untestable: Sequence[tuple[str, str]],
) -> Diagnosis:
    """From the search to a verdict.  given: (S,) predictions of the model as it was given."""
    last = rounds[-1].prediction if rounds else null.prediction
    before, rho = residual(null, values, null.prediction), residual(null, values, last)
    found = accepted(rounds)
    there, then = where(case), when(case)
    effects = tuple(
        replace(named(f, r, removed_instead(case, null, values, given, r)), where=there, when=then) for f, r in found
    )
    rivals = next(((f.name, *r.rivals) for f, r in found if r.rivals), ())
    explained, left_open = explains(null, before, rho, last), SECOND in case.budget.left_out
    chance = not found and bool(adjusted(deviates(null, values)).min() > SURE)
    if explained or chance or not rounds:
        effects = (*(named_missing(m) for m in lacking), *effects)
    unknown, class_ = None, None
    if contradictions:
        verdict = "data"
    elif rounds and not chance and not (found and explained and not left_open):
        verdict, effects = "unknown", ()
        unknown = {**structure(case, null, before), "best_candidate": found[0][0].name if found else None}
        unknown |= {"not_looked_for": SECOND, "effort": enough(case)} if left_open else {}
    elif rivals and not lacking:
        verdict = "class"
        class_ = {"members": list(rivals), "experiment": candidate(rivals[0]).experiment}
    elif found or lacking:
        verdict = "named"
    else:
        verdict = "parameter" if off.parameters else "none"
    z = deviates(replace(null, mean=given), values)
    return Diagnosis(
        verdict=verdict,
        sentence="",
        effects=effects,
        unknown=unknown,
        class_=class_,
        parameters=off.parameters,
        data=(*(c.text for c in contradictions), *told_of(found)),
        gap=gap_of(case, null, values, given, last),
        statistics=table(case, null, values, given, z, adjusted(z), last.mean, rho),
        ranking=tuple(ranked(f, r, f is r.fits[0] and any(r is t for _, t in found)) for r in rounds for f in r.fits),
        not_testable=tuple(untestable),
        bounds=(),
        patched=with_strengths(rounds[-1].model if rounds else model, off.parameters),
        model_name=model.name,
        campaign="",
        seed=case.seed,
        stages={},
    )


def enough(case: Case) -> int:
    """Effort with which another effect would have been looked for beside those found, in tens."""
    return 10 * math.ceil((case.budget.simulated / len(case.conditions) + CAMPAIGNS_PER_EFFECT + 1) / 10)


def accepted(rounds: Sequence[Round]) -> list[tuple[Fit, Round]]:
    """The best of each round that was kept, with its parameters as they are in the end, and the round."""
    kept = {e.name: e.parameters() for e in rounds[-1].model.effects} if rounds else {}
    added = [r for r, after in itertools.pairwise(rounds) if after.model is not r.model]
    found = [(r.fits[0], r) for r in added if r.fits[0].name in kept]
    return [(replace(f, parameters={k: kept[f.name][k] for k in f.parameters}), r) for f, r in found]


def removed_instead(case: Case, null: Null, values: Array, given: Array, turn: Round) -> dict[str, float]:
    """Share of the gap that the others of a round would remove alone, of those that were confirmed."""
    sure = [f for f in turn.fits[1:] if len(f.prediction.draws) > 1]
    return {f.name: gap_of(case, null, values, given, f.prediction).removed for f in sure}


def told_of(found: Sequence[tuple[Fit, Round]]) -> list[str]:
    """What to know of how it was found."""
    lent = [LENT] if any(r.used_held_out for _, r in found) else []
    return lent + ([HELD_OUT_ALONE] if any(r.motion_alone for _, r in found) else [])


def named_missing(found: Missing) -> NamedEffect:
    """An effect of the base pixel, as the refit measured it."""
    effect = found.effect
    key = type(effect).strength
    estimate = {key: Estimate(effect.parameters()[key], found.sd)}
    share = 0.99 / (1 + len(found.also))
    rivals = tuple((name, share) for name in found.also)
    return NamedEffect(effect.name, candidate(effect.name).family, share, estimate, rivals)


def named(found: Fit, turn: Round, instead: Mapping[str, float]) -> NamedEffect:
    """A candidate as the diagnosis names it, with its rivals; instead: share of the gap that some of these remove."""
    rivals = [(f, float(np.exp(-max(f.misfit - found.misfit, 0.0) / 2))) for f in turn.fits if f.name != found.name]
    total = 1.0 + sum(w for _, w in rivals)
    parameters = {k: Estimate(v, found.sd.get(k, np.nan)) for k, v in found.parameters.items()}
    return NamedEffect(
        found.name,
        candidate(found.name).family,
        min(1.0 / total, 0.99),
        parameters,
        tuple((f.name, w / total) for f, w in rivals),
        instead=dict(instead),
    )


def ranked(found: Fit, turn: Round, accepted: bool) -> Ranked:
    """A row of the ranking; the misfit of what was added is beside all that was found, in their noise."""
    before = turn.misfit
    parameters = {k: Estimate(v, found.sd.get(k, np.nan)) for k, v in found.parameters.items()}
    worst = float(np.abs(found.rho).max())
    reason = f"leaves {worst:.1f} noises at worst" if accepted or found.misfit < before else "explains nothing"
    return Ranked(found.name, candidate(found.name).family, before, found.misfit, parameters, accepted, reason)


def gap_of(case: Case, null: Null, values: Array, given: Array, after: Prediction) -> Gap:
    """Mean square distance on held-out recordings, in the noise that each model predicts."""
    held = case.held_out(null.keys)
    wider = np.sqrt(np.maximum(after.spread**2 - null.sd**2, 0.0) + null.noise**2)
    b, a = (np.nan_to_num((values - mean) / sd) ** 2 for mean, sd in ((given, null.noise), (after.mean, wider)))
    by = {}
    for c in case.conditions:
        of = np.array([k.recording == c.name for k in null.keys])
        if np.any(of):
            by[c.name] = {"before": float(b[of].mean()), "after": float(a[of].mean()), "floor": 1.0}
    before, then = float(b[held].mean()), float(a[held].mean())
    return grounded(Gap(before, then, 1.0, 0.0, by), 1.0)


def grounded(gap: Gap, floor: float) -> Gap:
    """A gap with its floor: what chance alone makes of it (`halves_floor`), or 1 where that is not known, or where
    halves of a recording differ by more than chance: the camera changes with time, and the floor would hold what is to
    be found."""
    ground = min(floor, 1.0) if np.isfinite(floor) else 1.0
    removed = (gap.before - gap.after) / (gap.before - ground) if gap.before > 1.5 * ground else 0.0
    by = {name: {**values, "floor": ground} for name, values in gap.by_recording.items()}
    return Gap(gap.before, gap.after, ground, removed, by)


def table(
    case: Case, null: Null, values: Array, given: Array, z: Array, p: Array, after: Array, rho: Array
) -> tuple[Statistic, ...]:
    """The bank as the result states it."""
    return tuple(
        Statistic(f"{k.group}: {k.name}", k.group, (k.recording,), float(values[j]), float(given[j]),
                  float(after[j]), float(null.noise[j]), float(z[j]), float(rho[j]), float(p[j]),
                  case.use(k.recording) == "holdout")
        for j, k in enumerate(null.keys)
    )  # fmt: skip
