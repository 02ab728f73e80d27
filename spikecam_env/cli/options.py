"""Options with a range: declared where the option stands, checked before the command runs.

    frames: Count = 4000
    rpm: Annotated[float | None, Range(most=1e9)] = None

An error names the option as it is typed.  Options without a range are held to two rules: numbers are finite, and a list
names nothing twice.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from spikecam_env.checked import checked_number, checked_shape, checked_whole, each_once
from spikecam_env.errors import InputError
from spikecam_env.numbers import Range


class _Shape:
    check = staticmethod(checked_shape)


Size = Annotated[tuple[int, int], _Shape()]
"""Rows and columns."""


def check_options(command: Any) -> None:
    """Check the options of a command.

    Raises:
        InputError: the first option that is out of its range.
    """
    hints = get_type_hints(type(command), include_extras=True)
    for field in fields(command):
        value = getattr(command, field.name)
        if is_dataclass(value):
            check_options(value)
        else:
            _check(value, hints[field.name], f"--{field.name.replace('_', '-')}")


def _check(value: Any, hint: Any, name: str) -> None:
    if value is None:
        return
    is_list = isinstance(value, tuple) and _is_list(hint)
    ranges = [mark for mark in _marks(hint) if isinstance(mark, Range | _Shape)]
    if is_list and ranges and not value:
        raise InputError(f"{name} has no value; give one or more")
    for mark in ranges:
        for item in value if is_list else (value,):
            mark.check(item, name)
    if not ranges:
        _check_finite(value, name)
    if is_list:
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
    """Marks in the `Annotated` of a type, and of the parts of a union with None."""
    if get_origin(hint) is Annotated:
        kind, *marks = get_args(hint)
        return [*marks, *_marks(kind)]
    return [mark for part in get_args(hint) if type(None) in get_args(hint) for mark in _marks(part)]
