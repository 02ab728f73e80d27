"""DenoiseObservation: the agent sees the denoised stream, `latency` frames late."""

from __future__ import annotations

import copy
import pickle

import gymnasium
import numpy as np
import pytest
import torch

from denoiser.online import OnlineDnSS
from denoiser.passes.recipe import RECIPES
from denoiser.weights import save_weights
from denoiser.wrapper import DenoiseObservation
from spikecam_env.errors import InputError, NotReadyError

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
    assert env.reset(seed=0)[1] == {"time_s": 0.0, "denoiser_latency": 31, "denoised_frames": 0}
    assert env.step(0)[4] == {"denoiser_latency": 31, "denoised_frames": 0}


def test_packed_observations_are_refused():
    env = Noise()
    env.observation_space = gymnasium.spaces.Box(0, 255, (K, 6), np.uint8)
    with pytest.raises(InputError, match="unpacked"):
        DenoiseObservation(env, denoiser("spikes"))


def test_an_unknown_output_is_named():
    with pytest.raises(InputError, match="output"):
        DenoiseObservation(Noise(), denoiser("spikes"), "film")


def test_one_denoiser_given_to_two_environments_gives_each_its_own_stream():
    mine = denoiser("rate")
    first, second = (DenoiseObservation(Noise(), mine) for _ in range(2))
    expected = [episode(DenoiseObservation(Noise(), denoiser("spikes")), seed=seed) for seed in (3, 4)]
    blocks = [[first.reset(seed=3)[0]], [second.reset(seed=4)[0]]]
    for _ in range(12):
        blocks[0].append(first.step(0)[0])
        blocks[1].append(second.step(0)[0])
    for seen, alone in zip(blocks, expected, strict=True):
        assert np.array_equal(np.concatenate(seen), alone)


def test_a_denoiser_that_is_given_stays_as_it_was():
    mine, twin = denoiser("rate"), denoiser("rate")
    stream = (np.random.default_rng(0).random((60, *SHAPE)) < 0.3).astype(np.uint8)
    pushed = [mine.push(stream[:30]), twin.push(stream[:30])]
    env = DenoiseObservation(Noise(), mine, "spikes")
    episode(env)
    assert mine.output == "rate" and np.array_equal(*pushed)
    assert np.array_equal(mine.push(stream[30:]), twin.push(stream[30:]))


@pytest.mark.parametrize("kind", [str, lambda path: path])
def test_a_checkpoint_is_a_mode(tmp_path, kind):
    torch.manual_seed(0)
    path = tmp_path / "mine.pt"
    save_weights(path, "best", RECIPES["best"], RECIPES["best"].network(), {})
    seen = episode(DenoiseObservation(Noise(), kind(path)))
    assert np.array_equal(seen, episode(DenoiseObservation(Noise(), denoiser("spikes"))))


@pytest.mark.parametrize("mode", ["worst", None, 3, ["best"], b"best.pt", "nowhere.pt"])
def test_an_unknown_mode_is_named(mode):
    with pytest.raises(InputError, match=r"unknown denoiser mode|no file nowhere\.pt"):
        DenoiseObservation(Noise(), mode)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_goes_on_as_the_original_does(copied):
    env = DenoiseObservation(Noise(), denoiser("rate"), "rate")
    episode(env)
    other = copied(env)
    for _ in range(6):
        assert np.array_equal(env.step(0)[0], other.step(0)[0])


def test_a_step_before_reset_or_after_close_is_refused():
    env = DenoiseObservation(Noise(), denoiser("spikes"))
    env.unwrapped.sent = []
    with pytest.raises(NotReadyError, match="call reset first"):
        env.step(0)
    env.reset(seed=0)
    env.close()
    env.close()
    for use in (lambda: env.step(0), env.reset):
        with pytest.raises(NotReadyError, match="closed; make a new one"):
            use()


@pytest.mark.parametrize("output", ["spikes", "rate"])
def test_the_first_frames_are_marked_and_may_be_noisy_in_place_of_black(output):
    black, noisy = (DenoiseObservation(Noise(), denoiser(output), output, warm_up=w) for w in ("black", "noisy"))
    (first, info), (grey, _) = black.reset(seed=3), noisy.reset(seed=3)
    marked = [info["denoised_frames"]]
    raw = noisy.unwrapped.sent[0]
    assert not first.any()
    np.testing.assert_allclose(grey, raw if output == "spikes" else np.broadcast_to(raw.mean(axis=0), grey.shape))
    for _ in range(8):
        (block, *_, info), (other, *_) = black.step(0), noisy.step(0)
        marked.append(info["denoised_frames"])
        done = slice(K - info["denoised_frames"], None)
        np.testing.assert_array_equal(block[done], other[done])
    assert sum(marked) == 9 * K - info["denoiser_latency"] and marked[-1] == K
    with pytest.raises(InputError, match="unknown warm_up 'grey'"):
        DenoiseObservation(Noise(), denoiser(output), warm_up="grey")
