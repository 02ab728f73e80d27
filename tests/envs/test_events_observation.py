"""The event camera as an observation: its pictures, its list, its bits, alone and in vectors."""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.vector import AutoresetMode

from spikecam_env.envs.observations import (
    Blocks,
    CameraView,
    EventCounts,
    FrameCamera,
    FrameSensor,
    observation,
    restarted,
)
from spikecam_env.envs.registration import SMALL_TASKS, register
from spikecam_env.envs.wrappers import ObserveSpikes
from spikecam_env.errors import InputError
from spikecam_env.sensor import EventCamera, EventList, EventPixel, Keyframes

register()
DISK = "spikecam_env/RotatingDisk-v0"
TRACK = "spikecam_env/Track-v1"
QUIET = EventPixel().noiseless()
SMALL: dict[str, Any] = {"shape": (24, 32)}


def played(env: Any, steps: int, seed: int = 0) -> tuple[list[Any], list[dict[str, Any]]]:
    """Observations and infos of an episode's first steps, with actions of a fixed course."""
    rng = np.random.default_rng(1)
    seen, infos = zip(
        env.reset(seed=seed),
        *(
            (lambda result: (result[0], result[4]))(env.step(rng.uniform(-1, 1, env.action_space.shape)))
            for _ in range(steps)
        ),
        strict=True,
    )
    return list(seen), list(infos)


@pytest.mark.parametrize("name", SMALL_TASKS)
def test_every_task_takes_it(name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(name, obs="events", obs_state=True).unwrapped
        check_env(env, skip_render_check=True)
    env.close()


def test_events_are_those_of_an_event_camera_in_the_same_light() -> None:
    """The light of each step's block, one after another, in a camera of the episode's seed."""
    env = gymnasium.make(DISK, **SMALL, obs=EventCounts(bins=2, listed=True)).unwrapped
    seen, info = env.reset(seed=3)
    camera = EventCamera(EventPixel(), (24, 32), env.blocks.seeds[0])  # type: ignore[attr-defined]
    for _ in range(5):
        start_s = camera.frame / 40_000
        own = camera.step(env.blocks.light[0], 40)  # type: ignore[attr-defined]
        assert info["events"] == own
        counts = own.counts((24, 32), 2, start_s, camera.frame / 40_000)
        np.testing.assert_array_equal(seen, np.minimum(255 * counts / 8 + 0.5, 255).astype(np.uint8))
        assert len(own) > 100 and info["time_s"] == pytest.approx(camera.frame / 40_000)
        seen, _, _, _, info = env.step(env.action_space.sample())


def test_a_white_of_255_gives_numbers_of_events() -> None:
    env = gymnasium.make(DISK, **SMALL, obs=EventCounts(EventPixel(refractory_us=20.0), white=255.0, listed=True))
    seen, infos = played(env, 3)
    for picture, info in zip(seen, infos, strict=True):
        np.testing.assert_array_equal(picture, info["events"].counts((24, 32)))
    assert max(picture.max() for picture in seen) > 1


def test_a_scene_at_rest_gives_no_event_without_noise() -> None:
    env = gymnasium.make(DISK, **SMALL, obs=EventCounts(QUIET), rpm=0.0, drift_px_s=0.0)
    assert not np.any(env.reset(seed=0)[0])
    still = np.zeros(2, np.float32)
    assert not any(env.step(still)[0].any() for _ in range(3))


def test_edges_of_a_turning_camera_have_both_signs() -> None:
    """Behind the camera's motion each rise of light is a fall elsewhere: ON and OFF are alike in number."""
    env = gymnasium.make(DISK, shape=(64, 64), obs=EventCounts(QUIET))
    env.reset(seed=0)
    on, off = np.sum([env.step(np.array([1.0, 0.0], np.float32))[0].sum(axis=(1, 2)) for _ in range(10)], axis=0)
    print(f"ON {on / 32:.0f}, OFF {off / 32:.0f}")
    assert 0.8 < on / off < 1.25 and on > 32 * 1000


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_a_native_vector_gives_the_bits_of_single_environments(mode: AutoresetMode) -> None:
    options: dict[str, Any] = {"obs": EventCounts(listed=True), "obs_state": True, "max_episode_steps": 5}
    many = gymnasium.make_vec(TRACK, 3, "vector_entry_point", autoreset_mode=mode, **options)
    sync = gymnasium.make_vec(TRACK, 3, "sync", {"autoreset_mode": mode}, **options)
    pairs = [(many.reset(seed=5), sync.reset(seed=5))]
    rng = np.random.default_rng(0)
    for _ in range(12):
        actions = rng.uniform(-1, 1, (3, *many.single_action_space.shape)).astype(np.float32)
        ours, theirs = many.step(actions), sync.step(actions)
        pairs.append(((ours[0], ours[4]), (theirs[0], theirs[4])))
    for ours, theirs in pairs:
        assert data_equivalence(ours, theirs, exact=True)
    assert isinstance(pairs[-1][0][1]["events"][0], EventList)
    assert pairs[-1][0][0]["picture"].any()
    many.close()
    sync.close()


def test_one_stream_begins_anew_while_another_goes_on() -> None:
    law, view = EventCounts(), CameraView((8, 8), 20)
    rng = np.random.default_rng(0)

    def block(first: int) -> Blocks:
        keys = Keyframes(np.array([first, first + 20.0]), rng.uniform(0.1, 0.9, (2, 8, 8)).astype(np.float32))
        return Blocks(np.zeros((2, 20, 8, 8), np.uint8), [keys, keys], seeds=(4, 9))

    blocks = [block(20 * n) for n in range(3)] + [block(20 * n) for n in range(3)]
    state = law.start(view, 2)
    for number, its in enumerate(blocks):
        if number == 3:
            state = restarted(law, view, state, np.array([True, True]))
        before = state
        picture, state = law.step(its, state)
        again, _ = law.step(its, before)
        np.testing.assert_array_equal(picture, again, "a step leaves the state before it as it was")
    alone = law.start(view, 1)
    for its in blocks[3:]:
        expected, alone = law.step(Blocks(its.spikes[1:], its.light[1:], seeds=(9,)), alone)
    np.testing.assert_array_equal(picture[1], expected[0])
    assert (picture[0] != picture[1]).any(), "units of two seeds differ"


def test_episodes_have_units_of_their_own_and_the_seed_repeats_them() -> None:
    env = gymnasium.make(DISK, **SMALL, obs="events")
    first, _ = played(env, 3, seed=1)
    again, _ = played(env, 3, seed=1)
    other, _ = played(env, 3, seed=2)
    np.testing.assert_array_equal(first, again)
    assert (np.array(first) != np.array(other)).any()


def test_the_wrapper_sees_the_same() -> None:
    inside = gymnasium.make(DISK, **SMALL, obs="events")
    outside = ObserveSpikes(gymnasium.make(DISK, **SMALL, obs="spikes"), "events")
    np.testing.assert_array_equal(played(inside, 4)[0], played(outside, 4)[0])


@pytest.mark.parametrize(
    ("obs", "bits"),
    [
        ("tfp", 24 * 32 * 40_000.0),
        ("spikes", 24 * 32 * 40_000.0),
        ("isi", 24 * 32 * 40_000.0),
        ("frame1000", 24 * 32 * 10 * 1000.0),
        ("frame120", 24 * 32 * 10 * 120.0),
        ("root_frame30", 24 * 32 * 10 * 30.0),
        (FrameCamera(2000.0, exposure_s=1e-4, sensor=FrameSensor(bits=8)), 24 * 32 * 8 * 2000.0),
    ],
)
def test_info_has_the_bits_that_each_camera_sends(obs: Any, bits: float) -> None:
    """Over a tenth of a second, to an exposure of the frame camera."""
    env = gymnasium.make(DISK, **SMALL, obs=obs)
    _, infos = played(env, 99)
    a_second = sum(info["camera_bits"] for info in infos) / infos[-1]["time_s"]
    print(f"{a_second / 1e6:.2f} Mbit/s, expected {bits / 1e6:.2f}")
    assert infos[-1]["time_s"] == pytest.approx(0.1) and abs(a_second - bits) <= 10 * 24 * 32 / 0.1


def test_bits_of_events_are_a_word_an_event_and_the_words_of_time() -> None:
    env = gymnasium.make(DISK, **SMALL, obs=EventCounts(listed=True))
    _, infos = played(env, 9)
    for info in infos:
        assert info["camera_bits"] == 32 * (len(info["events"]) + 1000 / 64)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: EventCounts(bins=0), "bins = 0"),
        (lambda: EventCounts(white=0.0), "white = 0"),
        (lambda: EventCounts(listed="yes"), "listed = 'yes'"),  # type: ignore[arg-type]
        (lambda: EventCounts("noisy"), "pixel is 'noisy'"),  # type: ignore[arg-type]
        (lambda: observation("event"), r"unknown obs 'event'.*events\?"),
        (
            lambda: EventCounts().step(Blocks(np.zeros((1, 8, 4, 4))), EventCounts().start(CameraView((4, 4), 8), 1)),
            "needs the light",
        ),
    ],
)
def test_wrong_use_is_named(call: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()
