"""The native vector environment in TorchRL: `GymWrapper` takes it, and its specs are those of its returned values."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
import torch

import spikecam_env.envs  # noqa: F401 - registers

pytest.importorskip("torchrl", reason="needs torchrl")
from tensordict.nn import TensorDictModule
from torchrl.envs import GymWrapper
from torchrl.envs.utils import check_env_specs

ENVS, STEPS = 2, 70
CATCH = "spikecam_env/Catch-v1"
"""An episode has 60 steps at most."""


def native(mode: str, **options: Any) -> Any:
    given = {"shape": (24, 24), "obs": "tfp", "autoreset_mode": mode, **options}
    return gymnasium.make_vec(CATCH, ENVS, "vector_entry_point", **given)


@pytest.mark.parametrize("mode", ["SameStep", "Disabled"])
@pytest.mark.parametrize("options", [{}, {"obs_state": True}, {"obs": "spikes"}, {"obs": "multibinary"}], ids=str)
def test_specs_are_those_of_what_is_returned(mode: str, options: dict[str, Any]) -> None:
    env = GymWrapper(native(mode, **options))
    check_env_specs(env)
    env.close()


@pytest.mark.parametrize("mode", ["SameStep", "Disabled"])
def test_a_rollout_over_the_ends_of_episodes_is_that_of_the_environment(mode: str) -> None:
    env = GymWrapper(native(mode))
    env.set_seed(3)
    policy = TensorDictModule(lambda seen: torch.full((ENVS, 1), 0.3), ["observation"], ["action"])
    rollout = env.rollout(STEPS, policy, break_when_any_done=False)
    env.close()
    assert rollout["next", "done"].any(), "no episode ended"
    plain = native("SameStep")
    plain.reset(seed=3)  # by `set_seed`; a rollout begins with a reset of its own
    seen = [plain.reset()[0]]
    rewards = []
    for _ in range(STEPS):
        picture, reward, *_ = plain.step(np.full((ENVS, 1), 0.3, np.float32))
        seen.append(picture)
        rewards.append(reward)
    plain.close()
    np.testing.assert_array_equal(rollout["observation"].numpy(), np.stack(seen[:-1], axis=1))
    np.testing.assert_array_equal(
        rollout["next", "reward"][..., 0].numpy(), np.stack(rewards, axis=1).astype(np.float32)
    )
