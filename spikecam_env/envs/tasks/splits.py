"""Episodes that have numbers, in two splits: an agent is never tested on an episode that it could learn from.

Everything in an episode follows from its number.  Users count within a split, from 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from spikecam_env.checked import checked_whole
from spikecam_env.errors import InputError, shown, unknown_name

EPISODES: dict[str, range] = {"train": range(1_000_000), "test": range(1_000_000, 1_001_000)}
"""Split -> numbers that its episodes follow from."""


def checked_split(split: Any, name: str = "split") -> str:
    """A name of EPISODES.

    Raises:
        InputError: for anything else.
    """
    if not isinstance(split, str) or split not in EPISODES:
        raise unknown_name(name, split, EPISODES)
    return split


def drawn_number(rng: np.random.Generator, split: str, options: Mapping[str, Any]) -> int:
    """The number, within its split, of the next episode.

    Args:
        rng: draws it; used alike where a number is given, so that all else stays the same.
        split: a name of EPISODES.
        options: of reset; `episode` is the number that a user chose.

    Raises:
        InputError: for a number that the split does not have.

    Example:
        >>> rng = np.random.default_rng
        >>> drawn_number(rng(0), "test", {}), drawn_number(rng(0), "test", {"episode": 3})
        (850, 3)
    """
    numbers = EPISODES[split]
    drawn = int(rng.integers(numbers.start, numbers.stop)) - numbers.start
    if "episode" not in options:
        return drawn
    given, last = options["episode"], len(numbers) - 1
    try:
        return checked_whole(given, "episode", 0, last)
    except InputError:
        has = f"the {split} split has episodes 0 to {last}"
        raise InputError(f"episode = {shown(given)}; {has}, and it must be one of them") from None


def episode_generator(split: str, number: int, stream: int) -> np.random.Generator:
    """The generator from which an episode follows.

    Args:
        split: a name of EPISODES.
        number: of the episode, within the split.
        stream: of the task, so that tasks whose draws begin alike have different episodes.
    """
    return np.random.default_rng([EPISODES[split].start + number, stream])
