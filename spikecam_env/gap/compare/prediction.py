"""A model's prediction: the mean of every statistic, the error of that mean, and the scatter of one campaign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from spikecam_env.gap.compare.pooled_variance import moderated
from spikecam_env.gap.settings import DiagnosisSettings, checked_settings
from spikecam_env.gap.statistics import StatisticKey, floor_of
from spikecam_env.gap.unit.refit import BaseFit
from spikecam_env.types import Floats, Masks

TOLERANCE = 0.05
"""Error of an effect's simulated change, relative: laws of first order in sub-frame time, beside a camera's.  More
twins do not make it smaller."""

PAIR_NOISE = {"rates": 0.15, "noise": 0.2, "rows": 0.3, "intervals": 0.5, "neighbours": 0.5, "drift": 0.6,
              "spectrum": 0.7, "timing": 1.0, "step": 1.2, "moving": 1.2}  # fmt: skip
"""Noise of a pair of twins of the same draws, with and without an effect, over a campaign's noise, by group
(the noisiest effect, by benchmarks/paired_twins.py of version 0.1.0); 1 for the others."""


@dataclass(frozen=True)
class Draw:
    """One simulated campaign."""

    number: int
    """Of its random draws."""
    values: Floats
    """(S,), NaN where it was not simulated."""
    refit: BaseFit | None
    """Of its unit; None without the recordings that a refit rests on."""
    pattern: Floats | None = None
    """(S,) of its own rates, whose unit is the measured one, NaN elsewhere; those among `values` are of fresh units."""


@dataclass(frozen=True)
class Prediction:
    """Statistics under a model."""

    mean: Floats
    """(S,)."""
    error: Floats
    """(S,) standard deviation of the mean."""
    spread: Floats
    """(S,) standard deviation of one campaign."""
    draws: tuple[Draw, ...] = ()
    """The campaigns that it was learnt from."""
    own: Floats | None = None
    """(S,) change by its effects in the very unit; None: the distance from the null.  Beside a severe effect the null's
    unit has taken its noise for its own."""
    units: Floats | None = None
    """(U, S) of the drawn units that the pattern was learnt from, NaN elsewhere; of all models by the same draws."""


@dataclass(frozen=True)
class Null:
    """The null model's prediction, of which all others differ by an effect."""

    keys: tuple[StatisticKey, ...]
    """(S,)."""
    mean: Floats
    """(S,) over twins, or of the pattern over drawn units."""
    sd: Floats
    """(S,) standard deviation of one of these."""
    floor: Floats
    """(S,) error of labels and laws, in the statistic's unit."""
    twins: Floats | int
    """(S,) number of twins or drawn units."""
    freedom: Floats | float
    """(S,) degrees of freedom of sd."""
    weight: Floats | float = 1.0
    """(S,) weight in a misfit: several recordings show one fixed pattern, which counts once."""
    draws: tuple[Draw, ...] = ()
    """The whole simulated campaigns."""
    settings: DiagnosisSettings = field(default_factory=DiagnosisSettings)

    @property
    def noise(self) -> Floats:
        """(S,) standard deviation of measured less mean."""
        return np.sqrt(self.sd**2 * (1.0 + 1.0 / self.twins) + self.floor**2)

    @property
    def prediction(self) -> Prediction:
        """Itself."""
        return Prediction(self.mean, self.sd / np.sqrt(self.twins), self.sd, self.draws)


def null_of(
    banks: Sequence[Mapping[StatisticKey, float]],
    keys: Sequence[StatisticKey],
    refits: Sequence[BaseFit | None] = (),
    settings: DiagnosisSettings | None = None,
) -> Null:
    """From simulated campaigns 0, 1, ..., for the statistics in `keys` that all of them have."""
    shared = tuple(k for k in keys if all(k in b for b in banks))
    values = np.array([[b[k] for k in shared] for b in banks])
    floor = np.maximum([floor_of(k) for k in shared], 1e-9)
    variances, freedom = moderated(shared, values.var(axis=0, ddof=1), len(banks) - 1)
    draws = tuple(Draw(n, v, r) for n, (v, r) in enumerate(zip(values, refits, strict=False)))
    return Null(
        shared,
        values.mean(axis=0),
        np.sqrt(variances),
        floor,
        len(banks),
        freedom,
        draws=draws,
        settings=checked_settings(settings),
    )


def paired(null: Null, made: Sequence[Draw]) -> Prediction:
    """The prediction from campaigns with an effect, each less the null's of the same draws: their noise nearly cancels.

    Values that a draw lacks are the null's.  One pair has PAIR_NOISE of a campaign's noise; several show it by scatter.

    Args:
        null: with the same draws.
        made: campaigns with the effect.
    """
    without = {d.number: d for d in null.draws}
    made = [
        replace(d, values=np.where(np.isfinite(d.values), d.values, w.values), refit=d.refit or w.refit)
        for d, w in ((d, without[d.number]) for d in made)
    ]
    change = np.nan_to_num([d.values - without[d.number].values for d in made])
    if len(made) > 1:
        error2, spread = half_pooled(null, change.var(axis=0, ddof=1)) / len(made), spread_of(null, null.mean + change)
    else:
        counted = np.array([k.group == "intervals" for k in null.keys])  # roots of counts scatter by 1 of themselves
        own = np.where(counted, 1.0, pair_noise_share(null.keys) * null.sd)
        error2, spread = own**2 * (change[0] != 0), null.sd
    return Prediction(null.mean + change.mean(axis=0), np.sqrt(null.sd**2 / null.twins + error2), spread, tuple(made))


def with_pattern_moved(null: Null, made: Draw) -> Draw:
    """A campaign whose pattern is that of the null's fresh unit of the same number, moved by as much as an effect moves
    the pattern of a twin; by less than fresh units vary, not at all.

    A response that bends or locks to the frames changes the distances between pixels, though it is no pattern.

    Args:
        null: with the draw of the same number.
        made: the campaign with the effect.
    """
    without = next(d for d in null.draws if d.number == made.number)
    if made.pattern is None or without.pattern is None:
        return made
    moved = np.nan_to_num(made.pattern - without.pattern)
    return replace(made, values=np.where(np.abs(moved) > null.sd, without.values + moved, made.values))


def pair_noise_share(keys: Sequence[StatisticKey]) -> Floats:
    """(S,) PAIR_NOISE of each statistic."""
    return np.array([PAIR_NOISE.get(k.group, 1.0) for k in keys])


def own_variance(null: Null, predicted: Prediction) -> Floats:
    """(S,) variance of a prediction's mean, less that of the null's own mean."""
    return np.maximum(predicted.error**2 - null.sd**2 / null.twins, 0.0)


def with_change_scaled(null: Null, one: Prediction, factor: float) -> Prediction:
    """A prediction with its change from the null, and its excess scatter, multiplied."""
    error2 = null.sd**2 / null.twins + own_variance(null, one) * factor**2
    spread2 = null.sd**2 + np.maximum(one.spread**2 - null.sd**2, 0.0) * abs(factor)
    mean = null.mean + factor * (one.mean - null.mean)
    own = None if one.own is None else factor * one.own
    return replace(one, mean=mean, error=np.sqrt(error2), spread=np.sqrt(spread2), own=own)


def values_of(bank: Mapping[StatisticKey, float], keys: Sequence[StatisticKey]) -> Floats:
    """(S,) in the order of keys; NaN where the bank has none."""
    return np.array([bank.get(k, np.nan) for k in keys])


def total_variance(null: Null, predicted: Prediction) -> Floats:
    """(S,) variance of measured less predicted; a prediction is exact to the tolerance of its effect."""
    return predicted.spread**2 + predicted.error**2 + null.floor**2 + law_error(null, predicted) ** 2


def law_error(null: Null, predicted: Prediction) -> Floats:
    """(S,) error of a prediction's laws."""
    return TOLERANCE * (predicted.mean - null.mean if predicted.own is None else predicted.own)


def pooled(keys: Sequence[StatisticKey], values: Floats) -> Floats:
    """(S,) each statistic's mean over all recordings."""
    of = {kind: i for i, kind in enumerate(dict.fromkeys((k.group, k.name) for k in keys))}
    kind = np.array([of[k.group, k.name] for k in keys])
    return np.asarray((np.bincount(kind, values) / np.bincount(kind))[kind])


def spread_of(null: Null, values: Floats) -> Floats:
    """(S,) standard deviation of statistics under a model with an effect, by its twins (n, S); the null's at least."""
    if len(values) < 2:
        return null.sd
    return np.asarray(np.sqrt(np.maximum(null.sd**2, half_pooled(null, values.var(axis=0, ddof=1)))))


def half_pooled(null: Null, variances: Floats) -> Floats:
    """(S,) variances from few twins: half the statistic's own, half that of the same statistic over all recordings."""
    known = null.sd**2 + null.floor**2
    return 0.5 * variances + 0.5 * known * pooled(null.keys, variances) / pooled(null.keys, known)


def from_drawn_units(null: Null, predicted: Prediction) -> Masks:
    """(S,) whether statistics are known from drawn units."""
    if predicted.units is None:
        return np.zeros(len(null.keys), bool)
    return np.asarray(np.isfinite(predicted.units).all(axis=0), bool)
