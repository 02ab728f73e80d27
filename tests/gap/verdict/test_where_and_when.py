"""Where and when: a part of the array, a part of the time."""

from __future__ import annotations

import numpy as np
import pytest
from small import FRAMES, SHAPE, case_from, effect, recorded, spikes_of

from spikecam_env.gap.verdict.where_and_when import (
    later_half,
    line_in_one_half,
    outlying_counts,
    outlying_means,
    step_in_the_middle,
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


NINE = np.repeat(np.arange(9), 100)
"""(P,) fields of 900 pixels."""


@pytest.mark.parametrize("inside, stands_out", [(1.7, False), (2.4, True)])
def test_a_field_has_to_have_twice_the_irregular_intervals(inside: float, stands_out: bool) -> None:
    """Of 10 000 a field, so that the noise of counts is no matter."""
    irregular = np.where(NINE == 4, 100.0 * inside, 100.0)
    assert outlying_counts(irregular, NINE)[4] == stands_out and not outlying_counts(irregular, NINE)[5]


@pytest.mark.parametrize("noises, stands_out", [(6.0, False), (10.0, True)])
def test_a_field_of_few_irregular_intervals_has_to_stand_out_of_their_noise(noises: float, stands_out: bool) -> None:
    """Four are expected of a field: eight noises are sixteen more."""
    irregular = np.full(900, 0.04)
    irregular[NINE == 4] = (4 + noises * 2) / 100
    assert outlying_counts(irregular, NINE)[4] == stands_out


@pytest.mark.parametrize("off, stands_out", [(0.7e-4, False), (1.4e-4, True)])
def test_a_field_has_to_be_off_by_more_than_labels_can_be(off: float, stands_out: bool) -> None:
    assert outlying_means(np.where(NINE == 4, off, 0.0), NINE)[4] == stands_out


@pytest.mark.parametrize("off, stands_out", [(6e-3, False), (14e-3, True)])
def test_a_field_has_to_be_off_by_eight_times_the_scatter_of_the_others(off: float, stands_out: bool) -> None:
    """The others are at plus and minus 1e-3; of the six nearest to the median, 1e-3, the scatter is 1.15e-3."""
    values = np.array([1, -1, 1, -1, 0, 1, -1, 1, -1], float)[NINE] * 1e-3
    values[NINE == 4] = off
    assert outlying_means(values, NINE)[4] == stands_out


def test_halves_have_to_differ_by_noise_and_by_a_share() -> None:
    of = {d: later_half(np.array([500 - 500 * d, 500 + 500 * d]), 8.0, 0.3) for d in (0.2, 0.4, -0.4)}  # noise: 0.25
    print(of)
    assert of == {0.2: [], 0.4: [True], -0.4: [False]}
    many = {d: later_half(np.array([5e5 * (1 - d), 5e5 * (1 + d)]), 8.0, 0.3) for d in (0.2, 0.4)}
    assert many == {0.2: [], 0.4: [True]}
    few = {d: later_half(np.array([50 * (1 - d), 50 * (1 + d)]), 8.0, 0.3) for d in (0.6, 0.9)}  # 6 and 9 noises of 0.1
    assert few == {0.6: [], 0.9: [True]}
    pooled = {d: later_half(np.array([50 * (1 - d), 50 * (1 + d)]), 5.0, 0.3) for d in (0.35, 0.6)}
    assert pooled == {0.35: [], 0.6: [True]}


@pytest.mark.parametrize(
    "first, second, said", [(1, 40, []), (1, 80, [True]), (80, 1, [False]), (200, 800, []), (100, 800, [True])]
)
def test_a_line_is_of_one_half_where_it_is_strong_there_and_weak_in_the_other(first, second, said) -> None:
    assert line_in_one_half(first, second) == said


def test_a_step_in_the_middle_has_to_be_beyond_labels_and_explain_the_change() -> None:
    blocks = np.ones(16)
    for step, said in ((1.4e-5, []), (3e-5, [True]), (-3e-5, [False])):
        assert step_in_the_middle(blocks + np.repeat([0.0, step], 8), 8.0) == said
    for noises, said in ((6.0, []), (10.0, [True])):
        scatter = np.tile([1e-3, -1e-3], 8)
        assert step_in_the_middle(blocks + scatter + np.repeat([0.0, noises * 1e-3], 8), 8.0) == said
