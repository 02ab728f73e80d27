"""Steps a second of environments, alone and as vectors, as ratios to a single one measured in the same run.

spikecam bench env
"""

from __future__ import annotations

import time
from typing import Any

import gymnasium
import numpy as np
from tqdm import tqdm

import spikecam_env.envs  # noqa: F401

ID = "spikecam_env/RotatingDisk-v0"
OPTIONS: dict[str, Any] = {"shape": (64, 64), "frames_per_step": 40}
COUNTS = (1, 16, 64)
MODES = {"sync": "sync", "async": "async", "native": "vector_entry_point"}
OBSERVATIONS = ("spikes", "rate")
"""Without the denoiser, and with it."""


def bench_environments(
    counts: tuple[int, ...] = COUNTS, observations: tuple[str, ...] = OBSERVATIONS, seconds: float = 2.0
) -> list[dict[str, Any]]:
    """Steps of 40 frames of 64 x 64 pixels a second, all environments together, on the rotating disk.

    Columns: observation, how (single, sync, async, native), environments, steps/s, x single (same observation, one
    environment), x real time (1000 steps a second each camera).
    """
    jobs = [(obs, how, count) for obs in observations for count in counts for how in MODES]
    rows: list[dict[str, Any]] = []
    single = 0.0
    for obs, how, count in tqdm(jobs, desc="bench", unit="row", leave=False):
        if (how, count) == (next(iter(MODES)), counts[0]):
            single = _single(obs, seconds)
            rows.append(_row(obs, "single", 1, single, single))
        rows.append(_row(obs, how, count, _vector(obs, MODES[how], count, seconds), single))
    return rows


def _row(obs: str, how: str, count: int, rate: float, single: float) -> dict[str, Any]:
    real_time = 40_000 / OPTIONS["frames_per_step"] * count
    return {
        "observation": obs,
        "how": how,
        "environments": count,
        "steps/s": rate,
        "x single": rate / single,
        "x real time": rate / real_time,
    }


def _single(obs: str, seconds: float) -> float:
    env = gymnasium.make(ID, **OPTIONS, obs=obs)
    env.reset(seed=0)
    still = np.zeros(2, np.float32)

    def step() -> None:
        *_, terminated, truncated, _ = env.step(still)
        if terminated or truncated:
            env.reset()

    try:
        return _calls_a_second(step, seconds)
    finally:
        env.close()


def _vector(obs: str, mode: str, count: int, seconds: float) -> float:
    env = gymnasium.make_vec(ID, num_envs=count, vectorization_mode=mode, **OPTIONS, obs=obs)
    env.reset(seed=0)
    still = np.zeros((count, 2), np.float32)
    try:
        return count * _calls_a_second(lambda: env.step(still), seconds)
    finally:
        env.close()


def _calls_a_second(call: Any, seconds: float) -> float:
    """Once the first three, which compile and fill pipelines, are over."""
    for _ in range(3):
        call()
    begin, calls = time.perf_counter(), 0
    while (elapsed := time.perf_counter() - begin) < seconds or calls == 0:
        call()
        calls += 1
    return calls / elapsed
