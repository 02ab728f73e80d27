"""Whole diagnoses of a small camera with two effects, or one: all are named, or the sentence says why not."""

from __future__ import annotations

from pathlib import Path

import pytest
from small import MODEL, effect

from spikecam_env.gap import Bars, Dark, Flat, Step, write_campaign
from spikecam_env.gap.diagnose import diagnose
from spikecam_env.gap.result import Diagnosis

STILL = (Dark(), *(Flat(radiance=x) for x in (0.08, 0.25, 0.55)), Flat(radiance=0.15, use="holdout"))
DEAD_TIME = effect("dead_time", tau_us=2.0)
ROWS = effect("row_temporal_noise", sigma_mV=30.0)
LAG = effect("photodiode_lag", fraction=0.2, tau_us=1000.0)
BENDS = ("dead_time", "comparator_delay")


def diagnosed(folder: Path, effects, recordings, names: tuple[str, ...], **options) -> Diagnosis:
    """The diagnosis of a camera of 16 x 16 pixels for 1200 frames a recording, by a few twins."""
    model = MODEL
    for each in effects:
        model = model.with_effect(each)
    made = write_campaign(folder / "c", model, shape=(16, 16), frames=1200, recordings=recordings, seed=4)
    found = diagnose(made, candidates=tuple(dict.fromkeys(names)), twin_count=4, progress=False, **options)
    print(found.sentence, {e.name: e.parameters for e in found.effects}, found.data)
    return found


@pytest.mark.parametrize(
    "effects, recordings, others",
    [
        ((DEAD_TIME, ROWS), STILL, ("common_threshold_noise",)),
        ((LAG, ROWS), (*STILL, Step(half_period=100), Bars(high=1.4)), ("readout_skew",)),
    ],
    ids=["saturation and rows", "lag and rows"],
)
def test_two_effects_are_named_with_their_strengths(effects, recordings, others, tmp_path: Path):
    """To a fifth: 256 pixels, and four twins."""
    found = diagnosed(tmp_path, effects, recordings, (*(e.name for e in effects), *others, *BENDS))
    assert found.verdict == "named" and {e.name for e in found.effects} == {e.name for e in effects}
    for true in effects:
        [named] = [e for e in found.effects if e.name == true.name]
        key = type(true).strength
        assert named.parameters[key].value == pytest.approx(true.parameters()[key], rel=0.2)
    assert found.gap.removed > 0.9


def test_where_effort_ends_before_a_second_effect_nothing_is_named_and_more_effort_is_asked_for(tmp_path: Path):
    found = diagnosed(tmp_path, (DEAD_TIME, ROWS), STILL, ("dead_time", ROWS.name, "comparator_delay"), effort=20)
    assert found.verdict == "unknown" and "--effort" in found.sentence


def test_one_effect_that_explains_all_is_named_alone(tmp_path: Path):
    found = diagnosed(tmp_path, (ROWS,), STILL, (*BENDS, ROWS.name, "common_threshold_noise"))
    assert found.verdict == "named" and [e.name for e in found.effects] == [ROWS.name]
