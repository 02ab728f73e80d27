"""The diagnosis: refit the unit, compare, and while something is left add the effect that explains most of it.

    read -> audit -> refit -> twins -> alarm -> [screen -> fit -> confirm -> add]* -> gate -> verdict

Each step is a function of its own, usable by itself; nothing is decided on the held-out recordings but the gap.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from spikecam_env.calibration.campaign import Campaign, read_campaign
from spikecam_env.errors import InputError
from spikecam_env.gap.candidates import candidate, chosen, testable
from spikecam_env.gap.case import Case, case_of, twins
from spikecam_env.gap.compare import HEAVY, Null, adjusted, deviates, misfit, residual, values_of
from spikecam_env.gap.fit import Fit, confirmed, fit
from spikecam_env.gap.parameters import off_nominal
from spikecam_env.gap.refit import BaseFit, within
from spikecam_env.gap.result import Diagnosis, Estimate, Evidence, Gap, NamedEffect, Ranked, Statistic
from spikecam_env.gap.templates import Templates, load, model_null, screen
from spikecam_env.gap.twin import simulate
from spikecam_env.gap.world import observed, shown
from spikecam_env.sensor import SensorModel

Array = NDArray[np.float64]

ALARM = 0.02
"""Adjusted p-value below which there is a discrepancy at all."""

TRIED = 4
"""Candidates fitted a round, the best by their templates."""

MOST = 3
"""Effects that one diagnosis names together."""

GATE = 4.5
"""Largest residual, in noise, that a named effect may leave: adjusted p of 0.01 for 600 statistics is 4.3."""

SEPARATED = 9.0
"""Difference of misfits from which one candidate is told from another (likelihood ratio of 90)."""


@dataclass(frozen=True)
class Round:
    """One turn of the search: the model it started from, what that left, and the candidates that were fitted."""

    model: SensorModel
    base: BaseFit
    predicted: Array
    count: int
    rho: Array
    fits: tuple[Fit, ...]


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
    jobs: threads.  Raises InputError for an unreadable campaign, an unknown name, or no static recording of known light.
    """
    stages: dict[str, float] = {}
    timed = _stages(stages, progress)
    measured = campaign if isinstance(campaign, Campaign) else read_campaign(campaign)
    assumed = model if isinstance(model, SensorModel) else SensorModel.load(model)
    names = chosen(assumed, candidates, exclude)
    with timed("read"):
        case = read_case(measured, seed, jobs)
    names, untestable = testable(names, case.conditions)
    with timed("twins"):
        null = model_null(case, assumed, twin_count)
    values = values_of(case.bank, null.keys)
    fitted = np.array([_use(case, k.recording) == "fit" for k in null.keys])
    z = deviates(null, values)
    p = adjusted(z)
    rounds: list[Round] = []
    if p.min() < ALARM:
        with timed("candidates"):
            rounds = search(case, assumed, null, values, names, templates or load())
    return concluded(measured, case, assumed, null, values, z, p, rounds, untestable, stages, seed, fitted)


def read_case(campaign: Campaign, seed: int = 0, jobs: int = 1) -> Case:
    """Observe and refit a campaign; recordings at another V_d than most, and rates only, are left to SNEE."""
    conditions = [shown(r) for r in campaign.recordings]
    kept = [i for i, (r, c) in enumerate(zip(campaign.recordings, conditions, strict=True)) if r.spikes]
    voltages = [conditions[i].v_d for i in kept]
    common = max(set(voltages), key=voltages.count) if voltages else None
    kept = [i for i in kept if conditions[i].v_d == common]
    part = replace(campaign, recordings=tuple(campaign.recordings[i] for i in kept))
    conditions = [conditions[i] for i in kept]
    if sum(c.kind in ("dark", "flat", "picture") and c.use == "fit" for c in conditions) < 2:
        raise InputError(f"{campaign.folder} has fewer than two static recordings of known light to refit the unit by")
    seen = observed(part, conditions)
    return case_of(campaign.shape, conditions, [o for o in seen if o is not None], seed, jobs)


def search(
    case: Case, model: SensorModel, null: Null, values: Array, names: Sequence[str], templates: Templates
) -> list[Round]:
    """Forward selection: each round adds the candidate that leaves least, until nothing is left or nothing helps."""
    rounds: list[Round] = []
    now, base, predicted, count = model, within(model, case.base), null.mean, null.twins
    while len(rounds) < MOST:
        rho = residual(null, values, predicted, count)
        if rounds and not alarmed(rho):
            break
        here = replace(null, mean=predicted)
        left = [n for n in names if n not in {e.name for e in now.effects}]
        screened = screen(templates, case.conditions, here, values, left)
        tried = screened[:TRIED]
        fits = [fit(case, now, here, values, s.name, s.start) for s in tried]
        fits.sort(key=lambda f: f.misfit)
        finalists = [f for f in fits if f.misfit < fits[0].misfit + 60][:2] if fits else []
        sure = [confirmed(case, now, here, values, f) for f in finalists]
        sure.sort(key=lambda f: f.misfit)
        rounds.append(Round(now, base, predicted, count, rho, (*sure, *(f for f in fits if f not in finalists))))
        if not sure or sure[0].misfit > misfit(rho) - SEPARATED:
            break
        best = sure[0]
        now, base, predicted, count = best.model, best.base, best.predicted, best.count
    rounds.append(Round(now, base, predicted, count, residual(null, values, predicted, count), ()))
    return rounds


def alarmed(rho: Array) -> bool:
    """Whether residuals say that something is left."""
    return bool(np.abs(rho).max() > GATE)


def concluded(measured, case, model, null, values, z, p, rounds, untestable, stages, seed, fitted) -> Diagnosis:  # type: ignore[no-untyped-def]
    """From the search to a verdict."""
    found = [r.fits[0] for r, after in zip(rounds, rounds[1:], strict=False) if after.model is not r.model]
    last = rounds[-1] if rounds else None
    rho = last.rho if last else residual(null, values, null.mean, null.twins)
    excess = misfit(residual(null, values, null.mean, null.twins)) - len(values)
    left = (misfit(rho) - len(values)) / max(excess, 1.0)
    patched = last.model if last else model
    effects = tuple(named(f, r, null, values) for f, r in zip(found, rounds, strict=False))
    alternatives = [f.name for r in rounds[:1] for f in r.fits[1:] if f.misfit < r.fits[0].misfit + SEPARATED]
    parameters = off_nominal(case, model)
    verdict, unknown, class_ = "none", None, None
    if rounds and not found:
        verdict, unknown = "unknown", structure(null, rho)
    elif found and alarmed(rho) and left > 0.1:
        verdict, unknown = "unknown", structure(null, rho)
    elif found and alternatives and len(found) == 1:
        verdict = "class"
        class_ = {"members": [found[0].name, *alternatives], "experiment": candidate(found[0].name).experiment}
    elif found:
        verdict = "named"
    elif parameters:
        verdict = "parameter"
    if verdict == "unknown":
        effects = ()
    after = last.predicted if last else null.mean
    return Diagnosis(
        verdict=verdict,
        sentence="",
        effects=effects,
        unknown=unknown,
        class_=class_,
        parameters=parameters,
        data=(),
        gap=gap_of(case, null, values, after),
        statistics=table(case, null, values, z, p, after, rho),
        ranking=tuple(ranked(r) for r in _each(rounds, null, values)),
        not_testable=tuple(untestable),
        bounds=(),
        patched=patched,
        model_name=model.name,
        campaign=str(measured.folder),
        seed=seed,
        stages=stages,
        evidence=None,
    )


def named(found: Fit, turn: Round, null: Null, values: Array) -> NamedEffect:
    rivals = [(f.name, float(np.exp(-max(f.misfit - found.misfit, 0.0) / 2))) for f in turn.fits if f is not found]
    total = 1.0 + sum(w for _, w in rivals)
    parameters = {k: Estimate(v, found.sd.get(k, np.nan)) for k, v in found.parameters.items()}
    return NamedEffect(
        found.name,
        candidate(found.name).family,
        min(1.0 / total, 0.99),
        parameters,
        tuple((n, w / total) for n, w in rivals),
    )


def _each(rounds: Sequence[Round], null: Null, values: Array) -> Iterator[tuple[Fit, float]]:
    for r in rounds:
        for f in r.fits:
            yield f, misfit(r.rho)


def ranked(pair: tuple[Fit, float]) -> Ranked:
    f, before = pair
    parameters = {k: Estimate(v, f.sd.get(k, np.nan)) for k, v in f.parameters.items()}
    return Ranked(f.name, candidate(f.name).family, before, f.misfit, parameters, False, "")


def gap_of(case: Case, null: Null, values: Array, after: Array) -> Gap:
    """Mean square distance on held-out recordings, in noise."""
    use = np.array([_use(case, k.recording) for k in null.keys])
    held = use == "holdout" if np.any(use == "holdout") else np.ones(len(use), bool)
    square = lambda mean: np.nan_to_num(((values - mean) / null.noise)) ** 2  # noqa: E731
    b, a = square(null.mean), square(after)
    floor = 1.0
    by = {}
    for c in case.conditions:
        of = np.array([k.recording == c.name for k in null.keys])
        if np.any(of):
            by[c.name] = {"before": float(b[of].mean()), "after": float(a[of].mean()), "floor": floor}
    before, then = float(b[held].mean()), float(a[held].mean())
    removed = (before - then) / (before - floor) if before > 1.5 * floor else 0.0
    return Gap(before, then, floor, removed, by)


def table(case: Case, null: Null, values: Array, z: Array, p: Array, after: Array, rho: Array) -> tuple[Statistic, ...]:
    return tuple(
        Statistic(f"{k.group}: {k.name}", k.group, (k.recording,), float(values[j]), float(null.mean[j]),
                  float(after[j]), float(null.noise[j]), float(z[j]), float(rho[j]), float(p[j]),
                  _use(case, k.recording) == "holdout")
        for j, k in enumerate(null.keys)
    )  # fmt: skip


def structure(null: Null, rho: Array) -> dict[str, object]:
    """What an unexplained discrepancy looks like: groups and recordings by their share."""
    weight = np.log1p(rho**2 / HEAVY)
    groups: dict[str, float] = {}
    for k, w in zip(null.keys, weight, strict=True):
        groups[k.group] = groups.get(k.group, 0.0) + float(w)
    order = sorted(groups, key=lambda g: -groups[g])
    return {"groups": {g: groups[g] for g in order[:4]}}


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
