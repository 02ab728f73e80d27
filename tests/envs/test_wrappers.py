"""Wrappers for agents, and their twins for vectors."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv

from denoiser import DenoiseObservation
from spikecam_env.envs.observations import TFP, FrameCamera
from spikecam_env.envs.registration import register
from spikecam_env.envs.wrappers import (
    ObserveSpikes,
    ProgressReward,
    RandomizeLight,
    RandomizeSensor,
    VectorObserveSpikes,
    VectorProgressReward,
)
from spikecam_env.errors import InputError, NotReadyError

register()
DISK = "spikecam_env/RotatingDisk-v0"
SMALL: dict[str, Any] = {"shape": (16, 24), "frames_per_step": 20}
FAST = 20_000.0
RANGES = {"dead_time.tau_us": (0.5, 2.0), "dark_current.mean_pA": (0.1, 0.9)}


def make(**options: Any) -> gymnasium.Env:
    return gymnasium.make(DISK, **{**SMALL, **options})


def vector(**options: Any) -> Any:
    options = {"max_gaze_rate_px_s": FAST, "max_episode_steps": 5, **options}
    return gymnasium.make_vec(DISK, num_envs=3, vectorization_mode="vector_entry_point", **{**SMALL, **options})


def actions(steps: int = 12) -> np.ndarray:
    return np.random.default_rng(0).uniform(-1, 1, (steps, 3, 2)).astype(np.float32)


@pytest.mark.parametrize("obs", ["tfp", "tfi", "isi", "packed", TFP(50), FrameCamera(1000.0)])
def test_a_wrapper_shows_what_the_option_shows(obs: Any) -> None:
    wrapped, own = ObserveSpikes(make(), obs), make(obs=obs)
    assert wrapped.observation_space == own.observation_space
    for seed in (1, 2):
        np.testing.assert_array_equal(wrapped.reset(seed=seed)[0], own.reset(seed=seed)[0])
        for action in actions(4)[:, 0]:
            np.testing.assert_array_equal(wrapped.step(action)[0], own.step(action)[0])


@pytest.mark.parametrize("obs", ["tfp", "tfi", "isi", TFP(50), "rate"])
def test_the_vector_twin_shows_what_the_option_shows_over_the_ends_of_episodes(obs: Any) -> None:
    wrapped, own = VectorObserveSpikes(vector(), obs), vector(obs=obs)
    assert wrapped.observation_space == own.observation_space
    np.testing.assert_array_equal(wrapped.reset(seed=3)[0], own.reset(seed=3)[0])
    ends = 0
    for action in actions():
        (seen, *_), (expected, _, terminated, truncated, _) = wrapped.step(action), own.step(action)
        np.testing.assert_array_equal(seen, expected)
        ends += int((terminated | truncated).sum())
    assert ends >= 3
    wrapped.close()
    own.close()


def test_denoised_spikes_can_be_shown_too() -> None:
    env = ObserveSpikes(DenoiseObservation(make(), output="spikes"), "tfp")
    env.reset(seed=0)
    assert env.step(np.zeros(2, np.float32))[0].any()


def test_progress_is_twenty_times_the_change_of_the_reward() -> None:
    plain, wrapped = make(), ProgressReward(make())
    for seed in (1, 2):
        plain.reset(seed=seed)
        wrapped.reset(seed=seed)
        rewards, paid = zip(*((plain.step(a)[1], wrapped.step(a)[1]) for a in actions(5)[:, 0]), strict=True)
        np.testing.assert_allclose(paid, [0.0, *(20.0 * np.diff(rewards))])


def test_the_vector_twin_of_progress_begins_anew_with_each_episode() -> None:
    plain, wrapped = vector(), VectorProgressReward(vector())
    plain.reset(seed=3)
    wrapped.reset(seed=3)
    before = np.full(3, np.nan)
    over = np.zeros(3, bool)
    for action in actions():
        reward, terminated, truncated = plain.step(action)[1:4]
        paid = wrapped.step(action)[1]
        for n in range(3):
            expected = 0.0 if over[n] or np.isnan(before[n]) else 20.0 * (reward[n] - before[n])
            assert paid[n] == pytest.approx(expected)
            before[n] = np.nan if over[n] else reward[n]
        over = terminated | truncated
    plain.close()
    wrapped.close()


def sensors(env: gymnasium.Env, seeds: list[int | None]) -> list[Any]:
    models = []
    for seed in seeds:
        env.reset(seed=seed)
        models.append(env.unwrapped.sensor.model)  # type: ignore[attr-defined]
    return models


def test_the_sensor_of_each_episode_is_drawn_from_the_ranges() -> None:
    env = RandomizeSensor(make(), RANGES)
    drawn = sensors(env, [0] + [None] * 7)
    taus, dark = (
        np.array([next(getattr(e, field) for e in m.effects if e.name == name) for m in drawn])
        for name, field in (("dead_time", "tau_us"), ("dark_current", "mean_pA"))
    )
    for values, (low, high) in ((taus, (0.5, 2.0)), (dark, (0.1, 0.9))):
        assert len(set(values)) == 8 and values.min() >= low and values.max() <= high
    assert sensors(env, [0])[0] == drawn[0]
    env.reset(seed=0, options={"model": "ideal"})
    assert not env.unwrapped.sensor.model.effects  # type: ignore[attr-defined]


def test_the_light_of_each_episode_is_drawn_from_the_range() -> None:
    env = RandomizeLight(make(ground_truth=True), (0.1, 0.5))
    usual = make(ground_truth=True).reset(seed=0)[1]["radiance"]
    lit = [env.reset(seed=0)[1]["radiance"] for _ in range(2)]
    factor = float((lit[0] / usual).mean())
    print(f"light times {factor:.3f}")
    np.testing.assert_array_equal(*lit)
    np.testing.assert_allclose(lit[0], factor * usual, rtol=1e-4)
    assert 0.1 <= factor <= 0.5


def test_randomized_vectors_are_vectors_of_randomized_environments() -> None:
    def one() -> gymnasium.Env:
        return RandomizeLight(RandomizeSensor(make(obs="tfp"), RANGES), (0.5, 1.0))

    seen, _ = SyncVectorEnv([one] * 2).reset(seed=5)
    np.testing.assert_array_equal(seen[1], one().reset(seed=6)[0])


@pytest.mark.parametrize(
    ("ranges", "message"),
    [
        ({"dead_tim.tau_us": (0, 1)}, "unknown effect 'dead_tim'"),
        ({"dead_time.tau": (0, 1)}, "unknown parameter of dead_time 'tau'"),
        ({"dead_time.tau_us": (0, 100)}, "dead_time.tau_us = 100"),
        ({"dead_time.tau_us": (2, 1)}, "dead_time.tau_us = 1"),
        ({"dead_time.tau_us": 3}, "a range is two numbers"),
        ({"shot_noise.dark_is_noisy": (0, 1)}, "only numbers have ranges"),
    ],
)
def test_bad_ranges_are_named(ranges: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        RandomizeSensor(make(), ranges)


def test_bad_uses_are_named() -> None:
    with pytest.raises(InputError, match="must be unpacked spike blocks"):
        ObserveSpikes(make(packed=True), "tfp")
    with pytest.raises(InputError, match="must be unpacked spike blocks"):
        VectorObserveSpikes(vector(obs="isi"), "tfp")
    with pytest.raises(InputError, match="light = 0"):
        RandomizeLight(make(), (0.0, 1.0))
    with pytest.raises(InputError, match="must be a spike camera's"):
        RandomizeLight(gymnasium.make("CartPole-v1"), (0.5, 1.0))
    env = vector()
    with pytest.raises(NotReadyError, match="call reset first"):
        VectorObserveSpikes(env, "tfp").step(np.zeros((3, 2), np.float32))
    env.close()
