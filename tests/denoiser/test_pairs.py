"""Training pairs: they follow from seed and number, and are what they say."""

from __future__ import annotations

import numpy as np
import pytest

from denoiser.pairs import WINDOWS_PER_CLIP, ClipFeed, draw_clip, draw_model, light_in_frame
from denoiser.recipe import RECIPES
from spikecam_env.sensor import Keyframes

SHAPE = (24, 32)


@pytest.fixture(scope="module", params=["paper", "best"])
def recipe(request):
    return RECIPES[request.param]


@pytest.fixture(scope="module")
def clip(recipe):
    return draw_clip(recipe, 5, 2, shape=SHAPE)


def test_a_clip_follows_from_its_number(recipe, clip):
    again = draw_clip(recipe, 5, 2, shape=SHAPE)
    other = draw_clip(recipe, 5, 3, shape=SHAPE)
    assert all(np.array_equal(a.spikes, b.spikes) for a, b in zip(clip, again, strict=True))
    assert not np.array_equal(clip[0].spikes, other[0].spikes)


def test_samples_have_the_recipe_s_channels(recipe, clip):
    assert len(clip) == WINDOWS_PER_CLIP
    for sample in clip:
        assert sample.spikes.shape == (recipe.layout.span, *SHAPE) and sample.spikes.max() <= 1
        assert sample.planes.shape == (recipe.layout.layers, *SHAPE)
        assert sample.light.shape == sample.target.shape == (recipe.layout.planes, *SHAPE)
        assert sample.light.min() >= 0 and sample.light.max() <= 1


def test_mean_target_is_the_mean_light():
    """1/ISI of the clean twin, averaged over time and phase, is the light, be it bright enough to be seen."""
    samples = [s for number in range(6) for s in draw_clip(RECIPES["paper"], 5, number, shape=SHAPE)]
    light = np.concatenate([s.light.astype(np.float64).ravel() for s in samples])
    target = np.concatenate([s.target.astype(np.float64).ravel() for s in samples])
    seen = light > 0.1
    ratio = target[seen].mean() / light[seen].mean()
    print(f"mean 1/ISI over mean light {ratio:.4f}, {seen.sum()} pixels")
    assert abs(ratio - 1) < 0.03


def test_a_network_gives_the_windows_a_gain():
    import torch

    torch.manual_seed(0)
    recipe = RECIPES["best"]
    plain, informed = (draw_clip(recipe, 5, 2, network, shape=SHAPE) for network in (None, recipe.network().eval()))
    assert all(not sample.planes[-1].any() for sample in plain)
    assert any(sample.planes[-1].any() for sample in informed)
    assert all(np.array_equal(a.spikes, b.spikes) for a, b in zip(plain, informed, strict=True))


def test_clips_come_in_order_from_several_workers(monkeypatch):
    monkeypatch.setattr("denoiser.pairs.CLIPS_AHEAD", 1)
    recipe = RECIPES["best"]
    feed = ClipFeed(recipe, 5, first=1, workers=2)
    try:
        clips = [next(feed) for _ in range(2)]
    finally:
        feed.close()
    for number, clip in enumerate(clips, start=1):
        expected = draw_clip(recipe, 5, number)
        assert all(np.array_equal(a.spikes, b.spikes) for a, b in zip(clip, expected, strict=True))


def test_light_of_a_frame_is_taken_at_its_middle_and_cut():
    keys = Keyframes(np.array([0.0, 2.0]), np.array([[[0.2, 1.8]], [[0.6, 2.0]]], np.float32))
    assert np.allclose(light_in_frame(keys, 0), [[0.3, 1.0]])


def test_sensors_vary_in_strength_and_rate():
    models = [draw_model(np.random.default_rng(i)) for i in range(40)]
    assert {m.name for m in models} == {"scsim", "physical", "ideal"}
    assert {m.frame_rate_hz for m in models} == {20_000.0, 40_000.0}
    assert len({e.sigma for m in models for e in m.effects if e.name == "conversion_gain_spread"}) > 10
