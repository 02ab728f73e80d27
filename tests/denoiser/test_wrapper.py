"""DenoiseObservation: the agent sees the denoised stream, `latency` frames late."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
import torch

from denoiser.online import OnlineDnSS
from denoiser.recipe import RECIPES
from denoiser.wrapper import DenoiseObservation
from spikecam_env.errors import InputError

K, SHAPE = 5, (6, 8)


class Noise(gymnasium.Env):
    """A camera that sees noise of one rate a pixel."""

    observation_space = gymnasium.spaces.MultiBinary((K, *SHAPE))
    action_space = gymnasium.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.sent = []
        return self._block(), {"time_s": 0.0}

    def step(self, action):
        return self._block(), 1.0, False, False, {}

    def _block(self):
        self.sent.append((self.np_random.random((K, *SHAPE)) < 0.3).astype(np.int8))
        return self.sent[-1]


def denoiser(output: str) -> OnlineDnSS:
    torch.manual_seed(0)
    return OnlineDnSS(RECIPES["best"], RECIPES["best"].network(), output=output)


def episode(env: DenoiseObservation, steps: int = 12, seed: int = 3) -> np.ndarray:
    blocks = [env.reset(seed=seed)[0]] + [env.step(0)[0] for _ in range(steps)]
    assert all(block in env.observation_space for block in blocks)
    return np.concatenate(blocks)


@pytest.mark.parametrize("output", ["spikes", "rate"])
def test_blocks_are_the_denoised_stream_late_by_the_latency(output):
    env = DenoiseObservation(Noise(), denoiser(output), output)
    seen = episode(env)
    online = denoiser(output)
    whole = np.concatenate([online.push(np.concatenate(env.unwrapped.sent)), online.flush()])
    assert not seen[: online.latency].any()
    assert np.array_equal(seen[online.latency :], whole[: len(seen) - online.latency])


def test_reset_forgets_the_last_episode():
    env = DenoiseObservation(Noise(), denoiser("spikes"))
    first = episode(env)
    assert np.array_equal(episode(env), first)
    assert not np.array_equal(episode(env, seed=4), first)


def test_info_says_how_late_the_block_is():
    env = DenoiseObservation(Noise(), denoiser("spikes"))
    assert env.reset(seed=0)[1] == {"time_s": 0.0, "denoiser_latency": 27}
    assert env.step(0)[4] == {"denoiser_latency": 27}


def test_packed_observations_are_refused():
    env = Noise()
    env.observation_space = gymnasium.spaces.Box(0, 255, (K, 6), np.uint8)
    with pytest.raises(InputError, match="unpacked"):
        DenoiseObservation(env, denoiser("spikes"))


def test_an_unknown_output_is_named():
    with pytest.raises(InputError, match="output"):
        DenoiseObservation(Noise(), denoiser("spikes"), "film")
