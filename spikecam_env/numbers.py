"""Numbers with a range, declared once: arguments, options, entries of files and parameters are checked by it.

Range(0, 25, "us").check(value, "tau_us")          an argument
rpm: Annotated[float, Range(-1e9, 1e9)]            an option of a command, or an entry of a file (`untrusted`)
tau_us: float = parameter(0.1, unit="us", ...)     a parameter of a model (`sensor.ranges`)
"""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass
from numbers import Real
from typing import Annotated, Any

from spikecam_env.errors import InputError, shown

MOST_PIXELS = 1 << 26
"""Largest picture [pixels], 8192 x 8192: 64 times that of the largest spike camera."""
LARGEST_SEED = 2**63 - 1
"""Largest seed of a user: files hold signed 64-bit numbers."""
LARGEST_COUNT = 2**53
"""Whole numbers beyond are not exact as float64, in which JSON tools hold them."""
MOST_RPM = 1e9
"""Fastest disk [turns a minute]: 1000 times the fastest motors."""
MOST_WORKERS = 1024
"""Threads or processes of a command; the largest machines have some hundreds of cores."""


@dataclass(frozen=True)
class Range:
    """Finite numbers from `least` to `most`.

    Example:
        >>> Range(0, 1).check(1.5, "share")
        Traceback (most recent call last):
            ...
        spikecam_env.errors.InputError: share = 1.5; it must be a number from 0 to 1
    """

    least: float = -math.inf
    most: float = math.inf
    unit: str = ""
    above: bool = False
    """Leave out `least` itself."""
    infinite: bool = False
    """Take infinity too."""

    def check(self, value: Any, name: str) -> float:
        """The value as a float; raises InputError, which begins with the name, where it is out of range."""
        number = self.number(value)
        if number is None:
            raise InputError(f"{with_value(name, value)}; it must {self.rule(value)}")
        return number

    def number(self, value: Any) -> float | None:
        """The value as a float; None where it is out of range."""
        number = as_number(value)
        inside = math.isfinite(number) and self.least <= number <= self.most
        fits = (inside and not (self.above and number == self.least)) or (self.infinite and number == math.inf)
        return number if fits else None

    def rule(self, value: Any = None) -> str:
        """The range in words, after "it must"."""
        rule = f"be {self._interval()}{self.unit and f' {self.unit}'}"
        return f"{rule}, or inf" if self.infinite else rule

    def _interval(self) -> str:
        if self.least == -math.inf and self.most == math.inf:
            return "a finite number"
        if self.most == math.inf:
            kind = "number" if self.infinite else "finite number"
            return f"a {kind} {'above' if self.above else 'of at least'} {self.least:g}"
        ends = ("above", "and up to") if self.above else ("from", "to")
        return f"a number {ends[0]} {self.least:g} {ends[1]} {self.most:g}"

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """The check of an entry of a file."""
        from pydantic_core import PydanticCustomError, core_schema

        def entry(value: Any) -> float:
            number = self.number(value)
            if number is None:
                raise PydanticCustomError("range", "{rule}", {"rule": self.rule(value)})
            return number

        return core_schema.no_info_plain_validator_function(entry)


@dataclass(frozen=True)
class WholeRange(Range):
    """Whole numbers from `least` to `most`; true and false are none."""

    least: float = -LARGEST_COUNT
    most: float = LARGEST_COUNT

    def check(self, value: Any, name: str) -> int:
        """The value as an int; raises InputError, which begins with the name, where it is out of range."""
        return int(super().check(value, name))

    def number(self, value: Any) -> int | None:
        """The value as an int; None where it is out of range."""
        number = as_whole(value)
        return None if number is None or not self.least <= number <= self.most else number

    def rule(self, value: Any = None) -> str:
        """The range in words, after "it must"."""
        number = as_whole(value)
        too_large = number is not None and number > self.most
        return f"be a whole number, {self.least} {f'to {self.most}' if too_large else 'or more'}"


Count = Annotated[int, WholeRange(1)]
"""1 or more."""
Whole = Annotated[int, WholeRange(0)]
"""0 or more."""
Workers = Annotated[int, WholeRange(1, MOST_WORKERS)]
"""Threads or processes."""
Seed = Annotated[int, WholeRange(0, LARGEST_SEED)]
"""A seed of random numbers."""
Side = Annotated[int, WholeRange(1, MOST_PIXELS)]
"""Rows or columns of a picture."""
Positive = Annotated[float, Range(0, above=True)]
"""A finite number above 0."""
Effort = Annotated[float, Range(0, above=True, infinite=True)]
"""A number above 0; infinite for no end."""
Rpm = Annotated[float, Range(-MOST_RPM, MOST_RPM)]
"""Turns a minute, either way."""


def as_number(value: Any) -> float:
    """A number as a float; NaN for text, true and false, arrays, and all else that is no real number or too large."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return math.nan
    try:
        return float(value)
    except (ValueError, OverflowError):
        return math.nan


def as_whole(value: Any) -> int | None:
    """A whole number as an int; None for all else, true and false included."""
    if isinstance(value, bool):
        return None
    try:
        return operator.index(value)
    except TypeError:
        return None


def with_value(name: str, value: Any) -> str:
    """A name and its value; options of a command as they are typed."""
    if not name.startswith("--"):
        return f"{name} = {shown(value)}"
    return f"{name} {' '.join(shown(item) for item in value) if isinstance(value, tuple) else shown(value)}"
