"""The diagnosis: refit the unit, compare, and while something is left add the effect that explains most of it.

    read -> audit -> refit -> twins -> alarm -> [screen -> fit -> confirm -> add]* -> gate -> verdict

Each step is a function of its own, usable by itself.  Held-out recordings take no part in alarm and search; in the
choice they decide what others cannot tell apart, and within errors they tell parameters that others leave open, which
is then said; the gate is on all, and the gap on them alone.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from spikecam_env.calibration.campaign import Campaign, read_campaign
from spikecam_env.errors import InputError
from spikecam_env.gap.audit import Contradiction, audit
from spikecam_env.gap.candidates import candidate, chosen, is_pattern, of_motion, testable
from spikecam_env.gap.case import Case, case_of
from spikecam_env.gap.compare import (
    TOLERANCE,
    Null,
    Prediction,
    adjusted,
    alarmed,
    deviates,
    judged,
    misfit,
    of_all_recordings,
    own_variance,
    residual,
    values_of,
)
from spikecam_env.gap.evidence import evidence_of
from spikecam_env.gap.fit import Fit, confirmed, fit, rejoined
from spikecam_env.gap.floor import floor_of_halves
from spikecam_env.gap.maps import diagnose_maps
from spikecam_env.gap.missing import Missing, missing
from spikecam_env.gap.own_templates import own_templates
from spikecam_env.gap.parameters import off_nominal
from spikecam_env.gap.place import when, where
from spikecam_env.gap.polish import Errors, polished
from spikecam_env.gap.refit import BaseFit, within
from spikecam_env.gap.result import Diagnosis, Estimate, Gap, NamedEffect, Ranked, Statistic
from spikecam_env.gap.rivals import is_rival
from spikecam_env.gap.statistics.spectrum import frequency, spectrum, strongest_line
from spikecam_env.gap.structure import structure
from spikecam_env.gap.templates import Screened, Templates, bounds, load, model_null, screen
from spikecam_env.gap.words import LENT, sentence
from spikecam_env.gap.world import KNOWN, Shown, observed, shown
from spikecam_env.sensor import SensorModel

Array = NDArray[np.float64]

ALARM = 0.02
"""Adjusted p-value below which there is a discrepancy at all."""

SURE = 0.002
"""Adjusted p-value below which a discrepancy is unknown where no candidate takes it up; above, it may be chance."""

LOUD = 6.0
"""Noises by which a statistic of the pattern, or of motion, has to stand out for its effects to be tried."""

FEWEST, TRIED = 3, 5
"""Candidates fitted a round, the best by their templates: so many at least and at most."""

MOST = 3
"""Effects that one diagnosis names together."""

GAIN = 12.0
"""Misfit that an effect has to remove to be added."""

LITTLE = (0.2, 0.5)
"""Share of what is beyond chance that the first effect, and each later one of what the others left, has to remove for
another to be looked for beside them: less is a stand-in's."""

UNEXPLAINED = 0.02
"""Share of the evidence that may stay unexplained when something is named."""

QUIET = 0.1
"""The loudest statistic that may be left, over the loudest before; the robust misfit hardly hears a single one."""

PROMISE = 15.0
"""Misfit by which a fit that is not confirmed may be worse than the best that is, to be confirmed as well."""


@dataclass(frozen=True)
class Round:
    """One turn of the search: the model it started from, what that left, and the candidates that were fitted.

    rivals: names that may as well be true as the best of them.  lent: whether held-out recordings were fitted too.
    """

    model: SensorModel
    base: BaseFit
    prediction: Prediction
    rho: Array
    misfit: float
    fits: tuple[Fit, ...]
    rivals: tuple[str, ...] = ()
    lent: bool = False


def diagnose(
    campaign: Campaign | str | Path,
    model: SensorModel | str | Path = "scsim",
    *,
    candidates: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    seed: int = 0,
    jobs: int = 1,
    twin_count: int = 12,
    templates: Templates | None = None,
    progress: bool = True,
) -> Diagnosis:
    """Find where a measured campaign and a model disagree, which effect is missing, and how large it is.

    campaign: a folder in the format spikecam-campaign/1.  model: a SensorModel, a preset's name or a TOML path.
    candidates: names to try, default the whole catalogue; exclude: names to leave out.  Same seed, same answer.
    jobs: threads.  Raises InputError for an unreadable campaign, an unknown name, or too few static recordings
    of known light to refit the unit by.
    """
    stages: dict[str, float] = {}
    timed = _stages(stages, progress)
    measured = campaign if isinstance(campaign, Campaign) else read_campaign(campaign)
    assumed = model if isinstance(model, SensorModel) else SensorModel.load(model)
    assumed = replace(assumed, frame_rate_hz=measured.frame_rate_hz)
    names = chosen(assumed, candidates, exclude)
    asked = {
        "model_name": assumed.name if isinstance(model, SensorModel) else str(model),
        "candidates": None if candidates is None else tuple(candidates),
        "exclude": tuple(exclude),
        "stages": stages,
    }
    if not any(r.spikes for r in measured.recordings):
        with timed("maps"):
            found = diagnose_maps(measured, assumed, candidates=candidates, exclude=exclude, seed=seed, jobs=jobs)
        found = replace(found, **asked)  # type: ignore[arg-type]
        return replace(found, sentence=sentence(found))
    with timed("read"):
        case = read_case(measured, seed, jobs)
    with timed("audit"):
        contradictions = audit(case)
        case = trimmed(case, contradictions)
    names, untestable = testable(names, case.conditions)
    lacking = missing(case, assumed, names)
    start = assumed
    for m in lacking:
        start = start.with_effect(m.effect)
    with timed("twins"):
        null = model_null(case, start, twin_count)
        before = model_null(case, assumed, 2) if lacking else null
    values = values_of(case.bank, null.keys)
    rounds: list[Round] = []
    z = deviates(null, of_fit(case, null, values))
    if adjusted(np.append(z, of_all_recordings(null.keys, z, "intervals"))).min() < ALARM:
        with timed("candidates"):
            if case.scenes_only:
                templates = templates or own_templates(case, start, null, names)
            rounds = search(case, start, null, values, names, templates or load())
    with timed("verdict"):
        found = concluded(
            case, start, null, in_order(before, null), values, lacking, rounds, contradictions, untestable
        )
    with timed("evidence"):
        base = within(assumed, case.base)
        after = rounds[-1].model if rounds else start
        unit = rounds[-1].base if rounds else within(start, case.base)
        changed = after is not assumed
        evidence = evidence_of(case, assumed, base, *((after, unit) if changed else ()))
    if found.verdict in ("none", "parameter"):
        found = replace(found, bounds=tuple(bounds(templates or load(), case.conditions, null, values, names)))
    found = replace(
        found,
        gap=grounded(found.gap, floor_of_halves(case, measured.recordings, null)) if found.gap else None,
        campaign=str(measured.folder),
        evidence=evidence,
        **asked,  # type: ignore[arg-type]
    )
    return replace(found, sentence=sentence(found))


def read_case(campaign: Campaign, seed: int = 0, jobs: int = 1) -> Case:
    """Observe and refit a campaign; recordings at another V_d than most, and rates only, are left to SNEE."""
    conditions = [shown(r) for r in campaign.recordings]
    kept = [i for i, (r, c) in enumerate(zip(campaign.recordings, conditions, strict=True)) if r.spikes]
    voltages = [conditions[i].v_d for i in kept]
    common = max(set(voltages), key=voltages.count) if voltages else None
    kept = [i for i in kept if conditions[i].v_d == common]
    part = replace(campaign, recordings=tuple(campaign.recordings[i] for i in kept))
    conditions = [conditions[i] for i in kept]
    if not refittable(conditions):
        raise InputError(
            f"{campaign.folder} has fewer than two static recordings of known light to refit the unit by (two of use "
            "fit are needed, or unknown static scenes and nothing else)"
        )
    seen = [o for o in observed(part, conditions) if o is not None]
    conditions = [
        replace(c, level=float(o.rate.mean())) if c.kind == "unknown" else c
        for c, o in zip(conditions, seen, strict=True)
    ]
    return case_of(campaign.shape, conditions, seen, seed, jobs, campaign.frame_rate_hz)


def refittable(conditions: Sequence[Shown]) -> bool:
    """Whether there are two recordings to refit the unit by, or nothing but scenes."""
    scenes = bool(conditions) and all(c.kind == "unknown" for c in conditions)
    return scenes or sum(c.kind in KNOWN and c.use == "fit" for c in conditions) >= 2


def trimmed(case: Case, contradictions: Sequence[Contradiction]) -> Case:
    """The case without recordings that contradict the others, where enough is left to refit the unit by."""
    bad = {r for c in contradictions for r in c.recordings}
    keep = [i for i, c in enumerate(case.conditions) if c.name not in bad]
    if not bad or not refittable([case.conditions[i] for i in keep]):
        return case
    return case_of(
        case.shape,
        [case.conditions[i] for i in keep],
        [case.observations[i] for i in keep],
        case.seed,
        case.jobs,
        case.frame_rate_hz,
    )


def of_fit(case: Case, null: Null, values: Array) -> Array:
    """(S,) values of recordings of use fit; NaN for the held-out ones, which take no part in the search."""
    return np.where([_use(case, k.recording) == "fit" for k in null.keys], values, np.nan)


def search(
    case: Case, model: SensorModel, null: Null, values: Array, names: Sequence[str], templates: Templates
) -> list[Round]:
    """Forward selection: each round adds the candidate that leaves least, until nothing is left or nothing helps.

    values: (S,) of all recordings; those held out decide between rivals, and tell parameters that others leave open.
    """
    rounds: list[Round] = []
    seen = of_fit(case, null, values)
    chance = float(np.sum(null.weight * np.isfinite(seen)))
    now, base, prediction = model, within(model, case.base), null.prediction
    while len(rounds) < MOST:
        rho = residual(null, seen, prediction)
        if rounds and not alarmed(null, rho):
            break
        here = standing_on(null, prediction)
        left_over = judged(here, seen, here.prediction)[1]
        left = [n for n in names if n not in {e.name for e in now.effects}]
        screened = screen(templates, case.conditions, here, seen, left, line_of(case))
        distance = np.nan_to_num((seen - here.mean) / here.noise)
        tried = worth_fitting(screened, misfit(distance, here.weight), loud(here, distance))
        with ThreadPoolExecutor(case.jobs) as pool:
            fits = list(pool.map(partial(_fitted, case, now, here, seen), tried))
        sure, rest = settle(fits, partial(confirmed, case, now, here, seen))
        sure, rivals = chosen_of(null, here, seen, values, sure)
        rounds.append(Round(now, base, prediction, rho, left_over, (*sure, *rest), rivals))
        if not sure or left_over - sure[0].misfit < GAIN:
            break
        best = sure[0]
        earlier = [r.fits[0].name for r in rounds[:-1]]
        if earlier:
            best = rejoined(case, model, null, seen, best, earlier)
        names_now = [n for n in (*earlier, best.name) if n in {e.name for e in best.model.effects}]
        best, errors, lent = polished(case, model, null, seen, values, best, names_now)
        rounds[-1] = replace(rounds[-1], fits=(best, *rounds[-1].fits[1:]), lent=lent)
        rounds = [with_errors(r, errors) for r in rounds]
        now, base, prediction = best.model, best.base, best.prediction
        if left_over - sure[0].misfit < LITTLE[len(rounds) > 1] * (left_over - chance):
            break
    rho, left_over = judged(null, seen, prediction)
    rounds.append(Round(now, base, prediction, rho, left_over, ()))
    return rounds


def with_errors(turn: Round, errors: Errors) -> Round:
    """The round with its effect's errors as they were found last, together with all others."""
    best = turn.fits[0]
    return replace(turn, fits=(replace(best, sd=errors.get(best.name) or best.sd), *turn.fits[1:]))


def settle(fits: Sequence[Fit], confirm: Callable[[Fit], Fit]) -> tuple[list[Fit], list[Fit]]:
    """(confirmed, best first; the others).  A fit rests on one twin: from the best on they are confirmed by more, two
    at least, until one, as much better as that made the others, still stands PROMISE above the best."""
    waiting, sure, better = sorted(fits, key=lambda f: f.misfit), list[Fit](), 0.0
    while waiting and (len(sure) < 2 or waiting[0].misfit - better < min(f.misfit for f in sure) + PROMISE):
        sure.append(confirm(waiting[0]))
        better = max(better, waiting.pop(0).misfit - sure[-1].misfit)
    return sorted(sure, key=lambda f: f.misfit), waiting


def chosen_of(
    null: Null, here: Null, seen: Array, values: Array, sure: Sequence[Fit]
) -> tuple[list[Fit], tuple[str, ...]]:
    """(fits, the chosen one first; names of its rivals).  What may as well be true as the first, by the recordings to
    fit (`seen`), is put in order by all recordings (`values`), and has to remain a rival by them."""
    if not sure:
        return [], ()
    close = [f for f in sure if f is sure[0] or is_rival(here, null.draws, seen, sure[0].prediction, f.prediction)]
    close.sort(key=lambda f: judged(here, values, f.prediction)[1])
    best = close[0]
    left = residual(here, values, best.prediction)
    rivals = [
        f.name
        for f in close[1:]
        if is_rival(here, null.draws, values, best.prediction, f.prediction)
        and (alarmed(here, left) or not alarmed(here, residual(here, values, f.prediction)))
    ]
    return [*close, *(f for f in sure if f not in close)], tuple(rivals)


def _fitted(case: Case, model: SensorModel, null: Null, values: Array, s: Screened) -> Fit:
    return fit(case, model, null, values, s.name, s.start, s.expected)


def standing_on(null: Null, predicted: Prediction) -> Null:
    """Predictions of a model with effects already added, known no better than TOLERANCE of what they changed."""
    law = TOLERANCE * (predicted.mean - null.mean)
    floor = np.sqrt(null.floor**2 + law**2 + own_variance(null, predicted))
    return replace(null, mean=predicted.mean, sd=predicted.spread, floor=floor, draws=predicted.draws)


def line_of(case: Case) -> float | None:
    """Frequency [Hz] of the strongest line in steady light; None where no line stands out."""
    both = zip(case.conditions, case.observations, strict=True)
    steady = [o.frame for c, o in both if not c.moves and c.use == "fit"]
    lines = [(strongest_line(spectrum(frame))[::-1], frame) for frame in steady if frame.sum() > 1000]
    (ratio, at), frame = max(lines, key=lambda line: line[0][0], default=((0.0, 0), np.zeros(1)))
    return frequency(frame, at) * case.frame_rate_hz if ratio > 30 else None


def worth_fitting(screened: Sequence[Screened], before: float, loud: Collection[str] = ()) -> list[Screened]:
    """The best by their templates, FEWEST and those that explain half of what the best does.  before: misfit of none.

    loud: groups of statistics that stand out.  Where the pattern does, with the two best of those that only change it,
    whose statistics are not in proportion to their strength; where motion does, with all that show by it alone, whose
    templates are of other pictures.
    """
    if not screened:
        return []
    best = before - screened[0].misfit
    tried = [s for i, s in enumerate(screened[:TRIED]) if i < FEWEST or before - s.misfit > 0.5 * best]
    also = [s for s in screened if is_pattern(s.name)][:2] if "pattern" in loud else []
    also += [s for s in screened if of_motion(s.name)] if {"moving", "step"} & set(loud) else []
    return tried + [s for s in also if s not in tried]


def loud(null: Null, distance: Array) -> set[str]:
    """Groups of which a statistic stands out by itself."""
    return {k.group for k, d in zip(null.keys, distance, strict=True) if abs(d) > LOUD}


def explains(null: Null, before: Array, rho: Array) -> bool:
    """Whether residuals `rho` are chance; or, beside those of the model as given, little and quiet, and none that was
    not there, which would contradict what was added."""
    by_chance = float(np.sum(null.weight * np.ones(len(rho))))
    left = (misfit(rho, null.weight) - by_chance) / max(misfit(before, null.weight) - by_chance, 1.0)
    quiet = np.abs(rho).max() < QUIET * np.abs(before).max()
    contradicted = alarmed(null, np.where(np.abs(rho) > np.abs(before), rho, 0.0))
    return not alarmed(null, rho) or bool(left < UNEXPLAINED and quiet and not contradicted)


def concluded(
    case: Case,
    model: SensorModel,
    null: Null,
    given: Array,
    values: Array,
    lacking: Sequence[Missing],
    rounds: Sequence[Round],
    contradictions: Sequence[Contradiction],
    untestable: Sequence[tuple[str, str]],
) -> Diagnosis:
    """From the search to a verdict.  given: (S,) predictions of the model as it was given."""
    z = deviates(replace(null, mean=given), values)
    p = adjusted(z)
    before = residual(null, values, null.prediction)
    last = rounds[-1] if rounds else None
    kept = {e.name: e for e in last.model.effects} if last else {}
    turns = [r for r, after in itertools.pairwise(rounds) if after.model is not r.model and r.fits[0].name in kept]
    found = [replace(r.fits[0], parameters={k: kept[r.fits[0].name].parameters()[k] for k in r.fits[0].parameters})
             for r in turns]  # fmt: skip
    rho = residual(null, values, last.prediction) if last else before
    predicted = last.prediction.mean if last else null.mean
    explained = explains(null, before, rho)
    chance = not found and bool(adjusted(deviates(null, values)).min() > SURE)
    place, time_ = where(case), when(case)
    share = lambda f: gap_of(case, null, values, given, f.prediction).removed  # noqa: E731
    others = lambda r: {o.name: share(o) for o in r.fits[1:] if len(o.prediction.draws) > 1}  # noqa: E731
    effects = tuple(
        replace(named(f, r, null, values), where=place, when=time_, instead=others(r))
        for f, r in zip(found, turns, strict=True)
    )
    rivals = turns[0].rivals if turns else ()
    if explained or chance or not rounds:
        effects = (*(named_missing(m) for m in lacking), *effects)
    parameters = {} if lacking else off_nominal(case, model)
    unknown, class_ = None, None
    if contradictions:
        verdict = "data"
    elif rounds and not chance and not (found and explained):
        verdict, effects = "unknown", ()
        unknown = {**structure(case, null, before), "best_candidate": found[0].name if found else None}
    elif found and rivals and len(found) == 1 and not lacking:
        verdict = "class"
        class_ = {"members": [found[0].name, *rivals], "experiment": candidate(found[0].name).experiment}
    elif found or lacking:
        verdict = "named"
    else:
        verdict = "parameter" if parameters else "none"
    return Diagnosis(
        verdict=verdict,
        sentence="",
        effects=effects,
        unknown=unknown,
        class_=class_,
        parameters=parameters,
        data=(*(c.text for c in contradictions), *([LENT] if any(r.lent for r in turns) else [])),
        gap=gap_of(case, null, values, given, last.prediction if last else null.prediction),
        statistics=table(case, null, values, given, z, p, predicted, rho),
        ranking=tuple(ranked(f, r, f is r.fits[0] and any(r is t for t in turns)) for r in rounds for f in r.fits),
        not_testable=tuple(untestable),
        bounds=(),
        patched=last.model if last else model,
        model_name=model.name,
        campaign="",
        seed=case.seed,
        stages={},
    )


def named_missing(found: Missing) -> NamedEffect:
    """An effect of the base pixel, as the refit measured it."""
    effect = found.effect
    key = type(effect).strength
    estimate = {key: Estimate(effect.parameters()[key], found.sd)}
    share = 0.99 / (1 + len(found.also))
    rivals = tuple((name, share) for name in found.also)
    return NamedEffect(effect.name, candidate(effect.name).family, share, estimate, rivals)


def in_order(other: Null, null: Null) -> Array:
    """(S,) predictions of another model for the statistics of `null`; where it has none, those of `null`."""
    there = dict(zip(other.keys, other.mean, strict=True))
    return np.array([there.get(k, m) for k, m in zip(null.keys, null.mean, strict=True)])


def named(found: Fit, turn: Round, null: Null, values: Array) -> NamedEffect:
    """A candidate as the diagnosis names it, with its rivals and the share of the gap that each would remove."""
    rivals = [(f, float(np.exp(-max(f.misfit - found.misfit, 0.0) / 2))) for f in turn.fits if f.name != found.name]
    total = 1.0 + sum(w for _, w in rivals)
    parameters = {k: Estimate(v, found.sd.get(k, np.nan)) for k, v in found.parameters.items()}
    return NamedEffect(
        found.name,
        candidate(found.name).family,
        min(1.0 / total, 0.99),
        parameters,
        tuple((f.name, w / total) for f, w in rivals),
    )


def ranked(found: Fit, turn: Round, accepted: bool) -> Ranked:
    """A row of the ranking."""
    before = turn.misfit
    parameters = {k: Estimate(v, found.sd.get(k, np.nan)) for k, v in found.parameters.items()}
    worst = float(np.abs(found.rho).max())
    reason = f"leaves {worst:.1f} noises at worst" if found.misfit < before else "explains nothing"
    return Ranked(found.name, candidate(found.name).family, before, found.misfit, parameters, accepted, reason)


def gap_of(case: Case, null: Null, values: Array, given: Array, after: Prediction) -> Gap:
    """Mean square distance on held-out recordings, in the noise that each model predicts."""
    use = np.array([_use(case, k.recording) for k in null.keys])
    held = use == "holdout" if np.any(use == "holdout") else np.ones(len(use), bool)
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
    """A gap with its floor: what two halves of the measurement differ by, or 1 where there are no halves."""
    ground = floor if np.isfinite(floor) else 1.0
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
                  _use(case, k.recording) == "holdout")
        for j, k in enumerate(null.keys)
    )  # fmt: skip


def _use(case: Case, recording: str) -> str:
    return next((c.use for c in case.conditions if c.name == recording), "fit")


def _stages(stages: dict[str, float], progress: bool):  # type: ignore[no-untyped-def]
    @contextmanager
    def timed(name: str) -> Iterator[None]:
        if progress:
            tqdm.write(f"{name} ...")
        start = time.perf_counter()
        yield
        stages[name] = stages.get(name, 0.0) + time.perf_counter() - start

    return timed
