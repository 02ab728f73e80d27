"""Noise that rows have in common."""

from __future__ import annotations

import pytest
from small import check_reveals, effect, loudest, quiet, recorded, seen

CASES = [
    # of 32 rows the array has 1 / sqrt(32) of it: at 8 mV that shows in the spectrum of bright flats
    (effect("row_temporal_noise", sigma_mV=6.0), "dark", ["row 1"], ["spectrum"]),
]


@pytest.mark.parametrize("shown_by, where, names, silent", CASES, ids=lambda v: getattr(v, "name", None))
def test_rows_reveal(shown_by, where, names, silent):
    check_reveals("rows", shown_by, where, names, silent)


def test_noise_of_the_whole_array_is_no_noise_of_rows():
    z = seen(recorded(effect("common_threshold_noise", sigma_mV=3.0)))
    worst, key = loudest(z, "rows")
    print(f"{worst:.1f} {key}")
    assert worst < quiet(sum(k.group == "rows" for k in z))
