"""Infos of N environments as gymnasium's vector environments have them, and back.

batched([{"frame": 40}, {"frame": 80}]) = {"frame": [40, 80], "_frame": [True, True]}
rows(batched(infos), N) = infos
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

MISSING = object()


def batched(infos: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """By name an array (N, ...), and as `_name` which environments have it.

    Returns:
        Numbers and arrays are 0 where an environment has none; dictionaries are dictionaries of such; anything else,
        and "final_obs", is an object.

    Example:
        >>> infos = batched([{"on_target": True}, {"on_target": False, "episode_number": 7}])
        >>> infos["episode_number"].tolist(), infos["_episode_number"].tolist()
        ([0, 7], [False, True])
    """
    together: dict[str, Any] = {}
    alike = all(info.keys() == infos[0].keys() for info in infos)
    for name in infos[0] if alike else dict.fromkeys(chain.from_iterable(infos)):
        values = [info.get(name, MISSING) for info in infos]
        has = np.ones(len(infos), bool) if alike else np.array([value is not MISSING for value in values])
        together[name] = _objects(values) if name == "final_obs" else _batched_values(values, has)
        together[f"_{name}"] = has
    return together


def rows(infos: dict[str, Any], count: int) -> list[dict[str, Any]]:
    """The N infos of `batched`, with Python's own numbers.

    Example:
        >>> rows(batched([{"on_target": True}, {"on_target": False, "episode_number": 7}]), 2)
        [{'on_target': True}, {'on_target': False, 'episode_number': 7}]
    """
    each: list[dict[str, Any]] = [{} for _ in range(count)]
    for name, values in infos.items():
        has = infos.get(f"_{name}")
        if has is None:  # it is a mask
            continue
        if isinstance(values, dict):
            values = rows(values, count)
        elif values.ndim == 1:
            values = values.tolist()
        for info, value, its_own in zip(each, values, has.tolist(), strict=True):
            if its_own:
                info[name] = value
    return each


def _batched_values(values: list[Any], has: NDArray[np.bool_]) -> Any:
    """values: N, MISSING where not has."""
    first = values[int(has.argmax())]
    if isinstance(first, dict):
        return batched([{} if value is MISSING else value for value in values])
    if type(first) not in (int, float, bool) and not isinstance(first, (np.number, np.ndarray)):
        return _objects(values)
    nothing = np.zeros_like(first)
    return np.array([nothing if value is MISSING else value for value in values], dtype=nothing.dtype)


def _objects(values: list[Any]) -> NDArray[Any]:
    """None where there is none."""
    array = np.full(len(values), None, dtype=object)
    for n, value in enumerate(values):
        if value is not MISSING:
            array[n] = value
    return array
