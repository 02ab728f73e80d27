"""Contradictions within the recordings, before any model is compared: labels, order, orientation, missing frames.

Each check looks for one mistake that explains one recording and leaves the others consistent; an effect changes all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.baseline.null_model import model_null
from spikecam_env.gap.compare.distance import GATE, adjusted, deviates
from spikecam_env.gap.compare.prediction import values_of
from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.observe.observation import BIN, Observation
from spikecam_env.gap.statistics.film import light_film
from spikecam_env.gap.twins.case import Case
from spikecam_env.robust import scatter
from spikecam_env.sensor import SensorModel

Array = NDArray[np.float64]

LEAST_LABEL = 1e-3
"""Relative error of a label from which it is reported."""

LEAST_DARK = 0.02
"""The same of a dark recording, against the extrapolation of the flats: of few spikes a pixel, the rate between first
and last is biased by their number squared."""

PIXEL_SPREAD = 0.5
"""Spread over pixels of a recording's residual, over its mean, from which the label is not at fault: a label is one
number, and an effect that sets in there depends on the pixel."""

IRREGULAR = 0.1
"""Share of irregular intervals in a recording, over its mean residual, from which the label is not at fault: spikes are
missing or too many, and light of another level makes no irregular interval."""

MENDED = 0.2
"""Share of the worst disagreement that may be left when a mistake is undone, for it to have been the mistake."""

MOST_BINS = 25
"""Largest shift of a moving recording against its light that is looked for [bins of the film]."""

RELABEL_TWINS = 6
"""Twins that a recording is compared with under another label."""

OFTEN, PASSES = 0.9, 0.4
"""Frames are missing only where the lateness elsewhere, its quantile OFTEN, is below PASSES times the largest: two gaps
are in few frames of a recording, a flicker in many."""

SEGMENTS = 8
"""Parts of a moving recording whose timing is compared."""


@dataclass(frozen=True)
class Contradiction:
    """kind: label, swapped, flipped, dropped or silent.  recordings: concerned; text: the finding, in words.

    factor: what a label has to be multiplied by.
    """

    kind: str
    recordings: tuple[str, ...]
    text: str
    factor: float = 1.0


def audit(case: Case) -> list[Contradiction]:
    """All contradictions, the grossest kind first; later checks skip recordings that are already suspect."""
    found: list[Contradiction] = []
    for check in (silent, flipped, swapped, wrong_label, dropped):
        suspect = {r for c in found for r in c.recordings}
        found += [c for c in check(case, suspect) if not suspect & set(c.recordings)]
    return found


def silent(case: Case, suspect: set[str]) -> list[Contradiction]:
    """Lit recordings without spikes, and any that never stop."""
    found = []
    for c, o in zip(case.conditions, case.observations, strict=True):
        mean = float(o.times.count.mean()) / o.frames
        if c.light is not None and c.level > 0 and mean == 0:
            found.append(Contradiction("silent", (c.name,), f"{c.name}: labelled radiance {c.level:g}, but no spikes"))
        if c.light is not None and c.level < 0.5 and mean > 0.999:
            text = f"{c.name}: labelled radiance {c.level:g}, but every pixel fires in every frame"
            found.append(Contradiction("silent", (c.name,), text))
    return found


def flipped(case: Case, suspect: set[str]) -> list[Contradiction]:
    """Recordings that fit their light and the unit's pattern upside down or mirrored."""
    found = []
    back, all_ = slice(None, None, -1), slice(None)
    turns = {"rows reversed": (back, all_), "columns reversed": (all_, back), "turned by 180 degrees": (back, back)}
    for i, (c, o) in enumerate(zip(case.conditions, case.observations, strict=True)):
        if c.light is None or o.times.count.sum() < 1000:
            continue
        if o.film is not None:
            seen = o.film.reshape(-1, *case.shape).astype(np.float64)
            expected = _expected_film(case, c).reshape(-1, *case.shape)
        else:
            seen = o.rate.reshape(1, *case.shape)
            others = [p.rate for j, p in enumerate(case.observations) if j != i and _lit(case.conditions[j], p)]
            if c.kind == "dark" or not others:
                continue
            expected = np.mean([r / r.mean() for r in others], axis=0).reshape(1, *case.shape)
        whole = (seen, expected), (seen.sum(axis=0)[None], expected.sum(axis=0)[None])  # in time, and its sum
        for name, (rows, columns) in turns.items():
            agree = [(_correlation(s[:, rows, columns], e), _correlation(s, e)) for s, e in whole]
            turned, right = max(agree, key=lambda a: a[0] - a[1])
            if turned > 0.2 and turned > right + 0.5 * (1.0 - max(right, 0.0)):
                text = f"{c.name}: {name}; so it agrees with the rest (correlation {turned:.2f}, as it is {right:.2f})"
                found.append(Contradiction("flipped", (c.name,), text))
                break
    return found


def _lit(condition: Condition, o: Observation) -> bool:
    return condition.kind == "flat" and o.times.count.sum() >= 1000


def _expected_film(case: Case, condition: Condition) -> Array:
    """(bins, P) spikes of the refitted unit in moving light, at most one a frame."""
    assert condition.light is not None
    light = light_film(condition.light, condition.frames).astype(np.float64)
    return np.minimum(light * case.base.gain + BIN * case.base.dark, BIN)


def _correlation(a: Array, b: Array) -> float:
    a, b = a - a.mean(), b - b.mean()
    return float((a * b).sum() / max(np.sqrt((a * a).sum() * (b * b).sum()), 1e-30))


def _steady_levels(case: Case, suspect: set[str]) -> tuple[list[str], Array, Array]:
    """Names, labels and mean rates of the uniform, steady recordings of known light below saturation."""
    rows = [
        (c.name, c.level, float(o.rate[case.base.live].mean()))
        for c, o in zip(case.conditions, case.observations, strict=True)
        if c.kind in ("dark", "flat") and c.name not in suspect
    ]
    rows = [r for r in rows if r[2] < 0.9]
    return [r[0] for r in rows], np.array([r[1] for r in rows]), np.array([r[2] for r in rows])


def _bend(light: Array, rate: Array) -> tuple[float, Array]:
    """Worst relative distance from the best straight line, and all of them."""
    weight = 1.0 / np.maximum(rate, 1e-6)
    design = np.stack([light, np.ones_like(light)], axis=1)
    line, *_ = np.linalg.lstsq(design * weight[:, None], rate * weight, rcond=None)
    off = rate / np.maximum(design @ line, 1e-9) - 1.0
    return float(np.abs(off).max()), off


def swapped(case: Case, suspect: set[str]) -> list[Contradiction]:
    """Two steady recordings whose labels, exchanged, make the rates a straight line."""
    names, light, rate = _steady_levels(case, suspect)
    if len(names) < 5:
        return []
    before = _bend(light, rate)[0]
    if before < 0.01:
        return []
    best: tuple[float, int, int] = (np.inf, 0, 0)
    for i, j in combinations(range(len(names)), 2):
        other = light.copy()
        other[[i, j]] = other[[j, i]]
        best = min(best, (_bend(other, rate)[0], i, j))
    left, i, j = best
    if left > MENDED * before:
        return []
    a, b = names[i], names[j]
    return [Contradiction("swapped", (a, b), f"{a} and {b} seem to be swapped: exchanged, rates follow the light to "
                          f"{100 * left:.2g} %, as labelled to {100 * before:.2g} %")]  # fmt: skip


def wrong_label(case: Case, suspect: set[str]) -> list[Contradiction]:
    """One recording off the straight line that all others lie on."""
    names, light, rate = _steady_levels(case, suspect)
    if len(names) < 5:
        return []
    before = _bend(light, rate)[0]
    best: tuple[float, int] = (np.inf, 0)
    for i in range(len(names)):
        keep = np.arange(len(names)) != i
        best = min(best, (_bend(light[keep], rate[keep])[0], i))
    left, i = best
    keep = np.arange(len(names)) != i
    slope, dark = np.polyfit(light[keep], rate[keep], 1, w=1.0 / np.maximum(rate[keep], 1e-6))
    off = float((rate[i] - dark) / max(slope * light[i], 1e-9) - 1.0) if light[i] > 0 else np.inf
    if left > MENDED * before or abs(off) < max(LEAST_LABEL, 4 * left):
        return []
    if light[i] > 0 and (
        pixel_spread(case, names[i], names) > PIXEL_SPREAD * abs(off)
        or irregular_share(case, names[i]) > IRREGULAR * abs(off)
    ):
        return []
    if light[i] == 0:
        off = float(rate[i] / max(dark, 1e-9) - 1)
        if off < LEAST_DARK or rate[i] - dark < 4 * left * rate[keep].min():  # none is darker than dark
            return []
        text = f"{names[i]}: labelled dark, but {100 * off:+.2g} % off what the flats extrapolate to"
    else:
        text = (
            f"{names[i]}: its rate is that of {100 * off:+.2g} % more light than its label says; all others agree to "
        )
        text += f"{100 * left:.1g} %"
    return [Contradiction("label", (names[i],), text, 1.0 + off if light[i] > 0 else 1.0)]


def upheld(case: Case, model: SensorModel, found: Sequence[Contradiction]) -> list[Contradiction]:
    """The contradictions that hold: the label of the brightest flat is at fault only where, relabelled, all else of its
    recording agrees.  An effect that removes spikes in bright light alone looks like a wrong label of the brightest."""
    levels = {c.name: c.level for c in case.conditions if c.kind == "flat"}
    brightest = max(levels, key=lambda name: levels[name], default="")
    return [
        c for c in found if c.kind != "label" or c.recordings != (brightest,) or agrees_when_relabelled(case, model, c)
    ]


def agrees_when_relabelled(case: Case, model: SensorModel, label: Contradiction) -> bool:
    """Whether a recording agrees with the model under another label."""
    [name] = label.recordings
    conditions = [relabelled(c, label.factor) if c.name == name else c for c in case.conditions]
    again = case.of(conditions, case.observations)
    null = model_null(again, model, RELABEL_TWINS)
    of = np.array([k.recording == name and k.group != "rates" for k in null.keys])
    return not adjusted(deviates(null, values_of(again.bank, null.keys))[of]).min() < GATE


def relabelled(condition: Condition, factor: float) -> Condition:
    """The same with its light multiplied."""
    assert condition.light is not None
    light = replace(condition.light, radiance=condition.light.radiance * np.float32(factor))
    return replace(condition, level=condition.level * factor, light=light)


def irregular_share(case: Case, name: str) -> float:
    """Share of short and long intervals in recording `name`."""
    [o] = [o for c, o in zip(case.conditions, case.observations, strict=True) if c.name == name]
    return float((o.short + o.long).sum()) / max(float(o.times.count.sum()), 1.0)


def pixel_spread(case: Case, name: str, names: Sequence[str]) -> float:
    """Spread over pixels (half of the middle 68 %) of their relative residuals in recording `name`, beyond that in the
    recording of nearest light."""
    live, base = case.base.live, case.base
    spread: dict[str, float] = {}
    level = {c.name: c.level for c in case.conditions}
    for c, o in zip(case.conditions, case.observations, strict=True):
        if c.name in names and c.level > 0:
            off = o.rate[live] / (base.gain * c.level + base.dark)[live]
            spread[c.name] = scatter(off)
    near = min((n for n in spread if n != name), key=lambda n: abs(np.log(level[n] / level[name])))
    return float(np.sqrt(max(spread[name] ** 2 - spread[near] ** 2, 0.0)))


def dropped(case: Case, suspect: set[str]) -> list[Contradiction]:
    """Frames missing (or doubled): from one frame on all pixels are ahead of (behind) their time."""
    found = []
    for c, o in zip(case.conditions, case.observations, strict=True):
        if c.name in suspect or c.light is None:
            continue
        jump = _jump_moving(case, c, o) if c.moves and o.film is not None else _jump_steady(o) if not c.moves else None
        if jump is not None:
            at, frames = jump
            what = "missing" if frames > 0 else "doubled"
            text = f"{c.name}: about {abs(frames):.0f} frames {what} near frame {at}"
            if not c.moves:  # spikes repeat: so many missing look like the rest of an interval too many
                text = f"{c.name}: frames missing or doubled near frame {at}"
            found.append(Contradiction("dropped", (c.name,), text))
    return found


def _jump_steady(o: Observation) -> tuple[int, float] | None:
    """(frame, missing): intervals that span a gap are short by it; they end within an interval after it.

    A gap of half an interval makes some of them odd, which are not timed, and lengthens the others.  Where more is off
    than two intervals on either side, it is light, or the dark, that changes; nearer to an end, it may be.
    """
    interval = o.shape[0] * o.shape[1] / max(float(o.frame.mean()), 1e-9)
    window = int(np.clip(round(interval), 4, o.frames // 8))
    total, timed = (np.convolve(a, np.ones(window), "valid") for a in (o.late, o.timed))
    spread = 1.4826 * float(np.median(np.abs(total - np.median(total)))) + 1e-9
    at = int(np.argmax(np.abs(total)))
    mean = float(total[at] / max(timed[at], 1))
    elsewhere = np.delete(np.abs(total), slice(max(at - 2 * window, 0), at + 2 * window))
    passes = float(np.quantile(elsewhere, OFTEN)) < PASSES * abs(total[at])
    inside = 2 * window <= at < total.size - 2 * window
    if abs(total[at]) > 12 * spread and abs(mean) > 0.3 and passes and inside:
        return at, -mean
    return None


def _jump_moving(case: Case, condition, o) -> tuple[int, float] | None:  # type: ignore[no-untyped-def]
    """(frame, missing) from how late each segment of the film is against its light."""
    expected = _expected_film(case, condition)
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
    if abs(steps[k - 1]) < max(0.7, 6 * rest):
        return None
    return k * condition.frames // SEGMENTS, -steps[k - 1]


def _bins_late(film: NDArray[np.uint8], expected: Array, part: NDArray[np.int64]) -> int:
    """Bins by which the light has to be moved on to agree best with a part of the film; 0 unless clearly better."""
    seen = film[part].astype(np.float64)
    scores = {}
    for shift in range(-MOST_BINS, MOST_BINS + 1):
        if part[0] + shift >= 0 and part[-1] + shift < len(expected):
            scores[shift] = float(((seen - expected[part + shift]) ** 2).sum())
    least = min(scores.values())
    if least > 0.8 * scores[0]:
        return 0
    return min((s for s in scores if scores[s] < least + 0.1 * (scores[0] - least)), key=abs)


def without(case: Case, names: Sequence[str]) -> list[int]:
    """Recordings that are not in `names`, by index."""
    return [i for i, c in enumerate(case.conditions) if c.name not in names]
