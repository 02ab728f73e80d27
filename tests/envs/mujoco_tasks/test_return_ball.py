"""Return-v1: the flight of the ball, the paddle and its motors, the verdict, and the classical controller."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the extra mujoco is not installed: pip install 'spikecam-env[mujoco]'")

import spikecam_env.envs  # noqa: F401
from scenes.mujoco import MujocoLight
from spikecam_env.envs.mujoco_tasks import make_task
from spikecam_env.envs.mujoco_tasks.return_ball import AWAY, BEND, CAN, LEVEL, REACH, Return
from spikecam_env.envs.mujoco_tasks.task import EYE, STEP_S


def played(env: Return, seed: int, act: Any = None, level: int | None = None) -> list[dict[str, Any]]:
    """Places and speeds of an episode, step by step; act: () -> action, default none."""
    env.reset(seed=seed, options={} if level is None else {"level": level})
    rows, over = [], False
    while not over:
        *_, terminated, truncated, info = env.step(np.zeros(2) if act is None else act())
        over = terminated or truncated
        ball = env.data.joint("ball")
        rows.append({"ball": ball.qpos[:3].copy(), "speed": ball.qvel[:3].copy(), "inner": env.sensed(), **info})
    return rows


@pytest.mark.parametrize("level", LEVEL)
def test_a_ball_arrives_where_and_when_it_should_in_free_flight(level: int) -> None:
    env = Return(level=level)
    for seed in range(5):
        rows = played(env, seed)
        crosses = next(n for n, row in enumerate(rows) if row["ball"][0] <= 0)
        arrival_s = AWAY / LEVEL[level].speed
        assert (crosses + 1) * STEP_S == pytest.approx(arrival_s, abs=1.01 * STEP_S)
        before, after = rows[crosses - 1]["ball"], rows[crosses]["ball"]
        share = before[0] / (before[0] - after[0])
        crossing = env.target()[0][1:]
        assert before[1:] + share * (after - before)[1:] == pytest.approx(crossing, abs=2e-3)
        assert np.abs(crossing).max() <= REACH


def test_spin_bends_the_way_as_much_at_every_speed() -> None:
    sags: dict[int, list[float]] = {1: [], 5: []}
    for level, its in sags.items():
        env = Return(level=level)
        for seed in range(20):
            rows = played(env, seed)
            y = np.array([row["ball"][1] for row in rows])
            x = np.array([row["ball"][0] for row in rows])
            middle = np.interp(0.5 * AWAY, x[::-1], y[::-1])
            ends = np.interp([0.02 * AWAY, 0.98 * AWAY], x[::-1], y[::-1])
            its.append(abs(middle - ends.mean()))
    slow, fast = (max(its) for its in sags.values())
    assert slow == pytest.approx(fast, rel=0.15)
    assert 0.4 < fast / (BEND * (0.96 * AWAY) ** 2 / 8) <= 1.0


def test_the_paddle_obeys_its_motors() -> None:
    env = Return(level=1)
    rows = played(env, 0, lambda: np.array([1.0, -1.0]))
    speed = np.array([row["inner"][2:] for row in rows]) * CAN.top
    assert np.abs(np.diff(speed[:100], axis=0)).max() / STEP_S == pytest.approx(CAN.acceleration, rel=0.01)
    place = rows[100]["inner"][:2]
    assert place == pytest.approx([-1.0, -1.0], abs=0.01), "to the right is to negative y, and down"


@pytest.mark.parametrize("level", LEVEL)
def test_the_oracle_returns_every_ball_and_a_paddle_at_rest_none(level: int) -> None:
    env = Return(level=level, split="test")
    ends = np.array([env.ends_of(seed) for seed in range(20)])
    assert ends.mean(axis=0).tolist() == [0.0, 1.0]


def test_success_is_a_ball_that_flies_back_above_the_net() -> None:
    env = Return(level=3, split="test")
    rows = played(env, 0, env.best_action)
    assert rows[-1]["is_success"]
    back, up = rows[-1]["speed"][0], rows[-1]["speed"][2]
    assert back > 0.7 * LEVEL[3].speed, "the paddle sends it back with most of its speed"
    assert up > 0


def test_light_between_steps_is_of_the_poses_of_the_physics() -> None:
    env = Return(level=5)
    env.reset(seed=0)
    light = MujocoLight(env.model, env.data, (32, 32), camera=EYE, supersample=1)
    light.begin()
    for _ in range(40):
        env.step(env.best_action())
        light.step()
        assert light.exact
    light.close()


def test_the_same_seed_gives_the_same_bits_and_another_episode_others() -> None:
    def picture(seed: int, **options: Any) -> np.ndarray:
        env = make_task("Return", level=4, obs="spikes")
        env.reset(seed=seed, options=options)
        for _ in range(5):
            spikes, *_ = env.step(np.ones(2))
        env.close()
        return np.asarray(spikes)

    assert np.array_equal(picture(1), picture(1))
    assert not np.array_equal(picture(1), picture(2))
    assert not np.array_equal(picture(1, episode=3), picture(1, episode=4))


def test_a_faster_level_is_darker_and_fuller() -> None:
    env = gymnasium.make("spikecam_env/Return-v1", level=(1, 5), split="test")
    means = {}
    for level in (1, 3, 5):
        picture, info = env.reset(seed=0, options={"level": level, "episode": 7})
        assert (info["level"], info["episode_number"]) == (level, 7)
        means[level] = picture.mean()
    env.close()
    assert means[1] > 2 * means[3] > 4 * means[5] > 0
