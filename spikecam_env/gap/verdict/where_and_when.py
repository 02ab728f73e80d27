"""Where and when: whether a discrepancy is everywhere and always, or in a part of the array or of the time.

Odd intervals, rate residuals and the strongest spectral line are counted in nine fields of the array and in both halves
of the recordings.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.observe.observation import TIME_BLOCKS
from spikecam_env.gap.statistics.spectrum import spectrum, strongest_line
from spikecam_env.gap.twins.case import Case

Array = NDArray[np.float64]

SIGMAS = 8.0
"""Noises by which a field or a half has to stand out."""

TOGETHER = 5.0
"""Noises by which the halves of all recordings together have to differ: one comparison, not one for each."""

LEAST_FRAMES = 1000
"""Shortest recording whose halves are compared by their lines: pixels of one rate make a line of their own at first."""

FIELDS = 3
"""Fields along each side of the array."""


def where(case: Case) -> str:
    """Rows and columns of the fields that stand out; empty where none does, or most do."""
    odd = np.zeros(case.base.gain.size)
    bent = np.zeros(case.base.gain.size)
    for c, o in zip(case.conditions, case.observations, strict=True):
        if not c.moves:
            odd += o.short + o.long
    known = np.isfinite(case.base.residual)
    bent = np.where(known, case.base.residual, 0.0)[_bright(case)].mean(axis=0) if len(known) else bent
    fields = _fields(case.shape)
    out = _outlying_counts(odd, fields) | _outlying_means(bent, fields)
    if not 0 < out.sum() <= FIELDS:
        return ""
    names = [_name(int(f), case.shape) for f in np.flatnonzero(out)]
    return "; ".join(names)


def _bright(case: Case) -> list[int]:
    static = [c for c in case.conditions if c.kind in ("dark", "flat", "picture")]
    order = sorted((c.level, i) for i, c in enumerate(static) if c.kind == "flat")
    return [i for _, i in order[-3:]]


def _fields(shape: tuple[int, int]) -> NDArray[np.int64]:
    rows = np.arange(shape[0]) * FIELDS // shape[0]
    columns = np.arange(shape[1]) * FIELDS // shape[1]
    both: NDArray[np.int64] = (rows[:, None] * FIELDS + columns[None, :]).reshape(-1)
    return both


def _outlying_counts(odd: Array, fields: NDArray[np.int64]) -> NDArray[np.bool_]:
    count = np.bincount(fields, odd, FIELDS**2)
    share = np.bincount(fields, minlength=FIELDS**2) / fields.size
    usual = float(np.median(count / share))
    expected = np.maximum(usual * share, 1.0)
    return (count > 2.0 * expected) & (count - expected > SIGMAS * np.sqrt(expected))


def _outlying_means(values: Array, fields: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Fields whose median is off by SIGMAS of its own error, sqrt(pi / 2) sd / sqrt(n), and of the others' scatter."""
    mean = np.array([np.median(values[fields == f]) for f in range(FIELDS**2)])
    off = np.abs(mean - np.median(mean))
    inside = np.sort(off)[: FIELDS**2 - FIELDS]
    error = 1.2533 * np.array([values[fields == f].std() / np.sqrt((fields == f).sum()) for f in range(FIELDS**2)])
    return off > np.maximum(SIGMAS * np.maximum(np.sqrt(np.mean(inside**2)), error), 1e-4)


def _name(field: int, shape: tuple[int, int]) -> str:
    r, c = divmod(int(field), FIELDS)
    rows = -(-r * shape[0] // FIELDS), -(-(r + 1) * shape[0] // FIELDS) - 1
    columns = -(-c * shape[1] // FIELDS), -(-(c + 1) * shape[1] // FIELDS) - 1
    return f"rows {rows[0]}-{rows[1]}, columns {columns[0]}-{columns[1]}"


def when(case: Case) -> str:
    """From (or until) which part of steady recordings it acts; empty where always."""
    votes = []
    odd = np.zeros(2)
    for c, o in zip(case.conditions, case.observations, strict=True):
        if c.moves or o.frame.sum() < 1000:
            continue
        half = o.frames // 2
        own = np.array([o.odd[:half].sum(), o.odd[half:].sum()], np.float64)
        odd += own
        votes += _more(own)
        halves = [strongest_line(spectrum(part)) for part in (o.frame[:half], o.frame[half:])]
        (_a, first_line), (_b, second_line) = halves
        louder, quieter = max(first_line, second_line), min(first_line, second_line)
        if o.frames >= LEAST_FRAMES and louder > 60 and louder > 6 * quieter:
            votes.append(second_line > first_line)
        blocks = o.blocks[:-1] if o.frames % TIME_BLOCKS else o.blocks
        votes += _jump(blocks[:, case.base.live].sum(axis=1).astype(np.float64), float(o.frame.sum()))
    if len(votes) < 2:
        votes = _more(odd, TOGETHER)  # few events a recording, but of all together
    if not votes:
        return ""
    return "from about half of each recording on" if np.mean(votes) > 0.5 else "until about half of each recording"


def _more(halves: Array, sigmas: float = SIGMAS) -> list[bool]:
    """Whether there are more counts in the second half; nothing where that may be chance."""
    first, second = halves
    clear = abs(first - second) > max(sigmas * np.sqrt(first + second), 0.3 * (first + second))
    return [bool(second > first)] if clear else []


def _jump(blocks: Array, spikes: float) -> list[bool]:
    """A step of the array's rate in the middle that explains nearly all of its change."""
    whole = blocks[: TIME_BLOCKS // 2 * 2] / blocks.mean()
    first, second = whole[: len(whole) // 2], whole[len(whole) // 2 :]
    step = float(second.mean() - first.mean())
    left = float(np.sqrt(np.mean(np.concatenate([first - first.mean(), second - second.mean()]) ** 2)))
    return [step > 0] if abs(step) > max(SIGMAS * left, 2e-5) else []
