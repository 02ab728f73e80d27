"""Irregular intervals."""

from __future__ import annotations

import pytest
from small import CLEAR, check_reveals, effect, quiet, recorded, seen

CASES = [
    (effect("missed_spikes", probability=0.002), "flat-0.2", ["long"], ["timing"]),
    (effect("spurious_spikes", probability=0.0005), "flat-0.2", ["short", "length 1", "length 2"], ["timing"]),
    (effect("afterpulsing", probability=0.002), "flat-0.2", ["short", "length 2"], ["timing", "dark"]),
]


@pytest.mark.parametrize("shown_by, where, names, silent", CASES, ids=lambda v: getattr(v, "name", None))
def test_intervals_reveal(shown_by, where, names, silent):
    check_reveals("intervals", shown_by, where, names, silent)


def test_afterpulsing_shows_at_its_own_delay_only():
    z = seen(recorded(effect("afterpulsing", probability=0.002)))
    lengths = {
        k.name: v for k, v in z.items() if (k.group, k.recording) == ("intervals", "flat-0.08") and "len" in k.name
    }
    print({n: round(v, 1) for n, v in lengths.items()})
    others = [abs(v) for n, v in lengths.items() if n != "length 2"]
    assert lengths["length 2"] > CLEAR and max(others) < quiet(len(others))
