"""Frames missing from a recording, or doubled: from one frame on all pixels are ahead of their time, or behind."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.check.contradiction import Contradiction
from spikecam_env.gap.compare.distance import SHOWS
from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.observe.observation import BIN, ObservedRecording
from spikecam_env.gap.statistics.film import refitted_film
from spikecam_env.gap.twins.case import Case
from spikecam_env.types import Floats

MOST_BINS = 25
"""Largest shift of a moving recording against its light that is looked for [bins of the film]."""

LEAST_TIMED = 20
"""Pixels with regular intervals only, of a recording that is looked at for lost frames."""

LATE_SHARE = 0.3
"""Frames by which pixels are late after a gap, at least.  Of the delay in a gap, that of other frames is less."""

AS_GOOD = 0.8
"""Share that a shift as good removes of the misfit that the best one removes."""

SEGMENTS = 8
"""Parts of a moving recording whose timing is compared."""


def dropped(case: Case, suspect: set[str]) -> list[Contradiction]:
    """Frames missing (or doubled): from one frame on all pixels are ahead of (behind) their time."""
    contradictions = []
    for c, o in zip(case.conditions, case.observations, strict=True):
        if c.name in suspect or c.light is None:
            continue
        jump = (_jump_moving(case, c, o) if o.film is not None else None) if c.moves else _jump_steady(case, o)
        if jump is not None:
            at, frames = jump
            what = "missing" if frames > 0 else "doubled"
            text = f"{c.name}: about {abs(frames):.0f} frames {what} near frame {at}"
            if not c.moves:  # spikes repeat: so many missing look like the rest of an interval too many
                text = f"{c.name}: frames missing or doubled near frame {at}"
            contradictions.append(Contradiction("dropped", (c.name,), text))
    return contradictions


def _jump_steady(case: Case, o: ObservedRecording) -> tuple[int, float] | None:
    """(frame, missing): intervals that span a gap are short by it; they end within an interval after it.

    A gap of half an interval makes some of them irregular, which are not timed, and lengthens the others.  Where more
    than two intervals on either side are late, light or the dark level changes; nearer to an end than that, it may.

    Two gaps are in few frames, a flicker in many.  Few pixels are late together by chance, where spikes are lost and a
    mean interval of 2 frames makes one of 4 regular.
    """
    if int(np.count_nonzero(o.short + o.long == 0)) < LEAST_TIMED:
        return None
    interval = o.shape[0] * o.shape[1] / max(float(o.frame.mean()), 1e-9)
    window = int(np.clip(round(interval), 4, o.frames // 8))
    total, timed = (np.convolve(a, np.ones(window), "valid") for a in (o.late, o.timed))
    spread = 1.4826 * float(np.median(np.abs(total - np.median(total)))) + 1e-9
    at = int(np.argmax(np.abs(total)))
    mean = float(total[at] / max(timed[at], 1))
    elsewhere = np.delete(np.abs(total), slice(max(at - 2 * window, 0), at + 2 * window))
    passes = float(np.quantile(elsewhere, 0.9)) < LATE_SHARE * abs(total[at])
    inside = 2 * window <= at < total.size - 2 * window
    if abs(total[at]) > 2 * SHOWS * spread and abs(mean) > LATE_SHARE and passes and inside:
        return at, -mean
    return None


def _jump_moving(case: Case, condition: Condition, o: ObservedRecording) -> tuple[int, float] | None:
    """(frame, missing) from how late each segment of the film is against its light."""
    assert o.film is not None
    expected = refitted_film(condition, case.base)
    parts = np.array_split(np.arange(1, len(expected) - 1), SEGMENTS)  # the ends have a change on one side only
    coarse = [_bins_late(o.film, expected, part) for part in parts]
    if len(set(coarse)) > 1 and coarse[0] == 0:
        k = next(i for i, s in enumerate(coarse) if s != 0)
        return k * condition.frames // SEGMENTS, float(coarse[k] * BIN)
    change = -np.gradient(expected, axis=0) / BIN
    left = o.film - expected
    late, weight = [], []
    for part in parts:
        power = float((change[part] ** 2).sum())
        late.append(float((left[part] * change[part]).sum()) / max(power, 1e-9))
        weight.append(power)
    times = np.array(late)
    if min(weight) <= 0:
        return None
    steps = [times[k:].mean() - times[:k].mean() for k in range(1, SEGMENTS)]
    k = int(np.argmax(np.abs(steps))) + 1
    rest = max(float(np.std(times[:k] - times[:k].mean())), float(np.std(times[k:] - times[k:].mean())))
    if abs(steps[k - 1]) < max(1 - LATE_SHARE, SHOWS * rest):
        return None
    return k * condition.frames // SEGMENTS, -steps[k - 1]


def _bins_late(film: NDArray[np.uint8], expected: Floats, part: NDArray[np.int64]) -> int:
    """Bins by which the light has to be moved on to agree best with a part of the film, the fewest that do as well; 0
    unless clearly better."""
    seen = film[part].astype(np.float64)
    scores = {}
    for shift in range(-MOST_BINS, MOST_BINS + 1):
        if part[0] + shift >= 0 and part[-1] + shift < len(expected):
            scores[shift] = float(((seen - expected[part + shift]) ** 2).sum())
    least = min(scores.values())
    if least > AS_GOOD * scores[0]:
        return 0
    return min((s for s in scores if scores[s] < scores[0] - AS_GOOD * (scores[0] - least)), key=abs)
