"""Every task by MuJoCo: checkers and learners of other people take it, and wrong use ends in one line."""

from __future__ import annotations

import importlib
import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

pytest.importorskip("mujoco", reason="the extra mujoco is not installed: pip install 'spikecam-env[mujoco]'")

import spikecam_env.envs  # noqa: F401
from spikecam_env.agents import evaluate
from spikecam_env.agents.controllers import CONTROLLERS
from spikecam_env.envs.mujoco_tasks import MUJOCO_TASKS, make_task
from spikecam_env.envs.registration import MUJOCO_ENVIRONMENTS, MUJOCO_NAMES
from spikecam_env.errors import InputError

SMALL: dict[str, Any] = {"shape": (36, 36)}
"""36 x 36 is the least that stable-baselines3's usual network takes."""
CAMERAS = ("tfp", "frame120", "events", "rate")
"""One of each kind of camera, and the denoised picture."""


def test_every_task_has_a_name_an_id_and_a_classical_controller() -> None:
    assert tuple(MUJOCO_TASKS) == MUJOCO_NAMES
    assert set(MUJOCO_NAMES) <= set(CONTROLLERS)
    streams = [task.stream for task in MUJOCO_TASKS.values()]
    assert len(set(streams)) == len(streams)


@pytest.mark.parametrize("name", MUJOCO_ENVIRONMENTS)
def test_checkers_of_gymnasium_and_stable_baselines_are_content(name: str) -> None:
    check = pytest.importorskip("stable_baselines3.common.env_checker", reason="needs stable-baselines3").check_env
    env = gymnasium.make(name, **SMALL, level=5, obs=CAMERAS[list(MUJOCO_ENVIRONMENTS).index(name) % len(CAMERAS)])
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*is different from the unwrapped version.*")
        check_env(env, skip_render_check=True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check(env)
    env.close()


@pytest.mark.parametrize("name", MUJOCO_NAMES)
def test_specs_of_torchrl_are_those_of_what_is_returned(name: str) -> None:
    pytest.importorskip("torchrl", reason="needs torchrl")
    wrapper = importlib.import_module("torchrl.envs").GymWrapper
    check = importlib.import_module("torchrl.envs.utils").check_env_specs
    env = wrapper(gymnasium.make(f"spikecam_env/{name}-v1", **SMALL, obs_state=True, obs_inner=True))
    check(env)
    env.close()


@pytest.mark.parametrize("name", MUJOCO_NAMES)
def test_stable_baselines_learns(name: str) -> None:
    ppo = pytest.importorskip("stable_baselines3", reason="needs stable-baselines3").PPO
    env = gymnasium.make(f"spikecam_env/{name}-v1", **SMALL)
    model = ppo("CnnPolicy", env, n_steps=32, batch_size=16, n_epochs=1, seed=0)
    before = [weights.detach().clone() for weights in model.policy.parameters()]
    model.learn(32)
    assert any((now != old).any() for now, old in zip(model.policy.parameters(), before, strict=True))
    result = evaluate(model, f"{name}-v1", episodes=2, **SMALL)
    assert 0 <= result.performance <= 1 and result.oracle == 1
    env.close()


@pytest.mark.parametrize("name", MUJOCO_NAMES)
def test_a_vector_plays_on_when_episodes_end(name: str) -> None:
    mode = "sync"
    envs = gymnasium.make_vec(f"spikecam_env/{name}-v1", 2, mode, shape=(16, 16), level=(1, 5), obs_inner=True)
    envs.reset(seed=1)
    ended, rng = 0, np.random.default_rng(0)
    shape = envs.action_space.shape
    assert shape is not None
    for _ in range(450):
        _, _, terminated, truncated, info = envs.step(rng.uniform(-1, 1, shape))
        ended += int((terminated | truncated).sum())
        assert {"performance", "target", "level"} <= set(info)
        if ended >= 2:
            break
    envs.close()
    assert ended >= 2, "no episode ended"


@pytest.mark.parametrize(
    "wrong, words",
    [
        ({"level": 0}, "level"),
        ({"level": 2.5}, "level"),
        ({"level": (4, 2)}, "the lowest, then the highest"),
        ({"level": "hard"}, "level"),
        ({"split": "all"}, "split"),
        ({"shape": (0, 64)}, "shape"),
        ({"render_mode": "human"}, "render_mode"),
        ({"supersample": 99}, "supersample"),
        ({"obs": "video"}, "video"),
        ({"levl": 3}, "(level?)"),
        ({"frames_per_step": 20}, "block_frames"),
        ({"task": "Retrun"}, "Return?"),
    ],
    ids=str,
)
def test_wrong_use_ends_in_one_line_that_names_it(wrong: dict[str, Any], words: str) -> None:
    given = {"task": "Return", **wrong}
    with pytest.raises(InputError) as caught:
        make_task(given.pop("task"), **given)
    assert words in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("action", [[np.nan, 0.0], [0.0], "up", None], ids=str)
def test_an_action_that_is_none_is_refused(action: Any) -> None:
    env = make_task("Return", shape=(16, 16))
    env.reset(seed=0)
    with pytest.raises(InputError, match="action"):
        env.step(action)
    env.close()
