"""Options of `reset` as users give them: one check for every environment."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os import PathLike
from typing import Any

from scenes.protocol import MOST_LIGHT, MOST_PLACE
from spikecam_env.checked import checked_number, checked_numbers
from spikecam_env.errors import InputError, shown, unknown_name
from spikecam_env.sensor import SensorModel

Rule = Callable[[Any, str], Any]
"""(value, name) -> the value to use; raises InputError for an unusable one."""

OF_EVERY = ("light", "model")
"""Options of every environment, which `camera_options` takes before the scene gets the others."""


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


def camera_options(options: Any, usual: SensorModel) -> tuple[SensorModel, float, dict[str, Any]]:
    """The options that every environment with a spike camera takes.

    Args:
        options: as a user gives them.
        usual: the model of episodes that are given none.

    Returns:
        The model of the episode, the factor on its light, and the other options.

    Raises:
        InputError: for an unusable one, and for a model of another frame rate.

    Example:
        >>> camera_options({"light": 0.5, "angle": 1.0}, loaded_model("ideal"))[1:]
        (0.5, {'angle': 1.0})
    """
    given = as_dictionary(options)
    model = loaded_model(given.pop("model", usual))
    if model.frame_rate_hz != usual.frame_rate_hz:
        raise InputError(
            f"model {model.name!r} has {model.frame_rate_hz} frames a second, the environment "
            f"{usual.frame_rate_hz}; make the environment with a model of that rate"
        )
    return model, checked_number(given.pop("light", 1.0), "light", 0.0, MOST_LIGHT, above=True), given


def loaded_model(model: Any) -> SensorModel:
    """The model that a user gave: a preset's name, the path of a TOML file, or a SensorModel.

    Raises:
        InputError: for anything else.
    """
    if isinstance(model, SensorModel):
        return model
    if not isinstance(model, (str, PathLike)):
        raise InputError(f"model is {shown(model)}; give a preset's name, the path of a TOML file, or a SensorModel")
    return SensorModel.load(model)


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
