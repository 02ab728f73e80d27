"""Options with a range: declared where the option stands, checked before the command runs.

    frames: Count = 4000
    rpm: Annotated[float | None, Checked(checked_number, most=1e9)] = None

The check is the library's own, with the option's name for the value's.  Options without a check of their own are held
to what every one of them must be: numbers are finite, and a list names nothing twice.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from spikecam_env.checked import (
    MOST_RPM,
    checked_above_zero,
    checked_count,
    checked_number,
    checked_seed,
    checked_shape,
    checked_whole,
    each_once,
)

MOST_WORKERS = 1024
"""Threads or processes of a command; the largest machines have some hundreds of cores."""


class Checked:
    """A check of the library, `check(value, name, **limits)`, for an option's `Annotated`."""

    def __init__(self, check: Callable[..., object], **limits: float) -> None:
        self.check, self.limits = check, limits


Count = Annotated[int, Checked(checked_count)]
"""1 or more."""
Whole = Annotated[int, Checked(checked_whole, least=0)]
"""0 or more."""
Workers = Annotated[int, Checked(checked_count, most=MOST_WORKERS)]
"""Threads or processes."""
Seed = Annotated[int, Checked(checked_seed)]
Size = Annotated[tuple[int, int], Checked(checked_shape)]
"""Rows and columns."""
Positive = Annotated[float, Checked(checked_number, least=0.0, above=True)]
"""A finite number above 0."""

Effort = Annotated[float, Checked(checked_above_zero)]
"""Above 0; infinite for no end."""
Rpm = Annotated[float, Checked(checked_number, least=-MOST_RPM, most=MOST_RPM)]
"""Turns a minute, either way."""


def check_options(command: Any) -> None:
    """Raises InputError for the first option of a command that is out of its range."""
    hints = get_type_hints(type(command), include_extras=True)
    for field in fields(command):
        value = getattr(command, field.name)
        if is_dataclass(value):
            check_options(value)
        else:
            _check(value, hints[field.name], f"--{field.name.replace('_', '-')}")


def _check(value: Any, hint: Any, name: str) -> None:
    checks = [mark for mark in _marks(hint) if isinstance(mark, Checked)]
    if value is None:
        return
    for mark in checks:
        mark.check(value, name, **mark.limits)
    if not checks:
        _check_finite(value, name)
    if isinstance(value, tuple) and _is_list(hint):
        each_once(value, name)


def _check_finite(value: Any, name: str) -> None:
    if isinstance(value, (tuple, list)):
        for item in value:
            _check_finite(item, name)
    elif isinstance(value, float):
        checked_number(value, name)
    elif isinstance(value, int) and not isinstance(value, bool):
        checked_whole(value, name)


def _is_list(hint: Any) -> bool:
    """Whether a type is `tuple[X, ...]`, annotated, or in a union."""
    return (get_origin(hint) is tuple and Ellipsis in get_args(hint)) or any(map(_is_list, get_args(hint)))


def _marks(hint: Any) -> list[Any]:
    """What `Annotated` says of a type, also of those that it is a union of."""
    if get_origin(hint) is Annotated:
        kind, *marks = get_args(hint)
        return [*marks, *_marks(kind)]
    return [mark for part in get_args(hint) if type(None) in get_args(hint) for mark in _marks(part)]
