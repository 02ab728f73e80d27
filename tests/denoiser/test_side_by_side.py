"""The input of a pass as one array: a pass over it gives the bits of the call of training."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from denoiser.passes import infer
from denoiser.passes.pixel_map import PixelMap
from denoiser.passes.recipe import RECIPES
from denoiser.passes.side_by_side import side_by_side
from denoiser.passes.window import RollingWindow
from spikecam_env.threads import as_many_as_pay

BEST = RECIPES["best"]


@pytest.mark.parametrize("number_type", [torch.bfloat16, torch.float32])
@pytest.mark.parametrize("shape", [(9, 14), (16, 32)])
@pytest.mark.parametrize("mapped", [False, True])
def test_a_pass_gives_the_bits_of_the_call_of_training(number_type, shape, mapped):
    torch.manual_seed(1)
    network = infer.prepared(BEST.network(), number_type)
    unit = PixelMap(np.full(shape, 1.1, np.float32), np.full(shape, 0.002, np.float32)) if mapped else None
    rolling = RollingWindow(BEST.layout, shape, unit)
    spikes = (np.random.default_rng(0).random((64, *shape)) < 0.3).astype(np.uint8)
    carried: infer.Carried = ()
    for w in rolling.push(spikes):
        before = tuple(torch.from_numpy(k)[None] for k in carried) or None
        arrays = torch.from_numpy(w.spikes)[None].to(number_type), torch.from_numpy(w.planes)[None]
        with torch.inference_mode(), torch.autocast("cpu", number_type, enabled=number_type != torch.float32):
            rate, kept = network(*(a.contiguous(memory_format=torch.channels_last) for a in arrays), before)
        found, carried = infer.rates(network, w, number_type, carried)
        assert found.any() and np.array_equal(found, rate[0].float().clamp(0, 1).numpy())
        assert all(np.array_equal(a, b[0].numpy()) for a, b in zip(carried, kept, strict=True))


def test_threads_change_no_bit():
    """Frames so large that two threads share them."""
    shape = (130, 140)
    spikes = (np.random.default_rng(0).random((64, *shape)) < 0.2).astype(np.uint8)
    before, found = torch.get_num_threads(), []
    try:
        for threads in (1, 2):
            torch.set_num_threads(threads)
            window = list(RollingWindow(BEST.layout, shape).push(spikes))[-1]
            pixels = side_by_side([window], [None], torch.bfloat16, 4)
            assert as_many_as_pay(threads, 9, min(window.spikes.size, pixels.numel())) == threads
            found.append((window.planes, pixels))
    finally:
        torch.set_num_threads(before)
    assert np.array_equal(found[0][0], found[1][0]) and torch.equal(found[0][1], found[1][1])
