"""Values of a user that many functions take: sizes, counts, seeds, numbers; each is checked by one function.

Whatever is refused is an InputError that says the value and what is allowed.
"""

from __future__ import annotations

import math
import operator
import os
import shutil
from collections.abc import Iterable
from numbers import Real
from pathlib import Path
from typing import Any

from spikecam_env.errors import InputError, shown

MOST_PIXELS = 1 << 26
"""Largest picture [pixels], 8192 x 8192: 64 times that of the largest spike camera."""
LARGEST_SEED = 2**63 - 1
"""Largest seed of a user: files hold signed 64-bit numbers."""
LARGEST_DERIVED_SEED = 2**128 - 1
"""Largest seed of a sensor, which may be made from a user's by arithmetic."""
LARGEST_COUNT = 2**53
"""Whole numbers beyond are not exact as float64, in which JSON tools hold them."""
MOST_RPM = 1e9
"""Fastest disk [turns a minute]: 1000 times the fastest motors."""


def checked_shape(shape: Any, name: str = "shape") -> tuple[int, int]:
    """(rows, columns), both 1 or more, at most MOST_PIXELS together."""
    try:
        rows, columns = (_whole(n) for n in shape)
    except (TypeError, ValueError):
        rows = columns = 0
    if rows < 1 or columns < 1:
        raise InputError(f"{_said(name, shape)}; it must be two positive whole numbers, (rows, columns)")
    if rows * columns > MOST_PIXELS:
        raise InputError(f"{_said(name, shape)}; it must be at most {MOST_PIXELS} pixels (8192 x 8192)")
    return rows, columns


def checked_count(count: Any, name: str = "frames", most: int = LARGEST_COUNT) -> int:
    """A whole number, 1 to `most`."""
    return checked_whole(count, name, 1, most)


def checked_seed(seed: Any, name: str = "seed", most: int = LARGEST_SEED) -> int:
    """A whole number, 0 to `most`."""
    return checked_whole(seed, name, 0, most)


def checked_whole(value: Any, name: str, least: int = -LARGEST_COUNT, most: int = LARGEST_COUNT) -> int:
    """A whole number from `least` to `most`; true and false are none."""
    if type(value) is int and least <= value <= most:  # what nearly all are
        return value
    try:
        number = _whole(value)
    except TypeError:
        number = least - 1
    if not least <= number <= most:
        rule = f"{least} or more" if number < least else f"{least} to {most}"
        raise InputError(f"{_said(name, value)}; it must be a whole number, {rule}")
    return number


def checked_number(
    value: Any, name: str, least: float = -math.inf, most: float = math.inf, *, unit: str = "", above: bool = False
) -> float:
    """A finite number from `least` to `most`; `above`: not `least` itself."""
    if type(value) is float and least < value < most:  # what nearly all are
        return value
    number = as_number(value)
    if not (math.isfinite(number) and least <= number <= most) or (above and number == least):
        raise InputError(f"{_said(name, value)}; it must be {_range(least, most, above)}{unit and f' {unit}'}")
    return number


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
    numbers = [] if isinstance(values, (str, bytes, dict, set)) else _listed(values)
    found = tuple(map(as_number, numbers))
    if len(found) != count or not all(math.isfinite(n) and least <= n <= most for n in found):
        rule = "finite numbers" if least == -math.inf else f"numbers from {least:g} to {most:g}"
        raise InputError(f"{_said(name, values)}; it must be {count} {rule}{unit and f' {unit}'}")
    return found


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
    raise InputError(f"{_said(name, value)}; it must be True or False")


def checked_above_zero(value: Any, name: str) -> float:
    """A number above 0, which may be infinite."""
    number = as_number(value)
    if not number > 0:
        raise InputError(f"{_said(name, value)}; it must be a number above 0, or inf")
    return number


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


def as_number(value: Any) -> float:
    """A number as a float; NaN for text, true and false, arrays, and whatever else is no real number or too large."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return math.nan
    try:
        return float(value)
    except (ValueError, OverflowError):
        return math.nan


_LITTLE = 1 << 24
"""Bytes that every machine has: to look what there is costs two files read, the tenth part of a step at 64 x 64."""


def checked_memory(size: int, what: str) -> None:
    """Raises InputError where so many bytes are more than the memory of this machine or container."""
    if size <= _LITTLE:
        return
    most = memory_bytes()
    if size > most:
        raise InputError(f"{what} would take {_amount(size)} of memory, this machine has {_amount(most)}; ask less")


def checked_disk(size: int, path: str | Path, what: str) -> None:
    """Raises InputError where so many bytes are more than is free where `path` is or will be."""
    place = Path(path).absolute()
    while not os.path.exists(place) and place != place.parent:  # False too for a name that is too long
        place = place.parent
    free = shutil.disk_usage(place).free
    if size > free:
        raise InputError(f"{what} would take {_amount(size)} on disk; {place} has {_amount(free)} free")


def memory_bytes() -> int:
    """Memory of this machine, or what its container may use of it."""
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


def _amount(size: float) -> str:
    """Bytes in the unit that fits: `38.4 kB`, `12 GB`."""
    for unit in ("bytes", "kB", "MB", "GB"):
        if size < 1000:
            return f"{size:.3g} {unit}"
        size /= 1000
    return f"{size:.3g} TB"


def _said(name: str, value: Any) -> str:
    """A name and its value; options of a command as they are typed."""
    if not name.startswith("--"):
        return f"{name} = {shown(value)}"
    return f"{name} {' '.join(shown(item) for item in value) if isinstance(value, tuple) else shown(value)}"


def _whole(value: Any) -> int:
    if isinstance(value, bool):
        raise TypeError
    return operator.index(value)


def _range(least: float, most: float, above: bool) -> str:
    if least == -math.inf and most == math.inf:
        return "a finite number"
    if most == math.inf:
        return f"a finite number {'above' if above else 'of at least'} {least:g}"
    return f"a number {'above' if above else 'from'} {least:g} {'and up to' if above else 'to'} {most:g}"
