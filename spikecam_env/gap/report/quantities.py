"""Quantities in words: values with errors, units and no more digits than are known."""

from __future__ import annotations

import math

from spikecam_env.gap.report.words import bare, parameter_unit
from spikecam_env.gap.result import Bound, Estimate, NamedEffect

SDS_OF_90_PERCENT = 1.645
"""Standard deviations of a 90 % interval, of a normal error."""


def quantity(value: float, unit: str, sd: float | None = None) -> str:
    """A value with its standard deviation and unit, to the digits that the latter leaves.

    >>> quantity(0.0612, "relative", 0.0012)
    '6.12 ± 0.12 %'
    >>> quantity(1224.0, "us", 24.0)
    '1.224 ± 0.024 ms'
    """
    scale, unit = readable(value, unit)
    value *= scale
    if sd is None or not math.isfinite(sd) or sd <= 0:
        return f"{value:.4g} {unit}".rstrip()
    sd *= scale
    digits = max(0, 1 - math.floor(math.log10(sd)))
    if digits > 7:
        return f"{value:.4g} ± {sd:.2g} {unit}".rstrip()
    return f"{value:.{digits}f} ± {sd:.{digits}f} {unit}".rstrip()


def readable(value: float, unit: str) -> tuple[float, str]:
    """(factor, unit) that a value of a unit is stated in."""
    if unit == "relative":
        return 100.0, "%"
    if unit == "us":
        return (1e-6, "s") if abs(value) >= 1e6 else (1e-3, "ms") if abs(value) >= 1e3 else (1.0, "us")
    return 1.0, unit


def sizes(parameters: dict[str, Estimate], effect: str) -> str:
    """Parameters in a line."""
    return ", ".join(
        f"{bare(effect, p)} {quantity(e.value, parameter_unit(effect, p), e.sd)}" for p, e in parameters.items()
    )


def plain_sizes(effect: NamedEffect) -> str:
    """An effect's parameters in a line, to three digits and without errors."""
    values = [(p, readable(e.value, parameter_unit(effect.name, p)), e.value) for p, e in effect.parameters.items()]
    return ", ".join(f"{bare(effect.name, p)} {v * scale:.3g} {unit}".rstrip() for p, (scale, unit), v in values)


def at_most(bound: Bound) -> str:
    """A bound to two digits, rounded up: no less can be stated."""
    scale, unit = readable(bound.below, bound.unit)
    value = bound.below * scale
    digit = 10.0 ** (math.floor(math.log10(value)) - 1) if value > 0 else 1.0
    return f"{math.ceil(value / digit - 1e-9) * digit:.4g} {unit}".rstrip()


def bounded_parameter(bound: Bound) -> str:
    """The parameter that a bound is of, with the effect's others where it shows least."""
    others = [f"{bare(bound.name, k)} {quantity(v, parameter_unit(bound.name, k))}" for k, v in bound.at.items()]
    return bare(bound.name, bound.parameter) + (f" ({', '.join(others)})" if others else "")
