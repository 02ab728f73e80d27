"""Every measure on made-up rates whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from denoiser.decoders import accumulate
from denoiser.evaluate import measures

SHAPE = (24, 32)


def moving_light(frames: int, late: float = 0.0) -> np.ndarray:
    """(frames, 24, 32) in [0.05, 0.45]: gratings of 20 and 33 frames a period that slide, `late` frames behind."""
    t = np.arange(frames)[:, None, None] - late
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    fast, slow = np.sin(2 * np.pi * (t / 20 - x / 9)), np.sin(2 * np.pi * (t / 33 - y / 7))
    return (0.25 + 0.12 * fast + 0.08 * slow).astype(np.float32)


@pytest.mark.parametrize("late", [0.0, 3.0, 1.5, -2.0])
def test_a_delay_is_found_to_a_tenth_of_a_frame(late: float) -> None:
    found = measures.lag_frames(moving_light(70, late), moving_light(70))
    print(f"delayed by {late}: {found:.3f} frames")
    assert found == pytest.approx(late, abs=0.1)


def test_the_longest_delay_that_is_looked_for_is_12_frames() -> None:
    assert measures.lag_frames(moving_light(90, 9.0), moving_light(90)) == pytest.approx(9.0, abs=0.1)
    assert measures.MOST_LAG == 12 and abs(measures.lag_frames(moving_light(90, 18.0), moving_light(90))) <= 12


def test_a_stream_of_spikes_of_the_light_does_not_lag() -> None:
    light = moving_light(400)
    spikes, _ = accumulate.step(light, accumulate.start(SHAPE))
    found = measures.lag_frames(spikes, light)
    print(f"spikes by accumulation: {found:.3f} frames")
    assert abs(found) < 0.3
    assert measures.lag_frames(np.roll(spikes, 3, axis=0)[20:], light[20:]) == pytest.approx(3 + found, abs=0.3)


def test_a_drift_does_not_move_the_delay() -> None:
    """A ramp of pixels' light, and a gain of the camera's, add nothing to the high-passed light."""
    ramp = np.linspace(0, 2, 70, dtype=np.float32)[:, None, None] * np.ones(SHAPE, np.float32)
    found = measures.lag_frames(1.1 * (moving_light(70, 3.0) + ramp), moving_light(70) + ramp)
    assert found == pytest.approx(3.0, abs=0.15)


def test_still_light_and_short_streams_have_no_lag() -> None:
    still = np.repeat(moving_light(1), 70, axis=0)
    assert np.isnan(measures.lag_frames(still, still))
    assert np.isnan(measures.lag_frames(moving_light(48), moving_light(48)))
    assert not np.isnan(measures.lag_frames(moving_light(49), moving_light(49)))


def test_a_bias_of_two_percent_is_found_and_dark_pixels_do_not_count() -> None:
    light = np.full((5, 4, 10), 1.0, np.float32)
    light[:, :, :2] = 0.3  # 35 % of the mean
    light[:, :, 2:4] = 0.55  # 63 %
    rate = 1.02 * light
    rate[:, :, :2] += 5.0
    assert measures.bias(rate, light) == pytest.approx(0.02, abs=1e-6)
    rate[:, :, 2:4] *= 2
    assert measures.bias(rate, light) > 0.1


def test_the_worst_place_in_a_pass_is_named_whatever_frame_comes_first() -> None:
    light = moving_light(40)
    rates = light + np.float32(0.001)
    first = 5
    at_place_3 = (first + np.arange(40)) % 8 == 3
    rates[at_place_3] = light[at_place_3] + np.float32(0.01)
    found = measures.db_by_place(rates, light, 8, first, peak=1.0)
    expected = np.full(8, 60.0)
    expected[3] = 40.0
    np.testing.assert_allclose(found, expected, atol=0.01)


def test_a_pass_with_an_error_of_its_own_flickers_by_the_ratio_of_the_errors() -> None:
    """Change within a pass: sqrt(2) b; into the next: sqrt(2 a^2 + 2 b^2).  a: of a pass, b: of a frame."""
    rng = np.random.default_rng(0)
    light = moving_light(320)
    a, b = 0.02, 0.01
    passes = np.repeat(rng.normal(0, a, (41, *SHAPE)), 8, axis=0)[3:323]
    rates = (light + passes + rng.normal(0, b, light.shape)).astype(np.float32)
    expected = np.sqrt(1 + (a / b) ** 2)
    found = measures.across_over_within(rates, light, 8, first=3)
    even = measures.across_over_within(rates, light, 8, first=0)
    print(f"flicker {found:.3f}, expected {expected:.3f}; passes cut elsewhere {even:.3f}")
    assert found == pytest.approx(expected, rel=0.03)
    assert even < 1
    assert np.isnan(measures.across_over_within(rates, light, 1, 0))


def test_the_change_of_a_step_at_rest_is_that_of_independent_noise() -> None:
    """sqrt(2) sigma of planes; of spikes with probability f, counted over 40 frames, sqrt(2 f (1 - f) / 40)."""
    rng = np.random.default_rng(3)
    light = np.full(SHAPE, 0.3)
    planes = (light + rng.normal(0, 0.02, (200, *SHAPE))).astype(np.float32)
    spikes = (rng.random((400, *SHAPE)) < light).astype(np.uint8)
    for frames, expected in ((planes, np.sqrt(2) * 0.02), (spikes, np.sqrt(2 * 0.3 * 0.7 / 40))):
        found = measures.change_of_step(frames, light)
        print(f"change {found:.4f}, expected {expected / 0.3:.4f}")
        assert found == pytest.approx(expected / 0.3, rel=0.03)
    assert np.isnan(measures.change_of_step(planes[:150], light))


def grating(period: float, size: int = 96) -> np.ndarray:
    return np.broadcast_to(np.sin(2 * np.pi * np.arange(size) / period), (size, size))


def test_the_texture_slope_is_what_was_left_of_it_and_noise_does_not_bias_it() -> None:
    light = 0.3 + 0.01 * grating(4)
    noise = np.random.default_rng(0).normal(0, 0.01, light.shape)
    found = measures.texture_slope(0.25 + 0.6 * (light - 0.3) + noise, light)
    print(f"texture slope {found:.3f}")
    assert found == pytest.approx(0.6, abs=0.05)
    assert np.isnan(measures.texture_slope(light, np.full(light.shape, 0.3)))


def test_texture_is_finer_than_two_pixels() -> None:
    """Of a fine and a coarse grating the coarse one is lost: the slope is the share of the fine one in both
    after the high-pass (1 - exp(-2 pi^2 s^2 / p^2), s = 2 pixels)."""
    light = 0.3 + 0.01 * grating(6) + 0.01 * grating(16)
    passed = [1 - np.exp(-2 * np.pi**2 * 2.0**2 / p**2) for p in (6, 16)]
    expected = passed[0] ** 2 / (passed[0] ** 2 + passed[1] ** 2)
    found = measures.texture_slope(0.3 + 0.01 * grating(6), light)
    print(f"texture slope {found:.3f}, expected {expected:.3f}")
    assert found == pytest.approx(expected, abs=0.03)


def test_texture_with_a_contrast_of_a_tenth_and_more_does_not_count() -> None:
    """Rms contrasts of 0.07 (left: halved) and 0.14 (right: kept)."""
    fine = grating(4)
    light = 0.3 * (1 + np.sqrt(2) * np.where(np.arange(96) < 48, 0.07, 0.14) * fine)
    picture = 0.3 + np.where(np.arange(96) < 48, 0.5, 1.0) * (light - 0.3)
    assert measures.texture_slope(picture, light) == pytest.approx(0.5, abs=0.05)
