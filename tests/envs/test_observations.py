"""Observations against their definitions, and how their state begins anew."""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from denoiser.observation import Rate
from spikecam_env.envs.observations import (
    ISI,
    OBSERVATIONS,
    TFI,
    TFP,
    Blocks,
    CameraView,
    Observation,
    observation,
    restarted,
)
from spikecam_env.envs.registration import register
from spikecam_env.errors import InputError
from spikecam_env.sensor import Keyframes
from spikecam_env.streams import isi_plane, unpack_frames

register()
DISK = "spikecam_env/RotatingDisk-v0"
SMALL: dict[str, Any] = {"shape": (16, 16), "frames_per_step": 8}
VIEW = CameraView((5, 7), 8)
FRAMES = 48


def stream(seed: int = 0) -> np.ndarray:
    """(1, FRAMES, 5, 7) spikes at rates from 0 to 1."""
    rng = np.random.default_rng(seed)
    return (rng.random((1, FRAMES, *VIEW.shape)) < rng.random(VIEW.shape)).astype(np.uint8)


def shown(law: Observation, spikes: np.ndarray, cut: int) -> list[np.ndarray]:
    """The pictures after every `cut` frames."""
    state, seen = law.start(CameraView(VIEW.shape, cut), len(spikes)), []
    for first in range(0, spikes.shape[1], cut):
        picture, state = law.step(Blocks(spikes[:, first : first + cut]), state)
        seen.append(picture)
    return seen


@pytest.mark.parametrize("obs_state", [False, True])
@pytest.mark.parametrize("obs", OBSERVATIONS)
def test_check_env_is_clean_for_every_observation(obs: str, obs_state: bool) -> None:
    """Of the disk; every scene id has one of them, and steps, in `test_scene_environment`."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(DISK, **SMALL, obs=obs, obs_state=obs_state).unwrapped
        check_env(env, skip_render_check=True)
        env.close()


def test_names_give_the_same_stream() -> None:
    def first(obs: str) -> Any:
        return gymnasium.make(DISK, **SMALL, obs=obs).reset(seed=4)[0]

    spikes = first("multibinary")
    np.testing.assert_array_equal(first("spikes"), spikes)
    np.testing.assert_array_equal(unpack_frames(first("packed"), (16, 16)), spikes)
    np.testing.assert_array_equal(first("tfp")[0], np.floor(255 * spikes.mean(axis=0) + 0.5))


@pytest.mark.parametrize("window", [3, 8, 20])
def test_tfp_is_the_share_of_the_last_frames(window: int) -> None:
    spikes = stream()
    for number, picture in enumerate(shown(TFP(window), spikes, 8), start=1):
        last = spikes[:, max(0, 8 * number - window) : 8 * number]
        np.testing.assert_allclose(picture[:, 0], 255 * last.mean(axis=1), atol=0.51)


def test_isi_is_the_last_whole_interval_or_the_wait() -> None:
    """By `streams.isi_plane` of all frames so far, which sees nothing of later frames."""
    spikes = stream()
    for number, picture in enumerate(shown(ISI(), spikes, 8), start=1):
        known = spikes[0, : 8 * number]
        wait = isi_plane(known, len(known) - 1)
        for y, x in np.ndindex(VIEW.shape):
            fired = np.flatnonzero(known[:, y, x])
            whole = np.diff(np.concatenate([[-1], fired]))[-1:] if len(fired) else [0]
            assert picture[0, 0, y, x] == max(wait[y, x], *whole), (number, y, x)


@pytest.mark.parametrize("law", [TFP(20), TFI(), ISI()])
def test_what_is_seen_does_not_depend_on_the_cut(law: Observation) -> None:
    spikes = stream()
    np.testing.assert_array_equal(shown(law, spikes, 24)[-1], shown(law, spikes, 4)[-1])


def test_tfi_is_the_inverse_interval() -> None:
    spikes = stream()
    np.testing.assert_array_equal(
        shown(TFI(), spikes, 8)[-1], np.floor(255 / shown(ISI(), spikes, 8)[-1] + np.float32(0.5))
    )


def test_before_the_denoiser_has_a_picture_it_is_the_noisy_rate_and_marked() -> None:
    env = gymnasium.make(DISK, **SMALL, obs=Rate("best"), obs_state=True)
    seen, info = env.reset(seed=1)
    noisy = gymnasium.make(DISK, **SMALL, obs="tfp").reset(seed=1)[0]
    np.testing.assert_array_equal(seen["picture"], noisy)
    assert info["age"] == -1
    ages = [env.step(np.zeros(2, np.float32))[4]["age"] for _ in range(5)]
    print(ages)
    assert ages == [-1, -1, 16, 24, 16]


def test_a_rate_is_by_default_a_picture_of_every_step() -> None:
    env = gymnasium.make(DISK, shape=(16, 16), obs="rate", frames_per_step=40)
    ages = [env.reset(seed=1)[1]["age"], *(env.step(np.zeros(2, np.float32))[4]["age"] for _ in range(3))]
    assert ages == [12] * 4, "the frame 12 before the newest"
    short = gymnasium.make(DISK, shape=(16, 16), obs="rate", frames_per_step=3)
    ages = [short.reset(seed=1)[1]["age"], *(short.step(np.zeros(2, np.float32))[4]["age"] for _ in range(5))]
    assert ages == [-1, -1, 8, 11, 14, 12], "nine frames are the shortest step of whole steps of three"


def test_a_dim_rate_is_the_same_plane_ten_times_brighter() -> None:
    def shown_last(obs: str) -> Any:
        env = gymnasium.make(DISK, **SMALL, obs=obs)
        pictures = [env.reset(seed=1, options={"light": 0.05})[0]]
        return [*pictures, *(env.step(np.zeros(2, np.float32))[0] for _ in range(3))]

    for bright, dim in zip(shown_last("rate"), shown_last("dim_rate"), strict=True):
        low, high = 10 * (bright.astype(float) - 0.5), 10 * (bright.astype(float) + 0.5)
        assert np.all((dim >= np.minimum(low - 0.5, 255)) & (dim <= high + 0.5))
        assert dim.max() > bright.max()


def test_a_root_picture_is_the_root_of_the_same_rate() -> None:
    (plain,), (root,) = (shown(law, stream(), FRAMES) for law in (TFP(), TFP(gamma=0.5)))
    rate = stream().mean(axis=1)
    assert np.array_equal(root[:, 0], np.floor(255 * np.sqrt(rate.astype(np.float32)) + 0.5))
    assert plain.mean() < root.mean()


def test_a_root_picture_of_the_denoised_rate_is_not_black_in_the_dark() -> None:
    """At a mean interval of 1000 frames eight bits of the rate itself hold 0 or 1."""

    def shown_last(obs: str) -> Any:
        env = gymnasium.make(DISK, **SMALL, obs=obs)
        env.reset(seed=1, options={"light": 0.005})
        return [env.step(np.zeros(2, np.float32))[0] for _ in range(9)][-1].astype(float)

    plain, root = shown_last("rate"), shown_last("root_rate")
    print(f"rate {plain.min():.0f} to {plain.max():.0f}, its root {root.min():.0f} to {root.max():.0f}")
    assert np.all(np.abs(255 * (root / 255) ** 2 - plain) <= 1), "the same rates"
    assert len(np.unique(root)) > len(np.unique(plain))


@pytest.mark.parametrize("law", [TFP, Rate])
@pytest.mark.parametrize("gamma", [0.0, 1.5, -1.0, "root"])
def test_a_gamma_that_is_none_is_refused(law: Any, gamma: Any) -> None:
    with pytest.raises(InputError, match="gamma"):
        law(gamma=gamma)


@pytest.mark.parametrize("obs", ["tfp", "isi", "rate", "frame1000"])
def test_one_stream_begins_anew_while_another_goes_on(obs: str) -> None:
    law, view = observation(obs), CameraView((8, 8), 20)
    rng = np.random.default_rng(0)
    light = Keyframes(np.zeros(1), np.full((1, 8, 8), 0.3, np.float32))
    blocks = [Blocks((rng.random((2, 20, 8, 8)) < 0.3).astype(np.uint8), [light] * 2) for _ in range(6)]
    state = law.start(view, 2)
    for number, block in enumerate(blocks):
        if number == 3:
            state = restarted(law, view, state, np.array([False, True]))
        picture, state = law.step(block, state)
    for stream, its in ((0, blocks), (1, blocks[3:])):
        alone = law.start(view, 1)
        for block in its:
            expected, alone = law.step(Blocks(block.spikes[stream : stream + 1], [light]), alone)
        np.testing.assert_array_equal(picture[stream], expected[0])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"obs": "tpf"}, "unknown obs 'tpf'.*tfp?"),
        ({"obs": 3}, "obs = 3; give a name"),
        ({"obs": "tfp", "packed": True}, "packed is True and obs is 'tfp'"),
    ],
)
def test_bad_observations_are_named(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        gymnasium.make(DISK, **SMALL, **options)


def test_a_window_that_is_none_is_refused() -> None:
    with pytest.raises(InputError, match="window = 0"):
        TFP(0)


def test_model_and_light_of_one_episode() -> None:
    env = gymnasium.make(DISK, **SMALL, obs="spikes", ground_truth=True)
    usual, info = env.reset(seed=2)
    ideal, _ = env.reset(seed=2, options={"model": "ideal"})
    bright, lit = env.reset(seed=2, options={"light": 1.5})
    again, _ = env.reset(seed=2)
    np.testing.assert_array_equal(again, usual)
    assert (ideal != usual).any()
    np.testing.assert_allclose(lit["radiance"], 1.5 * info["radiance"], rtol=1e-5)
    assert bright.mean() > 1.2 * usual.mean()
    expected, _ = gymnasium.make(DISK, **SMALL, obs="spikes", model="ideal").reset(seed=2)
    np.testing.assert_array_equal(ideal, expected)
    with pytest.raises(InputError, match="light = 0"):
        env.reset(options={"light": 0.0})
    with pytest.raises(InputError, match="unknown preset"):
        env.reset(options={"model": "perfect"})


@pytest.mark.parametrize("law", [TFP, TFI])
def test_a_white_of_a_quarter_shows_four_times_the_light_and_cuts_what_is_above(law: type) -> None:
    dim = (np.random.default_rng(2).random((1, FRAMES, *VIEW.shape)) < 0.15).astype(np.uint8)
    for plain, bright in zip(shown(law(), dim, 16), shown(law(white=0.25), dim, 16), strict=True):
        inside = plain < 63
        assert inside.any() and (~inside).any()
        assert np.abs(bright[inside].astype(int) - 4 * plain[inside]).max() <= 2  # each is rounded
        assert (bright[plain > 64] == 255).all()
    same = zip(shown(law(), dim, 16), shown(law(white=1.0), dim, 16), strict=True)
    assert all(np.array_equal(one, other) for one, other in same)
    for white in (0, -1, float("nan"), "1", None):
        with pytest.raises(InputError, match="white"):
            law(white=white)
