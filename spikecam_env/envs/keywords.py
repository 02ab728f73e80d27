"""Keywords of environments as users give them: a wrong one ends in a suggestion, as a wrong name does."""

from __future__ import annotations

from collections.abc import Iterable
from inspect import Parameter, signature
from pkgutil import resolve_name

from spikecam_env.envs.registration import HINTS_ABOVE
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
    names: dict[str, None] = {}
    settled: set[str] = set()
    for number, parent in enumerate(kind.__mro__):
        if "__init__" not in vars(parent):
            continue
        parameters = list(signature(vars(parent)["__init__"]).parameters.values())[1:]
        own = [p.name for p in parameters if p.kind is Parameter.KEYWORD_ONLY or (number == 0 and _is_named(p))]
        names |= dict.fromkeys(name for name in own if name not in settled)
        settled |= set(getattr(parent, "settles", ()))
        if not any(p.kind is Parameter.VAR_KEYWORD for p in parameters):
            break
    return [name for name in names if name != "unknown"]


def check_keywords(kind: type, given: Iterable[str]) -> None:
    """Refuse keywords that a class of environments does not take.

    Args:
        kind: the class.
        given: names that its constructor could not use.

    Raises:
        InputError: for the first name, with its owner or the nearest name that exists.

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
    return {name for parent in kind.__mro__ for name in getattr(parent, "settles", ())}


def _is_named(parameter: Parameter) -> bool:
    return parameter.kind is Parameter.POSITIONAL_OR_KEYWORD


def _elsewhere(kind: type, name: str) -> str:
    """The owner of the keyword, if it has another one; else nothing."""
    if name in OF_GYMNASIUM:
        return "it is of gymnasium.make and gymnasium.make_vec, which take it themselves"
    of_vectors, of_tasks = (resolve_name(place)(name) for place in HINTS_ABOVE)
    return of_vectors or (f"{kind.__name__} sets it itself" if name in _settled(kind) else of_tasks)
