"""Keywords of environments as users give them: a wrong one ends in a suggestion, as a wrong name does."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from importlib import import_module
from inspect import Parameter, signature
from typing import Any

from spikecam_env.errors import InputError, unknown_name

OF_GYMNASIUM = ("max_episode_steps", "disable_env_checker", "num_envs", "vectorization_mode")
"""Keywords of `gymnasium.make` and `make_vec`, which no environment gets."""


def keywords_of(kind: type) -> list[str]:
    """Keywords that a class of environments takes, its parents' included.

    Example:
        >>> from spikecam_env.envs.tasks.env import TaskEnv
        >>> "split" in keywords_of(TaskEnv), "frames_per_step" in keywords_of(TaskEnv), "axes" in keywords_of(TaskEnv)
        (True, True, False)
    """
    found: dict[str, None] = {}
    settled: set[str] = set()
    for number, each in enumerate(kind.__mro__):
        if "__init__" not in vars(each):
            continue
        parameters = list(signature(vars(each)["__init__"]).parameters.values())[1:]
        own = [p.name for p in parameters if p.kind is Parameter.KEYWORD_ONLY or (number == 0 and _is_named(p))]
        found |= dict.fromkeys(name for name in own if name not in settled)
        settled |= set(getattr(each, "settles", ()))
        if not any(p.kind is Parameter.VAR_KEYWORD for p in parameters):
            break
    return [name for name in found if name != "unknown"]


def check_keywords(kind: type, given: Iterable[str]) -> None:
    """Raise InputError for keywords that a class of environments does not take.

    Args:
        kind: The class.
        given: Names that its constructor could not use.

    Raises:
        InputError: For the first name: whose it is instead, or the nearest that exists.

    Example:
        >>> from spikecam_env.envs.tasks.env import TaskEnv
        >>> check_keywords(TaskEnv, ["frame_per_step"])
        Traceback (most recent call last):
            ...
        spikecam_env.errors.InputError: unknown keyword 'frame_per_step'; choose one of ... (frames_per_step?)
    """
    for name in given:
        elsewhere = _elsewhere(kind, name)
        if elsewhere:
            raise InputError(f"unknown keyword {name!r}; {elsewhere}")
        raise unknown_name("keyword", name, keywords_of(kind))


def check_settled(kind: type, given: Iterable[str]) -> None:
    """Raise InputError for keywords that a class, or a parent of it, sets itself (`settles`)."""
    settled = _settled(kind)
    check_keywords(kind, [name for name in given if name in settled])


def _settled(kind: type) -> set[str]:
    return {name for each in kind.__mro__ for name in getattr(each, "settles", ())}


def _is_named(parameter: Parameter) -> bool:
    return parameter.kind is Parameter.POSITIONAL_OR_KEYWORD


def _elsewhere(kind: type, name: str) -> str:
    """Whose the keyword is, if it is another's; else nothing."""
    if name in OF_GYMNASIUM:
        return "it is of gymnasium.make and gymnasium.make_vec, which take it themselves"
    if name in _of_vectors():
        return 'it is of vector environments: gymnasium.make_vec(id, vectorization_mode="vector_entry_point", ...)'
    if name in _settled(kind):
        return f"{kind.__name__} sets it itself"
    tasks: dict[str, Any] = import_module("spikecam_env.envs.tasks").TASKS
    of = [task for task, its in tasks.items() if name in (field.name for field in fields(its))]
    if of:
        return (
            f"it is a number of tasks ({', '.join(of)}): TaskEnv({of[0]}({name}=...)), or make(id, task={of[0]}(...))"
        )
    return ""


def _of_vectors() -> set[str]:
    """Keywords of vector environments alone."""
    vector = import_module("spikecam_env.envs.vector").SpikeCameraVectorEnv
    single = import_module("spikecam_env.envs.spike_camera").SpikeCameraEnv
    return (
        set(signature(vector.__init__).parameters) - set(signature(single.__init__).parameters) - {"single", "options"}
    )
