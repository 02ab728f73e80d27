"""Dodge: only whoever sees the gap gets through, balls obey mechanics, and same seeds give same bits."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from spikecam_env.envs.observations import CameraView
from spikecam_env.envs.registration import register
from spikecam_env.errors import InputError

pytest.importorskip("mujoco", reason="the extra mujoco is not installed: pip install 'spikecam-env[mujoco]'")

from scenes.mujoco import MujocoLight
from spikecam_env.agents.controllers.dodge import DodgeController
from spikecam_env.envs.mujoco_tasks import make_task
from spikecam_env.envs.mujoco_tasks.dodge import CAN, LEVEL, MASS, Dodge
from spikecam_env.envs.mujoco_tasks.task import EYE, STEP_S

register()


def played(env: Dodge, act: Callable[[], Any], episode: int) -> float:
    """The performance of an episode."""
    env.reset(options={"episode": episode})
    over = False
    while not over:
        _, _, terminated, truncated, info = env.step(act())
        over = terminated or truncated
    return float(info["performance"])


def success(env: Dodge, act: Callable[[], Any], episodes: int) -> float:
    share = float(np.mean([played(env, act, episode) for episode in range(episodes)]))
    print(f"level {env.levels[0]}: {share:.2f} of {episodes} episodes")
    return share


def late(env: Dodge, steps: int) -> Callable[[], Any]:
    """The oracle's action of so many steps ago."""
    waiting: list[Any] = []

    def act() -> Any:
        if env.steps_played == 0:
            waiting[:] = [np.zeros(2, np.float32)] * steps
        waiting.append(env.best_action())
        return waiting.pop(0)

    return act


def test_the_checker_of_gymnasium_passes() -> None:
    env = gymnasium.make("spikecam_env/Dodge-v1")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that the environment has a wrapper
        check_env(env, skip_render_check=True)
    env.close()


@pytest.mark.parametrize("level", [4, 5])
def test_the_oracle_gets_through_and_whoever_does_not_look_is_hit(level: int) -> None:
    env = Dodge(level=level, split="test")
    env.action_space.seed(0)
    assert success(env, env.best_action, 50) > 0.95
    assert success(env, lambda: np.zeros(2, np.float32), 50) < 0.1
    assert success(env, env.action_space.sample, 25) < 0.2


@pytest.mark.parametrize("corner", [(-1, -1), (1, -1), (-1, 1), (1, 1)])
def test_no_place_is_safe_to_wait_in(corner: tuple[int, int]) -> None:
    assert success(Dodge(level=5, split="test"), lambda: np.array(corner, np.float32), 8) == 0


def test_fifteen_milliseconds_late_is_too_late_at_level_5_and_not_at_level_1() -> None:
    slow, fast = Dodge(level=1, split="test"), Dodge(level=5, split="test")
    assert success(slow, late(slow, 15), 5) == 1
    assert success(fast, late(fast, 15), 15) < 0.2


def test_balls_fly_at_the_level_s_speed_and_a_hit_keeps_the_momentum() -> None:
    """Of puck and balls together, but for what motors can add until the ball has left the puck."""
    env, still, steps = Dodge(level=3, split="test"), np.zeros(2, np.float32), 5
    env.reset(options={"episode": 0})
    over, before = False, np.zeros((15, 2))
    while not over:
        before = env.data.qvel.reshape(-1, 2).copy()
        _, _, over, _, _ = env.step(still)
    speed = np.hypot(*before[1:].T)
    flying, most = speed[speed > 0] / LEVEL[3].speed, 1 + 1e-9
    for _ in range(steps):
        env.step(still)
    change = np.array([CAN.mass, *[MASS] * 14])[:, None] * (env.data.qvel.reshape(-1, 2) - before)
    given, left = np.hypot(*change[1:].T).max(), np.abs(change.sum(axis=0)).max()
    motors = CAN.mass * CAN.acceleration * STEP_S * (steps + 1)
    print(f"a ball gave {given:.2f} kg m/s; the sum changed by {left:.2f}, motors give {motors:.2f} at most")
    assert given > MASS * LEVEL[3].speed / 2
    assert left <= motors
    assert ((flying > 0.95 / most) & (flying < most)).sum() == 4


def test_light_between_steps_is_of_the_poses_that_there_were() -> None:
    env = Dodge(level=5, split="test")
    env.reset(seed=1)
    light = MujocoLight.of_env(env, CameraView((16, 16), 40, 40_000.0), camera=EYE)
    light.begin()
    over = False
    while not over:
        _, _, over, _, _ = env.step(env.best_action())
        light.step()
        assert light.exact
    light.close()


def test_same_seed_same_bits_and_options_choose_the_episode() -> None:
    films = []
    for _ in range(2):
        env = make_task("Dodge", level=(1, 5), split="test")
        env.action_space.seed(0)
        pictures = [env.reset(seed=3, options={"episode": 7, "level": 4})[0]]
        for _ in range(30):
            picture, _, _, _, info = env.step(env.action_space.sample())
            pictures.append(picture)
        films.append(np.array(pictures))
        assert (info["level"], info["episode_number"]) == (4, 7)
        env.close()
    assert np.array_equal(films[0], films[1]) and films[0].any()


@pytest.mark.parametrize(
    "options, says",
    [({"level": 6}, "level"), ({"episode": 1000}, "0 to 999"), ({"split": "exam"}, "split"), ({"speed": 1}, "speed")],
)
def test_wrong_options_are_named_in_a_line(options: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=says) as error:
        Dodge(split="test").reset(options=options)
    assert "\n" not in str(error.value)


def test_wrong_actions_are_named_in_a_line() -> None:
    env = Dodge()
    env.reset(seed=0)
    with pytest.raises(InputError, match="action"):
        env.step([np.nan, 0.0])


@pytest.mark.parametrize("shape", [(64, 64), (125, 200)])
def test_a_controller_gets_through_by_pictures_alone(shape: tuple[int, int]) -> None:
    env = make_task("Dodge", level=2, split="test", shape=shape, obs_inner=True)
    bare = env.unwrapped
    assert isinstance(bare, Dodge)
    controller, over = DodgeController(bare), False
    observation, _ = env.reset(seed=0, options={"episode": 0})
    controller.begin()
    while not over:
        observation, _, over, _, info = env.step(controller.act(observation))
    env.close()
    assert info["is_success"]
