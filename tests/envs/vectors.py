"""`python -m tests.envs.vectors PROGRAM`: vector environments as users make them, in a process that may hang."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterable
from typing import Any

import cv2
import gymnasium
import numba
import numpy as np
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv

import spikecam_env.envs  # noqa: F401
from tests.envs.kinds import DISK, KINDS

SMALL: dict[str, Any] = {"shape": (16, 16), "frames_per_step": 20, "obs": "spikes"}
TASKS = ("spikecam_env/Track-v1", "spikecam_env/Catch-v1", "spikecam_env/Exposure-v1")
"""Flat discs, a camera that only pans, and a scene in changing light: other tasks have the same code behind them."""
STEPS = 2
"""The denoiser's frames come 31 late: they are seen from the first step on."""

MANY = 18
WARM = 8
"""Environments made one after another, and after how many of them a process has all that it keeps."""

Maker = Callable[[], gymnasium.Env]


class Beside(gymnasium.Wrapper):
    """Info `spikes` is the observation of the environment within, below all other wrappers."""

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        observation, info = self.env.reset(**options)
        return observation, {**info, "spikes": observation.copy()}

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        observation, *ends, info = self.env.step(action)
        return observation, *ends, {**info, "spikes": observation.copy()}


def plain(name: str) -> Maker:
    return lambda: Beside(gymnasium.make(name, **SMALL))


def denoised(name: str) -> Maker:
    """Its observations are denoised, and its spikes beside them."""

    def make() -> gymnasium.Env:
        from denoiser import DenoiseObservation  # torch takes seconds, which a process without the denoiser need not

        return DenoiseObservation(plain(name)())

    return make


def alike(names: Iterable[str]) -> list[list[str]]:
    """The ids with equal actions together; each is made once, so that forks have the caches of its scene."""
    groups: dict[tuple[int, ...], list[str]] = {}
    for name in names:
        env = plain(name)()
        groups.setdefault(env.action_space.shape or (), []).append(name)
        env.close()
    return list(groups.values())


def seen(vector: Any) -> dict[str, np.ndarray]:
    """Observations, spikes, rewards and places of an episode's first steps; closes the environments."""
    observation, info = vector.reset(seed=3)
    found = {"observation": [observation.copy()], "spikes": [info["spikes"].copy()], "reward": [], "gaze": []}
    actions = (STEPS, vector.num_envs, *vector.single_action_space.shape)
    for action in np.random.default_rng(0).uniform(-0.2, 0.2, actions).astype(np.float32):
        observation, reward, _, _, info = vector.step(action)
        for name, values in {"observation": observation, "reward": reward, **info}.items():
            if name in found:
                found[name].append(values.copy())
    vector.close()
    for name in ("observation", "spikes"):
        assert np.any(found[name], axis=(0, 2, 3, 4)).all(), f"{vector}: no {name}"
    return {name: np.stack(arrays) for name, arrays in found.items()}


def same(a: dict[str, np.ndarray], b: dict[str, np.ndarray], way: str) -> None:
    for name in a:
        assert np.array_equal(a[name], b[name]), f"{way}: {name} differs"


@numba.njit(parallel=True)
def _total(values):
    total = 0.0
    for i in numba.prange(len(values)):
        total += values[i]
    return total


def use_every_pool() -> None:
    """Threads of numba and of OpenCV; a synchronous run has used torch's, OpenGL's and ours."""
    numba.set_num_threads(min(2, numba.config.NUMBA_NUM_THREADS))
    _total(np.ones(100_000))
    cv2.setNumThreads(2)
    cv2.GaussianBlur(np.ones((1000, 1000), np.float32), (15, 15), 2.0)


def every_kind() -> None:
    """Forked from a process that has exposed nothing, all ids at once whose actions are alike; then the same here; then
    forked from a process that has used every pool, with and without the denoiser."""
    vector = gymnasium.make_vec("spikecam_env/Fan-v0", num_envs=2, vectorization_mode="async", **SMALL)
    vector.reset(seed=0)
    vector.close()
    assert "torch" not in sys.modules
    imports_it_itself = seen(AsyncVectorEnv([denoised(DISK)]))
    import denoiser  # noqa: F401  # as most users have it: the forks that follow need not import torch each

    groups = alike([*KINDS, *TASKS])
    fresh = [seen(AsyncVectorEnv([denoised(name) for name in group])) for group in groups]
    for group, forked in zip(groups, fresh, strict=True):
        same(forked, seen(SyncVectorEnv([denoised(name) for name in group])), f"{group}, synchronous")
    same(imports_it_itself, seen(SyncVectorEnv([denoised(DISK)])), f"{DISK}, torch imported by the fork")
    keeps_opengl = gymnasium.make("spikecam_env/Fan-v0", **SMALL)
    keeps_opengl.reset(seed=0)
    makers = [make(name) for name in (DISK, "spikecam_env/Fan-v0") for make in (plain, denoised)]
    here = seen(SyncVectorEnv(makers))
    use_every_pool()
    same(here, seen(AsyncVectorEnv(makers)), "forked late")
    print(f"{sum(map(len, groups))} ids")


def contexts() -> None:
    """A rendered scene with the denoiser, spawned and from a server, against a synchronous run."""
    makers = [denoised("spikecam_env/Fan-v0")]
    expected = seen(SyncVectorEnv(makers))
    for context in ("spawn", "forkserver"):
        same(expected, seen(AsyncVectorEnv(makers, context=context)), context)
    print("spawn, forkserver")


def held() -> tuple[int, int, int]:
    """(resident memory [kB], open files, threads) of this process."""
    with open("/proc/self/statm") as numbers:
        resident = int(numbers.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") // 1024
    return resident, len(os.listdir("/proc/self/fd")), len(os.listdir("/proc/self/task"))


def many() -> None:
    """Environments one after another: a rendered scene, and another with the denoiser."""
    figures = []
    for number in range(MANY):
        env = plain("spikecam_env/Poker-v0")() if number % 2 else denoised("spikecam_env/Disk-v0")()
        env.reset(seed=number)
        env.step(np.zeros(2, np.float32))
        env.close()
        figures.append(held())
    (kilobytes, files, threads), last = figures[WARM - 1], figures[-1]
    print(f"after {WARM}: {figures[WARM - 1]}, after {MANY}: {last} (kB, files, threads)")
    assert last[0] - kilobytes < 1000 * (MANY - WARM), "memory grows by a megabyte an environment"
    assert last[1] <= files, "files grow"
    assert last[2] <= threads + 4, "threads grow"  # a pool starts its threads as it finds the others at work


if __name__ == "__main__":
    began = time.monotonic()
    {"every_kind": every_kind, "contexts": contexts, "many": many}[sys.argv[1]]()
    print(f"{time.monotonic() - began:.1f} s")
