"""How long episodes of scenes last: as `max_episode_steps` says, until the scene starts over."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

import spikecam_env.envs  # noqa: F401
from spikecam_env.envs.oracle import oracle
from spikecam_env.envs.rotating_disk import RotatingDiskEnv
from spikecam_env.envs.scene import SceneEnv
from spikecam_env.errors import InputError
from tests.envs.kinds import DISK

SMALL: dict[str, Any] = {"shape": (16, 24), "frames_per_step": 8}
STILL = "spikecam_env/Disk-v0"


def played(env: Any, most: int = 560) -> tuple[int, dict[str, Any]]:
    """Steps of the oracle's episode, `most` at most, and its last info."""
    env.reset(seed=0)
    for step in range(1, most + 1):
        *_, terminated, truncated, info = env.step(oracle(env.unwrapped.course))
        if terminated or truncated:
            return step, info
    return most + 1, info


@pytest.mark.parametrize("name", [STILL, DISK])
def test_an_episode_is_as_long_as_max_episode_steps_says(name: str) -> None:
    for given, steps in ((None, 500), (530, 530), (20, 20), (-1, 561)):
        found, info = played(gymnasium.make(name, **SMALL, max_episode_steps=given))
        print(f"{name} {given}: {found} steps, performance {info['performance']:.3f}")
        assert found == steps and 0 <= info["performance"] <= 1
    with pytest.raises(ValueError, match="positive"):
        gymnasium.make(name, **SMALL, max_episode_steps=0)


def test_a_longer_episode_has_the_share_of_all_its_steps() -> None:
    env: Any = gymnasium.make(STILL, **SMALL, max_episode_steps=530)
    _, info = played(env)
    assert info["performance"] == env.unwrapped.standing.steps_on / 530


def test_an_episode_ends_when_its_scene_starts_over_and_info_says_so() -> None:
    env: Any = gymnasium.make("spikecam_env/Ball-v0", shape=(16, 24), max_episode_steps=2000)
    steps, info = played(env)
    assert steps < 500 and info["scene_over"] is True
    assert played(gymnasium.make(STILL, **SMALL))[1]["scene_over"] is False


@pytest.mark.parametrize("steps", [12, 520])
def test_vectors_are_as_long(steps: int) -> None:
    for mode in ("sync", "vector_entry_point"):
        cameras: Any = gymnasium.make_vec(STILL, num_envs=2, vectorization_mode=mode, max_episode_steps=steps, **SMALL)
        cameras.reset(seed=0)
        envs = [env.unwrapped for env in cameras.unwrapped.envs]
        for step in range(1, steps + 1):
            actions = np.stack([oracle(env.course) for env in envs])
            *_, terminated, truncated, _ = cameras.step(actions)
            assert not terminated.any() and truncated.all() == (step == steps)
        cameras.close()


@pytest.mark.parametrize("given", [-1, None, 3, 0])
def test_the_native_vector_takes_the_numbers_that_a_single_environment_takes(given: int | None) -> None:
    options: dict[str, Any] = {"vectorization_mode": "vector_entry_point", "max_episode_steps": given, **SMALL}
    if given == 0:
        with pytest.raises(InputError, match="max_episode_steps = 0"):
            gymnasium.make_vec(STILL, num_envs=1, **options)
        return
    cameras: Any = gymnasium.make_vec(STILL, num_envs=1, **options)
    assert cameras.unwrapped.max_episode_steps == {-1: None, None: 500, 3: 3}[given]
    cameras.reset(seed=0)
    ends = [bool(cameras.step(np.zeros((1, 2), np.float32))[3][0]) for _ in range(3)]
    assert ends == [False, False, given == 3]
    cameras.close()


def test_a_class_made_by_hand_ends_after_its_own_steps() -> None:
    assert played(RotatingDiskEnv(**SMALL, steps=7))[0] == 7
    assert played(SceneEnv(scene="disk", **SMALL, steps=7))[0] == 7
