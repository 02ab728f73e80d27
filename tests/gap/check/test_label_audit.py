"""Contradictions within recordings, and effects that are none."""

from __future__ import annotations

import re

import numpy as np
import pytest
from small import FRAMES, MODEL, SHAPE, case_from, conditions, effect, recorded, spikes_of

from spikecam_env.gap import write_campaign
from spikecam_env.gap.baseline.upheld_labels import relabelled as labelled
from spikecam_env.gap.baseline.upheld_labels import upheld
from spikecam_env.gap.check.label_audit import audit
from spikecam_env.gap.diagnose import read_case

EFFECTS = [
    effect("dead_time", tau_us=0.5),
    effect("photo_response_nonlinearity", beta=0.02),
    effect("photodiode_lag", fraction=0.06, tau_us=1000.0),
    effect("light_flicker", modulation=0.02, frequency_hz=400.0),
    effect("readout_skew", span=1.0),
    effect("clock_jitter", sigma_ns=2000.0),
    effect("lamp_drift", sigma_per_root_s=0.02),
    effect("dark_current_drift", rise=0.3, tau_ms=50.0),
    effect("missed_spikes", probability=0.002),
    effect("optical_blur", sigma_pixels=0.5),
]


def found(case) -> list[tuple[str, tuple[str, ...]]]:
    contradictions = audit(case)
    print([c.text for c in contradictions])
    return [(c.kind, c.recordings) for c in contradictions]


def relabelled(name: str, factor: float):
    """Conditions with the label of one recording multiplied by a factor."""
    return [labelled(c, factor) if c.name == name else c for c in conditions()]


@pytest.mark.parametrize("seed", [1, 5, 6, 7])
def test_a_clean_campaign_contradicts_nothing(seed):
    assert found(recorded(seed=seed)) == []


@pytest.mark.parametrize("shown_by", EFFECTS, ids=lambda e: e.name)
def test_an_effect_is_no_contradiction(shown_by):
    assert found(recorded(shown_by)) == []


@pytest.mark.parametrize("name", ["flat-0.03", "flat-0.65"])
@pytest.mark.parametrize("factor", [0.98, 1.02])
def test_a_label_2_percent_wrong_is_named_with_its_error(name, factor):
    case = case_from(spikes_of(), shown=relabelled(name, factor))
    assert found(case) == [("label", (name,))]
    said = float(re.search(r"([+-][\d.]+) %", audit(case)[0].text)[1])
    assert said == pytest.approx(100 * (1 / factor - 1), abs=0.1)


@pytest.mark.parametrize("name", ["flat-0.2", "flat-0.65"])
def test_spikes_that_are_missing_at_one_level_are_not_called_a_wrong_label(name):
    """3 % of them: the rate is that of 3 % less light, but intervals are doubled."""
    spikes = spikes_of()
    spikes[name] = spikes[name] * (np.random.default_rng(0).random(spikes[name].shape) > 0.03)
    assert found(case_from(spikes)) == []


@pytest.mark.slow
def test_the_brightest_label_is_not_to_blame_where_more_of_its_recording_is_off():
    """An effect that takes spikes of bright light alone leaves traces in their timing; a label does not."""
    plain, noisy, shown = spikes_of(), spikes_of(), relabelled("flat-0.65", 0.98)
    noisy["flat-0.65"] = spikes_of(effect("frame_threshold_noise", sigma_mV=10.0))["flat-0.65"]
    for spikes, stands in ((plain, True), (noisy, False)):
        case = case_from(spikes, shown=shown)
        assert found(case) == [("label", ("flat-0.65",))]
        assert bool(upheld(case, MODEL, audit(case))) == stands


def test_a_wrong_label_is_named_beside_an_effect_that_bends_less():
    case = case_from(spikes_of(effect("dead_time", tau_us=0.05)), shown=relabelled("flat-0.2", 1.02))
    assert found(case) == [("label", ("flat-0.2",))]


@pytest.mark.parametrize("pair", [("flat-0.2", "flat-0.4"), ("flat-0.03", "flat-0.65")])
def test_two_flats_that_were_swapped_are_named_together(pair):
    spikes = spikes_of()
    a, b = pair
    spikes[a], spikes[b] = spikes[b], spikes[a]
    assert found(case_from(spikes)) == [("swapped", pair)]


@pytest.mark.parametrize("name", ["flat-0.4", "bars", "flat-0.65"])
def test_a_recording_with_rows_reversed_is_named(name):
    spikes = spikes_of()
    spikes[name] = spikes[name][:, ::-1]
    kinds = found(case_from(spikes))
    assert kinds == [("flipped", (name,))]
    assert "rows reversed" in audit(case_from(spikes))[0].text


@pytest.mark.parametrize("turn, said", [((slice(None), slice(None, None, -1)), "columns"),
                                        ((slice(None, None, -1),) * 2, "180")])  # fmt: skip
def test_a_recording_that_is_mirrored_or_turned_is_named(turn, said):
    spikes = spikes_of()
    spikes["flat-0.4"] = spikes["flat-0.4"][:, turn[0], turn[1]]
    (found_,) = audit(case_from(spikes))
    print(found_.text)
    assert (found_.kind, found_.recordings) == ("flipped", ("flat-0.4",)) and said in found_.text


@pytest.mark.parametrize("name, count", [("bars", 24), ("bars", 10), ("flat-0.2", 2), ("flat-0.03", 10)])
def test_dropped_frames_are_found_where_they_are_missing(name, count):
    """To an eighth of the recording.  How many is said of moving light alone, to a bin of 16 frames or threefold."""
    spikes = spikes_of()
    at = FRAMES // 2
    spikes[name] = np.delete(spikes[name], slice(at, at + count), axis=0)
    contradictions = audit(case_from(spikes))
    print([c.text for c in contradictions])
    assert [(c.kind, c.recordings) for c in contradictions] == [("dropped", (name,))]
    text = contradictions[0].text
    near = int(re.search(r"missing.* near frame (\d+)", text)[1])
    assert abs(near - at) <= FRAMES // 8
    if name == "bars":
        frames = int(re.search(r"about (\d+) frames missing", text)[1])
        assert abs(frames - count) <= max(16, 2 * count)


@pytest.mark.parametrize("name", ["dark", "flat-0.03"])
def test_a_burst_of_a_few_pixels_is_no_gap_in_time(name):
    """Three spikes too many, one frame after another, in one pixel of fifty."""
    spikes = spikes_of()
    few = np.random.default_rng(0).random(SHAPE) < 0.02
    spikes[name][700:703, few] = 1
    assert found(case_from(spikes)) == []


@pytest.mark.parametrize("name, count", [("flat-0.03", 10), ("flat-0.03", 17)])
def test_a_gap_that_makes_intervals_odd_is_found(name, count):
    """Some half an interval: those that it shortens are irregular and not timed, those that lose a spike are late."""
    spikes = spikes_of()
    spikes[name] = np.delete(spikes[name], slice(1000, 1000 + count), axis=0)
    assert found(case_from(spikes)) == [("dropped", (name,))]


def with_few_regular(pixels: int):
    """Spikes are lost, but for a few pixels that fire in every second frame of one flat: a double interval of theirs
    is still regular, and two frames late."""
    rng = np.random.default_rng(0)
    spikes = {name: seen * (rng.random(seen.shape) > 0.1) for name, seen in spikes_of().items()}
    every = np.broadcast_to(np.arange(FRAMES)[:, None] % 2 == 0, (FRAMES, pixels))
    spikes["flat-0.4"].reshape(FRAMES, -1)[:, :pixels] = every & (rng.random(every.shape) > 0.001)
    return spikes


@pytest.mark.parametrize("pixels", [2, 12])
def test_a_few_late_pixels_are_no_gap(pixels):
    spikes = with_few_regular(pixels)
    spikes["flat-0.4"].reshape(FRAMES, -1)[FRAMES // 2, :pixels] = 0
    assert found(case_from(spikes)) == []


def test_a_gap_is_found_by_those_pixels_that_are_regular():
    spikes = with_few_regular(36)
    spikes["flat-0.4"] = np.delete(spikes["flat-0.4"], FRAMES // 2, axis=0)
    assert found(case_from(spikes)) == [("dropped", ("flat-0.4",))]


def test_a_quick_drift_of_the_dark_is_no_gap_in_time():
    """All pixels of a dim flat are behind their time at its beginning, and for long after."""
    assert found(recorded(effect("dark_current_drift", rise=0.3, tau_ms=5.0))) == []


def fired(rate, light):
    """(F, H, W) spikes of pixels that fire at `rate` (H, W) a frame, in light (F,) times that, without noise."""
    phase = np.random.default_rng(0).random(rate.shape) + np.cumsum(light)[:, None, None] * rate
    return np.diff(np.floor(phase), axis=0, prepend=np.floor(phase[:1])).astype(np.uint8)


@pytest.mark.parametrize("frequency_hz", [100.0, 137.0, 200.0, 300.0])
def test_a_flicker_that_sets_in_half_way_is_no_gap_in_time(frequency_hz):
    """Nothing is late before, and two and three intervals after its first trough its waves may cancel."""
    spikes, frame = spikes_of(), np.arange(FRAMES)
    for name in ("flat-0.03", "flat-0.2"):
        wave = 0.04 * (frame > FRAMES // 2) * np.sin(2 * np.pi * frequency_hz / 40_000 * frame)
        spikes[name] = fired(spikes[name].mean(axis=0), 1.0 + wave)
    assert found(case_from(spikes)) == []


def test_two_gaps_in_time_are_still_gaps():
    spikes = spikes_of()
    spikes["flat-0.2"] = np.delete(spikes["flat-0.2"], [700, 701, 1300, 1301], axis=0)
    assert found(case_from(spikes)) == [("dropped", ("flat-0.2",))]


def test_a_lit_recording_without_spikes_is_named():
    spikes = spikes_of()
    spikes["flat-0.2"][:] = 0
    assert ("silent", ("flat-0.2",)) in found(case_from(spikes))


def test_a_recording_that_never_stops_is_named():
    spikes = spikes_of()
    spikes["flat-0.08"][:] = 1
    assert ("silent", ("flat-0.08",)) in found(case_from(spikes))


def test_a_dark_recording_that_saw_light_is_named():
    spikes = spikes_of()
    spikes["dark"] = spikes["flat-0.03"].copy()
    assert [c for c in found(case_from(spikes)) if "dark" in c[1]]


def test_a_recording_darker_than_the_flats_extrapolate_to_is_not_mislabelled():
    """Noise of rows takes 3 % off the rate of the dark: no dark recording is too dark for its label."""
    spikes = spikes_of()
    spikes["dark"] *= np.random.default_rng(0).random(spikes["dark"].shape) < 0.97
    assert found(case_from(spikes)) == []


@pytest.mark.parametrize("seed", [3, 4])
def test_the_standard_design_contradicts_nothing_however_few_spikes_the_dark_has(seed, tmp_path):
    """Rates of five spikes a pixel are biased by 0.2 %: no contradiction."""
    campaign = write_campaign(tmp_path, MODEL, shape=SHAPE, frames=FRAMES, seed=seed)
    assert found(read_case(campaign)) == []
