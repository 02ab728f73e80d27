"""The rolling window in torch is the rolling window: every stream, every pass, every plane."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from denoiser.passes.pixel_map import PixelMap
from denoiser.passes.recipe import RECIPES
from denoiser.passes.window import RollingWindow, WindowLayout
from denoiser.passes.window_torch import StreamWindows, learned, pushed
from spikecam_env.errors import InputError

LAYOUT = RECIPES["best"].layout
SHAPE = (6, 7)
PASSES = 40
BEGINS = {0: (0,), 1: (0, 1, 7, 20), 2: (0,), 3: (0, 11)}
"""Passes in which each stream begins; 2 and 3 are of calibrated units."""
MAPPED = torch.tensor([0.0, 0.0, 1.0, 1.0])


def test_every_plane_is_that_of_the_rolling_window():
    """Rates of 0.003 to 1 spike a frame; streams that begin anew in mid-run; gains learned from random rates."""
    rng = np.random.default_rng(0)
    chance = np.exp(rng.uniform(np.log(0.003), 0.0, (len(BEGINS), 1, *SHAPE)))
    spikes = (rng.random((len(BEGINS), PASSES * LAYOUT.planes, *SHAPE)) < chance).astype(np.uint8)
    rates = rng.random((PASSES, len(BEGINS), LAYOUT.planes, *SHAPE)).astype(np.float32)
    gain = rng.uniform(0.8, 1.2, (len(BEGINS), *SHAPE)).astype(np.float32)
    dark = rng.uniform(0.0, 0.05, (len(BEGINS), *SHAPE)).astype(np.float32)
    found = in_torch(spikes, rates, gain, dark)
    worst, compared = 0.0, 0
    for stream, begins in BEGINS.items():
        for first, stop in zip(begins, (*begins[1:], PASSES), strict=True):
            unit = PixelMap(gain[stream], dark[stream]) if MAPPED[stream] else None
            roller = RollingWindow(LAYOUT, SHAPE, unit)
            for window in roller.push(spikes[stream, first * LAYOUT.planes : stop * LAYOUT.planes]):
                number = first + window.start // LAYOUT.planes + 1  # the pass that its last frames complete
                frames, planes = found[number]
                assert np.array_equal(frames[stream], window.spikes)
                worst = max(worst, float(abs(planes[stream] - window.planes).max()))
                roller.learn(window, rates[number, stream])
                compared += 1
    print(f"{compared} passes, worst difference {worst:.1e}")
    assert compared == sum(PASSES - len(begins) for begins in BEGINS.values()) and worst < 1e-5


def in_torch(spikes, rates, gain, dark) -> list[tuple[np.ndarray, np.ndarray]]:
    """(frames, planes) of all streams, pass by pass."""
    windows, found = StreamWindows.begin(LAYOUT, len(BEGINS), SHAPE, torch.device("cpu")), []
    windows.gain, windows.dark, windows.mapped = torch.from_numpy(gain), torch.from_numpy(dark), MAPPED
    for number in range(PASSES):
        new = torch.from_numpy(spikes[:, number * LAYOUT.planes : (number + 1) * LAYOUT.planes])
        begins = torch.tensor([number in passes for passes in BEGINS.values()])
        windows, planes = pushed(LAYOUT, windows, new, begins)
        windows = learned(LAYOUT, windows, torch.from_numpy(rates[number]))
        found.append((windows.frames.numpy(), planes.numpy()))
    return found


def test_streams_can_be_taken_and_put_back():
    windows = StreamWindows.begin(LAYOUT, 3, SHAPE, torch.device("cpu"))
    rows = torch.tensor([2, 0])
    some = windows.rows(rows)
    some.gain[0], some.start[1] = 5.0, 32
    assert windows.gain.eq(1).all() and windows.start.tolist() == [-16] * 3
    windows.put(rows, some)
    assert windows.gain[:, 0, 0].tolist() == [1, 1, 5] and windows.start.tolist() == [32, -16, -16]


@pytest.mark.parametrize("layout", [WindowLayout(16, 16, 8), WindowLayout(20, 16, 16), WindowLayout()])
def test_a_layout_that_cannot_begin_a_pass_early_is_refused(layout):
    with pytest.raises(InputError, match="future must be planes"):
        StreamWindows.begin(layout, 1, SHAPE, torch.device("cpu"))
