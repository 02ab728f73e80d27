"""Coordinates that a descent moves parameters by: the logarithm, and of a phase its share of a period.

    value = value_0 exp(s)                                 parameters of one sign
    value = value_0 + PHASE_UNIT (high - low) s, wrapped     periodic parameters (`ranges.parameter`)

A step s of 1 is a factor of e, or PHASE_UNIT of a period.
"""

from __future__ import annotations

import math

import numpy as np

from spikecam_env.sensor import CATALOGUE

SDS_OF_90_PERCENT = 1.645
"""Standard deviations of a 90 % interval, of a normal error."""

PHASE_UNIT = 0.1
"""Share of a period that counts as much as a factor of e; a choice: a derivative then steps over a twentieth of it."""


_MOST_LOGARITHMS = 300.0
"""Beyond every range, and below overflow."""


def moved_value(name: str, key: str, value: float, step: float) -> float:
    """The parameter `key` of effect `name` after a step of its coordinate; bounds of other than phases are not kept."""
    period = _period(name, key)
    if period is None:
        return value * float(np.exp(step))
    low = CATALOGUE[name].__dataclass_fields__[key].metadata["bounds"][0]
    return float(low + (value - low + PHASE_UNIT * period * step) % period)


def error_of(name: str, key: str, value: float, sd: float) -> float:
    """Standard deviation of a parameter, in its own unit, from that of its coordinate."""
    period = _period(name, key)
    return abs(value) * sd if period is None else PHASE_UNIT * period * sd


def interval_of(name: str, key: str, value: float, sd: float) -> tuple[float, float] | None:
    """90 % interval of a parameter, by a normal error of its coordinate, within the parameter's range.

    Args:
        sd: its standard deviation, as of `error_of`.

    Returns:
        (low, high) in the parameter's unit; None where no error is known.  Low is above high where the interval of a
        phase contains the end of the period.
    """
    if not sd > 0 or not math.isfinite(sd):
        return None
    declared = CATALOGUE[name].__dataclass_fields__[key].metadata
    (low, high), half = declared["bounds"], SDS_OF_90_PERCENT * sd
    period = _period(name, key)
    if period is not None:
        return (
            (low, high) if 2 * half >= period else tuple(low + (v - low) % period for v in (value - half, value + half))
        )
    if value == 0:
        ends = [value - half, value + half]
    else:
        factor = math.exp(min(half / abs(value), _MOST_LOGARITHMS))
        ends = sorted([value / factor, value * factor])
    most = high if declared["largest"] is None else declared["largest"]
    return max(ends[0], low), min(ends[1], max(most, value))


def is_apart(name: str, key: str, one: float, other: float, error: float) -> bool:
    """Whether two values of a parameter differ by more than an error, in its own unit, of the second."""
    period = _period(name, key)
    if period is None:
        return not (one * other > 0 and abs(math.log(one / other)) < error / abs(other))
    return abs((one - other + 0.5 * period) % period - 0.5 * period) >= error


def _period(name: str, key: str) -> float | None:
    declared = CATALOGUE[name].__dataclass_fields__[key].metadata
    if not declared["periodic"]:
        return None
    low, high = declared["bounds"]
    return float(high - low)
