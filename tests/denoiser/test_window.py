"""The rolling window: a network's input does not depend on chunks, and follows the equations."""

from __future__ import annotations

import numpy as np
import pytest

from denoiser.passes.pixel_map import PixelMap
from denoiser.passes.window import RollingWindow, WindowLayout
from spikecam_env.streams import isi_planes

SHAPE = (5, 7)


def stream(frames: int, seed: int = 0) -> np.ndarray:
    """Every pixel at its own rate, some very dim."""
    rng = np.random.default_rng(seed)
    return (rng.random((frames, *SHAPE)) < rng.random(SHAPE) ** 3).astype(np.uint8)


def windows(layout: WindowLayout, chunks: list[np.ndarray]) -> list:
    roller = RollingWindow(layout, SHAPE)
    seen = []
    for chunk in chunks:
        seen += list(roller.push(chunk))
    return seen + list(roller.end())


def test_paper_plane_is_the_causal_interval_plane():
    spikes = stream(90, seed=1)
    seen = np.concatenate([w.planes for w in windows(WindowLayout(), [spikes])])
    assert np.array_equal(seen, isi_planes(spikes, future=20, normalised=True))


def test_block_planes_look_to_the_end_of_their_window():
    spikes = stream(96, seed=2)
    for window in windows(WindowLayout(planes=8), [spikes]):
        for i in range(window.count):
            t = window.start + i
            expected = isi_planes(spikes, start=t, stop=t + 1, future=27 - i, normalised=True)[0]
            assert np.array_equal(window.planes[i], expected)


def test_interval_rates_are_counts_over_whole_intervals():
    """Brute force: from the last spike at or before middle - h to the first at or after middle + h, else the last."""
    spikes = stream(160, seed=3)
    layout = WindowLayout(planes=8, half_widths=(4, 12))
    for window in windows(layout, [spikes])[10:12]:
        middle, stop = window.start + 4, window.start + 28
        for i, half in enumerate((4, 12)):
            for pixel in np.ndindex(SHAPE):
                times = np.flatnonzero(spikes[:stop, pixel[0], pixel[1]])
                before = times[times <= middle - half]
                if len(before) == 0:
                    continue
                after = times[times >= middle + half]
                end = after[0] if len(after) else times[-1]
                count = ((times > before[-1]) & (times <= end)).sum()
                expected = count / (end - before[-1]) if count else 1 / (stop - before[-1])
                assert window.planes[8 + i][pixel] == pytest.approx(expected, rel=1e-6)


def test_running_mean_is_the_weighted_mean_of_all_frames_seen():
    spikes = stream(80, seed=4)
    layout = WindowLayout(planes=8, memories=(16.0,))
    window = windows(layout, [spikes])[3]
    seen = spikes[: window.start + 28].astype(np.float64)
    weights = (15 / 16) ** np.arange(len(seen))[::-1]
    expected = np.tensordot(weights / weights.sum(), seen, 1)
    assert np.allclose(window.planes[8], expected, atol=1e-6)


def test_gain_is_the_ratio_of_spikes_to_learned_rates():
    """A camera whose pixels are 0.9 to 1.1 times as fast as the rates it is told: the gain plane says so."""
    layout = WindowLayout(planes=8, gain_memory=1e9)
    gains = np.linspace(0.9, 1.1, 35).reshape(SHAPE)
    charge = np.cumsum(np.full((800, *SHAPE), 0.4) * gains, axis=0)
    spikes = np.diff(np.floor(charge), axis=0, prepend=0.0).astype(np.uint8)
    roller = RollingWindow(layout, SHAPE)
    for window in roller.push(spikes):
        roller.learn(window, np.full((window.count, *SHAPE), 0.4, np.float32))
    found = 1 + window.planes[-2] / 4
    worst = abs(found - gains).max()
    print(f"worst gain error {worst:.4f}")
    assert worst < (1 + 2 * 0.1) / (0.4 * window.start)  # one spike more or less, and the prior's pull
    blind = RollingWindow(WindowLayout(planes=8), SHAPE)
    plain = next(w for w in blind.push(spikes) if w.start == window.start)
    assert np.allclose(window.planes[:-2] * found, plain.planes, rtol=1e-5) and not window.planes[-1].any()


def test_a_gain_of_few_spikes_is_pulled_to_one():
    """Four spikes where rates say two: 6 / 4 is a gain of 1.5, not of 2; none where they say six: 1/4, cut to 1/2."""
    layout = WindowLayout(planes=8, gain_memory=1e9)
    roller = RollingWindow(layout, (1, 2))
    spikes = np.zeros((48, 1, 2), np.uint8)
    spikes[:4, 0, 0] = 1
    rates = np.tile(np.array([[2 / 8, 6 / 8]], np.float32), (8, 1, 1))
    for window in roller.push(spikes):
        if window.start == 8:
            break
        roller.learn(window, rates)
    assert (1 + window.planes[-2] / 4).tolist() == [[1.5, 0.5]]


def test_a_map_takes_dark_rate_and_gain_out_of_every_plane():
    layout, spikes = WindowLayout(planes=8, half_widths=(4,), memories=(16.0,), gain_memory=64.0), stream(64, seed=7)
    rng = np.random.default_rng(8)
    unit = PixelMap(rng.uniform(0.8, 1.2, SHAPE), rng.uniform(0.0, 0.05, SHAPE))
    calibrated, plain = (
        RollingWindow(layout, SHAPE, unit),
        RollingWindow(WindowLayout(8 + 12, 8, 20, (4,), (16.0,)), SHAPE),
    )
    for window, other in zip(calibrated.push(spikes), plain.push(spikes), strict=True):
        calibrated.learn(window, np.full((window.count, *SHAPE), 0.9, np.float32))  # changes nothing
        expected = np.maximum(other.planes - unit.dark, 0) / unit.gain
        assert np.allclose(window.planes[:-2], expected, rtol=1e-6)
        assert np.allclose(window.planes[-2], 4 * (unit.gain - 1)) and (window.planes[-1] == 1).all()


def test_maps_of_other_types_are_taken_and_told_apart():
    unit = PixelMap.of(([[1, 2], [3, 4]], np.zeros((2, 2))))
    assert unit.gain.dtype == unit.dark.dtype == np.float32 and PixelMap.of(unit) is unit
    others = [PixelMap(unit.gain, unit.dark), PixelMap(2 * unit.gain, unit.dark), PixelMap(unit.gain, unit.dark + 0.1)]
    assert [other.digest == unit.digest for other in others] == [True, False, False]


def test_mirrored_spikes_fill_both_edges():
    spikes = stream(30, seed=5)
    seen = windows(WindowLayout(), [spikes])
    assert np.array_equal(seen[0].spikes[:20], spikes[:20][::-1])
    assert np.array_equal(seen[-1].spikes[-20:], spikes[-20:][::-1])
