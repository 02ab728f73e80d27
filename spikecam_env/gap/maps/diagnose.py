"""Diagnosis of maps of rates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from spikecam_env.campaign.reading import Campaign
from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.distance import adjusted, deviates
from spikecam_env.gap.compare.prediction import null_of, values_of
from spikecam_env.gap.maps.bank import MapCase, map_bank, read_maps, unit_maps
from spikecam_env.gap.maps.conclude import conclude_maps
from spikecam_env.gap.maps.evidence import evidence_of_maps
from spikecam_env.gap.maps.search import PatternModel, search_maps, spreads_matched
from spikecam_env.gap.result import Conclusion, Evidence
from spikecam_env.gap.settings import DiagnosisSettings, checked_settings
from spikecam_env.sensor import SensorModel


def diagnose_maps(
    campaign: Campaign,
    model: SensorModel,
    names: Sequence[str],
    seed: int = 0,
    jobs: int = 1,
    settings: DiagnosisSettings | None = None,
) -> tuple[Conclusion, Evidence]:
    """Find the fixed pattern that a model lacks, from rates alone.

    Args:
        model: the model under test.
        names: names of the candidates.
        seed: as in `diagnose.diagnose`.
        jobs: as in `diagnose.diagnose`.
        settings: as in `diagnose.diagnose`.

    Raises:
        InputError: where no rates are in known light, and for settings of another type.
    """
    case = read_maps(campaign, seed, jobs, checked_settings(settings))
    tested = [n for n in names if candidate(n).is_pattern and shows_in_maps(n, case)]
    measured = case.statistics
    given = spreads_matched(PatternModel(model, {}), case, measured)
    banks = [map_bank(unit_maps(given.fitted, case, n)) for n in range(case.settings.maps.units)]
    null = null_of(banks, list(measured), settings=case.settings)
    null = replace(null, sd=np.maximum(null.sd, 1e-3 * null.floor))
    values = values_of(measured, null.keys)
    alarm = adjusted(deviates(null, values)).min() < case.settings.judging.alarm
    rounds, rejected = search_maps(case, given, null, values, tested) if alarm else ([], [])
    not_testable = [(n, needs(n)) for n in names if n not in tested]
    conclusion = conclude_maps(case, model, null, values, rounds, rejected, not_testable)
    return conclusion, evidence_of_maps(case, given, rounds[-1][0] if rounds else None)


def shows_in_maps(name: str, case: MapCase) -> bool:
    """Whether the maps can show a candidate: dark effects need a dark map, all others a lit one."""
    kinds = {m.shown.kind for m in case.maps}
    return "dark" in kinds if candidate(name).family == "dark" else bool(kinds & {"flat", "picture"})


def needs(name: str) -> str:
    """The recording that would show a candidate which these maps do not."""
    if not candidate(name).is_pattern:
        return "spikes: rates say nothing of when they come"
    return "a dark map" if candidate(name).family == "dark" else "a map of a flat"
