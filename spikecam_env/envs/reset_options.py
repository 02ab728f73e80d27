"""Options of `reset` as users give them: one check for every environment."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from scenes.protocol import MOST_PLACE
from spikecam_env.checked import checked_numbers
from spikecam_env.errors import InputError, shown, unknown_name

Rule = Callable[[Any, str], Any]
"""(value, name) -> the value to use; raises InputError for an unusable one."""

OF_EVERY = ("light", "model")
"""Options of every environment, which `SpikeCameraEnv` takes before the scene gets the others."""


def pair(value: Any, name: str) -> tuple[float, float]:
    """A rule: two numbers, e.g. (x, y) [pixels]."""
    first, second = checked_numbers(value, name, 2, -MOST_PLACE, MOST_PLACE)
    return first, second


def checked_options(options: Any, rules: Mapping[str, Rule]) -> dict[str, Any]:
    """Options by name, each checked by its rule.

    Args:
        options: a dictionary, or None for no options.
        rules: of the options that this environment knows.

    Raises:
        InputError: for an unknown name, an unusable value, and for options that are no dictionary.

    Example:
        >>> checked_options({"offset": [1, 2]}, {"offset": pair})
        {'offset': (1.0, 2.0)}
    """
    given = as_dictionary(options)
    for name in given:
        if name not in rules:
            raise unknown_name("option of reset", name, (*rules, *OF_EVERY))
    return {name: rules[name](value, name) for name, value in given.items()}


def as_dictionary(options: Any, name: str = "options") -> dict[str, Any]:
    """A copy of the options.

    Raises:
        InputError: unless they are None or a dictionary by name.
    """
    if options is None:
        return {}
    if not isinstance(options, Mapping) or not all(isinstance(key, str) for key in options):
        raise InputError(f"{name} = {shown(options)}; it must be a dictionary of options by name, or None")
    return dict(options)
