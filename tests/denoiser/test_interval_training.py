"""Training on the clean interval: which interval, of which frame, of which streams."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import nn

from denoiser.networks.dnss import DnSS
from denoiser.passes.recipe import RECIPES
from denoiser.training import interval_training
from denoiser.training.interval_training import LOOK_AHEAD, IntervalWindows, inverse_interval
from denoiser.training.pairs import WARM_UP
from denoiser.training.simulated import StreamBlock
from spikecam_env.streams import isi_planes

LAYOUT = RECIPES["paper"].layout
CPU = torch.device("cpu")


class Same(nn.Module):
    """Gives the noisy interval back."""

    def forward(self, spikes, noisy, carried=None):
        return noisy, None


@pytest.fixture(scope="module")
def taught(bank):
    """Windows of a few streams at many moments."""
    windows = IntervalWindows(RECIPES["paper"], taken=8, patch=16, device=CPU, seed=1, pool=1, bank=bank)
    return list(windows._windows(Same(), 40))


def test_the_interval_is_that_of_the_stream():
    """From any frame of a long stream on, the last spike before known or none; the end sought to the last frame."""
    rng = np.random.default_rng(0)
    spikes = (rng.random((160, 8, 9)) < rng.random((8, 9)) ** 3).astype(np.uint8)
    for first, t in ((0, 20), (0, 0), (37, 20), (37, 50)):
        frames = spikes[first : first + 60]
        times = np.where(spikes[:first] > 0, np.arange(first)[:, None, None], -1)
        last = (times.max(axis=0) if first else np.full((8, 9), -1)) - first
        found = inverse_interval(torch.from_numpy(frames)[None], torch.from_numpy(last).int()[None], t)[0, 0].numpy()
        expected = isi_planes(spikes, start=first + t, stop=first + t + 1, future=59 - t, normalised=True)[0]
        assert np.array_equal(found, expected)


def test_windows_and_intervals_are_those_of_their_stream(bank):
    """Every window's noisy and clean interval, from the frames that the streams gave since they began."""
    windows = IntervalWindows(RECIPES["paper"], taken=3, patch=16, device=CPU, seed=1, pool=1, bank=bank)
    parts, advance = [], windows.streams.advance
    windows.streams.advance = lambda frames, rows: parts.append(advance(frames, rows)) or parts[-1]
    compared = 0
    for found in windows._windows(Same(), 24):
        for stream in torch.nonzero(found.valid).flatten().tolist():
            begin = max(i for i, part in enumerate(parts) if part.begins[stream])
            for name, plane, ahead in (("noisy", found.noisy, 20), ("clean", found.target, LOOK_AHEAD)):
                frames = torch.cat([getattr(part, name)[stream] for part in parts[begin:]]).numpy()
                t = len(frames) - 1 - LOOK_AHEAD
                expected = isi_planes(frames, start=t, stop=t + 1, future=ahead, normalised=True)[0]
                assert np.array_equal(plane[stream, 0].numpy(), expected)
            light = torch.cat([part.light[stream] for part in parts[begin:]])[t]
            assert torch.equal(found.light[stream, 0], light)
            compared += 1
    print(f"{compared} windows")
    assert compared > 5


def test_the_mean_of_the_clean_interval_is_the_mean_light(taught):
    """Averaged over pixels and phases 1/ISI is the light, where it is bright enough to be seen."""
    valid = torch.cat([w.valid for w in taught]) > 0
    light, target = (torch.cat([getattr(w, name) for w in taught])[valid].double() for name in ("light", "target"))
    seen = light > 0.1
    ratio = float(target[seen].mean() / light[seen].mean())
    print(f"mean 1/ISI over mean light {ratio:.4f}, {int(seen.sum())} pixels of {int(valid.sum())} windows")
    assert seen.sum() > 10_000 and abs(ratio - 1) < 0.03


def test_a_window_counts_once_the_twins_have_lost_their_common_phase(taught):
    """The first 64 frames of a stream are in no interval at the middle of a window that counts."""
    span = LAYOUT.past + 1 + LOOK_AHEAD
    first = next(i for i, w in enumerate(taught) if w.valid.any())
    print(f"first windows that count: after {16 * (first + 1)} frames")
    assert 16 * first < span + WARM_UP <= 16 * (first + 1)


def test_look_ahead_knows_the_interval_of_a_pixel_at_one_in_ninety():
    """Whatever its phase; of one in 150 it does not."""
    span = LAYOUT.past + 1 + LOOK_AHEAD
    for interval, whole in ((90, True), (150, False)):
        frames = torch.zeros(1, span + interval, 1, interval, dtype=torch.uint8)
        for phase in range(interval):
            frames[0, phase::interval, 0, phase] = 1
        times = torch.arange(interval, dtype=torch.int32)
        last = torch.where(frames[0, :interval, 0] > 0, times[:, None], -1).amax(0) - interval
        found = inverse_interval(frames[:, interval:], last[None, None].int(), LAYOUT.past)
        assert torch.allclose(found, torch.full_like(found, 1 / interval)) == whole


def test_young_streams_teach_nothing(bank, monkeypatch):
    windows = IntervalWindows(RECIPES["paper"], taken=2, patch=16, device=CPU, seed=1, pool=1, bank=bank)
    advance = windows.streams.advance

    def begun(frames, rows):
        part = advance(frames, rows)
        return StreamBlock(part.spikes, part.light, torch.ones_like(part.begins))

    monkeypatch.setattr(windows.streams, "advance", begun)
    assert float(windows.loss(Same(), 15)) == 0 and set(windows.errors(Same(), 15).values()) == {0.0}


def test_a_few_steps_lower_the_loss(bank, monkeypatch):
    monkeypatch.setattr(interval_training, "WARM_UP", 0)
    windows = IntervalWindows(RECIPES["paper"], taken=4, patch=16, device=CPU, seed=1, pool=1, bank=bank)
    windows.errors(Same(), 8)  # until they are old enough
    torch.manual_seed(0)
    network, losses = DnSS(), []
    adam = torch.optim.Adam(network.parameters(), 3e-3)
    for _ in range(20):
        loss = windows.loss(network, 1)
        adam.zero_grad()
        loss.backward()
        adam.step()
        losses += [float(loss.detach())] if loss else []
    print([round(loss, 4) for loss in losses])
    assert len(losses) > 10 and sum(losses[-4:]) < 0.5 * sum(losses[:4])
