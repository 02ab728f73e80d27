"""The stream: online equals offline bit for bit, save and restore change nothing, bad input is named."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
import torch

from denoiser.online import OnlineDnSS, denoise
from denoiser.passes import infer
from denoiser.passes.engine import Engine
from denoiser.passes.passes import passes_of
from denoiser.passes.recipe import RECIPES
from denoiser.passes.window import RollingWindow
from spikecam_env.errors import InputError, NotReadyError
from spikecam_env.streams import isi_planes

SHAPE = (9, 14)
MAP = (np.linspace(0.8, 1.2, 9 * 14).reshape(SHAPE), np.full(SHAPE, 0.002))
KINDS = {
    "paper": ("paper", {}),
    "stride": ("paper", {"stride": 3, "decoder": "mus"}),
    "best": ("best", {}),
    "overlap": ("best", {"overlap": True}),
    "eased": ("best", {"ease": True}),
    "map": ("best", {"unit": MAP}),
}
MODES = tuple(KINDS)


def denoiser(kind: str, **options) -> OnlineDnSS:
    """Untrained, and so the same for one mode."""
    mode, its = KINDS[kind]
    torch.manual_seed(1)
    return OnlineDnSS(RECIPES[mode], RECIPES[mode].network(), **{"output": "both", **its, **options})


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
    assert online.latency == (20 if KINDS[mode][0] == "paper" else 31)


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


@pytest.mark.parametrize("mode", [kind for kind in MODES if kind != "map"])
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


@pytest.mark.parametrize(
    "options",
    [
        *({"output": "film"}, {"output": 1}, {"precision": "int4"}, {"precision": None}, {"mode": None}),
        *({"mode": ["best"]}, {"stride": 0}, {"stride": 1.5}, {"stride": 2}, {"decoder": "film"}, {"overlap": 1}),
    ],
)
def test_unknown_options_are_named(options):
    with pytest.raises(InputError, match=next(iter(options))):
        denoise(stream(30), **options)


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


@pytest.mark.parametrize("mode", RECIPES)
def test_weights_converted_once_give_the_bits_of_converting_them_at_every_pass(mode):
    """Against autocast over the float32 network, at sizes that four divides and does not, with both types."""
    torch.manual_seed(1)
    network = RECIPES[mode].network().to(memory_format=torch.channels_last)
    for kind in (torch.bfloat16, torch.float32):
        once = infer.prepared(network, kind)
        assert {p.dtype for p in once.parameters()} == {kind}
        for shape in (SHAPE, (16, 32)):
            spikes = (np.random.default_rng(0).random((60, *shape)) < 0.3).astype(np.uint8)
            for window in RollingWindow(RECIPES[mode].layout, shape).push(spikes):
                every, kept = infer.rates(network, window, kind)
                found, left = infer.rates(once, window, kind)
                assert every.any() and np.array_equal(found, every)
                assert all(np.array_equal(a, b) for a, b in zip(left, kept, strict=True))


def test_training_a_network_on_changes_no_denoiser_made_of_it():
    torch.manual_seed(1)
    network = RECIPES["best"].network()
    online, same = OnlineDnSS(RECIPES["best"], network, output="rate"), denoiser("best", output="rate")
    assert network.training
    with torch.no_grad():
        for weights in network.parameters():
            weights += 1
    assert np.array_equal(online.push(stream(40)), same.push(stream(40)))


@pytest.mark.parametrize("mode", MODES)
def test_another_denoises_a_stream_of_its_own(mode):
    first, whole = denoiser(mode), run(denoiser(mode), [stream(40)])
    first.push(stream(30, seed=5))
    assert all(np.array_equal(a, b) for a, b in zip(run(first.another(), [stream(40)]), whole, strict=True))
    assert first.another("rate").output == "rate" and first.output == "both"


@pytest.mark.parametrize("mode", MODES)
def test_later_changes_of_what_went_in_and_came_out_change_nothing(mode):
    spikes, online, pieces = stream(61), denoiser(mode), []
    whole = run(denoiser(mode), [spikes])
    for start in range(0, 61, 7):
        block = spikes[start : start + 7].copy()
        out = online.push(block)
        pieces.append(tuple(part.copy() for part in out))
        state = online.state()
        chains = [a for c in state["chains"] for a in (*c["window"].values(), *c["carried"], c["held"])]
        mixing = list((state["mixing"] or {}).values())
        for array in (block, *out, *chains, *mixing, *state["decoding"]):
            if isinstance(array, np.ndarray) and array.size:
                array[...] = 1
    pieces.append(online.flush())
    for part, expected in zip(zip(*pieces, strict=True), whole, strict=True):
        assert np.array_equal(np.concatenate(part), expected)


def test_restoring_copies_the_state():
    spikes, whole = stream(61), run(denoiser("best"), [stream(61)])
    first = denoiser("best")
    before = first.push(spikes[:40])
    state = first.state()
    second = denoiser("best")
    second.restore(state)
    chain = state["chains"][0]
    for array in (*chain["window"].values(), *chain["carried"], *state["decoding"], chain["held"]):
        if isinstance(array, np.ndarray):
            array[...] = 0
    after = run(second, [spikes[40:]])
    assert np.array_equal(np.concatenate([before[1], after[1]]), whole[1])


def of_other_weights() -> OnlineDnSS:
    torch.manual_seed(2)
    return OnlineDnSS(RECIPES["paper"], RECIPES["paper"].network())


def of_another_decoder() -> OnlineDnSS:
    torch.manual_seed(1)
    recipe = replace(RECIPES["paper"], decoder="mus")
    return OnlineDnSS(recipe, recipe.network())


@pytest.mark.parametrize(
    ("other", "named"),
    [
        (of_other_weights, "weights"),
        (of_another_decoder, "recipe"),
        (lambda: denoiser("paper", stride=2), "stride"),
        (lambda: denoiser("best"), "weights"),
        (lambda: denoiser("paper", precision="float32"), "precision"),
    ],
)
@pytest.mark.parametrize("pushed", [0, 30])
def test_a_state_that_would_go_on_differently_is_refused_and_leaves_no_trace(other, named, pushed):
    first = denoiser("paper", precision="bfloat16")
    first.push(stream(pushed))
    mine = other()
    mine.push(stream(25, seed=3))
    twin = other()
    twin.push(stream(25, seed=3))
    with pytest.raises(InputError, match=named):
        mine.restore(first.state())
    assert np.array_equal(mine.push(stream(20))[-1], twin.push(stream(20))[-1])


def test_a_state_goes_on_with_another_output():
    whole = run(denoiser("best"), [stream(61)])
    first = denoiser("best", output="spikes")
    first.push(stream(61)[:40])
    second = denoiser("best", output="rate")
    second.restore(first.state())
    rest = np.concatenate([second.push(stream(61)[40:]), second.flush()])
    assert np.array_equal(rest, whole[1][61 - len(rest) :])


def _with_window(state, **changes):
    chain = state["chains"][0]
    return {**state, "chains": [{**chain, "window": {**chain["window"], **changes}}]}


@pytest.mark.parametrize(
    "change",
    [
        lambda state: None,
        lambda state: [state],
        lambda state: {},
        lambda state: {**state, "of": None},
        lambda state: {**state, "shape": (1, 2, 3)},
        lambda state: {**state, "shape": (8, 14)},
        lambda state: {**state, "decoding": None},
        lambda state: {**state, "chains": []},
        lambda state: {**state, "chains": [{**state["chains"][0], "held": np.zeros((8, 1, 1), np.float32)}]},
        lambda state: {**state, "chains": [{**state["chains"][0], "carried": (np.zeros((1, 9, 14), np.float32),)}]},
        lambda state: _with_window(state, frames=np.zeros((1, 2, 2), np.uint8)),
        lambda state: _with_window(state, last=None),
        lambda state: {name: state[name] for name in ("of", "shape")},
    ],
)
def test_what_is_no_state_is_refused(change):
    online = denoiser("best")
    online.push(stream(40))
    with pytest.raises(InputError, match="state"):
        denoiser("best").restore(change(online.state()))


@pytest.mark.parametrize("chunk", [0, -1, 1.5, None, float("nan"), "8"])
def test_a_chunk_of_no_frames_is_refused(chunk):
    with pytest.raises(InputError, match="chunk"):
        denoise(stream(30), chunk=chunk)


def test_overlapping_passes_are_the_mean_of_two_chains():
    """Weighed by how far a frame is from the end of either pass; the first half pass is one chain's alone."""
    spikes = stream(90)
    mixed = run(denoiser("overlap"), [spikes])[1]
    alone = run(denoiser("best"), [spikes])[1]
    recipe = RECIPES["best"]
    torch.manual_seed(1)
    passes = passes_of(Engine.of(recipe, recipe.network()), SHAPE, first=8)
    ((*done,), (*last,)) = passes.push(spikes[None])[0], passes.end()[0]
    later = np.concatenate([alone[:8], *(rates for _, rates in [*done, *last])])
    place = np.arange(90) % 16 + 0.5
    weight = np.minimum(place, 16 - place)[:, None, None]
    other = np.where(np.arange(90)[:, None, None] < 8, 0.0, 8 - weight)
    assert np.allclose(mixed, (weight * alone + other * later) / (weight + other), atol=1e-6)
    assert np.abs(later - alone)[8:].max() > 1e-4
    assert np.array_equal(later[8:], run(denoiser("best"), [spikes[8:]])[1])  # the chain begins anew there


def test_a_map_of_another_size_and_a_mode_without_one_are_refused():
    with pytest.raises(InputError, match="calibration map has shape"):
        denoiser("map").push(np.zeros((3, 4, 4), np.uint8))
    with pytest.raises(InputError, match="takes no calibration map"):
        denoiser("paper", unit=MAP)
