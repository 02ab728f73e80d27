"""Any policy on the test episodes of a task: its score, in one call.

from spikecam_env.agents import evaluate

print(evaluate(model, "Catch-v1", stack=3))
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
from gymnasium.envs.registration import load_env_creator
from gymnasium.wrappers import FrameStackObservation, ReshapeObservation

from spikecam_env.agents.controllers import classical, classical_sees
from spikecam_env.agents.playing import acting, episodes_of, judged, policy_of
from spikecam_env.checked import checked_count, checked_seed
from spikecam_env.envs.evaluation import Evaluation
from spikecam_env.envs.judged import is_judged
from spikecam_env.envs.observations import Observation
from spikecam_env.envs.registration import ALL_TASKS, ENVIRONMENTS, register
from spikecam_env.errors import InputError, shown, unknown_name

Env = gymnasium.Env[Any, Any]

CLASSICAL = "classical"
MOST_STACK = 1000
"""Pictures of an observation at most: those of a second."""


def evaluate(
    policy: Any,
    task: str,
    *,
    episodes: int | None = None,
    seed: int = 0,
    split: str = "test",
    stack: int = 1,
    obs: str | Observation | None = None,
    wrap: Callable[[Env], Env] | None = None,
    progress: bool | None = None,
    **options: Any,
) -> Evaluation:
    """Score a policy on episodes of a task, with an interval.

    The policy, the oracle and doing nothing have the same episodes: those of the seeds `seed`, `seed` + 1, and so on.

    Args:
        policy: a callable, observation -> action; a model with `predict`, as of stable-baselines3, whose deterministic
            actions are taken; an `Agent` or `Tracker`; or a name: "oracle", "nothing", "random", "classical" (the
            task's player without learning), or a shipped agent's.
        task: an id, with or without `spikecam_env/`, e.g. "Catch-v1", or a scene's, e.g. "Fan-v0".
        episodes: how many; by default 100 of Catch, 50 of Saccade and ReadSpin, 10 of others.
        seed: of the first episode.
        split: "train" or "test", of tasks.
        stack: observations that the policy sees together, along the first axis, the newest last and zeros before the
            first: as `VecFrameStack` of stable-baselines3. For `FrameStackObservation`, which adds an axis, use `wrap`.
        obs: observation of the environment; by default an agent's own, or the environment's.
        wrap: called with the environment; returns it with the wrappers of the training.
        progress: whether a bar is shown; by default in a terminal.
        options: further keywords of the environment, e.g. `shape`.

    Returns:
        The score and its parts; `print` shows it.

    Raises:
        InputError: for an unknown task, a policy that cannot act, and observations or actions of another shape.

    Example:
        >>> import numpy as np
        >>> result = evaluate(lambda picture: np.array([0.3]), "Catch-v1", episodes=4)
        >>> result.nothing, result.oracle, 0 <= result.low <= result.score <= result.high <= 1
        (0.0, 1.0, True)
    """
    name = _known(task)
    episodes = episodes_of(name) if episodes is None else checked_count(episodes, "episodes")
    is_classical = isinstance(policy, str) and policy == CLASSICAL
    act, sees = (None, classical_sees(name)) if is_classical else policy_of(policy)
    given = sees | ({} if obs is None else {"obs": obs}) | options
    if name not in ENVIRONMENTS:
        given["split"] = split
    env = gymnasium.make(name, **given)
    try:
        seen = _wrapped(stacked(env, checked_count(stack, "stack", MOST_STACK)), wrap)
        _check_spaces(policy, seen, stack)
        first = checked_seed(seed)
        act = acting(classical(env)) if act is None else act
        return judged(act, seen, range(first, first + episodes), progress=progress)
    finally:
        env.close()


def stacked(env: Env, stack: int) -> Env:
    """The last observations together, along the first axis, the newest last.

    Args:
        env: gives arrays.
        stack: how many; 1 leaves the environment as it is.

    Returns:
        An environment whose observations are (stack * C, ...) of (C, ...); before the first there are zeros.

    Raises:
        InputError: for observations that are no arrays.

    Example:
        >>> import gymnasium
        >>> stacked(gymnasium.make("spikecam_env/Track-v1"), 3).observation_space.shape
        (3, 64, 64)
    """
    if stack == 1:
        return env
    space = env.observation_space
    if not isinstance(space, gymnasium.spaces.Box):
        raise InputError(f"stack is {stack} and observations are {space}; only arrays can be stacked: use wrap")
    many = FrameStackObservation(env, stack, padding_type="zero")
    return ReshapeObservation(many, (stack * space.shape[0], *space.shape[1:]))


def _known(task: Any) -> str:
    """The id as gymnasium has it."""
    register()
    known = [*ALL_TASKS, *ENVIRONMENTS]
    for name in (task, f"spikecam_env/{task}"):
        if isinstance(task, str) and (name in known or name in gymnasium.registry):
            _check_kind(name)
            return name
    raise unknown_name("task", task, (one.split("/")[1] for one in known))


def _check_kind(name: str) -> None:
    """Raise InputError for an id of other people's, whose episodes have no oracle and no performance."""
    entry = gymnasium.spec(name).entry_point
    kind = load_env_creator(entry) if isinstance(entry, str) else entry
    if isinstance(kind, type) and not is_judged(kind):
        raise InputError(f"{name} makes a {kind.__name__}, which has no oracle; give an id of a task or a scene")


def _wrapped(env: Env, wrap: Any) -> Env:
    """The environment in the user's wrappers."""
    if wrap is None:
        return env
    wrapped = wrap(env) if callable(wrap) else None
    if not isinstance(wrapped, gymnasium.Env):
        raise InputError(f"wrap is {shown(wrap)}; give a function, environment -> environment")
    return wrapped


def _check_spaces(policy: Any, env: Env, stack: int) -> None:
    """Raise InputError for a model that was made for other observations or actions."""
    for of, its, space in (
        ("observations", getattr(policy, "observation_space", None), env.observation_space),
        ("actions", getattr(policy, "action_space", None), env.action_space),
    ):
        expected, shape = getattr(its, "shape", None), space.shape
        if expected is not None and tuple(expected) != shape:
            hint = f"; stack is {stack}, obs and wrap may differ from its training" if of == "observations" else ""
            raise InputError(f"the policy was made for {of} {tuple(expected)}, the task has {shape}{hint}")
