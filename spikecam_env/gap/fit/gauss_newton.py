"""Gauss-Newton over the parameters of effects, in their logarithms, on twins of the same draws as the null's.

Derivatives cost a twin a parameter: they are taken once, and then corrected by what each step turns out to change
(Broyden), unless it was a long one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.candidates.strength import bounded, with_effect
from spikecam_env.gap.candidates.table import candidate
from spikecam_env.gap.compare.distance import judged
from spikecam_env.gap.compare.prediction import Null, Prediction, own_variance
from spikecam_env.gap.compare.step import change_of, step_of
from spikecam_env.gap.fit.candidate import as_seen
from spikecam_env.gap.unit.indirect_inference import has_converged
from spikecam_env.gap.unit.refit import BaseFit, constrained_refit
from spikecam_env.sensor import SensorModel

Array = NDArray[np.float64]

TURNS = 4

SETTLED = 0.05
"""Largest step of a logarithm that needs no other."""

WORTH = 1.0
"""Misfit that a step has to promise for another: of two parameters that make up for each other either may be open by
far, and both together leave much."""

FAR = 0.5
"""Step of a logarithm beyond which derivatives are taken anew."""

CLEAR = 3.0
"""Noises by which a step has to surprise for derivatives to be corrected by it."""

LONGEST = 0.7
"""Largest step of a logarithm at once; none is further than what is open of its parameter before (`spans`)."""

WORSE = 3.0
"""Misfit by which a step may seem worse, by chance of the draws."""

PROBED = 2
"""Times that a model is probed: under the unit there was, and under the one that it then shows."""

WHITE = ("the unit", "white")
"""The unit's own s^2, among parameters by effect and name, where an effect hides it."""

Probe = Callable[[SensorModel, BaseFit], Prediction]
"""What a model and a unit give."""

Free = Sequence[tuple[str, str]]
"""Parameters by effect and name."""


@dataclass(frozen=True)
class Descent:
    """Where it ended.  prediction: of the twins there, the last step added in proportion.  columns: (S, n) derivatives;
    doubt: (S, n) their noise.  covariance: (n, n) of the logarithms.
    """

    model: SensorModel
    base: BaseFit
    prediction: Prediction
    columns: Array
    doubt: Array
    covariance: Array


def descend(
    probe: Probe,
    null: Null,
    measured: Array,
    model: SensorModel,
    base: BaseFit,
    free: Free,
    jobs: int = 1,
    worth: float = WORTH,
) -> Descent:
    """From a model and its unit down to the parameters `free` that suit (S,) `measured` best; where steps have come to
    leave more, the best of where they led, of those alike the first, and no step further that promises little and goes
    as far as one may.  jobs: threads.  worth: misfit that a step has to promise, and the one before it to have removed.
    """
    at, base = settled_there(probe, null, model, base, free)
    columns, doubt = derivatives(probe, null, measured, model, base, at, free, jobs)
    before, longest = spans(free), longest_of(free)
    tried = []
    for turn in range(TURNS):
        step, covariance = step_of(null, measured, at, columns, doubt, before)
        step = np.clip(step, -longest, longest)
        left, promised = (judged(null, measured, p)[1] for p in (at, replace(at, mean=at.mean + columns @ step)))
        tried.append((left, Descent(model, base, at, columns, doubt, covariance)))
        model, base = moved(model, as_told(model, base, null, at, free), free, step)
        little = left - promised < worth or (turn > 0 and 0 <= tried[-2][0] - left < worth)
        if turn == TURNS - 1 or little or np.all(np.abs(step) < SETTLED):
            break
        after, base = settled_there(probe, null, model, base, free)
        if np.abs(step).max() < FAR:
            noise = np.sqrt(own_variance(null, at) + own_variance(null, after))
            columns = broyden(columns, step, after.mean - at.mean, noise)
        else:
            columns, doubt = derivatives(probe, null, measured, model, base, after, free, jobs)
        at = after
    least = min(t[0] for t in tried)
    guess = little and bool(np.any(np.abs(step) >= longest))
    if guess or left > least + WORSE:
        return next(where for there, where in tried if there < least + WORTH)
    return Descent(model, base, replace(at, mean=at.mean + columns @ step), columns, doubt, covariance)


def broyden(columns: Array, step: Array, change: Array, noise: Array | float = 0.0) -> Array:
    """(S, n) derivatives that give the change (S,) that a step (n,) turned out to make, where there are any and it is
    clear of its noise (S,): that of a short step, as a slope, would look like knowledge of the parameters."""
    surprise = change - columns @ step
    told = (columns != 0) & (np.abs(surprise) > CLEAR * noise)[:, None]
    return np.asarray(columns + told * np.outer(surprise, step) / (step @ step))


def moved(model: SensorModel, base: BaseFit, free: Free, step: Array) -> tuple[SensorModel, BaseFit]:
    """The model and the unit with the logarithms of these parameters moved."""
    for (name, key), s in zip(free, step, strict=True):
        if (name, key) == WHITE:
            base = replace(base, white=base.white * float(np.exp(s)))
            continue
        here = next(e for e in model.effects if e.name == name).parameters()
        model = with_effect(model, name, bounded(name, {**here, key: here[key] * float(np.exp(s))}))
    return model, base


def derivatives(
    probe: Probe,
    null: Null,
    measured: Array,
    model: SensorModel,
    base: BaseFit,
    at: Prediction,
    free: Free,
    jobs: int = 1,
) -> tuple[Array, Array]:
    """(S, n) change of the statistics for one more of each parameter's logarithm, and its noise; at: what the model
    gives.  Each is taken under a unit that has settled: of one that has not, light that saturates tells more than there
    is.  What one parameter of an effect clearly moves says of its others that they do not, or how far."""
    peak = float(np.max(np.abs(at.mean - null.mean) / null.noise))
    nudges = np.array([nudge_of(name, key, peak) for name, key in free])
    with ThreadPoolExecutor(jobs) as pool:
        steps = [moved(model, base, [what], np.array([nudge])) for what, nudge in zip(free, nudges, strict=True)]
        there = [made for made, _ in pool.map(lambda step: settled_there(probe, null, step[0], step[1], free), steps)]
    changes, doubt, clear = (
        np.stack(v, axis=1) for v in zip(*(change_of(null, measured, t, at) for t in there), strict=True)
    )
    alike = np.array([[name == other for name, _ in free] for other, _ in free])
    return np.where(clear @ alike, changes, 0.0) / nudges, doubt / nudges


def settled_there(
    probe: Probe, null: Null, model: SensorModel, base: BaseFit, free: Free
) -> tuple[Prediction, BaseFit]:
    """(what a model gives under a unit that has settled, that unit): probed once more where the unit was not still."""
    made = probe(model, base)
    there = as_told(model, base, null, made, free)
    return (made, base) if has_converged(base, there) else (probe(model, there), there)


def as_told(model: SensorModel, base: BaseFit, null: Null, made: Prediction, free: Free) -> BaseFit:
    """`candidate.as_seen`, but for an s^2 that is fitted."""
    there = as_seen(model, constrained_refit(model, base), null, made)
    return replace(there, white=base.white) if WHITE in free else there


def spans(free: Free) -> Array:
    """(n,) logarithms by which parameters may differ, standard deviations, before anything is measured: a factor of e,
    of a shape twice the step that its derivative takes."""
    fitted = [name != WHITE[0] and key != candidate(name).fitted[0] for name, key in free]
    return np.array([2 * abs(candidate(f[0]).nudge) if shape else 1.0 for f, shape in zip(free, fitted, strict=True)])


def longest_of(free: Free) -> Array:
    """(n,) largest step of each logarithm at once."""
    return np.minimum(spans(free), LONGEST)


def nudge_of(name: str, key: str, peak: float) -> float:
    """Step of a logarithm to take a derivative by, long enough to show above the twins' own noise.

    peak: noises by which the effect shows.
    """
    if (name, key) == WHITE:
        return -0.2
    if key != candidate(name).fitted[0]:
        return candidate(name).nudge
    return float(np.clip(6.0 / max(peak, 1e-9), 0.25, 1.0))
