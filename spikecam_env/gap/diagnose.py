"""The diagnosis: refit the unit, compare, and while something is left add the effect that explains most of it.

    read -> audit -> refit -> twins -> alarm -> search -> gate -> verdict

Each step is a function of its own, usable by itself.  Held-out recordings take no part in the search, but for what
`search.forward` says; the gate is on all, and the gap on them alone.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import reduce
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from spikecam_env.campaign.reading import Campaign, read_campaign
from spikecam_env.errors import InputError
from spikecam_env.gap.baseline.alarm import rings
from spikecam_env.gap.baseline.halves_floor import floor_of_halves
from spikecam_env.gap.baseline.label_audit import Contradiction, audit, upheld
from spikecam_env.gap.baseline.missing_from_refit import missing, with_all
from spikecam_env.gap.baseline.null_model import model_null, unit_under
from spikecam_env.gap.baseline.off_nominal import Off, off_nominal
from spikecam_env.gap.candidates.table import candidate, chosen, testable
from spikecam_env.gap.compare.prediction import Null, values_of
from spikecam_env.gap.fit.problem import Problem, values_to_fit
from spikecam_env.gap.maps import diagnose_maps
from spikecam_env.gap.observe.conditions import KNOWN, Shown, observed, shown
from spikecam_env.gap.report.evidence import evidence_of
from spikecam_env.gap.report.words import sentence, unfinished
from spikecam_env.gap.result import Diagnosis
from spikecam_env.gap.screen.own_templates import own_templates
from spikecam_env.gap.screen.templates import Templates, load
from spikecam_env.gap.search.forward import forward_selection
from spikecam_env.gap.search.round import Round
from spikecam_env.gap.twins.budget import CAMPAIGNS, Budget
from spikecam_env.gap.twins.case import Case, case_of
from spikecam_env.gap.twins.workers import sums_in_one_order
from spikecam_env.gap.unit.label_unit import counted_anew, nominal_per_label, said_of
from spikecam_env.gap.unit.refit import within
from spikecam_env.gap.verdict.bounds import bounds
from spikecam_env.gap.verdict.verdict import concluded, grounded, harmless
from spikecam_env.sensor import SensorModel

Array = NDArray[np.float64]


@sums_in_one_order
def diagnose(
    campaign: Campaign | str | Path,
    model: SensorModel | str | Path = "scsim",
    *,
    candidates: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    seed: int = 0,
    jobs: int = 1,
    effort: float = CAMPAIGNS,
    twin_count: int = 12,
    templates: Templates | None = None,
    progress: bool = True,
) -> Diagnosis:
    """Find where a measured campaign and a model disagree, which effect is missing, and how large it is.

    campaign: a folder in the format spikecam-campaign/1.  model: a SensorModel, a preset's name or a TOML path.
    candidates: names to try, default the whole catalogue; exclude: names to leave out.  Same seed, same answer.
    jobs: threads, which change no bit.  effort: times the campaign may be simulated before nothing more is begun that
    an answer can do without, such as a third effect; infinite for whatever it takes.  Raises InputError for an
    unreadable campaign, an unknown name, no effort, or too few static recordings of known light to refit the unit by.
    """
    if not effort > 0:
        raise InputError(f"effort {effort:g}: it must be above 0")
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
        "effort": effort,
        "stages": stages,
    }
    if not any(r.spikes for r in measured.recordings):
        with timed("maps"):
            found = diagnose_maps(measured, assumed, candidates=candidates, exclude=exclude, seed=seed, jobs=jobs)
        found = replace(found, **asked)  # type: ignore[arg-type]
        return replace(found, sentence=sentence(found))
    with timed("read"):
        case = read_case(measured, seed, jobs)
        notes = said_of(case.nominal_per_label, case.base)
    with timed("audit"):
        contradictions = upheld(case, assumed, audit(case))
        case = trimmed(case, contradictions)
        case = replace(case, budget=Budget(effort * len(case.conditions), verdict_known=bool(contradictions)))
    names, untestable = testable(names, case.conditions)
    lacking = missing(case, assumed, names)
    start = with_all(assumed, lacking)
    off = Off({}, case.base) if lacking else off_nominal(case, assumed, case.base)
    with timed("twins"):
        null = model_null(case, start, twin_count)
        as_given = lacking or off.parameters
        before = model_null(replace(case, base=off.nominal), assumed, 2) if as_given else null
    values = values_of(case.bank, null.keys)
    rounds: list[Round] = []
    if rings(null, values_to_fit(case, null, values)) or rings(null, values):
        with timed("candidates"):
            if case.scenes_only:
                templates = templates or own_templates(case, start, null, names)
            problem = Problem.of(case, start, null, values)
            rounds = harmless(case, null, values, forward_selection(problem, names, templates or load()))
    if rounds and not lacking:
        off = replace(
            off, parameters=off_nominal(case, patterned(assumed, rounds[-1].model), rounds[-1].base).parameters
        )
    with timed("verdict"):
        found = concluded(
            case, start, null, in_order(before, null), values, lacking, off, rounds, contradictions, untestable
        )
    with timed("evidence"):
        base = within(assumed, off.nominal)
        after = rounds[-1].model if rounds else start
        unit = rounds[-1].base if rounds else within(start, case.base)
        changed = after is not assumed or off.parameters
        evidence = evidence_of(case, assumed, base, *((after, unit) if changed else ()))
    if found.verdict in ("none", "parameter"):
        with timed("bounds"):
            settled = replace(case, base=unit_under(case, start)) if case.scenes_only else case
            below, open_ = bounds(settled, start, null, values, names, templates or load())
        found = replace(found, bounds=tuple(below), not_bounded=tuple(open_))
    found = replace(
        found,
        gap=grounded(found.gap, floor_of_halves(case, measured.recordings, null)) if found.gap else None,
        campaign=str(measured.folder),
        evidence=evidence,
        data=(*found.data, *notes, *unfinished(case.budget)),
        simulated=case.budget.simulated,
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
    case = case_of(campaign.shape, conditions, seen, seed, jobs, campaign.frame_rate_hz)
    factor = nominal_per_label(case.base)
    if factor == 1.0:
        return case
    case = case.of([counted_anew(c, factor) for c in conditions], seen)
    return replace(case, nominal_per_label=factor)


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
    return case.of([case.conditions[i] for i in keep], [case.observations[i] for i in keep])


def patterned(model: SensorModel, found: SensorModel) -> SensorModel:
    """The model with those effects of another that make pixels differ: what they explain, its own spreads do not."""
    return reduce(SensorModel.with_effect, (e for e in found.effects if candidate(e.name).is_pattern), model)


def in_order(other: Null, null: Null) -> Array:
    """(S,) predictions of another model for the statistics of `null`; where it has none, those of `null`."""
    there = dict(zip(other.keys, other.mean, strict=True))
    return np.array([there.get(k, m) for k, m in zip(null.keys, null.mean, strict=True)])


def _stages(stages: dict[str, float], progress: bool):  # type: ignore[no-untyped-def]
    @contextmanager
    def timed(name: str) -> Iterator[None]:
        if progress:
            tqdm.write(f"{name} ...")
        start = time.perf_counter()
        yield
        stages[name] = stages.get(name, 0.0) + time.perf_counter() - start

    return timed
