"""Steps a second of environments, alone and as vectors, where the processor's time of a step goes, and episodes.

spikecam bench env

Other programs slow a machine at times.  So vectors are measured in turn, in short rounds, and a ratio is the median
over rounds of ratios within one round.  The processor's time, of all processes of a vector, stands beside the clock's.
"""

from __future__ import annotations

import ctypes
import os
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

import spikecam_env.envs  # noqa: F401
from scenes.flat.planes import painted_planes
from spikecam_env.bench.learners import bench_learners
from spikecam_env.envs.registration import MUJOCO_NAMES
from spikecam_env.envs.spike_camera import SpikeCameraEnv, lights_of
from spikecam_env.sensor import Keyframes, step_together
from spikecam_env.threads import as_many

OPTIONS: dict[str, Any] = {"shape": (64, 64), "frames_per_step": 40}
COUNTS = (1, 16, 64)
MODES = {"sync": "sync", "async": "async", "native": "vector_entry_point"}
CASES = (("RotatingDisk-v0", "spikes"), ("Track-v1", "tfp"), ("RotatingDisk-v0", "rate"))
"""(id, observation): without the denoiser, a task, and with the denoiser."""
KINDS = ("RotatingDisk-v0", "Track-v1", "Collage-v0", "Tumble-v0", "Scene-v0")
"""Ids of which episodes are timed: flat scenes, a task, a collage, a world, and a world drawn anew every episode."""
EPISODES, STEPS = 6, 8
"""Episodes of each that are timed, and steps in each, beside a first episode of each."""
PARTS = ("light, %", "camera, %", "beside both, %")
"""Parts of the processor's time of a step."""
ROUNDS = 7
WARM_UP = 3
"""Steps before the first round: they compile and fill pipelines."""


@dataclass(frozen=True)
class Contestant:
    """Environments that are stepped in one way."""

    how: str
    """Name of the way."""
    environments: int
    """Number of environments."""
    step: Callable[[], Any]
    """One step of all environments."""
    envs: Sequence[SpikeCameraEnv]
    """Environments in this process, whose scenes and cameras can run alone."""
    close: Callable[[], Any]
    processes: Sequence[int] = ()
    """Other processes that do the work."""

    def seconds_a_step(self, seconds: float) -> tuple[float, float]:
        """Seconds by the clock and of the processor for a step of one environment, over `seconds` at least."""
        begin, busy, calls = time.perf_counter(), cpu_seconds(self.processes), 0
        while (elapsed := time.perf_counter() - begin) < seconds or calls == 0:
            self.step()
            calls += 1
        steps = self.environments * calls
        return elapsed / steps, (cpu_seconds(self.processes) - busy) / steps


def bench_environments() -> dict[str, list[dict[str, Any]]]:
    """Tables by title: `bench_vectors`, `bench_episodes` and, with the extras, `bench_mujoco` and `bench_learners`."""
    from spikecam_env.bench.mujoco_tasks import bench_mujoco  # which measures as this file does

    tables = {"one camera and many": bench_vectors(), "episodes of one camera": bench_episodes()}
    optional = {"a task by MuJoCo": bench_mujoco(), "stable-baselines3": bench_learners()}
    return tables | {title: rows for title, rows in optional.items() if rows}


def bench_episodes(
    kinds: tuple[str, ...] = KINDS, episodes: int = EPISODES, steps: int = STEPS
) -> list[dict[str, Any]]:
    """Time that episodes take to begin, and steps of 40 frames of 64 x 64 pixels by a camera that does not turn.

    Returns:
        Rows of id; begin ms, of `reset`, and step ms, medians by the clock; frames/s of the steps, x real time.
    """
    rows = []
    for name in tqdm(kinds, desc="bench", unit="id", leave=False):
        with closing(gymnasium.make(f"spikecam_env/{name}", **OPTIONS, obs="tfp")) as env:
            timed = [_episode(env, seed, steps) for seed in range(episodes + 1)][1:]
        begin = float(np.median([first for first, _ in timed]))
        step = float(np.median([each for _, of_steps in timed for each in of_steps]))
        rate = OPTIONS["frames_per_step"] / step
        rows.append(
            {"id": name, "begin ms": 1e3 * begin, "step ms": 1e3 * step, "frames/s": rate, "x real time": rate / 40_000}
        )
    return rows


def _episode(env: gymnasium.Env[Any, Any], seed: int, steps: int) -> tuple[float, list[float]]:
    """Seconds by the clock of an episode's beginning, and of each of its steps, so many at most."""
    still = np.zeros(env.action_space.shape or (), np.float32)
    ends = [time.perf_counter()]
    env.reset(seed=seed)
    ends.append(time.perf_counter())
    for _ in range(steps):
        *_, terminated, truncated, _ = env.step(still)
        ends.append(time.perf_counter())
        if terminated or truncated:
            break
    first, *of_steps = np.diff(ends).tolist()
    return first, of_steps


def bench_vectors(
    counts: tuple[int, ...] = COUNTS,
    cases: tuple[tuple[str, str], ...] = CASES,
    seconds: float = 0.4,
    rounds: int = ROUNDS,
) -> list[dict[str, Any]]:
    """Steps of 40 frames of 64 x 64 pixels, all environments together; cameras that do not turn.

    Args:
        counts: numbers of environments.
        cases: ids and observations.
        seconds: time for each row in a round.
        rounds: number of rounds.

    Returns:
        Rows of id, observation, environments and how (single, sync, async, native).  steps/s is a median over rounds.
        x single (one environment) and x async (as many) are medians over rounds of ratios within a round.  x real time
        is over 1000 steps a second of each camera.  processor ms is the processor's time of an environment's step, all
        processes together, with x async of it.  Its parts, %, are of environments in this process: the light alone,
        the camera alone, the rest.
    """
    jobs = [(name, obs, count) for name, obs in cases for count in counts]
    rows: list[dict[str, Any]] = []
    for name, obs, count in tqdm(jobs, desc="bench", unit="group", leave=False):
        contestants = [single(name, obs), *(vector(name, obs, how, count) for how in MODES)]
        try:
            rows += measured(name, obs, contestants, seconds, rounds, with_single=count == counts[0])
        finally:
            for one in contestants:
                one.close()
    return rows


def measured(
    name: str, obs: str, contestants: Sequence[Contestant], seconds: float, rounds: int, with_single: bool
) -> list[dict[str, Any]]:
    """Rows of contestants measured in turn; the first is the single one, which other groups have too."""
    for one in contestants:
        for _ in range(WARM_UP):
            one.step()
    taken = np.array([[one.seconds_a_step(seconds) for one in contestants] for _ in range(rounds)])
    clock, processor = taken[:, :, 0], taken[:, :, 1]
    asynchronous = [one.how for one in contestants].index("async")
    rows = []
    for place, one in enumerate(contestants):
        if place == 0 and not with_single:
            continue
        rate = 1.0 / float(np.median(clock[:, place]))
        parts: dict[str, Any] = shares(one, seconds, rounds) if one.envs else dict.fromkeys(PARTS, "")
        rows.append(
            {
                "id": name,
                "observation": obs,
                "environments": one.environments,
                "how": one.how,
                "steps/s": rate,
                "x single": _times(clock, 0, place),
                "x async": _times(clock, asynchronous, place),
                "x real time": rate * OPTIONS["frames_per_step"] / 40_000 / one.environments,
                "processor ms": 1e3 * float(np.median(processor[:, place])),
                "x async, processor": _times(processor, asynchronous, place),
            }
            | parts
        )
    return rows


def _times(seconds: NDArray[np.float64], other: int, place: int) -> float:
    """Speed of a contestant over that of another, by seconds (rounds, contestants)."""
    return float(np.median(seconds[:, other] / seconds[:, place]))


def shares(one: Contestant, seconds: float, rounds: int) -> dict[str, float]:
    """Parts of the processor's time of a step [%]: the scenes', the cameras', and the rest."""
    threads = as_many(None, len(one.envs)) if one.how == "native" else 1
    calls = max(1, round(seconds / one.seconds_a_step(seconds)[0] / one.environments))
    light: list[Keyframes] = []

    def paint() -> None:
        light[:] = lights_of(one.envs, partial(painted_planes, threads=threads))

    def expose() -> None:
        for env in one.envs:  # the block of the last step once more
            env.sensor.frame = env.next_block[0]
        step_together([env.sensor for env in one.envs], light, OPTIONS["frames_per_step"], threads=threads)

    parts = []
    for _ in range(rounds):
        alone = [cpu_of(part, calls) for part in (paint, expose)]
        of_step = cpu_of(one.step, calls)
        parts.append([100.0 * part / of_step for part in alone])
    of_light, of_camera = np.median(parts, axis=0).tolist()
    return dict(zip(PARTS, (of_light, of_camera, 100.0 - of_light - of_camera), strict=True))


def cpu_of(call: Callable[[], Any], calls: int) -> float:
    """Seconds of the processor that so many calls take, all threads of this process."""
    begin = cpu_seconds()
    for _ in range(calls):
        call()
    return cpu_seconds() - begin


def cpu_seconds(others: Sequence[int] = ()) -> float:
    """Seconds of the processor so far, of this process and others; NaN where others do not show theirs."""
    return time.process_time() + sum(time.clock_gettime(clock) if clock else np.nan for clock in map(_clock, others))


@lru_cache(maxsize=256)
def _clock(process: int) -> int:
    """POSIX's clock of a process's time on the processor; 0 where there is none."""
    clock = ctypes.c_int(0)
    ask = getattr(ctypes.CDLL(None), "clock_getcpuclockid", None) if os.name == "posix" else None
    return clock.value if ask is not None and ask(process, ctypes.byref(clock)) == 0 else 0


def single(name: str, obs: str, options: dict[str, Any] = OPTIONS) -> Contestant:
    """One environment by itself."""
    env = gymnasium.make(f"spikecam_env/{name}", **options, obs=obs)
    env.reset(seed=0)
    still = np.zeros(env.action_space.shape or (), np.float32)

    def step() -> None:
        *_, terminated, truncated, _ = env.step(still)
        if terminated or truncated:
            env.reset()

    envs = [env.unwrapped] if isinstance(env.unwrapped, SpikeCameraEnv) else []
    return Contestant("single", 1, step, envs, env.close)


def vector(name: str, obs: str, how: str, count: int, options: dict[str, Any] = OPTIONS) -> Contestant:
    """As many in a vector: `how` is one of MODES."""
    mode = MODES[how]
    options = {**options, "obs": obs}
    if how == "async" and name.removesuffix("-v1") in MUJOCO_NAMES:  # OpenGL does not survive a fork
        options["vector_kwargs"] = {"context": "spawn"}
    env: Any = gymnasium.make_vec(f"spikecam_env/{name}", num_envs=count, vectorization_mode=mode, **options)
    env.reset(seed=0)
    still = np.zeros(env.action_space.shape, np.float32)
    envs = env.unwrapped.envs if how == "native" else []
    processes = [process.pid for process in env.unwrapped.processes] if how == "async" else []
    return Contestant(how, count, lambda: env.step(still), envs, env.close, processes)
