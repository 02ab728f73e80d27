"""Where and when: whether a discrepancy is everywhere and always, or in a part of the array or of the time.

Irregular intervals, rate residuals and the strongest spectral line are compared between nine fields of the array and
between both halves of the recordings.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.baseline.halves_floor import LEAST_FRAMES
from spikecam_env.gap.compare.distance import CLEAR
from spikecam_env.gap.observe.conditions import LABEL_ERROR
from spikecam_env.gap.observe.observation import TIME_BLOCKS
from spikecam_env.gap.search.shortlist import LEAST_SPIKES, LINE
from spikecam_env.gap.statistics.spectrum import spectrum, strongest_line
from spikecam_env.gap.twins.case import Case
from spikecam_env.types import Floats

LOCAL_NOISES = 8.0
"""Noises by which a field, or a half, stands out where, or when, an effect acts.  Comparisons are many; in the clean
campaigns of `tests/gap/verdict` none does."""

TIMES_EXPECTED = 2.0
"""Times expected, irregular intervals of a field in which an effect acts."""

HALF_SHARE = 0.3
"""Of all, the irregular intervals that halves differ by where they are of one half."""

LINE_RATIO = 6.0
"""Power of a line in one half over that in the other."""

FIELDS_PER_SIDE = 3
"""Fields along each side of the array."""


def where(case: Case) -> str:
    """Rows and columns of the fields that stand out; empty where none does, or most do."""
    if case.rates_only:
        return ""
    irregular = np.zeros(case.base.gain.size)
    off = np.zeros(case.base.gain.size)
    for c, o in zip(case.conditions, case.observations, strict=True):
        if not c.moves:
            irregular += o.short + o.long
    known = np.isfinite(case.base.residual)
    off = np.where(known, case.base.residual, 0.0)[brightest_flats(case)].mean(axis=0) if len(known) else off
    fields = fields_of(case.shape)
    out = outlying_counts(irregular, fields) | outlying_means(off, fields)
    if not 0 < out.sum() <= FIELDS_PER_SIDE:
        return ""
    names = [rows_and_columns(int(f), case.shape) for f in np.flatnonzero(out)]
    return "; ".join(names)


def brightest_flats(case: Case) -> list[int]:
    """The three brightest flats, by their place among the recordings that the refit has residuals of."""
    static = [c for c in case.conditions if c.kind in ("dark", "flat", "picture")]
    order = sorted((c.level, i) for i, c in enumerate(static) if c.kind == "flat")
    return [i for _, i in order[-3:]]


def fields_of(shape: tuple[int, int]) -> NDArray[np.int64]:
    """(P,) the field of each pixel, by rows."""
    rows = np.arange(shape[0]) * FIELDS_PER_SIDE // shape[0]
    columns = np.arange(shape[1]) * FIELDS_PER_SIDE // shape[1]
    both: NDArray[np.int64] = (rows[:, None] * FIELDS_PER_SIDE + columns[None, :]).reshape(-1)
    return both


def outlying_counts(irregular: Floats, fields: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(9,) whether a field has more irregular intervals (P,) than expected by the median field."""
    count = np.bincount(fields, irregular, FIELDS_PER_SIDE**2)
    share = np.bincount(fields, minlength=FIELDS_PER_SIDE**2) / fields.size
    usual = float(np.median(count / share))
    expected = np.maximum(usual * share, 1.0)
    more = count - expected > LOCAL_NOISES * np.sqrt(expected)
    return (count > TIMES_EXPECTED * expected) & more


def outlying_means(values: Floats, fields: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(9,) whether the median of a field stands out from its error, from the scatter of the others, and from labels.

    The error of a median is sqrt(pi / 2) sd / sqrt(n).

    Args:
        values: (P,) relative rates.
        fields: (P,) field of each pixel.
    """
    mean = np.array([np.median(values[fields == f]) for f in range(FIELDS_PER_SIDE**2)])
    off = np.abs(mean - np.median(mean))
    inside = np.sort(off)[: FIELDS_PER_SIDE**2 - FIELDS_PER_SIDE]
    error = 1.2533 * np.array(
        [values[fields == f].std() / np.sqrt((fields == f).sum()) for f in range(FIELDS_PER_SIDE**2)]
    )
    chance = LOCAL_NOISES * np.maximum(np.sqrt(np.mean(inside**2)), error)
    outlying: NDArray[np.bool_] = off > np.maximum(chance, CLEAR * LABEL_ERROR)
    return outlying


def rows_and_columns(field: int, shape: tuple[int, int]) -> str:
    """A field as rows and columns of the array."""
    r, c = divmod(int(field), FIELDS_PER_SIDE)
    rows = -(-r * shape[0] // FIELDS_PER_SIDE), -(-(r + 1) * shape[0] // FIELDS_PER_SIDE) - 1
    columns = -(-c * shape[1] // FIELDS_PER_SIDE), -(-(c + 1) * shape[1] // FIELDS_PER_SIDE) - 1
    return f"rows {rows[0]}-{rows[1]}, columns {columns[0]}-{columns[1]}"


def when(case: Case) -> str:
    """The half of steady recordings in which a discrepancy acts; empty where always."""
    if case.rates_only:
        return ""
    votes = []
    irregular = np.zeros(2)
    for c, o in zip(case.conditions, case.observations, strict=True):
        if c.moves or o.frame.sum() < LEAST_SPIKES:
            continue
        half = o.frames // 2
        own = np.array([o.odd[:half].sum(), o.odd[half:].sum()], np.float64)
        irregular += own
        votes += later_half(own, LOCAL_NOISES, HALF_SHARE)
        halves = [strongest_line(spectrum(part)) for part in (o.frame[:half], o.frame[half:])]
        (_a, first_line), (_b, second_line) = halves
        if o.frames >= LEAST_FRAMES:
            votes += line_in_one_half(first_line, second_line)
        blocks = o.blocks[:-1] if o.frames % TIME_BLOCKS else o.blocks
        votes += step_in_the_middle(blocks[:, case.base.live].sum(axis=1).astype(np.float64), LOCAL_NOISES)
    if len(votes) < 2:
        # few events a recording, but of all together; it is one comparison, not one for each recording
        votes = later_half(irregular, CLEAR, HALF_SHARE)
    if not votes:
        return ""
    return "from about half of each recording on" if np.mean(votes) > 0.5 else "until about half of each recording"


def later_half(halves: Floats, noises: float, share: float) -> list[bool]:
    """[whether there are more counts in the second half]; empty where that may be chance.

    Args:
        halves: (2,) counts.
        noises: standard deviations by which they have to differ.
        share: share of all counts by which they have to differ.
    """
    first, second = halves
    clear = abs(first - second) > max(noises * np.sqrt(first + second), share * (first + second))
    return [bool(second > first)] if clear else []


def line_in_one_half(first: float, second: float) -> list[bool]:
    """[whether a line is in the second half alone], by the powers in both; empty where it is in both or in none.

    It has to be twice as strong as one of a whole recording.
    """
    stronger, weaker = max(first, second), min(first, second)
    clear = stronger > 2 * LINE and stronger > LINE_RATIO * weaker
    return [second > first] if clear else []


def step_in_the_middle(blocks: Floats, noises: float) -> list[bool]:
    """[whether the array's rate rises in the middle]; empty without a step.

    A step exceeds the error of labels, and `noises` times the scatter that it leaves.

    Args:
        blocks: (n,) rates of the array in blocks of time.
        noises: factor of the scatter.
    """
    whole = blocks[: TIME_BLOCKS // 2 * 2] / blocks.mean()
    first, second = whole[: len(whole) // 2], whole[len(whole) // 2 :]
    step = float(second.mean() - first.mean())
    left = float(np.sqrt(np.mean(np.concatenate([first - first.mean(), second - second.mean()]) ** 2)))
    return [step > 0] if abs(step) > max(noises * left, LABEL_ERROR) else []
