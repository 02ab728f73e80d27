"""The fast engine: same bits by streaming, jumping, looking ahead, and in a forked process; its law of light."""

from __future__ import annotations

import multiprocessing
import pickle
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from spikecam_env.errors import InputError
from spikecam_env.sensor import CATALOGUE, SensorModel, SpikeSensor
from spikecam_env.sensor.engines.compiled import ahead, fast
from spikecam_env.sensor.light import GRAINS, Segment, ramp
from spikecam_env.sensor.model import generator

KEYS = 4


def wild_light(pixels: int, seed: int = 0) -> NDArray[np.float32]:
    """(KEYS, P) radiance at keys 64 frames apart: dim, bright, over two thresholds a frame, and dark."""
    rng = np.random.default_rng(seed)
    light = np.exp(rng.uniform(np.log(0.005), np.log(1.5), (KEYS, pixels)))
    light[:, : pixels // 50] = 0.0
    light[1:3, pixels // 50 : pixels // 25] = 5.0
    return light.astype(np.float32)


def started(pixels: int, preset: str = "scsim", seed: int = 3) -> fast.FastState:
    unit = SensorModel.preset(preset).draw_unit((1, pixels), seed)
    return fast.start(unit, generator(seed, "phase").random(pixels), seed)


def film(state: fast.FastState, light: NDArray[np.float32], cuts: list[int], threads: int = 1) -> NDArray[np.uint8]:
    """All frames of `light`, every key interval served in chunks of these lengths."""
    frames = []
    for start, stop in pairwise(light):
        first = 0
        for count in cuts * 64:
            count = min(count, 64 - first)
            if count:
                frames.append(fast.run(state, Segment(start, stop, 64, first, count), threads=threads))
            first += count
    return np.concatenate(frames)


@pytest.mark.parametrize("dense", [0.0, 0.2, np.inf])
def test_streaming_and_jumping_give_the_same_bits(dense: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every tile streamed, some, none."""
    light, lit = wild_light(3000), np.sort(wild_light(3000), axis=1)
    for picture in (light, lit):
        usual, other = started(3000), started(3000)
        bits = film(usual, picture, [64])
        with monkeypatch.context() as patch:
            patch.setattr(fast, "DENSE", dense)
            assert np.array_equal(film(other, picture, [64]), bits)
        assert np.array_equal(usual.remaining, other.remaining) and np.array_equal(usual.fired, other.fired)


@pytest.mark.parametrize("stays", [1, 2, 3, 7, 30, 200])
def test_looking_ahead_changes_no_bit(stays: int) -> None:
    """Pictures that change every so many frames, in place; asked for by ones and, now and then, by twos and tens."""
    pixels, rng = 1009, np.random.default_rng(stays)
    plain, looking = started(pixels), ahead.AheadState(started(pixels))
    light = wild_light(pixels)[0]
    for frame in range(300):
        if frame % stays == 0:
            light[:] = wild_light(pixels, frame)[0]
        segment = Segment(light, light, 64, 0, int(rng.choice([1, 1, 1, 1, 1, 1, 1, 2, 10])))
        assert np.array_equal(ahead.run(looking, segment), fast.run(plain, segment))
    ahead.roll_back(looking)
    assert np.array_equal(looking.pixels.remaining, plain.remaining)
    assert np.array_equal(looking.pixels.fired, plain.fired)


def test_looking_ahead_in_a_film_changes_no_bit() -> None:
    """Key intervals served by ones, the last of a change of mind half-way; and a copy taken half-way goes on alike."""
    light = wild_light(2000)
    plain, looking = started(2000), ahead.AheadState(started(2000))
    for start, stop in [*pairwise(light), *pairwise(light)]:
        for first in range(64):
            part = Segment(start, stop, 64, first, 1)
            assert np.array_equal(ahead.run(looking, part), fast.run(plain, part))
            if first == 40:
                other = pickle.loads(pickle.dumps(looking))
    assert looking.reach == 64
    for first in range(41, 64):
        ahead.run(other, Segment(start, stop, 64, first, 1))
    ahead.roll_back(other)
    assert np.array_equal(other.pixels.remaining, plain.remaining)


def test_a_region_of_a_camera_is_that_camera_cut_out() -> None:
    """A pixel's draws depend on its number and its unit alone, not on the array's size."""
    light = wild_light(4000)
    whole = started(4000, "ideal")
    part = started(4000, "ideal")
    first = film(whole, light, [64])[:, :1000]
    law = fast.PixelLaw(part.law.gain[:1024], part.law.dark[:1024], part.law.spread[:1024], part.law.polynomial)
    part = fast.FastState(law, part.remaining[:1024].copy(), part.fired[:1024].copy(), part.seeds)
    assert np.array_equal(first, film(part, light[:, :1000], [64]))


@pytest.mark.parametrize("pixels", [1, 7, 63, 64, 65, 256, 257, 1000])
def test_frames_by_ones_are_those_of_one_call_for_any_number_of_pixels(pixels: int) -> None:
    light, one, other = wild_light(pixels)[:1], *(SpikeSensor("scsim", (1, pixels), 3) for _ in range(2))
    assert np.array_equal(one.step(light, 64), np.concatenate([other.step(light) for _ in range(64)]))


def test_an_already_passed_threshold_fires_in_the_first_lit_frame() -> None:
    unit = SensorModel.preset("scsim").draw_unit((1, 2000), 0)
    state = fast.start(unit, np.full(2000, np.nextafter(1.0, 0.0)), 0)
    assert state.remaining.min() >= 1
    light = np.full(2000, 0.1, dtype=np.float32)
    assert fast.run(state, Segment(light, light, 64, 0, 1)).all()


def test_inputs_that_cannot_be_written_to_compile_nothing_new() -> None:
    from spikecam_env.sensor.engines.compiled import tile_driver

    light = wild_light(300)
    fast.run(started(300), Segment(light[0], light[1], 64, 0, 64))
    known = len(tile_driver.advance.signatures)
    light.flags.writeable = False
    fast.run(started(300), Segment(light[0], light[1], 64, 0, 64))
    fast.run(started(150), Segment(light[0, ::2], light[1, ::2], 64, 0, 64))
    assert len(tile_driver.advance.signatures) == known


def _count_spikes(queue: multiprocessing.Queue[int]) -> None:
    queue.put(int(film(started(40_000), wild_light(40_000), [64], threads=2).sum()))


def test_a_forked_process_goes_on_using_threads() -> None:
    """As vector environments do; numba's own OpenMP threads would abort there."""
    if "fork" not in multiprocessing.get_all_start_methods():
        pytest.skip("this platform does not fork")
    here = int(film(started(40_000), wild_light(40_000), [64], threads=2).sum())
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    process = context.Process(target=_count_spikes, args=(queue,))
    process.start()
    there = queue.get(timeout=60)
    process.join()
    assert there == here


def test_what_the_engine_does_not_carry_is_refused_by_name() -> None:
    scsim = SensorModel.preset("scsim")
    few = scsim.with_effect(CATALOGUE["shot_noise"](quanta=10))
    with pytest.raises(InputError, match=r"quanta=10 \(below 20\)"):
        SpikeSensor(few, (4, 4), engine="fast")
    assert SpikeSensor(few, (4, 4), engine="auto").engine == "reference"
    assert fast.missing(scsim.effects) == []


@pytest.mark.parametrize("length", [1, 2, 3, 7, 33, 63, 64])
def test_collected_light_never_falls_and_is_right_within_a_grain(length: int) -> None:
    """Every pair of levels up to 150 grains, and ramps up to a threshold a frame.

    An engine that jumps to the crossing agrees with one that steps only if F is monotone, to the grain.
    """
    rng = np.random.default_rng(length)
    dim = np.array(np.meshgrid(np.arange(150), np.arange(150))).reshape(2, -1)
    steep = rng.integers(0, GRAINS, (2, 20_000))
    fading = np.array([rng.integers(0, GRAINS, 20_000), np.zeros(20_000, dtype=np.int64)])
    start, stop = np.concatenate([dim, steep, fading, fading[::-1]], axis=1).astype(np.float32)
    one, none = np.ones_like(start), np.zeros_like(start)
    law = ramp(Segment(start, stop, length, 0, length), one, none)
    collected = np.array([law.collected(k) for k in range(length + 1)])
    k = np.arange(length + 1.0)[:, None]
    exact = start * k + (stop.astype(np.float64) - start) * k**2 / (2 * length)
    error = collected - exact
    print(f"length {length}: {error.min():+.2f} .. {error.max():+.2f} grains")
    assert np.diff(collected, axis=0).min() >= 0
    assert error.min() > -1.0
    assert error.max() < 1.0
