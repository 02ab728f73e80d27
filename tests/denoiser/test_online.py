"""The stream: online equals offline bit for bit, save and restore change nothing, bad input is named."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import torch

from denoiser.online import OnlineDnSS
from denoiser.recipe import RECIPES
from spikecam_env.errors import InputError, NotReadyError
from spikecam_env.streams import isi_planes

SHAPE = (9, 14)
MODES = ("paper", "best")


def denoiser(mode: str, **options) -> OnlineDnSS:
    """Untrained, and so the same for one mode."""
    torch.manual_seed(1)
    return OnlineDnSS(RECIPES[mode], RECIPES[mode].network(), **{"output": "both", **options})


def stream(frames: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return (rng.random((frames, *SHAPE)) < rng.random(SHAPE)).astype(np.uint8)


def run(online: OnlineDnSS, chunks) -> tuple[np.ndarray, np.ndarray]:
    pieces = [online.push(chunk) for chunk in chunks] + [online.flush()]
    spikes, rates = zip(*pieces, strict=True)
    return np.concatenate(spikes), np.concatenate(rates)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
def test_online_is_offline_bit_for_bit(mode, precision):
    spikes = stream(61)
    whole = run(denoiser(mode, precision=precision), [spikes])
    for chunks in (list(spikes[:, None]), np.split(spikes, [0, 3, 40, 41]), np.split(spikes, [13, 26, 39, 52])):
        pieces = run(denoiser(mode, precision=precision), chunks)
        assert all(np.array_equal(a, b) for a, b in zip(whole, pieces, strict=True))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("frames", [1, 5, 21, 28, 61])
def test_as_many_frames_come_out_as_went_in(mode, frames):
    spikes, rates = run(denoiser(mode), [stream(frames)])
    assert spikes.shape == rates.shape == (frames, *SHAPE)
    assert spikes.dtype == np.uint8 and rates.dtype == np.float32
    assert spikes.max() <= 1 and rates.min() >= 0 and rates.max() <= 1


@pytest.mark.parametrize("mode", MODES)
def test_frames_come_out_within_the_stated_latency(mode):
    online, out = denoiser(mode, output="spikes"), 0
    for t, frame in enumerate(stream(70)[:, None]):
        out += len(online.push(frame))
        assert out >= t + 1 - online.latency
    assert online.latency == {"paper": 20, "best": 27}[mode]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("at", [0, 1, 30, 55])
def test_saving_and_restoring_changes_nothing(mode, at):
    spikes = stream(61)
    whole = run(denoiser(mode), [spikes])
    first = denoiser(mode)
    before = first.push(spikes[:at])
    state = pickle.loads(pickle.dumps(first.state()))
    first.push(spikes[:20])  # the saved state is a copy
    second = denoiser(mode)
    second.restore(state)
    after = run(second, [spikes[at:]])
    for part in (0, 1):
        assert np.array_equal(np.concatenate([before[part], after[part]]), whole[part])


@pytest.mark.parametrize("mode", MODES)
def test_reset_begins_anew_even_with_another_size(mode):
    online = denoiser(mode)
    first = run(online, [stream(40)])
    online.reset()
    assert online.shape is None
    run(online, [np.zeros((3, 4, 4), np.uint8)])
    online.reset()
    again = run(online, [stream(40)])
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))


def test_stride_holds_planes_in_between():
    _, rates = run(denoiser("paper", stride=4), [stream(60)])
    _, every = run(denoiser("paper"), [stream(60)])
    for t in range(60):
        assert np.array_equal(rates[t], every[t // 4 * 4])


def test_stride_too_is_the_same_in_any_chunks():
    spikes = stream(50)
    whole = run(denoiser("paper", stride=3), [spikes])
    single = run(denoiser("paper", stride=3), list(spikes[:, None]))
    assert all(np.array_equal(a, b) for a, b in zip(whole, single, strict=True))


def test_outputs_are_spikes_or_rates_or_both():
    both = run(denoiser("best"), [stream(40)])
    for i, output in enumerate(("spikes", "rate")):
        online = denoiser("best", output=output)
        assert np.array_equal(np.concatenate([online.push(stream(40)), online.flush()]), both[i])


def test_an_empty_stream_is_a_stream():
    spikes, _ = run(denoiser("best"), [np.zeros((0, *SHAPE), np.uint8)])
    assert spikes.shape == (0, *SHAPE)


@pytest.mark.parametrize(
    "bad",
    [
        np.zeros(SHAPE, np.uint8),
        np.full((4, *SHAPE), np.nan),
        np.zeros((4, *SHAPE), np.float32),
        np.full((4, *SHAPE), 2, np.uint8),
        np.full((4, *SHAPE), -1, np.int8),
        np.zeros((4, 0, 5), np.uint8),
    ],
    ids=["two axes", "NaN", "float", "two", "minus one", "no rows"],
)
def test_unusable_spikes_are_refused_and_leave_no_trace(bad):
    online = denoiser("best")
    with pytest.raises(InputError):
        online.push(bad)
    assert online.shape is None


def test_frames_of_another_size_are_refused():
    online = denoiser("best")
    online.push(stream(3))
    with pytest.raises(InputError, match="reset"):
        online.push(np.zeros((3, 4, 4), np.uint8))


def test_calls_out_of_order_say_what_comes_first():
    online = denoiser("best")
    with pytest.raises(NotReadyError, match="push"):
        online.flush()
    online.push(stream(3))
    online.flush()
    with pytest.raises(NotReadyError, match="reset"):
        online.push(stream(3))


@pytest.mark.parametrize("options", [{"output": "film"}, {"precision": "int4"}, {"stride": 0}, {"stride": 2}])
def test_unknown_options_are_named(options):
    with pytest.raises(InputError, match=next(iter(options))):
        denoiser("best", **options)


def test_the_state_of_another_mode_is_refused():
    online = denoiser("paper")
    online.push(stream(3))
    with pytest.raises(InputError, match="state"):
        denoiser("best").restore(online.state())


def test_no_kernel_changes_torch_s_threads():
    """numba's parallel layer would: it and torch share OpenMP's number of threads."""
    before = torch.get_num_threads()
    try:
        torch.set_num_threads(1)
        online = denoiser("best")
        isi_planes(stream(20))
        online.push(stream(40))
        assert torch.get_num_threads() == 1
    finally:
        torch.set_num_threads(before)
