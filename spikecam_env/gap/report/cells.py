"""Numbers and values as a page writes them, and lists."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from spikecam_env.gap.report.words import human
from spikecam_env.page import element


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


def value_in_words(value: Any) -> str:
    """Anything that describes a discrepancy."""
    if value is None:
        return "not seen"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, dict):
        return "; ".join(f"{human(str(k))} {value_in_words(v)}" for k, v in value.items())
    if isinstance(value, (list, tuple, set)):
        return ", ".join(value_in_words(v) for v in value)
    return number(value)


def bullets(lines: Sequence[str]) -> str:
    """A line a bullet."""
    return f"<ul>{''.join(element('li', line) for line in lines)}</ul>"
