"""The diagnosis: refit the unit, compare, and while something is left add the effect that explains most of it.

    read -> audit -> refit -> twins -> alarm -> search -> gate -> verdict -> evidence -> bounds

A campaign passes the rooms of this package in their order (docs/architecture.md).  Held-out recordings take no part in
the search, with the exceptions of `search`; the gate is on all, and the gap on them alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from spikecam_env.campaign.reading import Campaign, read_campaign
from spikecam_env.errors import InputError, unknown_name
from spikecam_env.gap.baseline.halves_floor import floor_of_halves
from spikecam_env.gap.baseline.missing_from_refit import missing_effects, with_missing
from spikecam_env.gap.baseline.null_model import maps_null, model_null
from spikecam_env.gap.baseline.off_nominal import OffNominal, off_nominal
from spikecam_env.gap.baseline.upheld_labels import upheld
from spikecam_env.gap.candidates.table import candidate, chosen, testable
from spikecam_env.gap.check.contradiction import Contradiction
from spikecam_env.gap.check.label_audit import audit
from spikecam_env.gap.check.static_part import Observed, counted_pixels, without_motion
from spikecam_env.gap.compare.prediction import values_of
from spikecam_env.gap.fit.simulated_templates import own_templates
from spikecam_env.gap.fit.standard_templates import templates_of
from spikecam_env.gap.observe.conditions import STEADY_KNOWN, Condition, condition_of
from spikecam_env.gap.observe.observation import observe
from spikecam_env.gap.report.evidence import evidence_for, evidence_of_maps
from spikecam_env.gap.report.sentence import BOUNDS_OF_MAPS, sentence, unbounded, unfinished
from spikecam_env.gap.result import BOUND_KINDS, BOUNDED_VERDICTS, CHANCE, Bound, Conclusion, Diagnosis, Findings
from spikecam_env.gap.screen.templates import Templates, shipped_templates
from spikecam_env.gap.search.forward import forward_selection
from spikecam_env.gap.search.round import Round
from spikecam_env.gap.settings import DiagnosisSettings, checked_settings
from spikecam_env.gap.stages import Stages
from spikecam_env.gap.twins.budget import CAMPAIGNS, Budget
from spikecam_env.gap.twins.case import Case, case_of
from spikecam_env.gap.twins.rate_maps import MapCase, at_measured_dark, read_maps, with_spreads_matched
from spikecam_env.gap.twins.workers import sums_in_one_order
from spikecam_env.gap.unit.label_unit import in_nominal_units, label_unit_note, nominal_per_label
from spikecam_env.gap.verdict.bounds import bounds as upper_bounds
from spikecam_env.gap.verdict.comparison import Comparison, aligned_mean
from spikecam_env.gap.verdict.moving import moves, static_note
from spikecam_env.gap.verdict.verdict import conclude, up_to_named, with_given_parameters
from spikecam_env.numbers import Range
from spikecam_env.sensor import SensorModel
from spikecam_env.sensor.own_effects import files_of

SPIKES_NEEDED = "spikes: rates say nothing of when they come"
"""Needed for all candidates but patterns."""


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
    static_only: bool = False,
    bounds: str = "linear",
    settings: DiagnosisSettings | None = None,
    progress: bool = True,
) -> Diagnosis:
    """Find where a measured campaign and a model disagree, which effect is missing, and how large it is.

    Args:
        campaign: read already, or its folder (format spikecam-campaign/1).
        model: a SensorModel, a preset's name or a TOML path.
        candidates: names of effects to try; default the whole catalogue.
        exclude: names of effects not to try.
        seed: of all simulations; the same seed gives the same answer.
        jobs: threads; they change no bit.
        effort: budget: how often the campaign may be simulated before optional steps are skipped; inf for no limit.
        twin_count: simulations of the campaign under the model.
        templates: of the candidates; default those that ship, others are simulated.
        static_only: whether to use only the static pixels of unknown scenes that move.
        bounds: upper bounds of effects that were not found: "linear", by linear response, without a simulation;
            "simulated", by some 200 campaigns more; or "none".
        settings: the tuned numbers; default `DiagnosisSettings()`.
        progress: whether to show, on a terminal, a bar of the budget with the effect at hand; elsewhere, a line as each
            stage begins.

    Returns:
        The answer; `write` and `write_report` save it.

    Raises:
        InputError: for an unreadable campaign, an unknown name, no effort, an unknown kind of bounds, settings of
            another type, or too few static recordings of known light to refit the unit by.

    Example:
        >>> flats = [Dark(), *(Flat(radiance=level) for level in (0.1, 0.3))]
        >>> campaign = write_campaign("camera", "scsim", shape=(8, 8), frames=400, recordings=flats)
        >>> diagnosis = diagnose(campaign, "scsim", candidates=["dead_time"], twin_count=6, progress=False)
        >>> diagnosis.sentence
        'No gap: these recordings and the model scsim agree to within the noise.'
    """
    Range(0, above=True, infinite=True).check(effort, "effort")
    if bounds not in BOUND_KINDS:
        raise unknown_name("kind of bounds", bounds, BOUND_KINDS)
    settings = checked_settings(settings)
    stages = Stages(progress)
    measured = campaign if isinstance(campaign, Campaign) else read_campaign(campaign)
    tested = model if isinstance(model, SensorModel) else SensorModel.load(model)
    tested = replace(tested, frame_rate_hz=measured.frame_rate_hz)
    names = chosen(tested, candidates, exclude)
    request = DiagnosisRequest(tuple(names), seed, jobs, effort, twin_count, static_only, settings, bounds)
    with stages.shown(effort):
        if any(r.spikes for r in measured.recordings):
            findings = of_spikes(measured, tested, request, templates, stages)
        else:
            findings = of_maps(measured, tested, request, stages)
    model_name = tested.name if isinstance(model, SensorModel) else str(model)
    return Diagnosis(
        **vars(findings),
        sentence=sentence(findings, model_name),
        model_name=model_name,
        campaign=str(measured.folder),
        seed=seed,
        stages=stages.seconds,
        candidates=None if candidates is None else tuple(candidates),
        exclude=tuple(exclude),
        effort=effort,
        effect_files=files_of((*names, *(effect.name for effect in tested.effects))),
        static_only=static_only,
        settings=settings.changed(),
        bounds_kind=bounds,
    )


def findings_of(conclusion: Conclusion, notes: Sequence[str], **others: Any) -> Findings:
    """A conclusion with notes on labels and on parts that were left out, and with other fields of `Findings`."""
    return Findings(**vars(conclusion) | {"data": (*conclusion.data, *notes)} | others)


@dataclass(frozen=True)
class DiagnosisRequest:
    """Options of `diagnose`, with the names of candidates."""

    names: tuple[str, ...]
    seed: int
    jobs: int
    effort: float
    twin_count: int
    static_only: bool = False
    settings: DiagnosisSettings = field(default_factory=DiagnosisSettings)
    bounds: str = "linear"


def of_maps(measured: Campaign, tested: SensorModel, request: DiagnosisRequest, stages: Stages) -> Findings:
    """A campaign of rates only, from its files to the findings: its twins are fresh units."""
    with stages.timed("maps"):
        case = read_maps(measured, request.seed, request.jobs, request.settings.of_maps)
        comparison = comparison_of_maps(case, tested, request.names)
        rounds = up_to_named(comparison, searched(comparison, None)) if comparison.disagrees else []
        conclusion = conclude(comparison, rounds, CHANCE)
        if rounds:
            conclusion = replace(conclusion, patched=at_measured_dark(case, conclusion.patched))
        evidence = evidence_of_maps(comparison, rounds)
    return findings_of(conclusion, [BOUNDS_OF_MAPS] if request.bounds == "simulated" else [], evidence=evidence)


def comparison_of_maps(case: MapCase, tested: SensorModel, names: Sequence[str]) -> Comparison:
    """Maps of rates beside a model whose spreads are those of the unit, as far as units differ."""
    model = with_spreads_matched(case, tested)
    null = maps_null(case, model)
    by_spikes = [name for name in names if not candidate(name).is_pattern]
    shown, not_shown = testable([name for name in names if name not in by_spikes], case.conditions)
    return Comparison(
        case=case,
        tested=tested,
        model=model,
        null=null,
        values=values_of(case.bank, null.keys),
        given=null.mean,
        missing=(),
        off=OffNominal({}, case.base),
        contradictions=(),
        names=tuple(shown),
        not_testable=(*((name, SPIKES_NEEDED) for name in by_spikes), *not_shown),
    )


def of_spikes(
    measured: Campaign, tested: SensorModel, request: DiagnosisRequest, templates: Templates | None, stages: Stages
) -> Findings:
    """A campaign of spikes, from its files to the findings: one room after another."""
    with stages.timed("read"):
        recordings = observed(measured)
    with stages.timed("motion"):
        recordings, motion = without_motion(recordings, static_only=request.static_only, settings=request.settings)
    if motion and not recordings.recordings:
        return findings_of(moves(tested, motion, static_only=request.static_only), [], motion=motion)
    with stages.timed("refit"):
        case = case_of_observed(measured, recordings, request.seed, request.jobs, request.settings)
        notes = [*static_note(motion), *label_unit_note(case.nominal_per_label, case.base)]
    comparison = comparison_of(case, tested, request, stages)
    case, null, values = comparison.case, comparison.null, comparison.values
    rounds: list[Round] = []
    if comparison.disagrees:
        with stages.timed("templates"):
            templates = templates or templates_for(comparison, stages.progress)
        with stages.timed("candidates"):
            rounds = with_given_parameters(comparison, up_to_named(comparison, searched(comparison, templates)))
    with stages.timed("verdict"):
        conclusion = conclude(comparison, rounds, floor_of_halves(case, measured.recordings, null))
    with stages.timed("evidence"):
        evidence = evidence_for(comparison, rounds, conclusion)
    bounded: list[Bound] = []
    not_bounded: list[tuple[str, str]] = []
    if request.bounds != "none" and conclusion.verdict in BOUNDED_VERDICTS:
        with stages.timed("bounds"):
            if templates is None and request.bounds == "linear":
                templates = shipped_templates()
            templates = templates or templates_of(comparison.names, jobs=case.jobs, progress=stages.progress)
            bounded, not_bounded = upper_bounds(
                case, comparison.model, null, values, comparison.names, templates, request.bounds
            )
    notes += [*unbounded(conclusion.verdict, request.bounds), *unfinished(case.budget)]
    return findings_of(
        conclusion,
        notes,
        evidence=evidence,
        bounds=tuple(bounded),
        not_bounded=tuple(not_bounded),
        simulated=case.budget.simulated,
        motion=motion,
    )


def searched(comparison: Comparison, templates: Templates | None) -> list[Round]:
    """The rounds of a search among the candidates of a comparison; without templates for maps of rates."""
    return forward_selection(comparison.problem, comparison.names, templates)


def read_case(campaign: Campaign, seed: int = 0, jobs: int = 1, settings: DiagnosisSettings | None = None) -> Case:
    """Observe and refit a campaign.

    Args:
        campaign: recordings at another V_d than most, and rates only, are left to SNEE.
        seed: of all simulations.
        jobs: threads.
        settings: default `DiagnosisSettings()`.

    Raises:
        InputError: where a recording of steady light moves, and for settings of another type.
    """
    settings = checked_settings(settings)
    seen, motion = without_motion(observed(campaign), static_only=False, settings=settings)
    if motion:
        raise InputError(f"{motion[0].text}; a static recording is needed")
    return case_of_observed(campaign, seen, seed, jobs, settings)


def observed(campaign: Campaign) -> Observed:
    """Observe a campaign; recordings at another V_d than most, and rates only, are left to SNEE."""
    conditions = [condition_of(r) for r in campaign.recordings]
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
    both = zip(part.recordings, conditions, strict=True)
    seen = tuple(observe(r.packed(), part.shape, film=c.moves, static=c.static) for r, c in both)
    return Observed(part.recordings, tuple(conditions), seen)


def case_of_observed(
    campaign: Campaign, recordings: Observed, seed: int, jobs: int, settings: DiagnosisSettings
) -> Case:
    """Refit the unit by the recordings; labels in another unit are counted anew."""
    seen = recordings.observations
    conditions = [
        replace(c, level=float(o.rate[counted_pixels(c)].mean())) if c.kind == "unknown" else c
        for c, o in zip(recordings.conditions, seen, strict=True)
    ]
    case = case_of(campaign.shape, conditions, seen, seed, jobs, campaign.frame_rate_hz)
    case = replace(case, settings=settings)
    factor = nominal_per_label(case.base, settings.unit.usual)
    if factor == 1.0:
        return case
    case = case.of([in_nominal_units(c, factor) for c in conditions], seen)
    return replace(case, nominal_per_label=factor)


def refittable(conditions: Sequence[Condition]) -> bool:
    """Whether there are two recordings to refit the unit by, or nothing but scenes."""
    scenes = bool(conditions) and all(c.kind == "unknown" for c in conditions)
    return scenes or sum(c.kind in STEADY_KNOWN and c.use == "fit" for c in conditions) >= 2


def comparison_of(case: Case, tested: SensorModel, request: DiagnosisRequest, stages: Stages) -> Comparison:
    """The case beside a model, without a search: contradictions of labels, effects that the refit shows to be missing,
    parameters off nominal, and the null model's twins."""
    with stages.timed("audit"):
        contradictions = upheld(case, tested, audit(case))
        case = trimmed(case, contradictions)
        limit = request.effort * len(case.conditions)
        case = replace(case, budget=Budget(limit, verdict_known=bool(contradictions)))
        stages.follow(case.budget, len(case.conditions))
    names, not_testable = testable(request.names, case.conditions)
    lacking = missing_effects(case, tested, names)
    model = with_missing(tested, lacking)
    off = OffNominal({}, case.base) if lacking else off_nominal(case, tested, case.base)
    with stages.timed("twins"):
        null = model_null(case, model, request.twin_count)
        differs = lacking or off.parameters
        given = model_null(replace(case, base=off.nominal), tested, case.settings.twins.to_confirm) if differs else null
    return Comparison(
        case=case,
        tested=tested,
        model=model,
        null=null,
        values=values_of(case.bank, null.keys),
        given=aligned_mean(given, null),
        missing=tuple(lacking),
        off=off,
        contradictions=tuple(contradictions),
        names=tuple(names),
        not_testable=tuple(not_testable),
    )


def trimmed(case: Case, contradictions: Sequence[Contradiction]) -> Case:
    """The case without recordings that contradict the others, where enough is left to refit the unit by."""
    bad = {r for c in contradictions for r in c.recordings}
    keep = [i for i, c in enumerate(case.conditions) if c.name not in bad]
    if not bad or not refittable([case.conditions[i] for i in keep]):
        return case
    return case.of([case.conditions[i] for i in keep], [case.observations[i] for i in keep])


def templates_for(comparison: Comparison, progress: bool) -> Templates:
    """Templates of the standard design, or of unknown scenes alone their own; neither counts in the budget."""
    case = comparison.case
    if case.scenes_only:
        return own_templates(replace(case, budget=Budget()), comparison.model, comparison.null, comparison.names)
    return templates_of(comparison.names, jobs=case.jobs, progress=progress)
