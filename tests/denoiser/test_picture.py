"""Mode `picture`: its planes against a plain reading of the law, and its pictures as a stream."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from denoiser import DenoiseObservation, OnlineDnSS
from denoiser.many import ManyDnSS
from denoiser.passes.fused_picture import prepared_picture
from denoiser.passes.history_kernels import DARK
from denoiser.passes.picture_pass import pictures_of
from denoiser.passes.pixel_history import PictureLayout, PixelHistory
from denoiser.passes.pixel_map import PixelMap
from denoiser.passes.recipe import PictureRecipe
from denoiser.weights import load_weights, pretrained_path, save_weights
from spikecam_env.envs.rotating_disk import RotatingDiskEnv
from spikecam_env.errors import InputError, NotReadyError
from spikecam_env.streams.packing import pack_frames

SHAPE = (6, 11)
"""No multiple of 4, so that planes are extended."""
LAYOUT = PictureLayout()
COUNT_40 = len(LAYOUT.instants) + LAYOUT.counts.index(40)
HISTORY = COUNT_40 + 2 + len(LAYOUT.half_widths)


def stream(frames: int, shape: tuple[int, int] = SHAPE, seed: int = 0) -> np.ndarray:
    """(frames, H, W) spikes of pixels of all rates, some of which hardly ever fire."""
    rng = np.random.default_rng(seed)
    return (rng.random((frames, *shape)) < rng.random(shape) ** 4).astype(np.uint8)


def online(**options) -> OnlineDnSS:
    return OnlineDnSS.pretrained("picture", precision="float32", **options)


def rates_of(planes: np.ndarray) -> np.ndarray:
    """(rates, H, W) of planes (layers, H', W')."""
    return planes[: LAYOUT.rates, : SHAPE[0], : SHAPE[1]] ** 2 - DARK


def rates_of_a_pixel(spikes: np.ndarray, look: int) -> list[float]:
    """The law of `pixel_history` in words: of one pixel's spikes (T,), but for running means and the last picture."""
    frames = len(spikes)
    ages = [frames - 1 - t for t in np.flatnonzero(spikes)][::-1]
    known = [age for age in ages if age < 128]
    before = next((age for age in ages if age >= 128), frames)
    every = [*known, before]

    def older(age: int) -> int:
        return next(a for a in every if a >= min(age, before))

    def younger(age: int) -> int | None:
        return max((a for a in known if a < age), default=None)

    newest = every[0]
    still_open = max(newest + 1, next((a for a in every if a > newest), newest) - newest)
    rates = []
    for step in LAYOUT.instants:
        age = min(look + step if look + step > 0 else 0, before)
        end = younger(age)
        rates.append(1 / still_open if end is None else 1 / (older(age) - end))
    for count in LAYOUT.counts:
        first = max(look - count // 2, 0)
        stop = min(first + count, max(frames, first + 1))
        rates.append(sum(first <= age < stop for age in known) / (stop - first))
    for half in (*LAYOUT.half_widths, None):
        begin, end = (before, newest) if half is None else (older(look + half), younger(max(look - half, 0) + 1))
        end = newest if end is None else end
        whole = sum(end <= age < begin for age in known)
        rates.append(whole / (begin - end) if begin > end else 1 / still_open)
    return rates


@pytest.mark.parametrize(
    ("frames", "step", "look"), [(40, 40, 12), (8, 8, 12), (333, 37, 4), (500, 100, 24), (260, 130, 12)]
)
def test_planes_are_those_of_the_law(frames: int, step: int, look: int) -> None:
    spikes = stream(frames)
    *_, last = PixelHistory(LAYOUT, SHAPE, step=step, look=look).push(spikes)
    seen = frames // step * step
    look = min(look, seen - 1)
    wanted = np.array([[rates_of_a_pixel(spikes[:seen, y, x], look) for x in range(SHAPE[1])] for y in range(SHAPE[0])])
    found = rates_of(last.planes)[: wanted.shape[-1]]
    assert last.start == seen - 1 - look
    np.testing.assert_allclose(found, wanted.transpose(2, 0, 1), atol=2e-7)
    assert last.planes.shape == (LAYOUT.layers, 8, 12)
    np.testing.assert_array_equal(last.planes[:, 6:], last.planes[:, [5, 5]])


def test_a_spike_older_than_the_history_is_remembered_by_its_age() -> None:
    spikes = np.zeros((1200, 4, 4), np.uint8)
    spikes[99] = 1
    *_, last = PixelHistory(LAYOUT, (4, 4), step=400).push(spikes)
    rate = last.planes[HISTORY, 0, 0] ** 2 - DARK
    assert rate == pytest.approx(1 / 1101, rel=1e-3), "an interval that has lasted 1101 frames"


def test_the_gain_is_that_of_spikes_to_pictures_and_is_taken_out() -> None:
    """Two pixels fire every 8 and every 10 frames where pictures say 0.1: gains of 1.25 and 1, of 2 spikes' prior."""
    spikes = np.zeros((800, 1, 4), np.uint8)
    spikes[::8, 0, 0] = spikes[::10, 0, 1:] = 1
    window = PixelHistory(LAYOUT, (1, 4), step=40)
    for given in window.push(spikes):
        window.learn(given, np.full((1, 1, 4), 0.1, np.float32))
        last = given
    gain = 1 + last.planes[LAYOUT.rates, 0, :2] / 4
    print(f"gains {gain}")
    assert gain == pytest.approx([1.25, 1.0], abs=0.03)
    rate = last.planes[COUNT_40, 0, :2] ** 2 - DARK
    assert rate * gain == pytest.approx([0.125, 0.1], rel=1e-3)
    assert np.all(last.planes[LAYOUT.rates + 1, 0] == 0), "nothing changed, so the gain may be texture"


def test_a_calibration_map_is_taken_out_instead() -> None:
    unit = PixelMap(np.array([[0.8, 1.2]], np.float32), np.array([[0.0, 0.01]], np.float32))
    spikes = stream(40, (1, 2), seed=3) | np.eye(40, dtype=np.uint8)[::5].sum(0)[:, None, None].astype(np.uint8)
    plain, mapped = (next(PixelHistory(LAYOUT, (1, 2), u).push(spikes)).planes for u in (None, unit))
    wanted = np.maximum(plain[COUNT_40, 0, :2] ** 2 - DARK - unit.dark[0], 0) / unit.gain[0]
    assert mapped[COUNT_40, 0, :2] ** 2 - DARK == pytest.approx(wanted, rel=1e-5)
    assert np.all(mapped[-1] == 1) and np.all(plain[-1] == 0)


def test_the_compiled_pass_gives_the_networks_own_pictures() -> None:
    network = load_weights("picture")[1]
    inputs = [list(PixelHistory(LAYOUT, (24, 20)).push(stream(80, (24, 20), seed)))[-1] for seed in (0, 1)]
    both = pictures_of(prepared_picture(network, torch.float32), inputs, [(), ()], (24, 20), torch.float32)
    for given, (picture, (hidden,)) in zip(inputs, both, strict=True):
        with torch.inference_mode():
            rate, (kept,) = network(torch.from_numpy(given.planes[None]), torch.from_numpy(given.conditions[None]))
        np.testing.assert_allclose(picture, rate[0].clamp(0, 1), atol=1e-5)
        np.testing.assert_allclose(hidden, kept[0], atol=1e-5)


def test_a_module_around_the_network_is_called_and_gives_the_same_pictures() -> None:
    class Around(torch.nn.Module):
        def __init__(self, inner: torch.nn.Module) -> None:
            super().__init__()
            self.inner = inner

        def forward(self, *given):
            return self.inner(*given)

    recipe, network, _ = load_weights("picture")
    spikes = stream(120)
    found = OnlineDnSS(recipe, Around(network), precision="float32").push(spikes)
    np.testing.assert_allclose(found, online().push(spikes), atol=1e-5)


@pytest.mark.parametrize("step", [8, 40, 100])
def test_pictures_do_not_depend_on_how_the_stream_is_cut_nor_on_a_pause(step: int) -> None:
    spikes, whole = stream(333, (16, 12)), online(step=step)
    pictures = whole.push(spikes)
    assert len(pictures) == 333 // step and whole.latency == 12
    mine, parts = whole.another(), []
    for first in range(0, 333, 7):
        parts.append(mine.push(spikes[first : first + 7]))
        other = mine.another()
        other.restore(mine.state())
        mine = other
    np.testing.assert_array_equal(np.concatenate(parts), pictures)
    packed = online(step=step).push_packed(pack_frames(spikes), (16, 12))
    np.testing.assert_array_equal(packed, pictures)
    assert len(mine.flush()) == (333 % step > 0), "the frames that fill no step give a last picture"
    with pytest.raises(NotReadyError, match="has ended"):
        mine.push(spikes)


def test_a_still_scene_is_known_better_as_time_goes_on_with_a_map() -> None:
    """The pixel's quantisation is all that is random here."""
    rng = np.random.default_rng(0)
    light = np.repeat(np.repeat(rng.uniform(0.05, 0.6, (4, 4)), 8, 0), 8, 1)
    phase = rng.random(light.shape)
    spikes = np.diff(np.floor(light * np.arange(1601)[:, None, None] + phase), axis=0).astype(np.uint8)
    unit = np.ones(light.shape, np.float32), np.zeros(light.shape, np.float32)
    pictures = online(step=40, unit=unit).push(spikes)
    errors = [float(np.sqrt(np.mean((pictures[i] - light) ** 2))) for i in (0, 4, 39)]
    print(f"rms error after 40, 200 and 1600 frames: {errors}")
    assert max(errors[1:]) < errors[0]


def test_many_streams_are_denoised_as_alone_and_say_how_far_they_are() -> None:
    streams, one = [stream(120, (8, 12), seed) for seed in (1, 2)], online(step=40)
    many = ManyDnSS(one, 2, (8, 12))
    found = many.push(np.stack(streams))
    for spikes, pictures in zip(streams, found, strict=True):
        np.testing.assert_allclose(pictures, one.another().push(spikes), atol=1e-5)
    assert many.finished.tolist() == [108, 108], "frame 107 is 12 frames old"
    many.restart(np.array([True, False]))
    assert many.finished.tolist() == [0, 108]


def test_weights_are_written_and_read_with_their_recipe(tmp_path) -> None:
    recipe = PictureRecipe(channels=(8, 16))
    save_weights(tmp_path / "small.pt", "picture", recipe, recipe.network(), {"steps": 3})
    found, network, training = load_weights(tmp_path / "small.pt")
    assert found == recipe and training == {"steps": 3}
    assert OnlineDnSS(found, network).push(stream(80, (8, 8))).shape == (2, 8, 8)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"output": "spikes"}, "one picture a step gives 'rate' alone"),
        ({"output": "picture"}, "output"),
        ({"step": 7}, "step = 7; it must be a whole number, 8 or more"),
        ({"step": 4001}, "step = 4001"),
        ({"step": 40.5}, "step"),
        ({"look": 3}, "look = 3"),
        ({"look": 25}, "look = 25"),
        ({"stride": 2}, "leave them out"),
        ({"device": "cpu"}, "leave them out"),
        ({"overlap": True}, "overlap is True"),
        ({"decoder": "mus"}, "has no spikes"),
    ],
)
def test_options_of_other_modes_are_refused(options: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        online(**options)


@pytest.mark.parametrize("given", ["name", "file", "denoiser"])
def test_the_wrapper_shows_one_picture_a_step(given: str) -> None:
    """Those of the stream, from the first step on; a second episode is another stream."""
    stream_of_steps = OnlineDnSS.pretrained("picture", step=40)
    mode = {"name": "picture", "file": str(pretrained_path("picture")), "denoiser": stream_of_steps}[given]
    inner = RotatingDiskEnv(shape=(16, 24))
    env = DenoiseObservation(inner, mode, "rate")
    blocks = [inner.reset(seed=1)[0], *(inner.step(inner.action_space.sample())[0] for _ in range(3))]
    expected = stream_of_steps.push(np.concatenate(blocks))
    for _ in range(2):
        inner.action_space.seed(0)
        first, info = env.reset(seed=1)
        assert info["denoised_frames"] == 1 and info["denoiser_latency"] == 12
        assert first in env.observation_space and first.shape == (1, 16, 24)
        assert np.array_equal(first, expected[:1])
    assert env.step(env.action_space.sample())[0] in env.observation_space


def test_the_wrapper_refuses_spikes_and_steps_of_another_length() -> None:
    env = RotatingDiskEnv(shape=(16, 24))
    with pytest.raises(InputError, match="gives 'rate' alone"):
        DenoiseObservation(env, "picture")
    with pytest.raises(InputError, match="a picture of 16 frames, the environment blocks of 40; make it with step=40"):
        DenoiseObservation(env, online(step=16), "rate")
    with pytest.raises(InputError, match="step = 4; it must be a whole number, 8 or more"):
        DenoiseObservation(RotatingDiskEnv(shape=(16, 24), frames_per_step=4), "picture", "rate")


def test_other_modes_refuse_its_options() -> None:
    with pytest.raises(InputError, match="step and look are of mode 'picture'"):
        OnlineDnSS.pretrained("fast", step=40)


def test_a_state_of_another_step_is_refused() -> None:
    first = online(step=40)
    first.push(stream(100))
    with pytest.raises(InputError, match="step 40, this one has 80"):
        online(step=80).restore(first.state())
