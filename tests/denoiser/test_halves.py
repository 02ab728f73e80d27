"""A recording against its other half: a camera without noise gives the figures that its law says."""

from __future__ import annotations

import numpy as np
import pytest

from denoiser.evaluate.halves import LEAST, evaluate_halves, reference, report, static_pixels
from spikecam_env.errors import InputError
from spikecam_env.sensor import SensorModel, SpikeSensor

SHAPE = (64, 80)


class Painter:
    """A denoiser whose every plane is the same picture."""

    latency = 5

    def __init__(self, picture):
        self.picture, self.waiting = picture, 0

    def another(self, output):
        return Painter(self.picture)

    def push(self, spikes):
        self.waiting += len(spikes)
        ready = max(self.waiting - self.latency, 0)
        self.waiting -= ready
        return self._planes(ready)

    def flush(self):
        return self._planes(self.waiting)

    def _planes(self, count):
        planes = np.broadcast_to(self.picture, (count, *self.picture.shape))
        return np.zeros(planes.shape, np.uint8), planes


@pytest.fixture(scope="module")
def static():
    """Light and spikes of a camera without noise, every pixel of a light of its own."""
    light = np.random.default_rng(3).uniform(0.1, 0.5, SHAPE).astype(np.float32)
    spikes = SpikeSensor(SensorModel.preset("ideal"), SHAPE, seed=4, engine="fast").step(light, 432)
    return light, spikes


@pytest.fixture(scope="module")
def result(static):
    light, spikes = static
    return evaluate_halves(spikes, {"painter": Painter(1.02 * light)})


def rows(result):
    return {row["row"]: row for row in result["rows"]}


def test_the_variance_of_a_count_is_a_sixth(result):
    """f (1 - f), f uniform."""
    print(f"variance of a count {result['count_variance']:.4f}")
    assert result["count_variance"] == pytest.approx(1 / 6, abs=4 * 0.25 / np.sqrt(SHAPE[0] * SHAPE[1]))
    assert result["frames"] == 200
    assert result["reference_db"] == pytest.approx(10 * np.log10(result["brightest"] ** 2 * 6 * 200**2), abs=0.2)


def test_everything_is_static_but_for_chance(result):
    assert result["static"] > 0.998


@pytest.mark.parametrize("row, window", [("noisy TFP 21", 21), ("noisy TFP 41", 41), ("noisy half", 200)])
def test_noisy_pictures_err_by_their_quantisation(row, window, result):
    """1/6 / w^2, the reference's own noise taken off."""
    expected = 10 * np.log10(result["brightest"] ** 2 * 6 * window**2)
    found = rows(result)[row]
    print(f"{row}: {found['error_db']:.2f} dB, law {expected:.2f}")
    assert found["error_db"] == pytest.approx(expected, abs=0.3)
    assert found["kept"] == pytest.approx(1.0, abs=max(5 * found["kept_error"], 1e-9))


def test_a_picture_2_percent_too_bright_is_said_to_be(static, result):
    light, _ = static
    for name in ("painter last plane", "painter half"):
        row = rows(result)[name]
        expected = 10 * np.log10(result["brightest"] ** 2 / np.square(0.02 * light).mean())
        assert row["bias"] == pytest.approx(0.02, abs=0.001)
        assert row["error_db"] == pytest.approx(expected, abs=0.1)
        assert row["kept"] == pytest.approx(1.02, abs=0.01)


def test_what_a_removed_pattern_costs_follows_from_its_size(static, result):
    """2.8 % of the light, rms (docs/calibration.md: 2.6 to 2.9 %)."""
    expected = 10 * np.log10(result["brightest"] ** 2 / np.square(0.028 * static[0]).mean())
    assert result["pattern_db"] == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize("sd, moves", [(3.0, False), (6.0, True)])
def test_a_change_is_found_beyond_four_standard_deviations_of_5_x_5_pixels(sd, moves):
    """A third of the counts differ by one, as those of a camera without noise; more of them in a square of 5 x 5."""
    rng = np.random.default_rng(5)
    differs = rng.random((200, 200)) < 1 / 3
    wanted = round(25 * (1 / 3 + sd * np.sqrt(1 / 3 * 2 / 3 / 25)))
    differs[98:103, 98:103] = (np.arange(25) < wanted).reshape(5, 5)
    first = np.zeros((2, 200, 200), np.uint8)
    second = first.copy()
    first[0] = differs
    static = static_pixels(first, second)
    print(f"{sd:g} sd: {wanted} of 25 differ; {(~static).mean():.1e} of the pixels move")
    assert static[100, 100] == (not moves)
    assert (~static).mean() < 1e-3


def test_a_place_that_moves_is_left_out(static):
    _, spikes = static
    moved = spikes.copy()
    moved[216:, 20:40, 20:40] = np.roll(spikes[216:], 7, axis=2)[:, 20:40, 20:40]
    result = evaluate_halves(moved, {})
    left_out = (1 - result["static"]) * SHAPE[0] * SHAPE[1]
    print(f"{left_out:.0f} pixels left out; 400 moved, 176 are beside them")
    assert 390 < left_out < 600
    assert rows(result)["noisy half"]["error_db"] > 45


def test_the_brightest_is_the_thousandth_part(static):
    seen = reference(static[1], np.ones(SHAPE, bool))
    assert (seen.rate > seen.brightest).mean() <= 0.001 <= (seen.rate >= seen.brightest).mean()


def test_the_report_says_every_row(result):
    text = report(result)
    assert all(row["row"] in text for row in result["rows"]) and "subtracted" in text


def test_a_recording_that_is_too_short_or_dark_is_refused(static):
    with pytest.raises(InputError, match=f"halves of {LEAST}"):
        evaluate_halves(static[1][:220], {})
    with pytest.raises(InputError, match="static and lit"):
        evaluate_halves(np.zeros((300, 16, 16), np.uint8), {})
