"""Quantities in words: values with errors, units and no more digits than are known."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from spikecam_env.gap.report.words import bare, parameter_unit
from spikecam_env.gap.result import Bound, Estimate, NamedEffect


def quantity(value: float, unit: str, sd: float | None = None) -> str:
    """A value with its standard deviation and unit, to the digits that the deviation leaves.

    Example:
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
    digits = _digits(sd)
    if digits > 7:
        return f"{value:.4g} ± {sd:.2g} {unit}".rstrip()
    return f"{value:.{digits}f} ± {sd:.{digits}f} {unit}".rstrip()


def interval(estimate: Estimate, unit: str) -> str:
    """The 90 % interval of a parameter, to the digits of `quantity`, at least two an end; a dash where none is known.

    Example:
        >>> interval(Estimate(0.3023, 0.0081, (0.2893, 0.3159)), "relative")
        '28.93 … 31.59 %'
        >>> interval(Estimate(7.2, 6.8, (1.52, 34.06)), "us")
        '1.5 … 34.1 us'
    """
    if estimate.interval is None:
        return "–"
    scale, unit = readable(estimate.value, unit)
    low, high = (_end(end * scale, _digits(estimate.sd * scale)) for end in estimate.interval)
    return f"{low} … {high} {unit}".rstrip()


def _end(value: float, digits: int) -> str:
    own = 1 - math.floor(math.log10(abs(value))) if value else 0
    digits = max(digits, own)
    return f"{value:.2g}" if digits > 7 else f"{value:.{digits}f}"


def _digits(sd: float) -> int:
    """Decimals of a value that leave its standard deviation two digits."""
    return max(0, 1 - math.floor(math.log10(sd))) if sd > 0 and math.isfinite(sd) else 4


def rough(value: float, unit: str) -> str:
    """A value to three digits, or whole, with its unit.

    Example:
        >>> rough(0.0218, "relative"), rough(31000.0, "electrons")
        ('2.18 %', '31000 electrons')
    """
    scale, unit = readable(value, unit)
    return f"{three_digits(value * scale)} {unit}".rstrip()


def three_digits(value: float) -> str:
    """A number to three digits, a large one whole."""
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def readable(value: float, unit: str) -> tuple[float, str]:
    """The unit that a value is stated in, and the factor to it: (factor, unit)."""
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
    return ", ".join(
        f"{bare(effect.name, p)} {rough(e.value, parameter_unit(effect.name, p))}" for p, e in effect.parameters.items()
    )


def at_most(bound: Bound) -> str:
    """A bound to two digits, rounded up: below it none is known."""
    scale, unit = readable(bound.below, bound.unit)
    value = bound.below * scale
    digit = 10.0 ** (math.floor(math.log10(value)) - 1) if value > 0 else 1.0
    return f"{math.ceil(value / digit - 1e-9) * digit:.4g} {unit}".rstrip()


def bound_heading(bounds: Sequence[Bound]) -> str:
    """The head of a column of bounds, with their kind."""
    linear = any(b.kind == "linear" for b in bounds)
    return f"at most (95 %, {'by linear response' if linear else 'simulated'})"


def bounded_parameter(bound: Bound) -> str:
    """The parameter that a bound is of, with the effect's others where it shows least."""
    others = [f"{bare(bound.name, k)} {quantity(v, parameter_unit(bound.name, k))}" for k, v in bound.at.items()]
    return bare(bound.name, bound.parameter) + (f" ({', '.join(others)})" if others else "")


def number(value: Any) -> str:
    """Four digits; large ones whole, by thousands."""
    if isinstance(value, (float, np.floating)):
        known = float(value)
        return f"{known:.4g}" if abs(known) < 1e4 else f"{known:,.0f}".replace(",", "\u202f")
    return "–" if value is None else str(value)


def signed(z: float) -> str:
    """A deviate with its sign."""
    return f"{z:+.1f}".replace("-", "−")


def percent(share: float) -> str:
    """A share in per cent."""
    return f"{100 * share:.0f} %" if share >= 0.01 else f"{100 * share:.1g} %"
