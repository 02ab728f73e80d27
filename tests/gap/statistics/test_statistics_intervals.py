"""Irregular intervals."""

from __future__ import annotations

from small import CLEAR, effect, quiet, recorded, seen


def test_afterpulsing_shows_at_its_own_delay_only():
    z = seen(recorded(effect("afterpulsing", probability=0.002)))
    lengths = {
        k.name: v for k, v in z.items() if (k.group, k.recording) == ("intervals", "flat-0.08") and "len" in k.name
    }
    print({n: round(v, 1) for n, v in lengths.items()})
    others = [abs(v) for n, v in lengths.items() if n != "length 2"]
    assert lengths["length 2"] > CLEAR and max(others) < quiet(len(others))
