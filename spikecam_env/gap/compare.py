"""How far a measurement lies from what a model gives: every statistic in units of its own noise."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

from spikecam_env.gap.moderate import moderated
from spikecam_env.gap.statistics import Key, floor_of
from spikecam_env.gap.unit.refit import BaseFit

Array = NDArray[np.float64]

TOLERANCE = 0.05
"""Share of an effect's own size by which its simulation may be off: laws are first order, and simulated with noise."""

OPEN = 5e-4
"""Damping of what errors are told from: a step may be held back, an error must not be.  What it holds back is open."""

ENOUGH = 4
"""Twins of an effect that tell by how much its own chance leads parameters astray."""

HEAVY = 8.0
"""Degrees of freedom of the loss: statistics far off count by their logarithm."""


MEDIAN = 0.455
"""Of the square of a normal deviate."""

GATE = 0.005
"""Adjusted p-value of what a named effect leaves, below which something is left."""

PAIRED = {"rates": 0.15, "noise": 0.2, "rows": 0.3, "intervals": 0.5, "neighbours": 0.5, "drift": 0.6, "spectrum": 0.7,
          "timing": 1.0, "step": 1.2, "moving": 1.2}  # fmt: skip
"""Share of a campaign's noise that is left of a pair of twins of the same draws, with an effect and without, by group
(`python -m benchmarks.paired_twins`, the noisiest effect); 1 for the others."""


@dataclass(frozen=True)
class Draw:
    """One simulated campaign.  number: of its random draws.  values: (S,), NaN where it was not simulated.

    refit: of its unit, None where nothing was simulated that a refit rests on.
    """

    number: int
    values: Array
    refit: BaseFit | None


@dataclass(frozen=True)
class Prediction:
    """What a model gives.  mean: (S,).  error: (S,) standard deviation of that mean.  spread: (S,) of one campaign.

    draws: the campaigns it was learnt from.  own: (S,) what its effects do to the very unit; where None, that is its
    distance from the null, whose unit has taken an effect's noise for its own where they are severe.
    units: (U, S) of the drawn units that the pattern was learnt from, NaN elsewhere; of all models by the same draws.
    """

    mean: Array
    error: Array
    spread: Array
    draws: tuple[Draw, ...] = ()
    own: Array | None = None
    units: Array | None = None


@dataclass(frozen=True)
class Null:
    """What a model predicts.  keys: (S,).  mean, sd: (S,) over `twins` simulated campaigns, the whole ones kept in
    `draws`, or of the pattern over as many drawn units.

    floor: (S,) how exactly labels and laws are known at all, in the statistic's unit.  freedom: (S,) degrees of freedom
    of sd.  weight: (S,) how much each says of its own: what several recordings tell of one fixed pattern is told once.
    """

    keys: tuple[Key, ...]
    mean: Array
    sd: Array
    floor: Array
    twins: Array | int
    freedom: Array | float
    weight: Array | float = 1.0
    draws: tuple[Draw, ...] = ()

    @property
    def noise(self) -> Array:
        """(S,) standard deviation of measured less mean."""
        return np.sqrt(self.sd**2 * (1.0 + 1.0 / self.twins) + self.floor**2)

    @property
    def prediction(self) -> Prediction:
        """Itself."""
        return Prediction(self.mean, self.sd / np.sqrt(self.twins), self.sd, self.draws)


def null_of(banks: Sequence[Mapping[Key, float]], keys: Sequence[Key], refits: Sequence[BaseFit] = ()) -> Null:
    """From simulated campaigns 0, 1, ..., for the statistics in `keys` that all of them have."""
    there = tuple(k for k in keys if all(k in b for b in banks))
    values = np.array([[b[k] for k in there] for b in banks])
    floor = np.maximum([floor_of(k) for k in there], 1e-9)
    variances, freedom = moderated(there, values.var(axis=0, ddof=1), len(banks) - 1)
    draws = tuple(Draw(n, v, r) for n, (v, r) in enumerate(zip(values, refits, strict=False)))
    return Null(there, values.mean(axis=0), np.sqrt(variances), floor, len(banks), freedom, draws=draws)


def paired(null: Null, made: Sequence[Draw]) -> Prediction:
    """What campaigns with an effect say, each less the null's of the same number: their noise cancels nearly.

    What a draw lacks is the null's.  One pair has PAIRED of a campaign's noise; several tell it themselves.
    """
    without = {d.number: d for d in null.draws}
    made = [
        replace(d, values=np.where(np.isfinite(d.values), d.values, w.values), refit=d.refit or w.refit)
        for d, w in ((d, without[d.number]) for d in made)
    ]
    change = np.nan_to_num([d.values - without[d.number].values for d in made])
    if len(made) > 1:
        error2, spread = halved(null, change.var(axis=0, ddof=1)) / len(made), spread_of(null, null.mean + change)
    else:
        counted = np.array([k.group == "intervals" for k in null.keys])  # roots of counts scatter by 1 of themselves
        own = np.where(counted, 1.0, of_a_pair(null.keys) * null.sd)
        error2, spread = own**2 * (change[0] != 0), null.sd
    return Prediction(null.mean + change.mean(axis=0), np.sqrt(null.sd**2 / null.twins + error2), spread, tuple(made))


def of_a_pair(keys: Sequence[Key]) -> Array:
    """(S,) PAIRED of each statistic."""
    return np.array([PAIRED.get(k.group, 1.0) for k in keys])


def own_variance(null: Null, predicted: Prediction) -> Array:
    """(S,) of a prediction's mean, beyond what the null's own mean has."""
    return np.maximum(predicted.error**2 - null.sd**2 / null.twins, 0.0)


def scaled(null: Null, one: Prediction, factor: float) -> Prediction:
    """A prediction whose change from the null is multiplied, and with it what it scatters more."""
    error2 = null.sd**2 / null.twins + own_variance(null, one) * factor**2
    spread2 = null.sd**2 + np.maximum(one.spread**2 - null.sd**2, 0.0) * abs(factor)
    mean = null.mean + factor * (one.mean - null.mean)
    own = None if one.own is None else factor * one.own
    return replace(one, mean=mean, error=np.sqrt(error2), spread=np.sqrt(spread2), own=own)


def likeliest(null: Null, measured: Array, one: Prediction) -> tuple[float, float]:
    """(factor, sd of its logarithm) that suits a prediction best which mostly scatters: by the misfit and its price."""
    factors = np.geomspace(0.01, 100.0, 200)
    left = np.array([judged(null, measured, scaled(null, one, f))[1] for f in factors])
    near = np.log(factors[left < left.min() + 1.0])
    return float(factors[left.argmin()]), float(max(np.ptp(near), np.log(factors[1] / factors[0]))) / 2


def values_of(bank: Mapping[Key, float], keys: Sequence[Key]) -> Array:
    """(S,) in the order of keys; NaN where the bank has none."""
    return np.array([bank.get(k, np.nan) for k in keys])


def size_of(null: Null, measured: Array, change: Array) -> float:
    """Noises by which a change of the statistics (S,) shows at best, on those that were measured."""
    return float(np.max(np.where(np.isfinite(measured), np.abs(change), 0.0) / null.noise))


def deviates(null: Null, values: Array) -> Array:
    """(S,) normal deviates: Student's t of few twins, made normal; 0 where unknown."""
    return normal(null, np.nan_to_num((values - null.mean) / null.noise))


def normal(null: Null, t: Array, predicted: Prediction | None = None) -> Array:
    """(S,) normal deviates of distances in noise, of a prediction's or of the null's: the noise was learnt from few
    twins, and is the surer the more of it is floor.  What drawn units show is no less likely than their number says."""
    known, freedom = null.sd**2 * (1.0 + 1.0 / null.twins), null.freedom
    if predicted is not None:
        known, freedom = predicted.spread**2 + predicted.error**2, freedom_of(null, predicted)
    freedom = freedom * np.minimum(1.0 + null.floor**2 / np.maximum(known, 1e-300), 100.0) ** 2
    log_p = np.maximum(stats.t.logsf(np.abs(t), freedom), -800.0)
    if predicted is not None and predicted.units is not None:
        apart = (predicted.units - predicted.mean) / np.sqrt(variance(null, predicted))
        log_p = np.maximum(log_p, np.log(np.maximum(share_beyond(t, apart), 1e-300)))
    return np.sign(t) * -special.ndtri_exp(log_p)


def share_beyond(t: Array, apart: Array) -> Array:
    """(S,) share of drawn units, half at most, that lie as far to the same side as a distance; 0 where none does.
    apart: (U, S) their own distances, NaN where they show nothing.

    Pixels far out in a pattern of rows come by whole rows: one unit in a hundred has some, and no t knows of it.
    """
    beyond = np.sum(np.sign(t) * apart >= np.abs(t), axis=0)
    return np.where(beyond > 0, np.minimum((beyond + 1) / (len(apart) + 1), 0.5), 0.0)


def freedom_of(null: Null, predicted: Prediction) -> Array:
    """(S,) degrees of freedom of a prediction's spread (Welch and Satterthwaite): what is the null's has its own, what
    an effect's twins scatter beyond has those of few twins, `halved`, or of the drawn units.

    How much they scatter beyond, all statistics of a group say: one that happened to scatter little is no surer.
    """
    beyond = np.maximum(predicted.spread / np.maximum(null.sd, 1e-300), 1.0) ** 2 - 1.0
    groups = np.unique([k.group for k in null.keys], return_inverse=True)[1]
    beyond = np.maximum(beyond, (np.bincount(groups, beyond) / np.bincount(groups))[groups])
    kind = Counter((k.group, k.name) for k in null.keys)
    few = max(len(predicted.draws) - 1, 1) / (0.25 + 0.75 / np.array([kind[k.group, k.name] for k in null.keys]))
    if predicted.units is not None:
        few = np.where(np.isfinite(predicted.units[0]), len(predicted.units) - 1, few)
    return np.asarray((1.0 + beyond) ** 2 / (1.0 / null.freedom + beyond**2 / few))


def of_all_recordings(keys: Sequence[Key], z: Array, group: str) -> Array:
    """(n,) normal deviates of each statistic of a group over all recordings together, where z is not 0 (Stouffer): two
    events in every recording are chance in none, and none in all."""
    names = list(dict.fromkeys(k.name for k in keys if k.group == group))
    of = [z[[(k.group, k.name) == (group, name) for k in keys]] for name in names]
    return np.array([v.sum() / np.sqrt(max(int(np.count_nonzero(v)), 1)) for v in of])


def adjusted(z: Array) -> Array:
    """(S,) two-sided p-values, by Holm's step-down for as many statistics as there are."""
    p = 2.0 * special.ndtr(-np.abs(z))
    order = np.argsort(p)
    stepped = np.maximum.accumulate(p[order] * (p.size - np.arange(p.size)))
    out = np.empty_like(p)
    out[order] = np.minimum(stepped, 1.0)
    return out


def alarmed(null: Null, rho: Array, predicted: Prediction | None = None) -> bool:
    """Whether residuals, of a prediction or of the null's, say that something is left."""
    return bool(adjusted(normal(null, rho, predicted)).min() < GATE)


def variance(null: Null, predicted: Prediction) -> Array:
    """(S,) of measured less predicted; a prediction is good to TOLERANCE of its effect."""
    return predicted.spread**2 + predicted.error**2 + null.floor**2 + law(null, predicted) ** 2


def law(null: Null, predicted: Prediction) -> Array:
    """(S,) by how much a prediction's laws may be off."""
    return TOLERANCE * (predicted.mean - null.mean if predicted.own is None else predicted.own)


def residual(null: Null, measured: Array, predicted: Prediction) -> Array:
    """(S,) measured less predicted in noise."""
    return np.nan_to_num((measured - predicted.mean) / np.sqrt(variance(null, predicted)))


def judged(null: Null, measured: Array, predicted: Prediction) -> tuple[Array, float]:
    """(residual, misfit).  The misfit is a deviance: the heavy-tailed sum of squares of what is left, and the price of
    noise wider than the null's, without which a prediction would win by being vague.  What was not measured (NaN, held
    out) counts for nothing."""
    rho = residual(null, measured, predicted)
    wider = (variance(null, predicted) - predicted.error**2) / (null.sd**2 + null.floor**2)
    price = np.where(np.isfinite(measured), null.weight * np.log(wider), 0.0)
    return rho, misfit(rho, null.weight) + float(price.sum())


def pooled(keys: Sequence[Key], values: Array) -> Array:
    """(S,) each statistic's mean over all recordings."""
    of = {kind: i for i, kind in enumerate(dict.fromkeys((k.group, k.name) for k in keys))}
    kind = np.array([of[k.group, k.name] for k in keys])
    return np.asarray((np.bincount(kind, values) / np.bincount(kind))[kind])


def spread_of(null: Null, values: Array) -> Array:
    """(S,) standard deviation of statistics under a model with an effect, from its twins (n, S), at least the null's.

    An effect of rare events makes statistics noisier than the null knows.
    """
    if len(values) < 2:
        return null.sd
    return np.asarray(np.sqrt(np.maximum(null.sd**2, halved(null, values.var(axis=0, ddof=1)))))


def halved(null: Null, variances: Array) -> Array:
    """(S,) variances from few twins: what they say of one statistic counts half, the other half is what they say of the
    same one over all recordings."""
    known = null.sd**2 + null.floor**2
    return 0.5 * variances + 0.5 * known * pooled(null.keys, variances) / pooled(null.keys, known)


def step_of(
    null: Null,
    measured: Array,
    predicted: Prediction,
    jacobian: Array,
    doubt: Array | float = 0.0,
    before: Array | float = 1.0,
) -> tuple[Array, Array]:
    """(step (n,), covariance (n, n)): robust, slightly damped least squares for a jacobian (S, n), known to `doubt`.

    before: (n,) standard deviation of what nothing tells.

    What is far off is judged by how far off most is that moves: it would be outliers all, and hardly be heard.

    Statistics are not independent: the covariance is of how far the null's own draws would have led the step astray,
    and, where ENOUGH of them tell, those of the effect (other pixels have its traps), with the floors and TOLERANCE of
    the effect, all of one sign, on top.  Of the fixed pattern, drawn units tell: all recordings show the same one.
    Where two parameters do nearly the same, what twins scattered would seem to tell them apart: as many squares of it
    as can be expected in the normal matrix are no knowledge (errors in variables).
    """
    noise2 = variance(null, predicted)
    gap = np.nan_to_num(measured - predicted.mean)
    concerned = np.isfinite(measured) & np.any(jacobian != 0, axis=1)
    usual = max(float(np.median((gap**2 / noise2)[concerned])) / MEDIAN, 1.0) if concerned.any() else 1.0
    w = np.isfinite(measured) * null.weight * (HEAVY + 1) / (HEAVY + gap**2 / noise2 / usual) / noise2
    normal = jacobian.T @ (w[:, None] * jacobian)
    scale = np.diag(normal) + 1e-12
    step = np.linalg.solve(normal + 0.02 * np.diag(scale), jacobian.T @ (w * gap))
    values, basis = along(normal - by_chance(w, jacobian, doubt), np.sqrt(scale))
    back = np.linalg.inv(basis)
    solve = (back / values) @ back.T @ (jacobian.T * w)
    drawn = [d.values - null.mean for d in null.draws]
    alike = solve * ~patterned(null, predicted)
    chance = astray(alike, drawn) if len(drawn) > 1 else (alike * null.sd**2) @ alike.T
    off = solve @ law(null, predicted)
    total = chance + own_astray(null, predicted, solve) + (solve * null.floor**2) @ solve.T + np.outer(off, off)
    prior = np.diag(np.square(before * np.ones(len(scale))))
    held = (back * (OPEN / values)) @ basis
    total = total + held @ prior @ held.T
    total = total - total @ np.linalg.solve(total + prior, total)
    return np.asarray(step, np.float64), np.atleast_2d(total)


def by_chance(w: Array, jacobian: Array, doubt: Array | float) -> Array:
    """(n, n) of a normal matrix with weights (S,), that the noise of its jacobian makes: each column is a twin less one
    that they share.  doubt: (S, n) of both, with the sign of the step between them."""
    there = doubt * (jacobian != 0)
    shared = there.T @ (w[:, None] * there) / 2
    return np.asarray(shared + np.diag(np.diag(shared)))


def along(normal: Array, scale: Array) -> tuple[Array, Array]:
    """((n,) what is known, OPEN at least, (n, n) directions in units of 1 / `scale` (n,), one a row)."""
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    return np.maximum(values, 0.0) + OPEN, vectors.T * scale


def astray(solve: Array, draws: Sequence[Array] | Array) -> Array:
    """(n, n) covariance of where campaigns such as these (S,), not their mean, lead a step (n,) = solve @ values."""
    return np.atleast_2d(np.cov((np.nan_to_num(draws) @ solve.T).T)) * (1 + 1 / len(draws))


def own_astray(null: Null, predicted: Prediction, solve: Array) -> Array:
    """(n, n) covariance of a step by the effect's own chance: as its draws tell where ENOUGH of them move a statistic,
    as drawn units do where they show it, elsewhere as of independent ones."""
    variances = np.maximum(predicted.spread**2 + predicted.error**2 - null.sd**2 * (1 + 1 / null.twins), 0.0)
    without = {d.number: d.values for d in null.draws}
    draws = predicted.draws if len(predicted.draws) >= ENOUGH else ()
    change = np.array([d.values - without[d.number] for d in draws])
    shown = patterned(null, predicted)
    told = np.any(np.nan_to_num(change) != 0, axis=0) & ~shown
    total = np.asarray((solve * np.where(told | shown, 0.0, variances)) @ solve.T)
    total = total + astray(solve * told, change) if told.any() else total
    return total + astray(solve * shown, predicted.units) if predicted.units is not None else total


def patterned(null: Null, predicted: Prediction) -> NDArray[np.bool_]:
    """(S,) which statistics drawn units tell."""
    if predicted.units is None:
        return np.zeros(len(null.keys), np.bool_)
    return np.asarray(np.isfinite(predicted.units).all(axis=0), np.bool_)


def slope_of(null: Null, measured: Array, there: Prediction, here: Prediction, step: float) -> Array:
    """(S,) change of predictions over `step`, 0 where it is not clear of the twins' own noise: hundreds of statistics
    that do not move would drown those that do (regression dilution)."""
    change, _, clear = change_of(null, measured, there, here)
    return np.where(clear, change, 0.0) / step


def change_of(
    null: Null, measured: Array, there: Prediction, here: Prediction
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """((S,) change from one prediction to another, (S,) its noise, (S,) where it is clear of that).  What was not
    measured (NaN), and may move more, is a matter of its own."""
    change, known = there.mean - here.mean, np.isfinite(measured)
    own2 = np.maximum(own_variance(null, there), own_variance(null, here))
    if there.units is not None and here.units is not None:
        apart = there.units - here.units
        own2 = np.where(np.isfinite(apart).all(axis=0), apart.var(axis=0, ddof=1) / len(apart), own2)
    own2 = np.maximum(own2, 1e-300)
    clear = is_clear(np.where(known, change, 0.0), own2) | is_clear(np.where(known, 0.0, change), own2)
    return change, np.sqrt(own2), clear


def scale_of(
    gap: Array, effect: Array, of_gap: Array, of_effect: Array, tolerance: float = TOLERANCE
) -> tuple[float, float]:
    """(scale, sd): by how much to multiply an effect's change of the statistics to come nearest to the measured one.

    gap, effect: (S,) measured and simulated change.  of_gap, of_effect: (S,) their variances.
    Only statistics on which the simulated effect is clear of its own noise count: the noise of the others would drag
    the scale to 0 (regression dilution).  Under a heavy-tailed loss there are many minima: it is followed down from
    every ratio that many statistics agree on.
    """
    clear = is_clear(effect, of_gap + of_effect)
    if not clear.any():
        return 0.0, np.inf
    gap, effect, of_gap, of_effect = gap[clear], effect[clear], of_gap[clear], of_effect[clear]
    starts = np.unique(np.quantile(gap / effect, [0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95]))
    best = (np.inf, 0.0, np.inf)
    for start in starts:
        scale, total = float(start), 0.0
        for _ in range(8):
            noise2 = of_gap + scale**2 * of_effect + (tolerance * scale * effect) ** 2
            w = (HEAVY + 1.0) / (HEAVY + (gap - scale * effect) ** 2 / noise2) / noise2
            total = float(np.sum(w * effect**2))
            scale = float(np.sum(w * effect * gap)) / max(total, 1e-300)
        noise2 = of_gap + scale**2 * of_effect + (tolerance * scale * effect) ** 2
        left = misfit((gap - scale * effect) / np.sqrt(noise2))
        best = min(best, (left, scale, 1.0 / np.sqrt(max(total, 1e-300))))
    return best[1], best[2]


def scale_to(null: Null, measured: Array, predicted: Prediction) -> tuple[float, float]:
    """(scale, sd) of a prediction's change from the null that comes nearest to the measured one."""
    known = np.isfinite(measured)
    gap, effect = (np.where(known, v - null.mean, 0.0) for v in (measured, predicted.mean))
    return scale_of(gap, effect, null.noise**2, own_variance(null, predicted))


def is_clear(effect: Array, variance: Array) -> NDArray[np.bool_]:
    """(S,) whether an effect stands clear of noise on a statistic, or, where it does on none, half as well as on its
    best."""
    size = np.abs(effect) / np.sqrt(variance)
    most = float(size.max())
    least = max(min(3.0, 0.5 * most), min(6.0, 0.25 * most))  # of 600 statistics a few are 4 noises off by chance
    return np.asarray((size > least) & (effect != 0))


def misfit(rho: Array, weight: Array | float = 1.0) -> float:
    """Heavy-tailed sum of squares: of the order of the weights' sum for noise alone."""
    return float(np.sum(weight * (HEAVY + 1.0) * np.log1p(rho**2 / HEAVY)))
