"""Intervals of parameters at little effort and at much."""

from __future__ import annotations

import pytest
from small import MODEL, effect

from spikecam_env.gap import Dark, Flat, write_campaign
from spikecam_env.gap.diagnose import diagnose
from spikecam_env.gap.result import Diagnosis, Estimate

pytestmark = pytest.mark.slow

TRUTH_MV = 20.0
DESIGN = (Dark(), Flat(radiance=0.1), Flat(radiance=0.3), Flat(radiance=0.2, use="holdout"))
NAMES = ("row_temporal_noise", "column_fixed_pattern", "row_fixed_pattern", "common_threshold_noise",
         "frame_threshold_noise")  # fmt: skip
LITTLE, MUCH = 25.0, 200.0
"""Campaigns: the first is spent before strengths are refined."""


@pytest.fixture(scope="module")
def found(tmp_path_factory) -> dict[float, Diagnosis]:
    """Row noise of 20 mV, diagnosed at both efforts."""
    model = MODEL.with_effect(effect("row_temporal_noise", sigma_mV=TRUTH_MV))
    folder = tmp_path_factory.mktemp("rows")
    campaign = write_campaign(folder, model, shape=(40, 72), frames=2000, recordings=DESIGN, seed=0)
    return {n: diagnose(campaign, candidates=NAMES, effort=n, progress=False) for n in (LITTLE, MUCH)}


def sigma(diagnosis: Diagnosis) -> Estimate:
    """Of the row noise, the only effect found."""
    [named] = diagnosis.effects
    assert diagnosis.verdict == "named" and named.name == "row_temporal_noise"
    return named.parameters["sigma_mV"]


def test_the_interval_contains_the_truth_where_finer_strengths_were_skipped(found):
    estimate, skipped = sigma(found[LITTLE]), found[LITTLE].data
    print(estimate, skipped)
    assert any("finer strengths" in note and "Intervals are wider" in note for note in skipped)
    assert estimate.interval is not None and estimate.interval[0] < TRUTH_MV < estimate.interval[1]


def test_an_interval_of_little_effort_is_no_narrower_than_one_of_much(found):
    little, much = sigma(found[LITTLE]), sigma(found[MUCH])
    print(little, much)
    assert not any("Skipped" in note for note in found[MUCH].data)
    assert much.interval is not None and much.interval[0] < TRUTH_MV < much.interval[1]
    assert 0.9 * much.sd < little.sd < 2 * much.sd
