"""An episode step by step, and how steps become pictures of a film."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import floor
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from spikecam_env.cli.live.players import Player
from spikecam_env.envs.registration import ALL_TASKS, ENVIRONMENTS
from spikecam_env.envs.score import ends, judged_env, score
from spikecam_env.envs.wrappers.any_env import spike_camera_of
from spikecam_env.errors import InputError, unknown_name

FPS = 25
"""Pictures a second of screen and film."""


@dataclass(frozen=True)
class Moment:
    """An episode after a step, of which 0 is the reset."""

    seed: int
    step: int
    frame: int
    """Of the camera, at the end of the step."""
    time_s: float
    """The same in seconds of the scene."""
    spikes: NDArray[np.uint8]
    """(K, H, W), of the step."""
    reward: float
    """Of the step."""
    total: float
    """Reward of the episode so far."""
    info: dict[str, Any]
    """As of `JudgedEnv`."""
    over: bool
    """Whether the episode ended with the step."""


def environment(name: str, player: Player, **options: Any) -> gymnasium.Env[Any, Any]:
    """The environment of an id, with or without `spikecam_env/`, as the player sees it.

    Args:
        name: the id.
        player: who acts.
        options: of the environment; `split` goes to tasks of version 1 alone.

    Raises:
        InputError: an unknown id, or an agent of a task with other actions.
    """
    full, known = full_name(name), {**ENVIRONMENTS, **ALL_TASKS}
    if full not in known:
        raise unknown_name("id", name, (each.split("/")[1] for each in known))
    if not has_splits(name):
        options.pop("split", None)
    env = gymnasium.make(full, **dict(player.sees), **options)
    numbers = env.action_space.shape[0]  # type: ignore[index]
    if player.actions not in (None, numbers):
        raise InputError(f"{name} takes {numbers} numbers an action, this agent gives {player.actions}: another task's")
    return env


def full_name(name: str) -> str:
    """An id as gymnasium has it."""
    return name if "/" in name else f"spikecam_env/{name}"


def is_environment(name: str) -> bool:
    """Whether it is the id of an environment or a task."""
    return full_name(name) in {**ENVIRONMENTS, **ALL_TASKS}


def has_splits(name: str) -> bool:
    """Whether an id has training and test episodes: those of version 1."""
    return full_name(name) not in ENVIRONMENTS


def episode(env: gymnasium.Env[Any, Any], player: Player, seed: int) -> Iterator[Moment]:
    """Reset, then step by step to the end of the episode."""
    camera, inner, act = spike_camera_of(env), judged_env(env), player.act_in(env)
    if camera is None:
        raise TypeError(f"{type(inner).__name__} has no spike camera before it")
    inner.action_space.seed(seed)
    seen, info = env.reset(seed=seed)
    step, reward, total, over = 0, 0.0, 0.0, False
    while True:
        spikes = camera.blocks.spikes[0].view(np.uint8).copy()
        yield Moment(seed, step, info["frame"], info["time_s"], spikes, reward, total, info, over)
        if over:
            return
        action = np.asarray(act(seen, inner), np.float32)
        seen, paid, terminated, truncated, info = env.step(action)
        step, reward, over = step + 1, float(paid), bool(terminated or truncated)
        total += reward


def most_seconds(env: gymnasium.Env[Any, Any]) -> float:
    """Of an episode, at most [s]; known once there is one, so the first is begun."""
    camera: Any = spike_camera_of(env)
    env.reset(seed=0)
    limits = [
        camera.episode.steps if hasattr(camera, "episode") else None,
        env.spec.max_episode_steps if env.spec is not None else None,
    ]
    return float(min(limit for limit in limits if limit) * camera.step_s)


@dataclass(frozen=True)
class Scored:
    """Mean performances over the same episodes, and the score of `envs.score`."""

    mean: float
    nothing: float
    oracle: float

    @property
    def score(self) -> float:
        """0 is nothing's, 1 the oracle's."""
        return score(self.mean, self.nothing, self.oracle)


def scored(env: gymnasium.Env[Any, Any], ended: Sequence[Moment]) -> Scored:
    """Plays the oracle and nothing on the episodes of which these are the last moments."""
    nothing, best = ends(env, [last.seed for last in ended])
    mean = float(np.mean([last.info["performance"] for last in ended]))
    return Scored(mean, float(np.mean(nothing)), float(np.mean(best)))


def pictures_due(before_s: float, after_s: float, slow: float) -> int:
    """Pictures that fall into a stretch of the scene's time, at FPS pictures a second and `slow` times slower."""
    return floor(after_s * slow * FPS + ROUNDING) - floor(before_s * slow * FPS + ROUNDING)


ROUNDING = 1e-6
"""Of a picture: a step of exactly one picture's time gives one picture."""
