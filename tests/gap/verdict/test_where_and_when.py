"""Where and when: a part of the array, a part of the time."""

from __future__ import annotations

import pytest
from small import FRAMES, SHAPE, case_from, effect, recorded, spikes_of

from spikecam_env.gap.verdict.where_and_when import (
    when,
    where,
)

SOME = [
    effect("spurious_spikes", probability=0.002),
    effect("missed_spikes", probability=0.004),
    effect("dead_time", tau_us=2.0),
]
FEW = effect("spurious_spikes", probability=1.5e-5)
"""Some 15 in the half of a recording: told by all recordings together."""
LINES = [effect("light_flicker", modulation=0.05, frequency_hz=400.0), SOME[0], SOME[1], FEW]


def mixed(shown_by, part) -> object:
    """A campaign in which an effect acts only in `part` (frames, rows, columns)."""
    plain, bent = spikes_of(), spikes_of(shown_by)
    for name, spikes in plain.items():
        spikes[part] = bent[name][part]
    return case_from(plain)


@pytest.mark.parametrize("seed", [1, 5, 6, 7])
def test_a_clean_case_is_everywhere_and_always_the_same(seed):
    case = recorded(seed=seed)
    assert (where(case), when(case)) == ("", "")


@pytest.mark.parametrize("shown_by", SOME, ids=lambda e: e.name)
def test_an_effect_of_the_whole_array_has_no_place(shown_by):
    case = recorded(shown_by)
    print(f"where {where(case)!r}, when {when(case)!r}")
    assert (where(case), when(case)) == ("", "")


@pytest.mark.parametrize(
    "shown_by, corner", [(SOME[0], "top left"), (SOME[1], "bottom right"), (SOME[2], "top left")], ids=str
)
def test_an_effect_in_a_corner_is_placed_there(shown_by, corner):
    third = SHAPE[0] // 3, SHAPE[1] // 3
    top = corner == "top left"
    rows = slice(0, third[0]) if top else slice(SHAPE[0] - third[0], None)
    columns = slice(0, third[1]) if top else slice(SHAPE[1] - third[1], None)
    place = where(mixed(shown_by, (slice(None), rows, columns)))
    print(place)
    expected = "rows 0-10, columns 0-10" if top else "rows 22-31, columns 22-31"
    assert place == expected


@pytest.mark.parametrize("shown_by", LINES, ids=str)
def test_an_effect_from_half_way_on_is_timed(shown_by):
    case = mixed(shown_by, slice(FRAMES // 2, None))
    print(f"when {when(case)!r}, where {where(case)!r}")
    assert when(case) == "from about half of each recording on"
    assert where(case) == ""


def test_a_change_of_the_rate_half_way_is_timed():
    """Which half is the odd one, a rate alone does not say."""
    assert "half of each recording" in when(mixed(SOME[2], slice(FRAMES // 2, None)))


def test_an_effect_that_ends_half_way_is_timed():
    assert when(mixed(SOME[0], slice(0, FRAMES // 2))) == "until about half of each recording"
