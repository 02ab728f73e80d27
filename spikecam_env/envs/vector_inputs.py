"""Arguments of a vector environment, checked before anything is changed.

A call that is refused leaves every episode as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from spikecam_env.checked import checked_count, checked_seed
from spikecam_env.envs.action import finite_numbers
from spikecam_env.envs.reset_options import as_dictionary
from spikecam_env.errors import InputError, shown, unknown_name
from spikecam_env.numbers import LARGEST_SEED

RESET_MASK = "reset_mask"
"""Option of `reset` that selects environments, as gymnasium names it."""


def checked_mode(mode: Any) -> AutoresetMode:
    """The autoreset mode.

    Raises:
        InputError: for anything but an `AutoresetMode` or its value: "NextStep", "SameStep", "Disabled".
    """
    for known in AutoresetMode:
        if mode is known or (isinstance(mode, str) and mode == known.value):
            return known
    raise unknown_name("autoreset_mode", mode, [known.value for known in AutoresetMode])


def checked_limit(steps: Any, usual: int | None = None) -> int | None:
    """Steps after which an episode is truncated.

    Args:
        steps: 1 or more; -1 for no limit, and None for the usual one, as `gymnasium.make` has them.
        usual: the limit where none is given; None for no limit.

    Raises:
        InputError: for anything else.

    Example:
        >>> checked_limit(500), checked_limit(-1, 500), checked_limit(None, 500)
        (500, None, 500)
    """
    if steps is None:
        return usual
    if type(steps) is int and steps == -1:
        return None
    return checked_count(steps, "max_episode_steps")


def checked_models(models: Any, count: int) -> list[dict[str, Any]]:
    """Keywords of each environment for its own model; none where `models` is None.

    Raises:
        InputError: for models that are not N in a sequence.
    """
    if models is None:
        return [{}] * count
    if isinstance(models, (str, bytes, dict)) or not isinstance(models, Sequence):
        raise InputError(f"models = {shown(models)}; give a list of {count}, one an environment")
    if len(models) != count:
        raise InputError(f"models are {len(models)}; they must be one an environment, {count}")
    return [{"model": model} for model in deepcopy(list(models))]


def checked_seeds(seed: Any, count: int) -> list[int | None]:
    """The seed of each environment.

    Args:
        seed: s for s, s + 1, ...; or a sequence of N, each a seed or None; or None, for no seed at all.
        count: N.

    Raises:
        InputError: for another number of seeds, and for a value that is no seed.

    Example:
        >>> checked_seeds(5, 2), checked_seeds([7, None], 2)
        ([5, 6], [7, None])
    """
    if seed is None:
        return [None] * count
    if isinstance(seed, np.ndarray) and seed.ndim == 1:
        seed = list(seed)
    if not isinstance(seed, (list, tuple, range)):
        first = checked_seed(seed, most=LARGEST_SEED - count + 1)
        return list(range(first, first + count))
    if len(seed) != count:
        raise InputError(f"seed has {len(seed)} numbers; it must be one an environment, {count}, or one for all")
    return [None if one is None else checked_seed(one, f"seed[{n}]") for n, one in enumerate(seed)]


def checked_options(options: Any, count: int) -> tuple[NDArray[np.bool_], list[dict[str, Any]]]:
    """Which environments begin an episode, and with which options.

    Args:
        options: one dictionary for all, or None; beside the options of one environment it may have "reset_mask", (N,)
            bool.  Or a sequence of N, each a dictionary or None.
        count: N.

    Returns:
        The mask (N,) and N dictionaries.

    Raises:
        InputError: for options of another form, and for a mask of another shape or type, or that selects none.

    Example:
        >>> checked_options([{"episode": 1}, None], 2)
        (array([ True,  True]), [{'episode': 1}, {}])
    """
    everywhere = np.ones(count, bool)
    if isinstance(options, (list, tuple)):
        if len(options) != count:
            raise InputError(f"options are {len(options)}; give one dictionary for all, or one an environment, {count}")
        return everywhere, [as_dictionary(one, f"options[{n}]") for n, one in enumerate(options)]
    given = as_dictionary(options)
    mask = _checked_mask(given.pop(RESET_MASK), count) if RESET_MASK in given else everywhere
    return mask, [given] * count


def checked_actions(actions: Any, shape: tuple[int, ...]) -> NDArray[Any]:
    """Actions of all environments, of finite numbers; values beyond [-1, 1] are cut by each environment.

    Args:
        actions: an array or a tensor, or lists of numbers.
        shape: (N, numbers).

    Raises:
        InputError: for another shape, for values of another type, and for numbers that are not finite.
    """
    try:
        given = _on_host(actions)
    except ValueError as error:
        raise InputError(f"actions = {shown(actions)}; they must be numbers, {shape}") from error
    if given.dtype.kind not in "fiub":
        raise InputError(f"actions are {given.dtype}, {shown(given.tolist())}; they must be numbers, {shape}")
    if given.shape != shape:
        raise InputError(f"actions have shape {given.shape}; they must be one an environment, {shape}")
    finite = np.isfinite(given).all(axis=tuple(range(1, given.ndim)))
    if not finite.all():
        n = int(finite.argmin())
        raise InputError(f"actions[{n}] = {shown(given[n].tolist())}; it must be {finite_numbers(shape[1])} in [-1, 1]")
    return given


def _on_host(values: Any) -> NDArray[Any]:
    """An array, of tensors too, wherever they are."""
    return np.asarray(values.detach().cpu() if hasattr(values, "detach") else values)


def _checked_mask(mask: Any, count: int) -> NDArray[np.bool_]:
    given = _on_host(mask)
    if given.shape != (count,) or given.dtype != bool:
        raise InputError(f"{RESET_MASK} = {shown(mask)}; it must be true or false for each of {count} environments")
    if not given.any():
        raise InputError(f"{RESET_MASK} selects no environment; at least one value must be true")
    return given
