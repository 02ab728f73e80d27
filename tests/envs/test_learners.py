"""The ids in other people's learners: Gymnasium's statistics, stable-baselines3, RLlib on a local Ray cluster."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import warnings
from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium
import numpy as np
import pytest

import spikecam_env.envs  # noqa: F401
from spikecam_env.agents import evaluate
from spikecam_env.agents.evaluation import stacked
from spikecam_env.envs.observations import OBSERVATIONS
from spikecam_env.envs.registration import SMALL_TASKS, TASK_ENVIRONMENTS
from tests.envs import rllib
from tests.envs.kinds import DISK, KINDS

SMALL: dict[str, Any] = {"shape": (36, 36), "frames_per_step": 8}
"""36 x 36 is the least that stable-baselines3's usual network takes."""
TRACK = "spikecam_env/Track-v1"
NO_PICTURES = {
    "spikes": "image but its `dtype` is",
    "isi": "image but its `dtype` is",
    "packed": "unconventional shape",
}
"""Observations that are no uint8 pictures, and the warnings of stable-baselines3: another network is needed."""


PICTURES = [name for name in OBSERVATIONS if name not in NO_PICTURES]


def test_statistics_of_episodes_are_kept_beside_the_info_of_a_task() -> None:
    env = gymnasium.wrappers.RecordEpisodeStatistics(gymnasium.make("spikecam_env/Catch-v1", **SMALL))
    _, info = env.reset(seed=0)
    number, over = info["episode_number"], False
    while not over:
        _, _, terminated, truncated, info = env.step(np.zeros(1, np.float32))
        over = terminated or truncated
    assert info["episode_number"] == number and info["episode"]["l"] >= 1


def checked(name: str, **options: Any) -> None:
    """By stable-baselines3, every warning an error."""
    check = pytest.importorskip("stable_baselines3.common.env_checker", reason="needs stable-baselines3").check_env
    env = gymnasium.make(name, **SMALL, **options)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check(env)
    env.close()


@pytest.mark.parametrize("name", [*SMALL_TASKS, DISK])
def test_stable_baselines_is_content_with_every_task_and_every_picture(name: str) -> None:
    """Every picture in one task at least, and every task with two; the state beside it in every other.  The `-Full` ids
    have another default shape, and are the same at this one."""
    place = [*SMALL_TASKS, DISK].index(name)
    for i in (place, place + 1):
        checked(name, obs=PICTURES[i % len(PICTURES)])
    if place % 2:
        checked(name, obs="tfp", obs_state=True)


@pytest.mark.parametrize("name", sorted(set(TASK_ENVIRONMENTS) - set(SMALL_TASKS)))
def test_stable_baselines_is_content_with_every_large_task(name: str) -> None:
    checked(name, obs="tfp")


@pytest.mark.parametrize("name, obs", list(zip(KINDS, PICTURES, strict=False)))
def test_stable_baselines_is_content_with_every_kind_of_scene(name: str, obs: str) -> None:
    """Each with one of the observations in turn; `test_scene_environment` has Gymnasium's checks of every id."""
    checked(name, obs=obs)


@pytest.mark.parametrize("obs", NO_PICTURES)
def test_an_observation_that_is_no_picture_is_named_and_nothing_else_is_wrong(obs: str) -> None:
    with pytest.raises(UserWarning, match=NO_PICTURES[obs]):
        checked(TRACK, obs=obs)
    check = importlib.import_module("stable_baselines3.common.env_checker").check_env
    check(gymnasium.make(TRACK, **SMALL, obs=obs), warn=False)


def test_stable_baselines_learns_from_spikes() -> None:
    """They are no picture, so its network is not to divide them by 255."""
    ppo = pytest.importorskip("stable_baselines3", reason="needs stable-baselines3").PPO
    env = gymnasium.make(TRACK, **SMALL, obs="spikes")
    model = ppo("CnnPolicy", env, n_steps=16, batch_size=16, n_epochs=1, policy_kwargs={"normalize_images": False})
    before = [weights.detach().clone() for weights in model.policy.parameters()]
    model.learn(16)
    assert any((now != old).any() for now, old in zip(model.policy.parameters(), before, strict=True))


def example() -> ModuleType:
    pytest.importorskip("stable_baselines3", reason="needs stable-baselines3")
    path = Path(__file__).parents[2] / "examples" / "sb3_ppo.py"
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 60
    spec = importlib.util.spec_from_file_location("sb3_ppo", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_example_learns_and_is_judged() -> None:
    """A few hundred steps teach it nothing; the model changes, acts within its range, and gets a score."""
    sb3_ppo = example()
    model = sb3_ppo.learned("Catch-v1", 256, count=4, rollout=64)
    assert model.num_timesteps == 256 and model.observation_space.shape == (sb3_ppo.PICTURES, 64, 64)
    result = evaluate(model, "Catch-v1", stack=sb3_ppo.PICTURES, episodes=3)
    assert 0 <= result.performance <= 1 and len(result.performances) == 3


def test_a_model_of_stable_baselines_is_scored_on_the_pictures_of_its_frame_stack() -> None:
    """Bit for bit, over the first steps of an episode."""
    vectors = pytest.importorskip("stable_baselines3.common.vec_env", reason="needs stable-baselines3")
    env = gymnasium.make(TRACK, **SMALL)
    theirs = vectors.VecFrameStack(vectors.DummyVecEnv([lambda: env]), 3)
    theirs.seed(5)
    expected = [theirs.reset()[0], *(theirs.step(np.full((1, 2), 0.2, np.float32))[0][0] for _ in range(4))]
    ours = stacked(gymnasium.make(TRACK, **SMALL), 3)
    found = [ours.reset(seed=5)[0], *(ours.step(np.full(2, 0.2, np.float32))[0] for _ in range(4))]
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("name", [*SMALL_TASKS, DISK, "spikecam_env/Disk-v0"])
def test_no_default_observation_is_refused(name: str) -> None:
    """By stable-baselines3's learner; blocks of spikes are no pictures for its check, which warns of their type."""
    check = pytest.importorskip("stable_baselines3.common.env_checker", reason="needs stable-baselines3").check_env
    env = gymnasium.make(name, **SMALL)
    check(env, warn=False)
    if name in SMALL_TASKS:
        checked(name)
        assert env.observation_space == gymnasium.spaces.Box(0, 255, (1, 36, 36), np.uint8)
    else:
        assert env.observation_space == gymnasium.spaces.Box(0, 1, (8, 36, 36), np.int8)


def test_processes_of_stable_baselines_give_the_bits_of_one_process() -> None:
    vectors = pytest.importorskip("stable_baselines3.common.vec_env", reason="needs stable-baselines3")
    makers = [lambda name=name: gymnasium.make(name, **SMALL, obs="tfp") for name in (TRACK, DISK)]

    def seen(vector: Any) -> list[np.ndarray]:
        vector.seed(3)
        pictures = [vector.reset(), *(vector.step(np.full((2, 2), 0.3, np.float32))[0] for _ in range(3))]
        vector.close()
        return pictures

    processes = seen(vectors.SubprocVecEnv(makers, start_method="fork"))
    np.testing.assert_array_equal(processes, seen(vectors.DummyVecEnv(makers)))


@pytest.mark.slow
@pytest.mark.parametrize("name", [*SMALL_TASKS, DISK])
def test_rllib_learns_on_a_local_cluster(name: str) -> None:
    """A round of PPO by a worker.  RLlib is in no extra: it pins a Gymnasium of its own; runs where it is installed."""
    pytest.importorskip("tree", reason="needs ray[rllib]")  # dm-tree, which RLlib alone asks for
    printed = subprocess.run([sys.executable, "-m", "tests.envs.rllib", name], capture_output=True, text=True)
    assert printed.returncode == 0, printed.stderr
    print(printed.stdout)
    assert f"{name}: {rllib.STEPS} steps" in printed.stdout


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_skrl_takes_the_native_vector(mode: str) -> None:
    """skrl is in no extra: it asks for TensorBoard; runs where it is installed."""
    wrap_env = pytest.importorskip("skrl.envs.wrappers.torch", reason="needs skrl").wrap_env
    torch = importlib.import_module("torch")
    cameras = gymnasium.make_vec(TRACK, 2, "vector_entry_point", obs="tfp", autoreset_mode=mode, **SMALL)
    env = wrap_env(cameras)
    assert env.num_envs == 2 and env.reset()[0].shape == (2, 36 * 36)
    seen, rewards, *_ = env.step(torch.zeros(2, 2))
    assert seen.shape == (2, 36 * 36) and rewards.shape == (2, 1)
    env.close()
