"""Episodes played without their pictures: as the environment plays them, and solved by the oracle at every scene id."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import gymnasium
import numpy as np
import pytest

import spikecam_env.envs  # noqa: F401
from spikecam_env.envs.course import StepOutcome, steps_of
from spikecam_env.envs.oracle import oracle
from spikecam_env.envs.registration import ENVIRONMENTS, SMALL_TASKS, TASK_NAMES

SEEDS = (0,)
"""Of the episodes that are played at every scene id: their scenes move differently."""


def nothing(course: StepOutcome) -> Any:
    return np.zeros(course.drive.axes, np.float32)


@pytest.mark.parametrize("name", ["spikecam_env/Saccade-v1", "spikecam_env/Exposure-v1"])
def test_a_course_is_the_episode_that_the_environment_plays(name: str) -> None:
    env: Any = gymnasium.make(name, split="test").unwrapped
    courses = list(steps_of(env.opening(4), oracle))
    env.reset(seed=4)
    for course in courses:
        *_, terminated, truncated, info = env.step(oracle(env.course))
        assert env.gaze == course.gaze.stop and env.standing == course.standing
        assert info["performance"] == course.performance and info["is_success"] == course.is_success
        assert (terminated, truncated) == (course.terminated, course.truncated)
    assert terminated or truncated


@pytest.mark.slow
@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_the_oracle_follows_every_scene_and_doing_nothing_does_not(name: str) -> None:
    env: Any = gymnasium.make(name, shape=(64, 64)).unwrapped
    best, rest = [], []
    for seed in SEEDS:
        begun = env.opening(seed)
        (x, y), ends = begun.standing.place, [list(steps_of(begun, policy)) for policy in (oracle, nothing)]
        assert 0 <= x <= 63 and 0 <= y <= 63 and min(map(len, ends)) > 3
        best.append(ends[0][-1].performance)
        rest.append(ends[1][-1].performance)
    print(f"{name}: oracle {np.mean(best):.3f}, nothing {np.mean(rest):.3f}")
    assert np.mean(best) > 0.9 and np.mean(rest) < 0.5 * np.mean(best)


def test_no_task_plays_the_paths_of_another() -> None:
    """Under the same number: the headings of the target, whatever its speed."""
    ways = {}
    for name in TASK_NAMES:
        env: Any = gymnasium.make(f"spikecam_env/{name}-v1").unwrapped
        begun = env.opening(0, {"episode": 7})
        places = [np.array(begun.episode.scene.places(40.0 * step)[begun.episode.target]) for step in range(12)]
        ways[name] = np.diff(places, axis=0) / np.linalg.norm(np.diff(places, axis=0), axis=1, keepdims=True)
    for one, other in combinations(TASK_NAMES, 2):
        assert np.abs(ways[one] - ways[other]).max() > 0.1, (one, other)


def test_an_episode_follows_from_its_number_alone() -> None:
    for name in SMALL_TASKS:
        env: Any = gymnasium.make(name).unwrapped
        one, same, other = (env.opening(seed, {"episode": number}) for seed, number in ((0, 5), (1, 5), (0, 6)))
        assert one.standing == same.standing != other.standing and other.episode.number == 6
