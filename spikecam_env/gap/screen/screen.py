"""Screening: templates scaled to the measurement, and the misfit that each candidate would leave.

The fit that follows simulates the campaign at hand and uses no template.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.candidates.strength import bounded
from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.distance import in_noise, loss
from spikecam_env.gap.compare.prediction import TOLERANCE, Null, pair_noise_share, pooled
from spikecam_env.gap.compare.step import scale_of
from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.screen.templates import Template, Templates
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.sensor import CATALOGUE
from spikecam_env.types import Floats


@dataclass(frozen=True, eq=False)
class Screened:
    """A candidate by its template."""

    name: str
    start: dict[str, float]
    """Parameters to fit from."""
    misfit: float
    """That it would leave."""
    expected: Floats
    """(S,) change of the statistics at the start."""
    white: float = 1.0
    """s^2 of the unit at the start, over the refit's."""


def screen(
    templates: Templates,
    conditions: Sequence[Condition],
    null: Null,
    measured: Floats,
    names: Sequence[str],
    line_hz: float | None = None,
) -> list[Screened]:
    """Scale templates to a measurement, and keep the best of each candidate and shape.

    Args:
        templates: the bank.
        conditions: of the recordings.
        null: prediction of the model without a candidate.
        measured: (S,) statistics, NaN where they take no part.
        names: of the candidates.
        line_hz: frequency [Hz] of the strongest line of the measured spectra, from which periodic candidates start.

    Returns:
        Candidates by the misfit that they would leave, the least first.
    """
    at = places(templates, conditions, null.keys)
    d = in_noise(null, measured)
    best: dict[tuple[str, frozenset[Any]], Screened] = {}
    for entry in templates.entries:
        if entry.name not in names:
            continue
        shift = np.where((at >= 0) & np.isfinite(measured), (entry.shift * templates.noise)[at] / null.noise, 0.0)
        now = (
            _scattered(entry, null, d, shift)
            if candidate(entry.name).random_course
            else _in_proportion(entry, null, d, shift)
        )
        if now is None and candidate(entry.name).of_motion:
            now = Screened(entry.name, dict(entry.parameters), loss(null, d), shift * null.noise)
        if now is None:
            continue
        if line_hz and "frequency_hz" in entry.parameters:
            now = replace(now, start=bounded(entry.name, {**now.start, "frequency_hz": line_hz}))
        if entry.shape not in best or now.misfit < best[entry.shape].misfit:
            best[entry.shape] = now
    return sorted(best.values(), key=lambda s: s.misfit)


def _in_proportion(entry: Template, null: Null, d: Floats, shift: Floats) -> Screened | None:
    """A template scaled to the measured distances `d`, in noise; None where only a wrong sign would do."""
    own2 = pair_noise_share(null.keys) ** 2 * (shift != 0)
    scale, _ = scale_of(d, shift, np.ones_like(d), own2, 2 * TOLERANCE)
    if scale <= 0 and not candidate(entry.name).may_be_negative:
        return None
    strength, power = CATALOGUE[entry.name].strength, candidate(entry.name).power
    wider = 1.0 + scale**2 * own2 + (2 * TOLERANCE * scale * shift) ** 2
    scaled = entry.parameters[strength] * np.sign(scale) * abs(scale) ** (1 / power)
    start = bounded(entry.name, {**entry.parameters, strength: scaled})
    white = 1.0 / (1.0 + abs(scale) * (1.0 / entry.white - 1.0))
    return Screened(entry.name, start, misfit_of(null, d - scale * shift, wider), scale * shift * null.noise, white)


def _scattered(entry: Template, null: Null, d: Floats, shift: Floats) -> Screened:
    """A template of an effect that makes statistics scatter: its size, over all recordings, is the scatter's."""
    strength, power = CATALOGUE[entry.name].strength, candidate(entry.name).power
    size2 = pooled(null.keys, shift**2)
    tried = []
    for factor in np.geomspace(1e-3, 1e3, 100):
        tried.append((misfit_of(null, d, 1.0 + factor * size2), factor))
    left, factor = min(tried)
    start = bounded(entry.name, {**entry.parameters, strength: entry.parameters[strength] * factor ** (1 / power)})
    return Screened(entry.name, start, left, np.sqrt(factor * size2) * null.noise)


def misfit_of(null: Null, left: Floats, wider: Floats) -> float:
    """Misfit that a scaled template leaves, as that of a fit (`distance.residual_and_misfit`).

    A template far above its own strength is vague: its noise, scaled as well, explains anything.  The logarithm of the
    variance counts against it.

    Args:
        left: (S,) distances in noise, 0 where not measured.
        wider: (S,) variance over the null model's.
    """
    log_variance = float(np.sum(null.weight * np.log(wider) * (left != 0)))
    return loss(null, left / np.sqrt(wider)) + log_variance


def places(templates: Templates, conditions: Sequence[Condition], keys: Sequence[StatisticKey]) -> NDArray[np.int64]:
    """(S,) index of each statistic in the templates, by the recording of its kind whose level is nearest; -1: none."""
    nearest: dict[str, str] = {}
    for c in conditions:
        kind = "flat" if c.kind in ("picture", "unknown") else c.kind
        same = [n for n, k in templates.kinds.items() if k == kind]
        if not same:
            continue
        level = c.level if c.level > 0 else 0.1
        byname = [n for n in same if n == c.name]
        nearest[c.name] = (byname or [min(same, key=lambda n: abs(np.log(max(templates.levels[n], 1e-6) / level)))])[0]
    index = {k: i for i, k in enumerate(templates.keys)}
    return np.array([index.get(StatisticKey(k.group, nearest.get(k.recording, ""), k.name), -1) for k in keys])
