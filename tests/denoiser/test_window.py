"""The rolling window: what a network sees does not depend on chunks, and is what the equations say."""

from __future__ import annotations

import numpy as np
import pytest

from denoiser.recipe import RECIPES
from denoiser.window import RollingWindow, WindowLayout, without_gain
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


@pytest.mark.parametrize("mode", ["paper", "best"])
def test_chunks_do_not_matter(mode):
    spikes = stream(75)
    whole = windows(RECIPES[mode].layout, [spikes])
    single = windows(RECIPES[mode].layout, list(spikes[:, None]))
    uneven = windows(RECIPES[mode].layout, np.split(spikes, [0, 1, 30, 31, 70]))
    for other in (single, uneven):
        assert [(w.start, w.count) for w in other] == [(w.start, w.count) for w in whole]
        for a, b in zip(whole, other, strict=True):
            assert np.array_equal(a.spikes, b.spikes) and np.array_equal(a.planes, b.planes)


@pytest.mark.parametrize("frames", [1, 2, 7, 20, 41, 75])
@pytest.mark.parametrize("mode", ["paper", "best"])
def test_every_frame_is_covered_once(mode, frames):
    seen = windows(RECIPES[mode].layout, [stream(frames)])
    assert [t for w in seen for t in range(w.start, w.start + w.count)] == list(range(frames))
    assert all(w.spikes.shape[0] == RECIPES[mode].layout.span for w in seen)


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
    found = 1 + window.planes[-1] / 4
    worst = abs(found - gains).max()
    print(f"worst gain error {worst:.4f}")
    assert worst < (1 + 2 * 0.1) / (0.4 * window.start)  # one spike more or less, and the prior's pull
    blind = RollingWindow(WindowLayout(planes=8), SHAPE)
    plain = next(w for w in blind.push(spikes) if w.start == window.start)
    assert np.allclose(without_gain(window).planes[:-1], plain.planes, rtol=1e-6)


def test_mirrored_spikes_fill_both_edges():
    spikes = stream(30, seed=5)
    seen = windows(WindowLayout(), [spikes])
    assert np.array_equal(seen[0].spikes[:20], spikes[:20][::-1])
    assert np.array_equal(seen[-1].spikes[-20:], spikes[-20:][::-1])


def test_state_is_all_that_matters():
    spikes = stream(75, seed=6)
    layout = RECIPES["best"].layout
    first = RollingWindow(layout, SHAPE)
    list(first.push(spikes[:50]))
    second = RollingWindow(layout, SHAPE)
    second.restore(first.state())
    for roller in (first, second):
        roller.seen_windows = [*roller.push(spikes[50:]), *roller.end()]
    for a, b in zip(first.seen_windows, second.seen_windows, strict=True):
        assert np.array_equal(a.planes, b.planes)
