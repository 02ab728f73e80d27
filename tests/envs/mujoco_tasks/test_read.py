"""Read: a number on a sled that passes, its physics, its verdicts, and a reader from pictures alone."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence
from numpy.typing import NDArray

from spikecam_env.envs.registration import register
from spikecam_env.errors import InputError

pytest.importorskip("mujoco", reason="the extra mujoco is not installed: pip install 'spikecam-env[mujoco]'")

from scenes.mujoco import MujocoLight
from spikecam_env.agents.controllers.read import ReadController
from spikecam_env.envs.mujoco_tasks.make import make_task
from spikecam_env.envs.mujoco_tasks.read import BOUNCE_HZ, DAMPING, Read
from spikecam_env.envs.mujoco_tasks.task import EYE
from spikecam_env.sensor import Keyframes

register()
SILENCE = np.zeros(Read.actions, np.float32)


def played(env: Any, act: Callable[[], NDArray[Any]], seed: int = 0) -> tuple[list[float], dict[str, Any]]:
    """Rewards of an episode, and its last info."""
    env.reset(seed=seed)
    rewards, over, info = [], False, {}
    while not over:
        _, reward, terminated, truncated, info = env.step(act())
        rewards.append(float(reward))
        over = terminated or truncated
    return rewards, info


def test_check_env_is_clean() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that the environment has a wrapper, and spaces no end
        check_env(gymnasium.make("spikecam_env/Read-v1", shape=(24, 32), obs_inner=True).unwrapped)
        check_env(gymnasium.make("spikecam_env/Read-v1", shape=(24, 32)), skip_render_check=True)


@pytest.mark.parametrize("level", [1, 2, 3, 4, 5])
def test_the_oracle_reads_every_number_and_neither_silence_nor_chance_does(level: int) -> None:
    env = Read(level=level, split="test")
    nothing, best = np.mean([env.ends_of(seed) for seed in range(50)], axis=0)
    env.action_space.seed(0)
    chance = np.mean([env.played(seed, env.action_space.sample) for seed in range(300)])
    print(f"level {level}: oracle {best}, nothing {nothing}, random {chance}")
    assert best > 0.95 and nothing == 0.0
    assert chance < 0.1 + 4 * np.sqrt(0.1 * 0.9 / 300)


def test_same_seed_same_bits() -> None:
    def rollout() -> list[Any]:
        env = make_task("Read", level=4)
        seen = [env.reset(seed=3), *(env.step(SILENCE) for _ in range(5))]
        env.close()
        return seen

    assert data_equivalence(rollout(), rollout(), exact=True)


def test_the_camera_has_the_poses_of_the_physics_exactly() -> None:
    env = Read(level=5)
    env.reset(seed=0)
    light = MujocoLight(env.model, env.data, (16, 16), camera=EYE)
    light.begin()
    for _ in range(8):
        env.step(SILENCE)
        light.step()
        assert light.exact
    light.close()


@pytest.mark.parametrize(("level", "speed"), [(1, 5), (2, 10), (3, 20), (4, 35), (5, 50)])
def test_the_plate_passes_at_the_pixels_a_millisecond_of_its_level(level: int, speed: float) -> None:
    env = Read(level=level)
    for seed in range(3):
        env.reset(seed=seed)
        before = env.places(env.target()[0])[0]
        env.step(SILENCE)
        moved = abs(env.places(env.target()[0])[0] - before)
        print(f"level {level}: {moved:.2f} pixels a millisecond")
        assert 0.9 * speed <= moved <= 1.1 * speed


def test_the_sled_rises_and_falls_as_a_damped_spring_does() -> None:
    """z = e^(-d w t) (z0 cos(w' t) + (v0 + d w z0) / w' sin(w' t)), w' = w sqrt(1 - d^2)."""
    env = Read(level=1)
    env.reset(seed=1)
    rise = env.data.joint("rise")
    start, speed = float(rise.qpos[0]), float(rise.qvel[0])
    natural = 2 * np.pi * BOUNCE_HZ
    damped, decay = natural * np.sqrt(1 - DAMPING**2), DAMPING * natural
    largest = np.hypot(start, speed / natural)
    for _ in range(40):
        env.step(SILENCE)
    t = env.data.time
    law = np.exp(-decay * t) * (start * np.cos(damped * t) + (speed + decay * start) / damped * np.sin(damped * t))
    print(f"after {1e3 * t:.0f} ms {1e3 * rise.qpos[0]:.3f} mm, by the law {1e3 * law:.3f} mm")
    assert rise.qpos[0] == pytest.approx(law, abs=0.02 * largest)


def test_the_right_answer_pays_ten_a_wrong_one_costs_a_ninth_and_silence_nothing() -> None:
    env = Read(level=3, split="test")
    right, info = played(env, env.best_action)
    assert sum(right) == pytest.approx(10.0) and info["is_success"] and info["performance"] == 1.0

    def wrong() -> NDArray[Any]:
        say, *numbers = env.best_action()
        return np.array([say, *np.roll(numbers, 1)], np.float32)

    rewards, info = played(env, wrong)
    assert sum(rewards) == pytest.approx(-10 / 9) and not info["is_success"] and info["performance"] == 0.0
    rewards, info = played(env, lambda: SILENCE)
    assert sum(rewards) == 0.0 and not info["is_success"] and len(rewards) < env.most_steps


def test_an_episode_follows_from_its_number() -> None:
    env = Read(level=(1, 5))
    for options in ({"episode": 7, "split": "test", "level": 5}, {"episode": 8, "level": 2}):
        infos = [env.reset(seed=seed, options=options)[1] for seed in (0, 1)]
        assert infos[0]["episode_number"] == options["episode"] and infos[0]["level"] == options["level"]
        assert data_equivalence(infos[0], infos[1], exact=True)
    assert {env.reset(seed=seed)[1]["level"] for seed in range(40)} == {1, 2, 3, 4, 5}


def test_wrong_use_is_refused_in_a_line() -> None:
    env = Read()
    env.reset(seed=0)
    for wrong in (
        lambda: Read(level=6),
        lambda: Read(split="tests"),
        lambda: env.reset(options={"episode": -1}),
        lambda: env.step(np.zeros(2)),
        lambda: make_task("Red"),
    ):
        with pytest.raises(InputError) as caught:
            wrong()
        assert "\n" not in str(caught.value)


def test_the_camera_looks_for_the_end_of_a_step_unless_told_otherwise() -> None:
    short, whole = make_task("Read", obs="spikes"), make_task("Read", obs="spikes", block_frames=40)
    for env in (short, whole):
        env.reset(seed=0)
        env.step(SILENCE)
    np.testing.assert_array_equal(short.blocks.spikes, whole.blocks.spikes[:, -8:])
    short.close()
    whole.close()


@pytest.mark.parametrize("level", [1, 3, 5])
def test_the_light_of_a_block_is_within_five_percent_of_that_of_many_more_keys(level: int) -> None:
    def blocks(**options: Any) -> NDArray[Any]:
        env = make_task("Read", level=level, split="test", **options)
        env.reset(seed=1)
        over, seen = False, []
        while not over:
            _, _, over, _, _ = env.step(SILENCE)
            seen.append(mean_light(env.light, 8))
        env.close()
        return np.stack(seen)

    few, many = blocks(), blocks(motion_per_key=0.25)
    passing = np.abs(many - many[0]).max(axis=(1, 2)) > 1e-4
    error = np.sqrt(np.mean((few - many)[passing] ** 2)) / many[passing].mean()
    print(f"level {level}: {100 * error:.1f} % rms")
    assert passing.sum() > 2 and 0 < error < 0.05


def mean_light(keys: Keyframes, frames: int) -> NDArray[Any]:
    """(H, W) of the last frames."""
    times = np.linspace(keys.frame[-1] - frames, keys.frame[-1], 16 * frames + 1)
    return np.asarray(np.mean([keys.at(t) for t in times], axis=0))


def test_a_reader_from_pictures_alone_reads() -> None:
    env = make_task("Read", level=2, split="test", obs="tfp", obs_state=True, obs_inner=True)
    bare: Any = env.unwrapped
    reader = ReadController(bare)
    for seed in range(3):
        observation, _ = env.reset(seed=seed)
        reader.begin()
        over = False
        while not over:
            observation, _, over, _, info = env.step(reader.act(observation))
        assert info["is_success"]
    env.close()
