"""Spike times of a recording, and the law of A_k."""

from __future__ import annotations

import numpy as np
import pytest

from spikecam_env.calibration.jitter import fit_jitter, second_difference
from spikecam_env.calibration.spike_times import spike_times
from spikecam_env.sensor import CATALOGUE, SensorModel, SpikeSensor
from spikecam_env.streams import pack_frames


def steady(model: SensorModel, radiance: float, frames: int, shape=(16, 16)) -> np.ndarray:
    return SpikeSensor(model, shape, seed=2).step(np.full(shape, radiance, np.float32), frames)


def test_one_pass_gives_what_plain_numpy_gives() -> None:
    rng = np.random.default_rng(0)
    spikes = (rng.random((300, 3, 7)) < rng.random((3, 7)) ** 2).astype(np.uint8)
    spikes[:, 0, 0] = 0
    times = spike_times(pack_frames(spikes), 21, (1, 3, 40))
    for p in range(21):
        t = np.flatnonzero(spikes.reshape(300, 21)[:, p])
        assert times.count[p] == t.size
        assert (times.first[p], times.last[p]) == ((t[0], t[-1]) if t.size else (-1, -1))
        for i, k in enumerate((1, 3, 40)):
            d = t[2 * k :] - 2 * t[k : t.size - k] + t[: t.size - 2 * k] if t.size > 2 * k else np.zeros(0)
            assert times.terms[p, i] == d.size
            assert times.square[p, i] == (d**2).sum()


def test_threads_change_nothing() -> None:
    packed = pack_frames(steady(SensorModel.preset("physical"), 0.3, 500))
    one, three = (spike_times(packed, 256, threads=n) for n in (1, 3))
    assert np.array_equal(one.square, three.square)
    assert np.array_equal(one.first, three.first)


def test_second_differences_of_an_ideal_camera_are_those_of_rounding() -> None:
    for x in (0.1, 0.37, 0.5, 0.81):
        expected = 2 * min(x, 1 - x)
        # The series in cosines is cut after 12 terms.
        assert second_difference(1, 3 + x, 1e-12) == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize("interval", [1.5, 3.0, 7.3])
def test_second_differences_follow_the_law_at_one_interval(interval: float) -> None:
    model = SensorModel.preset("ideal").with_effect(CATALOGUE["shot_noise"](quanta=5000.0))
    times = spike_times(pack_frames(steady(model, 1 / interval, 6000)), 256, (1, 2, 5, 20))
    per_pixel = times.square / times.terms
    measured, error = per_pixel.mean(axis=0), per_pixel.std(axis=0) / 16
    expected = second_difference(times.steps, interval, 1 / 5000)
    print(f"T = {interval}: {measured.round(4)}, law {expected.round(4)}, errors {error.round(4)}")
    assert np.all(np.abs(measured - expected) < 4.5 * error + 1e-3)


def test_white_noise_is_found_and_no_slow_noise_beside_it() -> None:
    times = [
        spike_times(pack_frames(steady(SensorModel.preset("physical"), x, 6000)), 256) for x in (0.01, 0.05, 0.2, 0.6)
    ]
    fit = fit_jitter(
        times[0].steps,
        np.stack([t.square for t in times]),
        np.stack([t.terms for t in times]).astype(float),
        np.stack([t.rate for t in times]),
    )
    unit = SpikeSensor("physical", (16, 16), seed=2).unit
    expected = np.mean(1 / unit.electrons + unit.kappa**2)
    print(f"s^2 = {fit.white:.4g} +- {fit.white_sd:.1g}, true {expected:.4g}; slow {fit.slow:.2g} +- {fit.slow_sd:.1g}")
    assert abs(fit.white - expected) < 4 * fit.white_sd
    assert fit.white_sd < 0.03 * expected
    assert not fit.slow_fitted


def test_slow_noise_is_told_from_white() -> None:
    model = SensorModel.preset("physical").with_effect(CATALOGUE["threshold_flicker_noise"](sigma_mV=2.0))
    spikes = SpikeSensor(model, (12, 12), seed=2, engine="reference").step(np.full((12, 12), 0.3, np.float32), 2500)
    times = spike_times(pack_frames(spikes), 144)
    fit = fit_jitter(times.steps, times.square[None], times.terms[None].astype(float), times.rate[None])
    print(f"slow {fit.slow:.3g} +- {fit.slow_sd:.1g}")
    assert fit.slow_fitted
