"""Which of a round's fits are confirmed, which of them is chosen, and which may as well be true.

Had a rival been true, would the chosen one have looked as much better as it does?  The noise of the null's own draws,
added to the rival's prediction, makes campaigns in which the rival is true.  They show which lead is chance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import scipy

from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.distance import APART, is_significant, residual, residual_and_misfit
from spikecam_env.gap.compare.prediction import Draw, Null, Prediction, own_variance, with_change_scaled
from spikecam_env.gap.compare.step import scale_to
from spikecam_env.gap.fit.hypothesis import Fit
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.sensor import SensorModel
from spikecam_env.types import Floats

PER_PARAMETER = 2.0
"""Mean reduction of the deviance by a parameter without a meaning (Akaike)."""


def confirmed_in_order(
    fits: Sequence[Fit],
    confirm: Callable[[Fit], Fit],
    margin: float,
    known: Sequence[Fit] = (),
    enough: float = np.inf,
) -> tuple[list[Fit], list[Fit]]:
    """Confirm fits, which rest on one twin each, by more twins, from the best on.

    At least two are confirmed, not counting those of random course, which rest on many twins already.  Confirmation
    ends at a fit that would be `margin` above the best one, even if it got as much better as any did.

    Args:
        fits: in any order.
        confirm: simulates a fit with more twins.
        margin: misfit above the best that chance cannot explain.
        known: fits that were confirmed before.
        enough: misfit that a fit has to come down to for any to be confirmed.

    Returns:
        (confirmed fits, the best first; the others).
    """
    waiting, done, better = sorted(fits, key=lambda f: f.misfit), list(known), 0.0
    while waiting:
        least, hope = min((f.misfit for f in done), default=np.inf), waiting[0].misfit - better
        few = [f for f in done if not candidate(f.name).random_course]
        if min(least, hope) > enough or (len(few) > 1 and hope >= least + margin):
            break
        done.append(confirm(waiting[0]))
        better = max(better, waiting.pop(0).misfit - done[-1].misfit)
    return sorted(done, key=lambda f: f.misfit), waiting


NOTHING = ""
"""Name of no candidate: without one, nothing of the misfit is removed."""


def ahead_of(model: SensorModel, before: float, fits: Sequence[Fit]) -> dict[str, float]:
    """Of the misfit that the first fit removes, the share that each other fit does not remove: 0 to 1, by name.

    Fits of the first effect together with another one are no others.  A candidate of random course is none to one that
    is not: it makes a difference likely as scatter, of whatever shape, and does not predict it.

    Args:
        model: that the candidates were added to.
        before: its misfit.
        fits: the chosen fit, then the others in any order.
    """
    if not fits or fits[0].misfit >= before:
        return {}
    best, *rest = fits
    of_course = candidate(best.name).random_course
    others = [f for f in rest if best.name not in f.added_to(model)]
    left = {f.name: f.misfit for f in others if of_course or not candidate(f.name).random_course}
    removed = before - best.misfit
    return {
        name: float(np.clip((misfit - best.misfit) / removed, 0.0, 1.0))
        for name, misfit in {NOTHING: before, **left}.items()
    }


def chosen_of(here: Problem, draws: Sequence[Draw], confirmed: Sequence[Fit]) -> tuple[list[Fit], tuple[str, ...]]:
    """Choose among confirmed fits, and find the rivals of the chosen one.

    All recordings decide between those that the recordings to fit do not separate from the first.  A fit with one more
    parameter is chosen if its misfit is smaller by a tie.  It is a rival if its misfit is smaller by PER_PARAMETER, as
    much as a parameter without a meaning removes.

    Args:
        here: the problem of the candidates, with the effects before them.
        draws: campaigns of the model as given.
        confirmed: fits, the best first.

    Returns:
        (fits, the chosen one first; names of its rivals).
    """
    if not confirmed:
        return [], ()
    null, seen, values, deviance = here.null, here.seen, here.values, here.settings.deviance
    first = confirmed[0].prediction
    close = [
        f
        for f in confirmed
        if f is confirmed[0]
        or lead(null, seen, first, f.prediction) < deviance.dismiss
        or is_rival(null, draws, seen, first, f.prediction)
    ]
    behind = {f.name: lead(null, values, first, f.prediction) for f in close}
    parameters = {f.name: sum(len(candidate(n).fitted) for n in f.added_to(here.model)) for f in close}
    close.sort(key=lambda f: behind[f.name] + deviance.tie * parameters[f.name])
    best = close[0]
    left = residual(null, values, best.prediction)

    def may_be_true(f: Fit) -> bool:
        more = parameters[f.name] - parameters[best.name]
        pays = more <= 0 or behind[f.name] + PER_PARAMETER * more < behind[best.name]
        return (
            pays
            and is_rival(null, draws, values, best.prediction, f.prediction)
            and (
                is_significant(null, left, best.prediction)
                or not is_significant(null, residual(null, values, f.prediction), f.prediction)
            )
        )

    rivals = tuple(f.name for f in close[1:] if may_be_true(f))
    return [*close, *(f for f in confirmed if f not in close)], rivals


def is_rival(null: Null, draws: Sequence[Draw], measured: Floats, best: Prediction, other: Prediction) -> bool:
    """Whether a measurement does not separate one candidate from another.

    It does if the lead of the best is larger than chance makes it in campaigns in which the other is true.

    Args:
        null: the null model, to which both were added.
        draws: campaigns of the model as given; their noise is made as large as that of `null`.
        measured: (S,) statistics, NaN where they take no part.
        best: prediction of the best candidate.
        other: prediction of the other.
    """
    observed = lead(null, measured, best, other)
    if observed < null.settings.deviance.tie:
        return True
    noise = np.array([d.values for d in draws])
    noise = noise - noise.mean(axis=0)
    scatter = noise.std(axis=0, ddof=1)
    noise *= np.maximum(null.sd / np.where(scatter > 0, scatter, np.inf), 1.0)
    middle, own2 = most_likely(null, *(rescaled(null, measured, p) for p in (best, other)))
    noise += np.sqrt(own2) * np.random.default_rng(len(noise)).standard_normal(noise.shape)
    known = np.isfinite(measured)
    by_chance = [lead(null, np.where(known, middle + n, np.nan), best, other) for n in noise]
    above = observed - np.mean(by_chance)
    sd = np.std(by_chance, ddof=1) * np.sqrt(1 + 1 / len(noise))
    return bool(scipy.stats.t.sf(above / max(sd, 1e-9), len(noise) - 1) > null.settings.judging.least_chance)


def most_likely(null: Null, best: Prediction, other: Prediction) -> tuple[Floats, Floats]:
    """The most likely statistics of a candidate: the mean of both where its twins do not differ from the best's.

    Otherwise the chance of its few twins would count as its law.

    Args:
        best: prediction of the best candidate.
        other: prediction of the other.

    Returns:
        ((S,) mean, (S,) its variance).
    """
    apart, own2, others2 = best.mean - other.mean, own_variance(null, other), own_variance(null, best)
    both2 = np.maximum(own2 + others2, 1e-300)
    clearly = np.abs(apart) > APART * np.sqrt(both2)
    share = np.where(clearly, 0.0, own2 / both2)
    return other.mean + share * apart, (1.0 - share) * own2


def lead(null: Null, seen: Floats, best: Prediction, other: Prediction) -> float:
    """Misfit by which `best` is better than `other`, each at the strength that suits `seen` (S,) best.

    Both are judged in the mean of their noises.  Two twins of each do not show which one's campaigns scatter more, and
    the logarithm of the variance would decide.

    Args:
        seen: (S,) statistics.
        best: prediction of one candidate.
        other: prediction of the other.
    """
    both = [rescaled(null, seen, p) for p in (other, best)]
    spread = np.sqrt(np.mean([p.spread**2 for p in both], axis=0))
    left = [residual_and_misfit(null, seen, replace(p, spread=spread))[1] for p in both]
    return left[0] - left[1]


def rescaled(null: Null, seen: Floats, predicted: Prediction) -> Prediction:
    """A prediction with its change from the null scaled to come nearest to the statistics `seen` (S,)."""
    return with_change_scaled(null, predicted, scale_to(null, seen, predicted)[0])
