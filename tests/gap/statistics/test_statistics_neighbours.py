"""Neighbours that fire together."""

from __future__ import annotations

import pytest
from small import check_reveals, effect

CASES = [
    (effect("crosstalk", kick=0.02), "flat-0.2", ["down 1", "across 1"], ["intervals"]),
]


@pytest.mark.parametrize("shown_by, where, names, silent", CASES, ids=lambda v: getattr(v, "name", None))
def test_neighbours_reveal(shown_by, where, names, silent):
    check_reveals("neighbours", shown_by, where, names, silent)
