"""Steps a second of environments, alone and as vectors, and what a step costs beside scene and sensor.

spikecam bench env

Other programs slow a machine by tens of per cent.  So what is compared is measured in turn, in short rounds; a ratio is
the median over rounds of ratios within one round, and a share is one of CPU time.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from tqdm import tqdm

import spikecam_env.envs  # noqa: F401
from spikecam_env.envs.spike_camera import SpikeCameraEnv, expose
from spikecam_env.threads import as_many

OPTIONS: dict[str, Any] = {"shape": (64, 64), "frames_per_step": 40}
COUNTS = (1, 16, 64)
MODES = {"sync": "sync", "async": "async", "native": "vector_entry_point"}
CASES = (("RotatingDisk-v0", "spikes"), ("Track-v1", "tfp"), ("RotatingDisk-v0", "rate"))
"""(id, observation): without the denoiser, a task, and with the denoiser."""
ROUNDS = 7
WARM_UP = 3
"""Steps before the first round: they compile and fill pipelines."""


@dataclass(frozen=True)
class Contestant:
    """how: of the row.  step: one step of all environments.  envs: in this process, whose scenes and cameras can be
    asked alone; empty where there are none.  close: gives everything back."""

    how: str
    environments: int
    step: Callable[[], Any]
    envs: Sequence[SpikeCameraEnv]
    close: Callable[[], Any]

    def steps_a_second(self, seconds: float) -> float:
        """All environments together."""
        begin, calls = time.perf_counter(), 0
        while (elapsed := time.perf_counter() - begin) < seconds or calls == 0:
            self.step()
            calls += 1
        return self.environments * calls / elapsed


def bench_environments(
    counts: tuple[int, ...] = COUNTS,
    cases: tuple[tuple[str, str], ...] = CASES,
    seconds: float = 0.4,
    rounds: int = ROUNDS,
) -> list[dict[str, Any]]:
    """Steps of 40 frames of 64 x 64 pixels a second, all environments together; cameras that do not turn.

    seconds: of each row in a round.
    Columns: id, observation, environments, how (single, sync, async, native), steps/s (median over rounds), x single
    (one environment of the same id and observation) and x async (as many environments), medians over rounds of ratios
    within a round; x real time (1000 steps a second each camera); beside scene and sensor, %: of a step's CPU time,
    what is left when the same light is painted and the same frames are exposed alone, where that can be measured.
    """
    jobs = [(name, obs, count) for name, obs in cases for count in counts]
    rows: list[dict[str, Any]] = []
    for name, obs, count in tqdm(jobs, desc="bench", unit="group", leave=False):
        contestants = [single(name, obs), *(vector(name, obs, how, count) for how in MODES)]
        try:
            rows += _group(name, obs, contestants, seconds, rounds, with_single=count == counts[0])
        finally:
            for one in contestants:
                one.close()
    return rows


def _group(
    name: str, obs: str, contestants: Sequence[Contestant], seconds: float, rounds: int, with_single: bool
) -> list[dict[str, Any]]:
    """Rows of contestants measured in turn; the first is the single one, which other groups have too."""
    for one in contestants:
        for _ in range(WARM_UP):
            one.step()
    rates = np.array([[one.steps_a_second(seconds) for one in contestants] for _ in range(rounds)])
    asynchronous = [one.how for one in contestants].index("async")
    rows = []
    for place, one in enumerate(contestants):
        if place == 0 and not with_single:
            continue
        real_time = 40_000 / OPTIONS["frames_per_step"] * one.environments
        rows.append(
            {
                "id": name,
                "observation": obs,
                "environments": one.environments,
                "how": one.how,
                "steps/s": float(np.median(rates[:, place])),
                "x single": float(np.median(rates[:, place] / rates[:, 0])),
                "x async": float(np.median(rates[:, place] / rates[:, asynchronous])),
                "x real time": float(np.median(rates[:, place]) / real_time),
                "beside scene and sensor, %": 100 * beside(one, seconds, rounds) if one.envs else "",
            }
        )
    return rows


def beside(one: Contestant, seconds: float, rounds: int) -> float:
    """Share of the CPU time of a step that is not the scenes' and the cameras'."""
    threads = as_many(None, len(one.envs)) if one.how == "native" else 1

    def alone() -> None:
        for env in one.envs:  # the block of the last step once more
            env.sensor.frame = env.asked[0]
        expose(one.envs, threads=threads)

    alone()
    calls = max(1, round(seconds * one.steps_a_second(seconds) / one.environments))
    shares = [1.0 - cpu_seconds(alone, calls) / cpu_seconds(one.step, calls) for _ in range(rounds)]
    return float(np.median(shares))


def cpu_seconds(call: Callable[[], Any], calls: int) -> float:
    """Of this process, all its threads."""
    begin = time.process_time()
    for _ in range(calls):
        call()
    return time.process_time() - begin


def single(name: str, obs: str) -> Contestant:
    """One environment by itself."""
    env = gymnasium.make(f"spikecam_env/{name}", **OPTIONS, obs=obs)
    env.reset(seed=0)
    still = np.zeros(env.action_space.shape or (), np.float32)

    def step() -> None:
        *_, terminated, truncated, _ = env.step(still)
        if terminated or truncated:
            env.reset()

    return Contestant("single", 1, step, [env.unwrapped], env.close)  # type: ignore[list-item]


def vector(name: str, obs: str, how: str, count: int) -> Contestant:
    """As many in a vector: `how` is one of MODES."""
    mode = MODES[how]
    env: Any = gymnasium.make_vec(f"spikecam_env/{name}", num_envs=count, vectorization_mode=mode, **OPTIONS, obs=obs)
    env.reset(seed=0)
    still = np.zeros(env.action_space.shape, np.float32)
    envs = env.unwrapped.envs if how == "native" else []
    return Contestant(how, count, lambda: env.step(still), envs, env.close)
