"""Evidence: recordings that the report draws, measured and simulated under the model before and after."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

from spikecam_env.gap.observe.observation import ObservedRecording
from spikecam_env.gap.result import LABELLED_LIGHT, NOMINAL_LIGHT, Conclusion, Evidence
from spikecam_env.gap.search.round import Round
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.twins.fresh_units import drawn_response
from spikecam_env.gap.twins.rate_maps import unit_without_errors
from spikecam_env.gap.twins.unknown_scene import simulate_seen
from spikecam_env.gap.unit.refit import BaseFit, constrained_refit, free_refit
from spikecam_env.gap.verdict.comparison import Comparison
from spikecam_env.sensor import SensorModel


def evidence_for(comparison: Comparison, rounds: Sequence[Round], conclusion: Conclusion) -> Evidence:
    """Twins of the tested model, with its nominal unit, and where it differs of the patched one."""
    case, tested = comparison.case, comparison.tested
    model = rounds[-1].start.model if rounds else comparison.model
    unit = rounds[-1].start.base if rounds else constrained_refit(model, case.base)
    changed = model is not tested or conclusion.parameters
    base = constrained_refit(tested, comparison.off.nominal)
    return evidence_of(case, tested, base, *((model, unit) if changed else ()))


def evidence_of_maps(comparison: Comparison, rounds: Sequence[Round]) -> Evidence:
    """Response and dark level of every pixel, measured and of fresh units."""
    case = comparison.case
    nothing = (None,) * len(case.conditions)
    models = [comparison.model, *(r.start.model for r in rounds[-1:])]
    before, *last = [
        drawn_response(m, case.base, case.shape, case.seed + case.settings.twins.drawn_units) for m in models
    ]
    after = last[0] if last else None
    return Evidence(
        conditions=case.conditions,
        measured=nothing,  # type: ignore[arg-type]
        before=nothing,  # type: ignore[arg-type]
        after=nothing if after else None,  # type: ignore[arg-type]
        free_refit=case.base,
        before_base=unit_without_errors(*before),
        after_base=unit_without_errors(*after) if after else None,
        drawn_before=before,
        drawn_after=after,
    )


def evidence_of(
    case: Case, before: SensorModel, base: BaseFit, after: SensorModel | None = None, after_base: BaseFit | None = None
) -> Evidence:
    """Two twins of the model before, one of the patched model, and fresh units of both.

    Args:
        case: the measurement.
        before: the tested model.
        base: its unit.
        after: the patched model; None where nothing was added.
        after_base: its unit; None for `base`.
    """
    counted_anew = case.nominal_per_label != 1.0

    def twin(model: SensorModel, unit: BaseFit, number: int) -> tuple[ObservedRecording, ...]:
        seed, takes = case.seed * 1000 + 900 + number, range(len(case.conditions))
        return tuple(simulate_seen(model, unit, case.conditions, case.observations, case.shape, seed, takes, case.jobs))

    with ThreadPoolExecutor(case.jobs) as pool:
        of_before = [pool.submit(twin, before, base, number) for number in (0, 1)]
        of_after = pool.submit(twin, after, after_base or base, 2) if after else None
        first, again = (made.result() for made in of_before)
        last = of_after.result() if of_after else None
    return Evidence(
        conditions=case.conditions,
        measured=case.observations,
        before=first,
        after=last,
        free_refit=case.base,
        before_base=free_refit(list(first), list(case.conditions)),
        after_base=free_refit(list(last), list(case.conditions)) if last else None,
        again=again,
        drawn_before=None if case.scenes_only else drawn_response(before, case.base, case.shape, case.seed),
        drawn_after=drawn_response(after, case.base, case.shape, case.seed) if after and not case.scenes_only else None,
        light=NOMINAL_LIGHT if counted_anew else LABELLED_LIGHT,
    )
