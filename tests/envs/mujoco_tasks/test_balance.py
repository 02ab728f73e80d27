"""Balance: rods fall as the law says, the oracle holds them and doing nothing does not, and pictures alone suffice."""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence

import spikecam_env.envs  # noqa: F401
from spikecam_env.errors import InputError

pytest.importorskip("mujoco", reason="the extra mujoco is not installed: pip install 'spikecam-env[mujoco]'")

from scenes.mujoco import MujocoLight
from spikecam_env.agents.controllers.balance import BalanceController
from spikecam_env.envs.mujoco_tasks import make_task
from spikecam_env.envs.mujoco_tasks.balance import LEVEL, PUFF_STEPS, ROD_MASS, STRONGEST, Balance, puffs
from spikecam_env.envs.mujoco_tasks.task import LEVELS, STEP_S
from spikecam_env.envs.mujoco_tasks.upright import GRAVITY, fall_time

SMALL, FULL = "spikecam_env/Balance-v1", "spikecam_env/Balance-Full-v1"


@pytest.mark.parametrize("name, shape", [(SMALL, (1, 64, 64)), (FULL, (1, 250, 400))])
def test_check_env_is_clean(name: str, shape: tuple[int, int, int]) -> None:
    env = gymnasium.make(name)
    assert env.observation_space.shape == shape
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*infinity")  # of the encoders' space
        check_env(env.unwrapped, skip_render_check=True)
        warnings.filterwarnings("ignore", message=".*different from the unwrapped version")  # the camera is a wrapper
        check_env(env, skip_render_check=True)
    env.close()


@pytest.mark.parametrize("level", LEVELS)
def test_the_oracle_holds_the_rod_and_doing_nothing_or_anything_does_not(level: int) -> None:
    env, still, rng = Balance(level=level, split="test"), np.zeros(1, np.float32), np.random.default_rng(0)
    acts = {"oracle": env.best_action, "nothing": lambda: still, "random": lambda: rng.uniform(-1, 1, 1)}
    held = {name: np.mean([env.played(seed, act) for seed in range(25)]) for name, act in acts.items()}
    print(f"level {level}: {held}")
    assert held["oracle"] > 0.95 and held["nothing"] < 0.1 and held["random"] < 0.1


@pytest.mark.parametrize("level", LEVELS)
def test_a_small_lean_grows_as_the_exponential_of_time_over_the_fall_time(level: int) -> None:
    """Before the first puff.  The law is of a heavy cart; this one weighs 83 of the longest rods, which makes T shorter
    by 3/8 of that share, 0.45 %, and so the growth over 2 T larger by 0.9 %."""
    env, start = Balance(level=level), 1e-3
    env.reset(seed=0)
    rod, length = env.data.joint(f"rod{level}"), LEVEL[level].length
    rod.qpos[0], rod.qvel[0] = start, start / fall_time(length)
    steps = int(2 * fall_time(length) / STEP_S)
    for _ in range(steps):
        env.step([0.0])
    end, upright = env.target()
    grown = np.arcsin((end - upright)[0] / length) / start
    print(
        f"level {level}: {grown:.3f} times in {steps} ms, by the law {np.exp(steps * STEP_S / fall_time(length)):.3f}"
    )
    assert grown == pytest.approx(np.exp(steps * STEP_S / fall_time(length)), rel=0.03)


def test_the_largest_action_accelerates_the_cart_by_half_of_gravity() -> None:
    env = Balance(level=3)
    env.reset(seed=0)
    for _ in range(10):
        sensed = env.step([1.0])[0]
    assert sensed[1] * np.sqrt(GRAVITY * LEVEL[3].length) == pytest.approx(0.01 * STRONGEST * GRAVITY, rel=0.02)


@pytest.mark.parametrize("level", LEVELS)
def test_a_puff_alone_is_never_more_than_the_cart_can_hold_and_comes_after_time_to_right_the_rod(level: int) -> None:
    """u = angle + T angle' changes by 1.5 F t T / (m l)."""
    length, mass = LEVEL[level].length, ROD_MASS * LEVEL[level].length
    for seed in range(100):
        force = puffs(np.random.default_rng(seed), LEVEL[level])
        at = np.flatnonzero(force)
        assert not len(at) or at[0] * STEP_S > 2.4 * fall_time(length)
        change = 1.5 * np.abs(force) * PUFF_STEPS * STEP_S * fall_time(length) / (mass * length)
        assert change.max() < STRONGEST


@pytest.mark.parametrize("name", [SMALL, FULL])
@pytest.mark.parametrize("level", LEVELS)
def test_the_whole_track_and_a_rod_on_it_are_in_the_picture(name: str, level: int) -> None:
    env: Any = gymnasium.make(name, level=level).unwrapped
    env.reset(seed=0)
    reach, length = LEVEL[level].reach, LEVEL[level].length
    middle = env.target()[1][0] - env.sensed()[0] * reach
    ends = [(middle + side * reach, 0.0, up) for side in (-1, 1) for up in (0.0, length)]
    seen, (rows, columns) = env.places(np.array(ends)), env.shape
    assert (seen >= 0).all() and (seen <= (columns - 1, rows - 1)).all()
    assert seen[0, 1] - seen[1, 1] >= 6 * rows / 64  # the rod's pixels
    env.close()


@pytest.mark.parametrize("level", [1, 5])
def test_the_replay_of_every_step_is_exact(level: int) -> None:
    env = Balance(level=level)
    env.reset(seed=1)
    light = MujocoLight(env.model, env.data, (16, 16), camera="eye", supersample=1)
    light.begin()
    over = False
    while not over:
        over = env.step(env.best_action())[2]
        light.step()
        assert light.exact
    assert env.steps_played == env.most_steps
    light.close()


def test_same_seed_same_bits_whatever_was_played_before() -> None:
    def rollout(env: Any, seed: int) -> list[Any]:
        return [env.reset(seed=seed), *(env.step([0.3]) for _ in range(5))]

    first, other = (gymnasium.make(SMALL, level=(1, 5), obs_inner=True) for _ in range(2))
    rollout(other, 8)
    assert data_equivalence(rollout(first, 3), rollout(other, 3), exact=True)
    first.close()
    other.close()


def test_level_episode_and_split_are_options() -> None:
    env = Balance(level=(1, 5))
    assert len({env.reset(seed=seed)[1]["level"] for seed in range(20)}) == 5
    chosen = {"level": 5, "episode": 7, "split": "test"}
    one, other = (env.reset(seed=seed, options=chosen)[1] for seed in (0, 1))
    assert one["level"] == 5 and one["episode_number"] == 7 and (one["target"] == other["target"]).all()
    trained = env.reset(options=chosen | {"split": "train"})[1]
    assert (trained["target"] != one["target"]).any()


def test_wrong_use_ends_in_one_line() -> None:
    with pytest.raises(InputError, match=r"level is \[5, 1\]|level is \(5, 1\)"):
        make_task("Balance", level=(5, 1))
    with pytest.raises(InputError, match="give the bare Balance of one level"):
        BalanceController(Balance(level=(1, 5)))
    with pytest.raises(InputError, match="episode = 1000; the test split has episodes 0 to 999"):
        Balance(split="test").reset(options={"episode": 1000})


def test_pictures_and_encoders_suffice_to_hold_a_rod_of_ten_centimetres() -> None:
    env = make_task("Balance", level=3, split="test", obs="tfp", obs_state=True, obs_inner=True)
    controller, held = BalanceController(env.unwrapped), []
    for episode in range(2):
        observation, info = env.reset(seed=episode, options={"episode": episode})
        controller.begin()
        over = False
        while not over:
            observation, _, over, _, info = env.step(controller.act(observation))
        held.append(info["is_success"])
    env.close()
    assert all(held)
