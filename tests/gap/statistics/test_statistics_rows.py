"""Noise that rows have in common."""

from __future__ import annotations

from small import effect, loudest, quiet, recorded, seen


def test_noise_of_the_whole_array_is_no_noise_of_rows():
    z = seen(recorded(effect("common_threshold_noise", sigma_mV=3.0)))
    worst, key = loudest(z, "rows")
    print(f"{worst:.1f} {key}")
    assert worst < quiet(sum(k.group == "rows" for k in z))
