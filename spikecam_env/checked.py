"""Values of a user that many functions take: sizes, counts, seeds, numbers; each is checked by one function.

Whatever is refused is an InputError that says the value and its range.
"""

from __future__ import annotations

import math
import os
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from spikecam_env.errors import InputError, shown
from spikecam_env.numbers import LARGEST_COUNT, LARGEST_SEED, MOST_PIXELS, Range, WholeRange, as_whole, with_value

LARGEST_DERIVED_SEED = 2**128 - 1
"""Largest seed of a sensor, which may be made from a user's by arithmetic."""


def checked_shape(shape: Any, name: str = "shape") -> tuple[int, int]:
    """(rows, columns), both 1 or more, at most MOST_PIXELS together."""
    try:
        rows, columns = (as_whole(n) or 0 for n in shape)
    except (TypeError, ValueError):
        rows = columns = 0
    if rows < 1 or columns < 1:
        raise InputError(f"{with_value(name, shape)}; it must be two positive whole numbers, (rows, columns)")
    if rows * columns > MOST_PIXELS:
        raise InputError(f"{with_value(name, shape)}; it must be at most {MOST_PIXELS} pixels (8192 x 8192)")
    return rows, columns


def checked_count(count: Any, name: str = "frames", most: int = LARGEST_COUNT) -> int:
    """A whole number, 1 to `most`."""
    return checked_whole(count, name, 1, most)


def checked_seed(seed: Any, name: str = "seed", most: int = LARGEST_SEED) -> int:
    """A whole number, 0 to `most`."""
    return checked_whole(seed, name, 0, most)


def checked_whole(value: Any, name: str, least: int = -LARGEST_COUNT, most: int = LARGEST_COUNT) -> int:
    """A whole number from `least` to `most`; true and false are none."""
    if type(value) is int and least <= value <= most:  # nearly all are
        return value
    return WholeRange(least, most).check(value, name)


def checked_number(
    value: Any, name: str, least: float = -math.inf, most: float = math.inf, *, unit: str = "", above: bool = False
) -> float:
    """A finite number from `least` to `most`; `above`: not `least` itself."""
    if type(value) is float and least < value < most:  # nearly all are
        return value
    return Range(least, most, unit, above).check(value, name)


def checked_numbers(
    values: Any, name: str, count: int, least: float = -math.inf, most: float = math.inf, *, unit: str = ""
) -> tuple[float, ...]:
    """So many finite numbers from `least` to `most`, as a list, tuple or array.

    Args:
        values: The numbers.
        name: Begins the error's text.
        count: How many there have to be.
        least: Smallest number that is allowed.
        most: Largest number that is allowed.
        unit: Unit of the numbers, for the error's text.

    Returns:
        The numbers as floats.

    Raises:
        InputError: For text, another count, and a number that is not finite or out of range.

    Example:
        >>> checked_numbers([1, 2.5], "offset", 2)
        (1.0, 2.5)
    """
    listed = [] if isinstance(values, (str, bytes, dict, set)) else _listed(values)
    numbers = [number for number in map(Range(least, most).number, listed) if number is not None]
    if not len(numbers) == len(listed) == count:
        rule = "finite numbers" if least == -math.inf else f"numbers from {least:g} to {most:g}"
        raise InputError(f"{with_value(name, values)}; it must be {count} {rule}{unit and f' {unit}'}")
    return tuple(numbers)


def _listed(values: Any) -> list[Any]:
    """Its parts; none where it has none."""
    try:
        return list(values)
    except Exception:  # whatever an object of someone else's raises that has no parts
        return []


def checked_switch(value: Any, name: str) -> bool:
    """True or false; text such as "no", which Python takes as true, is neither.

    Args:
        value: True or False, numpy's too.
        name: Begins the error's text.

    Returns:
        The value as Python's own.

    Raises:
        InputError: For anything else.

    Example:
        >>> checked_switch("no", "packed")
        Traceback (most recent call last):
            ...
        spikecam_env.errors.InputError: packed = 'no'; it must be True or False
    """
    if type(value).__name__ in ("bool", "bool_"):  # numpy's too, which commands do not import for this
        return bool(value)
    raise InputError(f"{with_value(name, value)}; it must be True or False")


def each_once(values: Iterable[object], what: str) -> None:
    """Refuse a value that a list holds more than once: of two the last would count, or the work would be done twice.

    Args:
        values: of the list; any that can be compared.
        what: begins the error's text, e.g. "--candidates".

    Raises:
        InputError: for the first such value.

    Example:
        >>> each_once(["dead_time", "crosstalk", "dead_time"], "--candidates")
        Traceback (most recent call last):
            ...
        spikecam_env.errors.InputError: --candidates: 'dead_time' is given more than once; give it once
    """
    seen: list[object] = []
    for value in values:
        if value in seen:
            given = os.fspath(value) if isinstance(value, os.PathLike) else value
            raise InputError(f"{what}: {shown(given)} is given more than once; give it once")
        seen.append(value)


_LITTLE = 1 << 24
"""Bytes that every machine has: a look at its memory takes a tenth of a step at 64 x 64."""


def checked_memory(size: int, what: str) -> None:
    """Check that the memory of this machine or container is enough for `what`.

    Raises:
        InputError: it has less than `size` bytes.
    """
    if size <= _LITTLE:
        return
    most = memory_bytes()
    if size > most:
        raise InputError(f"{what} would take {amount(size)} of memory, this machine has {amount(most)}; ask less")


def checked_disk(size: int, path: str | Path, what: str) -> None:
    """Check that the disk of a path, whose folders may not exist yet, has room for `what`.

    Raises:
        InputError: it has less than `size` bytes free.
    """
    place = Path(path).absolute()
    while not os.path.exists(place) and place != place.parent:  # False too for a name that is too long
        place = place.parent
    free = shutil.disk_usage(place).free
    if size > free:
        raise InputError(f"{what} would take {amount(size)} on disk; {place} has {amount(free)} free")


def memory_bytes() -> int:
    """Memory of this machine, or the limit of its container."""
    try:
        most = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):  # no POSIX system: no limit is known
        most = 1 << 62
    for limit in ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"):
        try:
            most = min(most, int(Path(limit).read_text()))
        except (OSError, ValueError):  # none, or "max"
            continue
    return most


def amount(size: float) -> str:
    """Bytes in the unit that fits: `38.4 kB`, `12 GB`."""
    for unit in ("bytes", "kB", "MB", "GB"):
        if size < 1000:
            return f"{size:.3g} {unit}"
        size /= 1000
    return f"{size:.3g} TB"
