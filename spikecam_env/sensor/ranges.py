"""Numbers with a unit and a range: declared where the field stands, checked whenever an instance is made.

@dataclass(frozen=True)
class Circuit:
    reset_V: float = parameter(3.3, unit="V", bounds=(0.1, 20.0), doc="voltage a reset leaves")

    def __post_init__(self) -> None:
        check_parameters(self, "circuit")
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from spikecam_env.errors import InputError, shown, unknown_name
from spikecam_env.numbers import Range


def parameter(
    default: Any = dataclasses.MISSING,
    *,
    unit: str,
    bounds: tuple[float, float] | None = None,
    largest: float | None = None,
    choices: tuple[str, ...] = (),
    periodic: bool = False,
    doc: str,
) -> Any:
    """Declare a field.

    Args:
        default: True or False makes a switch, a whole number a whole number, anything else a number.
        unit: in words.
        bounds: lowest and highest value, both allowed; None for a switch.
        largest: where the upper bound is infinite, the largest value besides infinity.
        choices: of a name, its allowed values.
        periodic: whether the bounds are the same value, as those of a phase are.
        doc: its meaning.
    """
    return dataclasses.field(
        default=default,
        metadata={
            "unit": unit,
            "bounds": bounds,
            "largest": largest,
            "choices": choices,
            "periodic": periodic,
            "doc": doc,
        },
    )


def check_parameters(owner: Any, name: str) -> None:
    """Check every declared field of a frozen dataclass, and keep its value as plain bool, int, float or str.

    Raises:
        InputError: `name.field = value ...`, for a value of another kind or outside its range.
    """
    for field in dataclasses.fields(owner):
        if "bounds" in field.metadata:
            value = _checked(getattr(owner, field.name), field, f"{name}.{field.name}".lstrip("."))
            object.__setattr__(owner, field.name, value)


def range_text(field: dataclasses.Field[Any]) -> str:
    """Allowed range of a declared field in words, without its unit, like `2 .. 1e+12 or inf`; empty for a switch."""
    if field.metadata["choices"]:
        return " or ".join(field.metadata["choices"])
    bounds, largest = field.metadata["bounds"], field.metadata["largest"]
    if bounds is None:
        return ""
    return f"{bounds[0]:g} .. {bounds[1]:g}" if largest is None else f"{bounds[0]:g} .. {largest:g} or {bounds[1]:g}"


def _checked(value: Any, field: dataclasses.Field[Any], place: str) -> bool | int | float | str:
    if field.metadata["choices"]:
        if not isinstance(value, str) or value not in field.metadata["choices"]:
            raise unknown_name(place, value, field.metadata["choices"])
        return str(value)
    if isinstance(field.default, bool):
        if not isinstance(value, (bool, np.bool_)):
            raise InputError(f"{place} = {shown(value)}; it must be true or false")
        return bool(value)
    (low, high), largest = field.metadata["bounds"], field.metadata["largest"]
    most = high if largest is None else largest
    number = Range(low, most, field.metadata["unit"], infinite=high == math.inf).check(value, place)
    if isinstance(field.default, int):
        if not number.is_integer():
            raise InputError(f"{place} = {shown(value)}; it must be a whole number")
        return int(number)
    return number + 0.0  # of -0.0 too: 0.0
