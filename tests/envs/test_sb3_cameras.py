"""`SB3Cameras` against stable-baselines3's own `DummyVecEnv` over as many environments: the same, step for step."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence

import spikecam_env.envs  # noqa: F401 - registers
from spikecam_env.bench.learners import bench_learners
from spikecam_env.errors import InputError
from tests.envs.kinds import DISK

pytest.importorskip("stable_baselines3", reason="needs stable-baselines3")
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv, VecFrameStack, VecNormalize

from spikecam_env.envs.wrappers import SB3Cameras

ENVS = 3
CATCH = "spikecam_env/Catch-v1"
OPTIONS: dict[str, Any] = {"shape": (36, 36), "frames_per_step": 20, "obs": "tfp"}
ENDING: dict[str, Any] = {**OPTIONS, "max_gaze_rate_px_s": 20_000.0, "max_episode_steps": 5}
"""The disk leaves the picture within a few steps, so that episodes are terminated and truncated."""


def native(name: str = DISK, count: int = ENVS, **options: Any) -> Any:
    given = {"autoreset_mode": "SameStep", **ENDING, **options}
    return gymnasium.make_vec(name, count, "vector_entry_point", **given)


def dummy(name: str = DISK, **options: Any) -> VecEnv:
    return make_vec_env(name, ENVS, env_kwargs={**ENDING, **options})


def without_seconds(infos: Any) -> Any:
    """Infos without the time by the clock of an episode."""
    return [
        {**info, "episode": {"r": info["episode"]["r"], "l": info["episode"]["l"]}} if "episode" in info else info
        for info in infos
    ]


def plain(seen: Any) -> Any:
    """An observation of stable-baselines3, whose dictionaries are ordered ones."""
    return dict(seen) if isinstance(seen, dict) else seen


def same(ours: VecEnv, theirs: VecEnv, steps: int = 12) -> list[dict[str, Any]]:
    """Whether all that two vectors return is the same; infos of steps that ended an episode."""
    for vector in (ours, theirs):
        vector.seed(3)
    assert data_equivalence(plain(ours.reset()), plain(theirs.reset()), exact=True)
    assert data_equivalence(ours.reset_infos, theirs.reset_infos, exact=True)
    ended = []
    rng = np.random.default_rng(0)
    for _ in range(steps):
        actions = rng.uniform(-1, 1, (ENVS, *ours.action_space.shape)).astype(np.float32)
        (seen, *a, our_infos), (wanted, *b, their_infos) = ours.step(actions), theirs.step(actions)
        assert data_equivalence((plain(seen), *a), (plain(wanted), *b), exact=True)
        assert data_equivalence(without_seconds(our_infos), without_seconds(their_infos), exact=True)
        assert data_equivalence(ours.reset_infos, theirs.reset_infos, exact=True)
        ended += [info for info in our_infos if "episode" in info]
    ours.close()
    theirs.close()
    return ended


@pytest.mark.parametrize("state", [False, True])
def test_everything_is_as_of_stable_baselines_own_vector_in_monitors(state: bool) -> None:
    options = {"obs_state": state, "ground_truth": state}
    ended = same(SB3Cameras(native(**options)), dummy(**options))
    assert {info["TimeLimit.truncated"] for info in ended} == {False, True}
    assert all(info["episode"]["l"] <= 5 and info["episode"]["t"] >= 0 for info in ended)


@pytest.mark.parametrize("wrapped", [lambda env: VecFrameStack(env, 3), lambda env: VecNormalize(env, norm_obs=False)])
def test_wrappers_of_stable_baselines_see_the_same(wrapped: Any) -> None:
    assert same(wrapped(SB3Cameras(native())), wrapped(dummy()))


def test_options_of_a_reset_are_each_environment_s_own() -> None:
    ours, theirs = SB3Cameras(native()), dummy()
    for vector in (ours, theirs):
        vector.set_options([{"light": 0.5}, {}, {"light": 2.0}])
    same(ours, theirs, 2)


def test_ppo_learns_the_same_weights_step_for_step() -> None:
    def learned(vector: VecEnv) -> tuple[list[np.ndarray], list[float], list[np.ndarray]]:
        seen: list[np.ndarray] = []
        model = PPO("CnnPolicy", vector, n_steps=8, batch_size=8, n_epochs=1, seed=0, device="cpu")
        model.learn(16 * ENVS, callback=lambda own, _: bool(seen.append(own["new_obs"].copy()) or True))
        returns = [episode["r"] for episode in model.ep_info_buffer or ()]
        vector.close()
        return [weights.detach().numpy() for weights in model.policy.parameters()], returns, seen

    ours, theirs = learned(SB3Cameras(native())), learned(dummy())
    assert ours[1] and ours[1] == theirs[1]
    for a, b in zip((*ours[0], *ours[2]), (*theirs[0], *theirs[2]), strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_policy_is_evaluated_on_whole_episodes() -> None:
    """By the rewards of a Monitor, without the warning that there is none."""
    model = PPO("CnnPolicy", SB3Cameras(native(count=1)), n_steps=8, batch_size=8)
    returns, lengths = evaluate_policy(model, SB3Cameras(native(count=2)), 3, return_episode_rewards=True)
    assert len(returns) == len(lengths) == 3 and max(lengths) <= 5


def test_attributes_methods_and_pictures_are_those_of_some_environments() -> None:
    cameras = SB3Cameras(native(render_mode="rgb_array"))
    cameras.reset()
    assert cameras.render_mode == "rgb_array"
    picture = cameras.render()
    assert picture is not None and picture.shape[2] == 3
    assert cameras.get_attr("shape") == [(36, 36)] * ENVS and cameras.get_attr("shape", indices=1) == [(36, 36)]
    cameras.set_attr("note", "last", indices=[2])
    assert not cameras.has_attr("note") and cameras.get_attr("note", indices=2) == ["last"]
    assert cameras.env_method("set_top_rate", 50.0, indices=[0]) == [None]
    assert [motor.top_px_s for motor in cameras.get_attr("motor")] == [50.0, 20_000.0, 20_000.0]
    assert cameras.env_is_wrapped(Monitor) == [True] * ENVS
    assert cameras.env_is_wrapped(gymnasium.wrappers.TimeLimit, [0]) == [False]
    cameras.close()


@pytest.mark.parametrize(
    "made, message",
    [
        (lambda: native(autoreset_mode="NextStep"), "autoreset_mode is NextStep; make cameras with 'SameStep'"),
        (lambda: native(device="cpu"), "device is cpu; .* leave device out"),
        (lambda: gymnasium.make_vec(DISK, 2, "sync", **OPTIONS), "vector_entry_point"),
        (lambda: gymnasium.make(DISK, **OPTIONS), "vector_entry_point"),
        (lambda: None, "cameras = None; give make_vec"),
    ],
)
def test_another_vector_is_refused_by_name(made: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        SB3Cameras(made())


def test_the_wrappers_are_had_without_stable_baselines() -> None:
    program = (
        "import sys; sys.modules['stable_baselines3'] = None\n"
        "from spikecam_env.envs import wrappers\n"
        "try:\n    wrappers.SB3Cameras\n"
        "except ValueError as error:\n    print(error)\n"
    )
    printed = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert "stable-baselines3 is not installed; pip install 'spikecam-env[sb3]'" in printed


def test_the_bench_has_a_row_for_each_vector() -> None:
    rows = bench_learners(count=2, rollout=4, rounds=1)
    assert [(row["vector"], row["environments"]) for row in rows] == [("DummyVecEnv", 2), ("SB3Cameras", 2)]
    assert all(row["steps/s"] > 0 and row["steps/s with PPO"] > 0 for row in rows)
    assert rows[0]["x DummyVecEnv"] == rows[0]["x DummyVecEnv, PPO"] == 1.0
