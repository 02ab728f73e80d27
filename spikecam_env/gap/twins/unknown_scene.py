"""Static scenes that nobody measured: the light that gives every pixel its measured rate.

    L(x, y) = (rate(x, y) - dark(x, y)) / gain(x, y)        under the unit and the model to be tested

Rates then say nothing; what is left to test is when spikes come: noise, neighbours, rows, drift, lines.  Every twin
draws rates anew that agree with the recording (`calibration.spike_times.plausible_rates`), and where a model bends the
response, light is corrected until the rates come out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from spikecam_env.calibration.spike_times import plausible_rates
from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.observe.observation import ObservedRecording
from spikecam_env.gap.twins.simulate import simulate
from spikecam_env.gap.twins.workers import at_once
from spikecam_env.gap.unit.refit import BaseFit
from spikecam_env.sensor import Keyframes, SensorModel
from spikecam_env.types import Floats

FEWEST_SPIKES = 3
"""Fewest spikes for a rate; other pixels get the rate of two spikes."""

RATE_TOLERANCE = 3e-4
"""Relative error of rates beyond which light is corrected."""

MOST_AT_ONCE = 2.0
"""Largest factor of one correction of light.  Pixels that stay silent in a twin, or fire in every frame, do not show
the size of the error."""

BRIGHTEST = 1e4
"""Radiance of a scene at most: a pixel with a gain of 2e-4 of nominal saturates in it."""

_BINS = 12
_MOST_CORRECTIONS = 6


def simulate_seen(
    model: SensorModel,
    base: BaseFit,
    conditions: Sequence[Condition],
    seen: Sequence[ObservedRecording],
    shape: tuple[int, int],
    seed: int,
    takes: Sequence[int],
    jobs: int = 1,
) -> list[ObservedRecording]:
    """As `simulate`, with unknown scenes lit so that their pixels fire as in `seen`, `jobs` recordings at once."""

    def one(i: int) -> ObservedRecording:
        if conditions[i].kind == "unknown":
            return simulate_scene(model, base, conditions[i], seen[i], shape, seed, takes[i])
        return simulate(model, base, [conditions[i]], shape, seed, [takes[i]])[0]

    # the longest begin first, moving and then bright ones: no thread waits for one at the end
    order = sorted(range(len(conditions)), key=lambda i: (not conditions[i].moves, -seen[i].frame.sum()))
    made = dict(zip(order, at_once(one, order, jobs), strict=True))
    return [made[i] for i in range(len(conditions))]


def simulate_scene(
    model: SensorModel,
    base: BaseFit,
    scene: Condition,
    seen: ObservedRecording,
    shape: tuple[int, int],
    seed: int,
    take: int,
) -> ObservedRecording:
    """One recording of an unknown scene, lit so that its pixels fire as in `seen`."""
    wanted = plausible_true_rates(seen, base.white, np.random.default_rng([seed, take]))
    light = np.minimum(np.maximum(wanted - base.dark, 0.0) / np.maximum(base.gain, 1e-9), BRIGHTEST)
    counted = np.ones(light.shape, bool) if scene.static is None else scene.static.reshape(-1)
    for turn in range(_MOST_CORRECTIONS):
        lit = replace(scene, light=Keyframes(np.zeros(1), light.reshape(1, *shape).astype(np.float32)))
        [twin] = simulate(model, base, [lit], shape, seed, [take])
        factor = np.ones_like(light)
        factor[counted] = correction(twin.rate[counted], wanted[counted])
        if turn == _MOST_CORRECTIONS - 1 or np.abs(factor - 1.0).max() < RATE_TOLERANCE:
            break
        light = np.minimum(light * factor, BRIGHTEST)
    return twin


def plausible_true_rates(seen: ObservedRecording, white: float, rng: np.random.Generator) -> Floats:
    """(P,) rates [thresholds/frame] that the pixels may have had."""
    few = seen.times.count < FEWEST_SPIKES
    known = replace(
        seen.times,
        count=np.where(few, 2, seen.times.count),
        first=np.where(few, 0, seen.times.first),
        last=np.where(few, seen.frames - 1, seen.times.last),
    )
    return np.asarray(plausible_rates(known, white, rng), np.float64)


def correction(simulated: Floats, wanted: Floats) -> Floats:
    """(P,) factor by which light misses, a smooth function of the rate: means of pixels of about the same one."""
    edges = np.unique(np.quantile(wanted, np.linspace(0.0, 1.0, _BINS + 1)))
    if edges.size < 3 or simulated.sum() == 0:
        return np.full(wanted.shape, _limited(wanted.mean() / max(float(simulated.mean()), 1e-9)))
    bins = np.clip(np.searchsorted(edges, wanted, "right") - 1, 0, edges.size - 2)
    total = np.bincount(bins, minlength=edges.size - 1)
    filled = total > 0
    mean = np.bincount(bins, wanted)[filled] / total[filled]
    got = np.bincount(bins, simulated)[filled] / total[filled]
    return np.interp(wanted, mean, _limited(mean / np.maximum(got, 1e-9)))


def _limited(factor: Floats) -> Floats:
    return np.clip(factor, 1.0 / MOST_AT_ONCE, MOST_AT_ONCE)
