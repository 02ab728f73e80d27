"""Light between keys is integrated over each frame, whatever the times of the keys."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from laws import check

from spikecam_env.errors import InputError
from spikecam_env.sensor import CATALOGUE, Keyframes, SensorModel, SpikeSensor, SpikeSensorBatch
from spikecam_env.sensor.between_keys import frame_means, key_weights
from spikecam_env.sensor.light import GRAINS, ramp, segments

SHAPE = (5, 7)
GAIN, NO_DARK = np.full(1, GRAINS, np.float32), np.zeros(1, np.float32)


def uniform(times: Sequence[float], values: Sequence[float]) -> Keyframes:
    return Keyframes(np.asarray(times, float), np.asarray(values, np.float32).reshape(-1, 1, 1))


def charges(light: Keyframes, frames: int, cuts: Sequence[int] = ()) -> np.ndarray:
    """Grains (frames,) that a pixel of nominal gain collects in every frame, in calls of so many frames."""
    found, at = [], 0
    for count in cuts or (frames,):
        for segment in segments(light, at, count):
            law = ramp(segment, GAIN, NO_DARK)
            so_far = [int(law.collected(segment.first + k)[0]) for k in range(segment.count + 1)]
            found.extend(np.diff(so_far))
        at += count
    assert at == frames == len(found)
    return np.array(found)


def trapezoids(times: np.ndarray, values: np.ndarray, frame: int) -> float:
    """Mean light of a frame, by hand."""
    inside = times[(times > frame) & (times < frame + 1)]
    at = np.concatenate([[frame], inside, [frame + 1]])
    light = np.interp(at, times, values)
    return float(np.sum(np.diff(at) * (light[1:] + light[:-1]) / 2))


def random_keys(rng: np.random.Generator, frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Keys at any times, some at whole frames, up to five in a frame, some beyond both ends; light up to 1."""
    times = rng.uniform(-5, frames + 5, rng.integers(1, 5 * frames))
    times = np.unique(np.where(rng.random(times.size) < 0.3, np.floor(times), times))
    return times, rng.uniform(0, 1, times.size).astype(np.float32) * np.float32(10.0 ** -rng.integers(0, 4))


def test_light_between_any_keys_is_integrated_to_grains_and_cut_at_will() -> None:
    """Frames with keys inside are off by half a grain, ramps by up to two, and as much more as float32 is of light."""
    rng, worst, ramps = np.random.default_rng(0), 0.0, 0.0
    for _ in range(100):
        times, values = random_keys(rng, 40)
        light = uniform(times, values)
        found = charges(light, 40)
        cuts = np.diff(np.unique([0, *rng.integers(1, 40, 9), 40])).tolist()
        np.testing.assert_array_equal(charges(light, 40, cuts), found)
        truth = np.array([trapezoids(times, values, n) for n in range(40)]) * GRAINS
        np.testing.assert_allclose(frame_means(times, values.astype(float), 40) * GRAINS, truth, atol=1e-5)
        with_keys = np.isin(np.arange(40), np.floor(times[times > np.floor(times)]))
        off = np.abs(found - truth)
        worst, ramps = (
            max(w, float(o.max(initial=0.0))) for w, o in ((worst, off[with_keys]), (ramps, off[~with_keys]))
        )
    print(f"worst {worst:.2f} grains where keys are inside, {ramps:.2f} in ramps")
    assert worst < 0.5 + GRAINS * 2.0**-25 + 1e-3 and ramps < 2.0


def test_dim_light_has_little_bias() -> None:
    """Light of 1e-4 a frame, 839 grains; rounding takes a quarter of a grain a frame from ramps of one frame."""
    rng, biases = np.random.default_rng(0), []
    for _ in range(200):
        times, values = np.sort(rng.uniform(0, 40, 60)), (rng.uniform(0.5, 1.5, 60) * 1e-4).astype(np.float32)
        truth = frame_means(times, values.astype(float), 40).sum() * GRAINS
        biases.append(charges(uniform(times, values), 40).sum() / truth - 1)
    print(f"bias {np.mean(biases):.1e} +- {np.std(biases) / np.sqrt(200):.0e}")
    assert abs(np.mean(biases)) < 1e-3


@pytest.mark.parametrize("when", [100.0, 100.25, 100.75])
def test_a_step_within_a_frame_counts_from_when_it_comes(when: float) -> None:
    light = Keyframes.steps([0.0, when], np.array([0.0, 0.4], np.float32).reshape(2, 1, 1))
    found = charges(light, 103) / (0.4 * GRAINS)
    np.testing.assert_allclose(found[99:], [0.0, 101.0 - when, 1.0, 1.0], atol=1e-6)


def test_steps_are_checked_as_keys_are() -> None:
    for frame, radiance in (
        ([0.0, 0.0], np.ones((2, 1, 1))),
        ([0.0], -np.ones((1, 1, 1))),
        ([0.0, 1.0], np.ones((1, 1))),
    ):
        with pytest.raises(InputError):
            Keyframes.steps(frame, radiance)


def test_light_that_rises_within_a_frame_is_never_negative() -> None:
    rng = np.random.default_rng(5)
    for _ in range(100):
        times = np.sort(rng.uniform(0, 10, 40))
        values = np.where(rng.random(40) < 0.7, 0.0, rng.uniform(0, 6, 40))
        light = uniform(times, values)
        for frame in np.unique(np.floor(times)).astype(int):
            (s,) = segments(light, int(frame), 1)
            assert s.length == 1 and s.radiance1 is s.radiance0
            assert abs(float(s.rise[0])) <= 2.0 * float(s.radiance0[0]) * (1 + 1e-6)


def test_a_frame_looks_at_its_own_keys_alone() -> None:
    """So a recording's work grows with its frames and keys, and not with their product."""
    times = np.arange(0.0, 1e6, 0.25) + 0.1
    for frame in (0, 17, 249_000):
        weights = key_weights(times, frame, frame + 1)
        assert weights.mean.size <= 6 and weights.mean.sum() == pytest.approx(1.0)
        assert abs(times[weights.first] - frame) < 0.5


def moving(seed: int = 0) -> Keyframes:
    rng = np.random.default_rng(seed)
    times, _ = random_keys(rng, 60)
    return Keyframes(times, rng.uniform(0, 1.2, (times.size, *SHAPE)))


def test_engines_agree_on_light_between_any_keys() -> None:
    """Bit for bit without noise: reference, fast, its block kernel, the batch's; with noise, fast and batch."""
    light = moving()
    reference, fast = (SpikeSensor("ideal", SHAPE, 1, engine).step(light, 60) for engine in ("reference", "fast"))
    with_effect = SensorModel.preset("ideal").with_effect(CATALOGUE["dead_time"].neutralised())
    block = SpikeSensor(with_effect, SHAPE, 1, "fast").step(light, 60)
    np.testing.assert_array_equal(fast, reference)
    np.testing.assert_array_equal(block, reference)
    for name in ("photodiode_lag", "readout_skew", "light_flicker", "clock_jitter", "optical_blur", "blooming"):
        model = SensorModel.preset("ideal").with_effect(CATALOGUE[name]())
        by_block, by_reference = (
            SpikeSensor(model, SHAPE, 1, engine).step(light, 60) for engine in ("fast", "reference")
        )
        np.testing.assert_array_equal(by_block, by_reference)
    lights, seeds = [moving(1), moving(2)], [3, 4]
    batch = SpikeSensorBatch("scsim", SHAPE, seeds, device="cpu")
    spikes = np.concatenate([batch.step(lights, n).numpy() for n in (7, 1, 52)], axis=1)
    for b, seed in enumerate(seeds):
        np.testing.assert_array_equal(spikes[b], SpikeSensor("scsim", SHAPE, seed).step(lights[b], 60))


@pytest.mark.parametrize("engine", ["reference", "fast"])
@pytest.mark.parametrize("effect", [None, "photodiode_lag", "readout_skew", "light_flicker"])
def test_cutting_light_between_any_keys_changes_no_bit(engine: str, effect: str | None) -> None:
    model = SensorModel.preset("scsim")
    if effect is not None:
        model = model.with_effect(CATALOGUE[effect]())
    light = moving(3)
    whole = SpikeSensor(model, SHAPE, 1, engine).step(light, 60)
    sensor = SpikeSensor(model, SHAPE, 1, engine)
    np.testing.assert_array_equal(np.concatenate([sensor.step(light, n) for n in (1, 1, 3, 30, 25)]), whole)


def test_a_population_sees_a_strobe() -> None:
    """Share of pixels that fire in a frame: the light of the frame; here a flash of 0.3 in every third frame."""
    pixels, flashes = 40_000, np.arange(0, 60, 3) + 0.7
    edges = np.concatenate([[0.0], np.sort(np.concatenate([flashes, flashes + 0.15]))])
    light = Keyframes.steps(edges, np.where(np.arange(edges.size) % 2, 2.0, 0.0).reshape(-1, 1, 1))
    wide = Keyframes(light.frame, np.broadcast_to(light.radiance, (len(light.frame), 1, pixels)))
    rate = SpikeSensor("ideal", (1, pixels), 2).step(wide, 60).mean(axis=(1, 2))
    expected = np.where(np.arange(60) % 3 == 0, 0.3, 0.0)
    check("worst share", float(np.abs(rate - expected).max()), 0.0, 4.5 * np.sqrt(0.21 / pixels))
