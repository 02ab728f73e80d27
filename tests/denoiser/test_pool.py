"""The pool of training: patches of the last clips, cut, turned and flipped alike in every array."""

from __future__ import annotations

import numpy as np
import pytest

from denoiser.pairs import WINDOWS_PER_CLIP, Sample, draw_clip
from denoiser.pool import SamplePool
from denoiser.recipe import RECIPES

SHAPE = (24, 32)
CHANNELS = (0, -1, 0)  # of light, spikes and target that are compared


@pytest.mark.parametrize("mode", ["paper", "best"])
def test_patches_are_cut_turned_and_flipped_alike(mode):
    layout = RECIPES[mode].layout
    clip = draw_clip(RECIPES[mode], 5, 2, shape=SHAPE)
    pool = SamplePool(1)
    pool.add(clip)
    batch = pool.batch(np.random.default_rng(0), 5, 16)
    assert batch.spikes.shape == (5, layout.span, 16, 16) and batch.planes.shape == (5, layout.layers, 16, 16)
    cuts = {cut for sample in clip for cut in _all_cuts(sample, 16)}
    for arrays in zip(batch.light, batch.spikes, batch.target, strict=True):
        assert tuple(_bytes(a[channel]) for a, channel in zip(arrays, CHANNELS, strict=True)) in cuts


def test_the_oldest_clip_leaves():
    def clip(value: int) -> list[Sample]:
        flat = np.full((1, 8, 8), value)
        return [Sample(flat.astype(np.uint8), *(flat.astype(np.float16) for _ in range(3)))] * WINDOWS_PER_CLIP

    pool, rng = SamplePool(2), np.random.default_rng(0)
    for number, expected in enumerate([{1}, {1, 2}, {2, 3}, {3, 4}], start=1):
        pool.add(clip(number))
        assert set(np.unique(pool.batch(rng, 64, 4).light)) == expected


def _all_cuts(sample, patch):
    arrays = [a[channel] for a, channel in zip((sample.light, sample.spikes, sample.target), CHANNELS, strict=True)]
    for y in range(SHAPE[0] - patch + 1):
        for x in range(SHAPE[1] - patch + 1):
            for turns in range(4):
                turned = [np.rot90(a[y : y + patch, x : x + patch], turns) for a in arrays]
                yield tuple(_bytes(a) for a in turned)
                yield tuple(_bytes(a[:, ::-1]) for a in turned)


def _bytes(array):
    return np.ascontiguousarray(array).tobytes()
