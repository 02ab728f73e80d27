"""From maps of rates to a verdict."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.campaign.reading import Campaign
from spikecam_env.gap.candidates.table import candidate, chosen
from spikecam_env.gap.compare.distance import adjusted, deviates, is_significant, residual
from spikecam_env.gap.compare.prediction import Null, null_of, values_of
from spikecam_env.gap.maps.bank import Maps, bank, dark_of, of_use, read_maps, unit_levels, unit_maps
from spikecam_env.gap.maps.search import SHARES, SPREADS, UNITS, State, Tried, free_of, search, within
from spikecam_env.gap.result import Diagnosis, Estimate, Evidence, Gap, NamedEffect, Ranked, Statistic
from spikecam_env.gap.unit.refit import BaseFit
from spikecam_env.gap.unit.usual import USUAL
from spikecam_env.sensor import CATALOGUE, SensorModel

Array = NDArray[np.float64]

ALARM, UNEXPLAINED = 0.02, 0.08
"""As in `diagnose`; what stays unexplained is a share of mean squares here, since many statistics are very far off."""


def diagnose_maps(
    campaign: Campaign,
    model: SensorModel,
    *,
    candidates: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    seed: int = 0,
    jobs: int = 1,
) -> Diagnosis:
    """Find what fixed pattern a model lacks, from rates alone.  Arguments as `diagnose.diagnose`."""
    case = read_maps(campaign, seed, jobs)
    names = chosen(model, candidates, exclude)
    tested = [n for n in names if candidate(n).is_pattern and _visible(n, case)]
    values_by_key = case.bank
    given = within(State(model, {}), case, values_by_key)
    banks = [bank(unit_maps(given.fitted, case, n)) for n in range(UNITS)]
    null = null_of(banks, list(values_by_key))
    null = replace(null, sd=np.maximum(null.sd, 1e-3 * null.floor))
    values = values_of(values_by_key, null.keys)
    z = deviates(null, values)
    rounds, rejected = search(case, given, null, values, tested) if adjusted(z).min() < ALARM else ([], [])
    return concluded(campaign, case, model, given, null, values, z, rounds, rejected, names, tested)


def _visible(name: str, case: Maps) -> bool:
    """Dark effects want a dark map, all others a lit one; what is one number with a spread of the model is none."""
    kinds = {m.shown.kind for m in case.maps}
    return "dark" in kinds if candidate(name).family == "dark" else bool(kinds & {"flat", "picture"})


def concluded(
    campaign: Campaign, case: Maps, model: SensorModel, given: State, null: Null, values: Array, z: Array,
    rounds: list[list[Tried]], rejected: list[Tried], names: Sequence[str], tested: Sequence[str],
) -> Diagnosis:  # fmt: skip
    """From the search to a verdict."""
    last = rounds[-1][0] if rounds else None
    use = of_use(case, null.keys, "fit")
    rho = last.rho if last else residual(null, values, null.prediction)
    predicted = last.predicted if last else null.mean
    square = [float(np.mean(((values - mean) / null.noise) ** 2)) for mean in (null.mean, predicted)]
    left = (square[1] - 1.0) / max(square[0] - 1.0, 1e-9)
    significant = is_significant(null, rho)
    explained = not rounds or not significant or left < UNEXPLAINED
    parameters = off_usual(case, last.state) if last else {}
    effects = tuple(
        replace(_named(r, last), instead={t.name: _gap(case, null, values, t.predicted).removed for t in r[1:]})
        for r in rounds[1:]
        if last and shows(last, r[0].name)
    )
    unknown = None
    found = [e.name for e in effects]
    notes = (_left(null, rho, left),) if rounds and explained and significant else ()
    if not explained:
        verdict, unknown, effects = "unknown", _structure(null, rho, left, found), ()
    elif effects:
        verdict = "named"
    else:
        verdict = "parameter" if parameters else "none"
    patched = _patched(last.state, case) if last else model
    for e in (e for e in last.state.added if not shows(last, e)) if last else ():
        patched = patched.without(e)
    p = adjusted(z)
    return Diagnosis(
        verdict=verdict, sentence="", effects=effects, unknown=unknown, class_=None, parameters=parameters, data=notes,
        gap=_gap(case, null, values, predicted), statistics=tuple(
            Statistic(f"{k.group}: {k.name}", k.group, (k.recording,), float(values[j]), float(null.mean[j]),
                      float(predicted[j]), float(null.noise[j]), float(z[j]), float(rho[j]), float(p[j]),
                      not bool(use[j]))
            for j, k in enumerate(null.keys)
        ),
        ranking=tuple(_ranked(t, was[0].misfit, t is r[0] and r is not rejected)
                      for was, r in itertools.pairwise([*rounds, rejected]) for t in r),
        not_testable=tuple((n, _lack(n)) for n in names if n not in tested),
        bounds=(), patched=patched, model_name=model.name, campaign=str(campaign.folder), seed=case.seed, stages={},
        evidence=_evidence(case, given, last),
    )  # fmt: skip


def _lack(name: str) -> str:
    if not candidate(name).is_pattern:
        return "spikes: rates say nothing of when they come"
    return "a dark map" if candidate(name).family == "dark" else "a map of a flat"


def off_usual(case: Maps, state: State) -> dict[str, dict[str, float]]:
    """Spreads of the model that this unit has in another amount than units differ by: as `baseline.off_nominal`."""
    found = {}
    for what, factor in state.factors.items():
        if 1 / USUAL < factor < USUAL:
            continue
        for effect in state.model.effects:
            if effect.name in SPREADS[what]:
                key = SPREADS[what][effect.name]
                nominal = effect.parameters()[key]
                found[effect.name] = {"measured": nominal * factor, "nominal": nominal, "ratio": factor}
    return found


def _named(tried: list[Tried], last: Tried) -> NamedEffect:
    """The best of a round, with parameters as they are in the end; confidence and rivals are the round's."""
    best = tried[0]
    weights = [(t.name, float(np.exp(-max(t.misfit - best.misfit, 0.0) / 2))) for t in tried[1:]]
    total = 1.0 + sum(w for _, w in weights)
    return NamedEffect(best.name, candidate(best.name).family, min(1.0 / total, 0.99), _estimates(last, best.name),
                       tuple((n, w / total) for n, w in weights))  # fmt: skip


def shows(last: Tried, name: str) -> bool:
    """Whether an effect's strength is more than two standard deviations in the end: a later one may take its place."""
    return last.sd[f"{name}.{CATALOGUE[name].strength}"] < 0.5


def _estimates(tried: Tried, name: str) -> dict[str, Estimate]:
    values = next(e for e in tried.state.model.effects if e.name == name).parameters()
    return {
        p: Estimate(values[p], tried.sd.get(f"{name}.{p}", np.nan) * (1.0 if p in SHARES else values[p]))
        for p in free_of(name)
    }


def _ranked(t: Tried, before: float, accepted: bool) -> Ranked:
    worst = float(np.abs(t.rho).max())
    reason = f"leaves {worst:.1f} noises at worst" if t.misfit < before else "explains nothing"
    return Ranked(t.name, candidate(t.name).family, before, t.misfit, _estimates(t, t.name), accepted, reason)


def _worst(null: Null, rho: Array) -> list[str]:
    order = sorted(range(len(rho)), key=lambda j: -abs(rho[j]))[:6]
    return [f"{null.keys[j].recording} {null.keys[j].name} ({rho[j]:+.1f})" for j in order]


def _left(null: Null, rho: Array, left: float) -> str:
    return (
        f"what is named leaves {100 * left:.1f} % of the mean square distance, and that is no chance; "
        f"largest, in noises: {', '.join(_worst(null, rho))}"
    )


def _structure(null: Null, rho: Array, left: float, found: list[str]) -> dict[str, Any]:
    """What is left once all that helps is in."""
    return {
        "light": "rates alone: in the dark and in the light",
        "left": round(left, 3),
        "found": found,
        "worst": _worst(null, rho),
        "patch": f"what helps: {', '.join(found)}, and spreads" if found else "spreads as fitted",
    }


def _gap(case: Maps, null: Null, values: Array, predicted: Array) -> Gap:
    b, a = (((values - mean) / null.noise) ** 2 for mean in (null.mean, predicted))
    by = {}
    for m in case.maps:
        of = np.array([k.recording == m.shown.name for k in null.keys])
        by[m.shown.name] = {"before": float(b[of].mean()), "after": float(a[of].mean()), "floor": 1.0}
    held = of_use(case, null.keys, "holdout")
    held = held if held.any() else np.ones(len(held), bool)
    before, after = float(b[held].mean()), float(a[held].mean())
    return Gap(before, after, 1.0, (before - after) / (before - 1.0) if before > 1.5 else 0.0, by)


def _patched(state: State, case: Maps) -> SensorModel:
    """The fitted model, its dark level the measured one."""
    out = state.fitted
    level = next((e for e in out.effects if e.name == "dark_current"), None)
    middle = float(np.median(out.draw_unit(case.shape, case.seed).dark))
    if level is None or middle <= 0 or case.dark <= 0:
        return out
    return out.with_effect(replace(level, mean_pA=level.parameters()["mean_pA"] * case.dark / middle))  # type: ignore[call-arg]


def _evidence(case: Maps, given: State, last: Tried | None) -> Evidence:
    """Response and dark level of every pixel, measured and of fresh units."""
    dark = dark_of(case.maps)
    lit = [m for m in case.maps if m.shown.name in case.response and m.shown.use == "fit"]
    zero = np.zeros(case.shape)
    dark = zero if dark is None else dark
    gain = (lit[0].rate - dark) / max(case.response[lit[0].shown.name], 1e-12) if lit else zero

    def base(gain: Array, dark: Array) -> BaseFit:
        flat = np.zeros(gain.size)
        return BaseFit(gain.ravel(), dark.ravel(), flat, flat, 0.0, np.zeros((0, gain.size)), flat == 0)

    def levels(model: SensorModel) -> tuple[Array, Array]:
        fresh, level = unit_levels(model, case, UNITS)
        return fresh.ravel(), level.ravel()

    nothing = (None,) * len(case.maps)
    before = levels(given.fitted)
    after = levels(last.state.fitted) if last else None
    measured = base(gain, dark)
    return Evidence(
        tuple(m.shown for m in case.maps), nothing, nothing, nothing if last else None, measured,  # type: ignore[arg-type]
        base(*before), base(*after) if after else None, None, before, after,
    )  # fmt: skip
