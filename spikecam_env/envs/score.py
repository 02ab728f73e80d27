"""How good an agent is at a task: 0 is doing nothing, 1 is the oracle.

    score = (performance - nothing's) / (oracle's - nothing's)

Each is the mean over the same episodes of `info["performance"]` at their end; rewards do not count, so that agents that
learned from different ones compare.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import ArrayLike
from tqdm import tqdm

from spikecam_env.envs.action import checked_action
from spikecam_env.envs.judged import JudgedEnv, is_judged
from spikecam_env.errors import InputError

Policy = Callable[[Any, JudgedEnv], ArrayLike]
"""(observation, environment) -> action.  An agent looks at the observation alone; the oracle at the environment."""


def act_oracle(observation: Any, env: Any) -> ArrayLike:
    """See `JudgedEnv.best_action`."""
    best: ArrayLike = env.best_action()
    return best


def act_nothing(observation: Any, env: Any) -> ArrayLike:
    """Zeros."""
    return np.zeros(env.action_space.shape or (), np.float32)


def act_random(observation: Any, env: Any) -> ArrayLike:
    """Evenly from the action space; `play` seeds it."""
    drawn: ArrayLike = env.action_space.sample()
    return drawn


BASELINES: dict[str, Policy] = {"oracle": act_oracle, "nothing": act_nothing, "random": act_random}


@dataclass(frozen=True)
class Played:
    """Means over episodes, and the performance in each."""

    returns: float
    """Undiscounted sum of rewards."""
    performance: float
    """`info["performance"]` at the end, 0 to 1."""
    success: float
    """Share of episodes with `info["is_success"]` at the end."""
    distance_px: float
    """Distance from the target over all steps [pixels]."""
    ms_a_step: float
    """Time of a step in the environment alone [ms]."""
    steps: float
    """Steps of an episode."""
    camera_bits_s: float
    """What the camera sent [bits/s]; NaN where the environment has no camera."""
    performances: tuple[float, ...]
    """Performance in each episode."""


def play(env: gymnasium.Env[Any, Any], policy: Policy, seeds: Iterable[int], progress: bool | None = False) -> Played:
    """Play a policy's episodes, one a seed.

    Args:
        env: of an id of this package, wrapped or not.
        policy: gives the actions.
        seeds: of the episodes.
        progress: whether a bar is shown; None: in a terminal.

    Raises:
        InputError: for an environment without a performance.
    """
    inner = judged_env(env)
    bar = tqdm(seeds, desc="episodes", unit="episode", leave=False, disable=None if progress is None else not progress)
    rows = [_episode(env, inner, policy, seed) for seed in bar]
    returns, performance, success, distance, seconds, steps, bits, time_s = map(np.array, zip(*rows, strict=True))
    return Played(
        returns=float(returns.mean()),
        performance=float(performance.mean()),
        success=float(success.mean()),
        distance_px=float(distance.sum() / steps.sum()),
        ms_a_step=float(1e3 * seconds.sum() / steps.sum()),
        steps=float(steps.mean()),
        camera_bits_s=float(bits.sum() / time_s.sum()),
        performances=tuple(performance.tolist()),
    )


def judged_env(env: gymnasium.Env[Any, Any]) -> Any:
    """The bare environment, which is a `JudgedEnv`.

    Raises:
        InputError: for an environment whose episodes have no performance.
    """
    inner = env.unwrapped
    if not is_judged(type(inner)):
        raise InputError(f"{type(inner).__name__} has no performance and no oracle; give an id of this package")
    return inner


def score(performance: float, nothing: float, best: float) -> float:
    """See the head of this file; NaN where the oracle does no better than nothing."""
    return (performance - nothing) / (best - nothing) if best > nothing else float("nan")


def ends(env: gymnasium.Env[Any, Any], seeds: Sequence[int]) -> tuple[list[float], list[float]]:
    """Performance of doing nothing and of the oracle: where a score is 0, and where it is 1.

    They look at no pictures, so that no camera is exposed.

    Returns:
        (nothing's, the oracle's), of each episode.
    """
    inner = judged_env(env)
    most = None if env.spec is None else env.spec.max_episode_steps
    nothing, best = zip(*(inner.ends_of(seed, most) for seed in seeds), strict=True)
    return list(nothing), list(best)


def _episode(
    env: gymnasium.Env[Any, Any], inner: Any, policy: Policy, seed: int
) -> tuple[float, float, bool, float, float, int, float, float]:
    """(return, performance, success, distances' sum, seconds in steps, steps, the camera's bits, time of the scene)."""
    inner.action_space.seed(seed)
    (count,) = inner.action_space.shape or (0,)
    observation, info = env.reset(seed=seed)
    total, distance, seconds, steps, over = 0.0, 0.0, 0.0, 0, False
    bits = info.get("camera_bits", np.nan)
    while not over:
        action = np.array(checked_action(policy(observation, inner), count), np.float32)
        began = time.perf_counter()
        observation, reward, terminated, truncated, info = env.step(action)
        seconds += time.perf_counter() - began
        over = terminated or truncated
        total, distance, steps = total + float(reward), distance + info["distance_px"], steps + 1
        bits += info.get("camera_bits", np.nan)
    time_s = info.get("time_s", np.nan)
    return total, info["performance"], info["is_success"], distance, seconds, steps, bits, time_s


def baselines(
    ids: Sequence[str], episodes: int = 20, seed: int = 0, progress: bool = False, **options: Any
) -> list[dict[str, Any]]:
    """The baselines of every id, on the episodes of seeds `seed`, `seed` + 1, ...; test episodes where an id has them.

    Args:
        ids: of the environments.
        episodes: of each id.
        seed: of the first episode.
        progress: whether a bar is shown.
        options: keywords of every environment, e.g. shape.

    Returns:
        A row an id: task, performance, return and success of the oracle and of doing nothing, the score of random
        actions, mean distances of the oracle and of nothing [pixels], milliseconds a step.
    """
    return [_row(name, range(seed, seed + episodes), options) for name in tqdm(ids, unit="task", disable=not progress)]


def _row(name: str, seeds: range, options: dict[str, Any]) -> dict[str, Any]:
    split = {"split": "test"} if name.endswith("-v1") else {}
    env = gymnasium.make(name, **{**split, **options})
    try:
        played = {baseline: play(env, policy, seeds) for baseline, policy in BASELINES.items()}
    finally:
        env.close()
    best, nothing, chance = played["oracle"], played["nothing"], played["random"]
    return {
        "task": name.removeprefix("spikecam_env/"),
        "oracle": best.performance,
        "nothing": nothing.performance,
        "score of random": score(chance.performance, nothing.performance, best.performance),
        "oracle's return": best.returns,
        "nothing's return": nothing.returns,
        "oracle's success": best.success,
        "nothing's success": nothing.success,
        "oracle's distance [px]": best.distance_px,
        "nothing's distance [px]": nothing.distance_px,
        "ms a step": best.ms_a_step,
    }
