"""The light of every kind of recording, and how little it takes to store."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from spikecam_env.campaign.takes import light_during
from spikecam_env.errors import InputError
from spikecam_env.gap import KINDS, Bars, Disk, Flat, MaskedRows, Step, second_voltage, standard_design
from spikecam_env.sensor import SpikeSensor

SHAPE = (12, 16)
FRAMES = 500


def example(kind: str):
    return KINDS[kind](radiance=0.3) if kind == "flat" else KINDS[kind]()


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_light_is_a_pure_function_on_whole_frames_that_broadcasts_to_the_picture(kind: str) -> None:
    one, two = (example(kind).light(SHAPE, FRAMES) for _ in range(2))
    np.testing.assert_array_equal(one.radiance, two.radiance)
    np.testing.assert_array_equal(one.frame, np.floor(one.frame))
    np.broadcast_to(one.radiance, (len(one.frame), *SHAPE))
    assert one.frame[0] == 0


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_blocks_of_keys_give_the_bits_of_all_keys(kind: str) -> None:
    light = example(kind).light(SHAPE, FRAMES)
    whole = SpikeSensor("scsim", SHAPE, 1).step(light_during(light, 0, FRAMES, SHAPE), FRAMES)
    camera = SpikeSensor("scsim", SHAPE, 1)
    cuts = (0, 1, 65, 199, 200, 201, 384, FRAMES)
    pieces = [camera.step(light_during(light, a, b, SHAPE), b - a) for a, b in pairwise(cuts)]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)


def test_bars_are_the_mean_light_over_a_pixel_at_all_times() -> None:
    bars = Bars(low=0.1, high=0.5, period=8.0, speed=0.25)
    light = bars.light(SHAPE, FRAMES)
    assert light.radiance.shape == (FRAMES // 4 + 1, 1, SHAPE[1])
    fine = (np.arange(1000) + 0.5) / 1000
    for frame in (0.0, 1.0, 2.5, 37.3, 331.9):
        place = np.arange(SHAPE[1])[:, None] + fine - 0.25 * frame
        sampled = np.where(np.mod(place, 8.0) < 4.0, 0.5, 0.1).mean(axis=1)
        # Sampling at a thousand points sees an edge to 0.4 / 1000; a pixel has at most one.
        np.testing.assert_allclose(light.at(frame)[0], sampled, atol=0.4e-3 + 1e-6)


def test_bars_go_down_and_backwards() -> None:
    assert Bars(down=True).light(SHAPE, FRAMES).radiance.shape[1:] == (SHAPE[0], 1)
    there, back = (Bars(speed=s).light(SHAPE, FRAMES).at(0.0 if s > 0 else 80.0) for s in (0.2, -0.2))
    np.testing.assert_allclose(there, back, atol=1e-6)


def test_a_step_takes_one_frame_and_spends_half_its_time_high() -> None:
    light = Step(low=0.1, high=0.3, half_period=50).light(SHAPE, 400)
    assert light.radiance.shape[1:] == (1, 1)
    assert [round(float(light.at(t)[0, 0]), 6) for t in (0, 49, 49.5, 50, 99, 100, 399)] == [
        0.1,
        0.1,
        0.2,
        0.3,
        0.3,
        0.1,
        0.3,
    ]


def test_the_disk_turns_before_a_still_pattern_a_pixel_a_key() -> None:
    light = Disk(rim_speed=0.05).light((32, 32), 2000)
    assert np.diff(light.frame).max() * 0.05 <= 1.2 + 1e-9
    change = np.ptp(light.radiance, axis=0)
    y, x = np.indices((32, 32)) - 15.5
    outside = np.hypot(x, y) > 0.44 * 32 + 1
    assert change[outside].max() == 0.0 and change[~outside].max() > 0.2
    assert np.ptp(light.radiance[0][outside]) > 0.1


def test_masked_rows_give_equal_light_under_unequal_load() -> None:
    picture = MaskedRows(band=3).light(SHAPE, FRAMES).radiance[0]
    assert np.ptp(picture[:, : SHAPE[1] // 2]) == 0.0
    load = picture.mean(axis=1)
    assert load[0] == load[6] > 1.5 * load[3]


def test_the_standard_design_is_what_acceptance_asks_for() -> None:
    fit = [p.file_name for p in standard_design() if p.use == "fit"]
    held = [p.file_name for p in standard_design() if p.use == "holdout"]
    assert fit == ["dark", *(f"flat-{x:g}" for x in (0.01, 0.03, 0.08, 0.2, 0.4, 0.65)), "step", "bars"]
    assert held == ["flat-0.05", "flat-0.15", "flat-0.5", "disk"]


def test_a_second_voltage_repeats_dark_and_flats_to_fit() -> None:
    added = second_voltage(standard_design(), 0.7)[len(standard_design()) :]
    assert [p.file_name for p in added][:2] == ["dark-at-0.7V", "flat-0.01-at-0.7V"]
    assert len(added) == 7 and all(p.v_d == 0.7 for p in added)


@pytest.mark.parametrize(
    ("recording", "message"),
    [
        (Flat(radiance=-0.1), "negative"),
        (Flat(radiance=np.nan), "NaN"),
        (Step(half_period=1), "half_period = 1"),
        (Bars(speed=2.0), "speed 2.0"),
        (Bars(period=1.0), "period 1.0"),
        (Disk(rim_speed=3.0), "rim_speed = 3.0"),
        (MaskedRows(band=12), "band = 12"),
    ],
)
def test_light_that_cannot_be_is_refused(recording, message: str) -> None:
    with pytest.raises(InputError, match=message):
        recording.light(SHAPE, FRAMES)
