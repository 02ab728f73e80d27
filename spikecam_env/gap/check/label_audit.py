"""Contradictions within the recordings, before any model is compared: labels, order, orientation, missing frames.

Each check looks for one mistake that explains one recording and leaves the others consistent; an effect changes all.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from spikecam_env.gap.check.contradiction import Contradiction
from spikecam_env.gap.check.missing_frames import dropped
from spikecam_env.gap.check.orientation import flipped
from spikecam_env.gap.twins.case import Case
from spikecam_env.robust import scatter
from spikecam_env.types import Floats

LEAST_ERROR = 1e-3
"""Relative error of a label from which it is reported; a choice.  An array that fires in all frames but so few fires in
every one."""

LEAST_GROSS = 0.02
"""Relative error of a dark recording, and curvature by exchanged labels, from which they are reported: of few spikes a
pixel, the rate between first and last is biased by their number squared."""

PIXELS_DIFFER = 0.5
"""Of a label's error, by which pixels differ where the label is not at fault."""

IRREGULAR = 0.1
"""Share of irregular intervals, of a label's error, from which the label is not at fault: light of another level makes
none."""

UNDONE = 0.8
"""Share of the disagreement that a mistake of a campaign removes, once undone."""

FEWEST_LEVELS = 5
"""Steady recordings that show a mistake: two of a line, two that may be exchanged, and one more."""

BELOW_SATURATION = 0.9
"""Mean rate [spikes/frame] of a steady recording up to which hardly a pixel fires in every frame."""


def audit(case: Case) -> list[Contradiction]:
    """All contradictions, the grossest kind first; later checks skip recordings that are already suspect."""
    faults: list[Contradiction] = []
    for check in (silent, flipped, swapped, wrong_label, dropped):
        suspect = {r for c in faults for r in c.recordings}
        faults += [c for c in check(case, suspect) if not suspect & set(c.recordings)]
    return faults


def silent(case: Case, suspect: set[str]) -> list[Contradiction]:
    """Lit recordings without spikes, and any that never stop."""
    contradictions = []
    all_frames, usual = 1 - LEAST_ERROR, case.settings.unit.usual
    for c, o in zip(case.conditions, case.observations, strict=True):
        mean = float(o.times.count.mean()) / o.frames
        if c.light is not None and c.level > 0 and mean == 0:
            contradictions.append(
                Contradiction("silent", (c.name,), f"{c.name}: labelled radiance {c.level:g}, but no spikes")
            )
        if c.light is not None and c.level * usual < 1 and mean > all_frames:
            text = f"{c.name}: labelled radiance {c.level:g}, but every pixel fires in every frame"
            contradictions.append(Contradiction("silent", (c.name,), text))
    return contradictions


def _steady_levels(case: Case, suspect: set[str]) -> tuple[list[str], Floats, Floats]:
    """Names, labels and mean rates of the uniform, steady recordings of known light below saturation."""
    rows = [
        (c.name, c.level, float(o.rate[case.base.live].mean()))
        for c, o in zip(case.conditions, case.observations, strict=True)
        if c.kind in ("dark", "flat") and c.name not in suspect
    ]
    rows = [r for r in rows if r[2] < BELOW_SATURATION]
    return [r[0] for r in rows], np.array([r[1] for r in rows]), np.array([r[2] for r in rows])


def _bend(light: Floats, rate: Floats) -> tuple[float, Floats]:
    """Worst relative distance from the best straight line, and all of them."""
    weight = 1.0 / np.maximum(rate, 1e-6)
    design = np.stack([light, np.ones_like(light)], axis=1)
    line, *_ = np.linalg.lstsq(design * weight[:, None], rate * weight, rcond=None)
    off = rate / np.maximum(design @ line, 1e-9) - 1.0
    return float(np.abs(off).max()), off


def swapped(case: Case, suspect: set[str]) -> list[Contradiction]:
    """Two steady recordings whose labels, exchanged, make the rates a straight line."""
    names, light, rate = _steady_levels(case, suspect)
    if len(names) < FEWEST_LEVELS:
        return []
    before = _bend(light, rate)[0]
    if before < LEAST_GROSS:
        return []
    best: tuple[float, int, int] = (np.inf, 0, 0)
    for i, j in combinations(range(len(names)), 2):
        other = light.copy()
        other[[i, j]] = other[[j, i]]
        best = min(best, (_bend(other, rate)[0], i, j))
    left, i, j = best
    if left > (1 - UNDONE) * before:
        return []
    a, b = names[i], names[j]
    return [Contradiction("swapped", (a, b), f"{a} and {b} seem to be swapped: exchanged, their rates follow the light "
                          f"to {100 * left:.2g} %, as labelled only to {100 * before:.2g} %")]  # fmt: skip


def wrong_label(case: Case, suspect: set[str]) -> list[Contradiction]:
    """One recording off the straight line that all others lie on."""
    names, light, rate = _steady_levels(case, suspect)
    if len(names) < FEWEST_LEVELS:
        return []
    best: tuple[float, int] = (np.inf, 0)
    for i in range(len(names)):
        keep = np.arange(len(names)) != i
        best = min(best, (_bend(light[keep], rate[keep])[0], i))
    left, i = best
    if left > (1 - UNDONE) * _bend(light, rate)[0]:
        return []
    keep = np.arange(len(names)) != i
    slope, dark = np.polyfit(light[keep], rate[keep], 1, w=1.0 / np.maximum(rate[keep], 1e-6))
    if light[i] == 0:
        return _wrong_dark(case, names[i], rate[i], dark, left * rate[keep].min())
    off = float((rate[i] - dark) / max(slope * light[i], 1e-9) - 1.0)
    return _wrong_flat(case, names[i], names, off, left)


def _wrong_flat(case: Case, name: str, names: Sequence[str], off: float, left: float) -> list[Contradiction]:
    """A flat whose rate is `off` the line of the others, which are off it by `left` at most; both relative.

    A label is one number and makes no interval irregular; an effect that begins at that level differs from pixel to
    pixel.
    """
    if abs(off) < LEAST_ERROR:
        return []
    differs = pixel_spread(case, name, names) > PIXELS_DIFFER * abs(off)
    if differs or irregular_share(case, name) > IRREGULAR * abs(off):
        return []
    text = (
        f"{name}: its rate fits {100 * off:+.2g} % more light than its label says; all others agree to "
        f"{100 * left:.1g} %"
    )
    return [Contradiction("label", (name,), text, 1.0 + off)]


def _wrong_dark(case: Case, name: str, rate: float, dark: float, left: float) -> list[Contradiction]:
    """A recording labelled dark whose rate is above `dark`, the extrapolation of the others; none is darker than dark.

    The others are off their line by `left` at most, of their lowest rate.
    """
    off = float(rate / max(dark, 1e-9) - 1)
    outstanding = UNDONE / (1 - UNDONE)
    if off < LEAST_GROSS or rate - dark < outstanding * left:
        return []
    text = f"{name}: labelled dark, but its rate is {100 * off:+.2g} % off the extrapolation of the flats"
    return [Contradiction("label", (name,), text)]


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
