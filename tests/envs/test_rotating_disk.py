from __future__ import annotations

import subprocess
import sys
import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence

from spikecam_env.envs.registration import register
from spikecam_env.envs.rotating_disk import RotatingDiskEnv
from spikecam_env.envs.spike_camera import SpikeCameraEnv
from spikecam_env.errors import InputError, NotReadyError
from spikecam_env.sensor import SensorModel
from spikecam_env.streams import unpack_frames

register()
ID = "spikecam_env/RotatingDisk-v0"
SMALL: dict[str, Any] = {"shape": (24, 32), "frames_per_step": 8}


def make(**options: Any) -> RotatingDiskEnv:
    env = gymnasium.make(ID, **{**SMALL, **options}).unwrapped
    assert isinstance(env, RotatingDiskEnv)
    return env


def rollout(env: Any, seed: int, steps: int = 5) -> list[Any]:
    actions = np.random.default_rng(0).uniform(-1, 1, (steps, 2)).astype(np.float32)
    return [env.reset(seed=seed), *(env.step(action) for action in actions)]


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("render_mode", [None, "rgb_array"])
def test_check_env_is_clean(packed: bool, render_mode: str | None) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(make(packed=packed, render_mode=render_mode, ground_truth=True))


def test_same_seed_and_actions_give_the_same_bits() -> None:
    env = make(ground_truth=True)
    first, other, again = rollout(env, 3), rollout(env, 4), rollout(env, 3)
    assert data_equivalence(first, again, exact=True)
    assert data_equivalence(first, rollout(make(ground_truth=True), 3), exact=True)
    assert not data_equivalence(first, other, exact=True)


def test_observations_are_fresh_blocks_and_scalars_are_plain() -> None:
    env = make()
    observation, info = env.reset(seed=0)
    kept = observation.copy()
    after, reward, terminated, truncated, info = env.step(np.zeros(2, np.float32))
    assert observation.shape == (8, 24, 32) and observation.dtype == np.int8
    assert after in env.observation_space and not np.shares_memory(observation, after)
    np.testing.assert_array_equal(observation, kept)
    assert [type(x) for x in (reward, terminated, truncated)] == [float, bool, bool]
    assert info["frame"] == 16 and info["time_s"] == 16 / 40_000 and type(info["time_s"]) is float
    np.testing.assert_array_equal(info["gaze"], 0.0)


def test_packed_observations_hold_the_same_bits() -> None:
    plain, packed = rollout(make(), 7), rollout(make(packed=True), 7)
    for a, b in zip(plain, packed, strict=True):
        np.testing.assert_array_equal(unpack_frames(b[0], (24, 32)), a[0])


def test_gaze_moves_at_the_rate_of_the_action() -> None:
    env = make(max_gaze_rate_px_s=10_000.0, ground_truth=True, drift_px_s=0.0)
    _, before = env.reset(seed=0)
    _, _, _, _, info = env.step(np.array([1.0, -0.5], np.float32))
    np.testing.assert_allclose(info["gaze"], [2.0, -1.0])
    np.testing.assert_allclose(info["poses"]["camera"], [1.0, -0.5])
    moved = info["poses"]["disk"][:2] - before["poses"]["disk"][:2]
    np.testing.assert_allclose(moved, [-1.0, 0.5], atol=1e-9)
    background = info["flow"][info["object_id"] == 0]
    np.testing.assert_allclose(background, np.broadcast_to([-0.25, 0.125], background.shape), atol=1e-6)
    _, _, _, _, info = env.step(np.array([5.0, -9.0]))
    np.testing.assert_allclose(info["gaze"], [4.0, -3.0])


def test_spikes_follow_the_light() -> None:
    """Counts of an ideal camera over 800 frames of a still scene: within one spike of the light collected."""
    env = make(model="ideal", frames_per_step=800, rpm=0.0, drift_px_s=0.0, ground_truth=True)
    observation, info = env.reset(seed=1)
    error = np.abs(observation.sum(axis=0) - 800 * info["radiance"]).max()
    print(f"largest difference {error:.4f} spikes")
    assert error <= 1.001


def test_reward_is_one_in_the_middle_and_falls_to_the_corner() -> None:
    env = make(drift_px_s=0.0)
    env.reset(seed=0, options={"centre": (15.5, 11.5)})
    assert env.step(np.zeros(2))[1] == pytest.approx(1.0)
    env.reset(seed=0, options={"centre": (15.5 + 16 * 0.9, 11.5 + 12 * 0.9)})
    assert env.step(np.zeros(2))[1] == pytest.approx(0.1)


def test_following_the_disk_beats_standing_still() -> None:
    def mean_reward(follow: bool) -> float:
        env = make(ground_truth=True, frames_per_step=40, drift_px_s=20.0)
        rewards = []
        for seed in range(3):
            _, info = env.reset(seed=seed)
            for _ in range(60):
                error = info["poses"]["disk"][:2] - [15.5, 11.5]
                _, reward, _, _, info = env.step(np.clip(error, -1, 1) if follow else np.zeros(2))
                rewards.append(reward)
        return float(np.mean(rewards))

    following, still = mean_reward(True), mean_reward(False)
    print(f"mean reward: following {following:.3f}, still {still:.3f}")
    assert following > 0.9 > still


def test_episode_ends_when_the_disk_leaves_and_at_the_time_limit() -> None:
    env = make(max_gaze_rate_px_s=40_000.0)
    env.reset(seed=0)
    ends = [env.step(np.array([1.0, 0.0]))[2] for _ in range(4)]
    assert ends[0] is False and ends[-1] is True
    limited = gymnasium.make(ID, **SMALL, max_episode_steps=3)
    limited.reset(seed=0)
    assert [limited.step(np.zeros(2, np.float32))[2:4] for _ in range(3)][-1] == (False, True)
    assert gymnasium.spec(ID).max_episode_steps == 500


def test_render_is_a_picture_of_the_recent_spikes() -> None:
    env = make(render_mode="rgb_array", model="ideal", rpm=0.0, background=0.25, radius=5.0)
    env.reset(seed=0)
    for _ in range(6):
        env.step(np.zeros(2))
    picture = env.render()
    assert picture is not None and picture.shape == (24, 32, 3) and picture.dtype == np.uint8
    assert picture[0, 0, 0] == pytest.approx(255 * 0.25 ** (1 / 2.2), abs=1)
    assert make().render() is None


def test_model_file_and_scene_options_reach_the_camera(tmp_path: Any) -> None:
    path = tmp_path / "slow.toml"
    SensorModel.preset("physical").to_toml(path)
    path.write_text(path.read_text().replace("40000.0", "20000.0"))
    dim, bright = (make(model=path, light=(0.0, x), background=0.1 * x, rpm=500.0, radius=6.0) for x in (0.1, 0.9))
    rates = [env.reset(seed=0)[0].mean() for env in (dim, bright)]
    assert dim.reset(seed=0)[1]["time_s"] == 8 / 20_000
    assert rates[0] < rates[1]


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ({"model": "scs"}, "unknown preset"),
        ({"frames_per_step": 0}, "frames_per_step is 0"),
        ({"frames_per_step": 2.5}, "frames_per_step is 2.5"),
        ({"render_mode": "ansi"}, "unknown render_mode"),
        ({"max_gaze_rate_px_s": -1.0}, "max_gaze_rate_px_s is -1"),
        ({"shape": (0, 4)}, "shape = "),
        ({"light": (0.4, 0.1)}, "light"),
        ({"drift_px_s": -2.0}, "drift_px_s = -2"),
        ({"engine": "warp"}, "unknown engine"),
    ],
)
def test_bad_options_are_named(option: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        RotatingDiskEnv(**{**SMALL, **option})


def test_nothing_works_before_the_first_reset() -> None:
    env = RotatingDiskEnv(**SMALL, render_mode="rgb_array")
    with pytest.raises(NotReadyError, match="call reset"):
        env.step(np.zeros(2))
    with pytest.raises(NotReadyError, match="call reset"):
        env.render()


def test_a_scene_of_another_size_is_refused() -> None:
    disk = RotatingDiskEnv(**SMALL)
    env = SpikeCameraEnv(lambda *_: disk._disk, lambda *_: (0.0, False), shape=(10, 10))
    with pytest.raises(InputError, match="the scene is"):
        env.reset(seed=0)


def test_importing_the_environments_registers_them() -> None:
    program = f"import gymnasium, spikecam_env.envs; gymnasium.make({ID!r}, shape=(8, 8)).reset(seed=0)"
    subprocess.run([sys.executable, "-W", "error", "-c", program], check=True, timeout=120)


def test_clean_twin_sees_the_same_scene() -> None:
    """Stepped through the same light, the noise-free twin's counts are those of the light."""
    env = make(rpm=0.0, drift_px_s=0.0, frames_per_step=400, ground_truth=True)
    _, info = env.reset(seed=2)
    twin = env.sensor.clean_twin()
    clean = twin.step(env.scene.radiance(0, 400, None), 400)
    assert np.abs(clean.sum(axis=0) - 400 * info["radiance"]).max() <= 1.001
