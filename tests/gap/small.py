"""Small cameras for the tests of the diagnosis: a known unit, with or without an effect, recorded and refitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from spikecam_env.gap import Bars, Dark, Flat, Step
from spikecam_env.gap.baseline.null_model import model_null
from spikecam_env.gap.compare.distance import deviates
from spikecam_env.gap.compare.prediction import Draw, Null, Prediction, values_of
from spikecam_env.gap.fit.problem import Problem
from spikecam_env.gap.observe.conditions import Condition, planned_conditions
from spikecam_env.gap.observe.observation import ObservedRecording, observe
from spikecam_env.gap.search.round import Round
from spikecam_env.gap.statistics import StatisticKey
from spikecam_env.gap.twins.case import Case, case_of
from spikecam_env.gap.twins.simulate import expose
from spikecam_env.gap.unit.conversion import exact_refit, unit_from_refit
from spikecam_env.gap.unit.refit import BaseFit
from spikecam_env.sensor import CATALOGUE, Effect, SensorModel
from spikecam_env.streams import pack_frames, unpack_frames
from spikecam_env.types import Floats

Spikes = NDArray[np.uint8]

SHAPE = (32, 32)
FRAMES = 2000
MODEL = SensorModel.preset("scsim")
DESIGN = (Dark(), *(Flat(radiance=x) for x in (0.03, 0.08, 0.2, 0.4, 0.65)), Step(), Bars(high=1.4, period=16.0),
          Flat(radiance=0.5, use="holdout"))  # fmt: skip
UNIT = 3
TWINS = 12
CLEAR = 5.0
"""Normal deviates that a statistic is off by, to reveal an effect."""


def effect(name: str, **parameters: float) -> Effect:
    """An effect of the catalogue."""
    return CATALOGUE[name](**parameters)


@lru_cache(maxsize=1)
def conditions() -> list[Condition]:
    """Of the small design."""
    return planned_conditions(DESIGN, SHAPE, FRAMES)


@lru_cache(maxsize=64)
def unit(model: SensorModel = MODEL, seed: int = UNIT) -> BaseFit:
    """A drawn unit, exactly."""
    return exact_refit(model.draw_unit(SHAPE, seed))


def with_effects(model: SensorModel, effects: Sequence[Effect]) -> SensorModel:
    """The model with effects added."""
    for e in effects:
        model = model.with_effect(e)
    return model


@lru_cache(maxsize=64)
def recorded(*effects: Effect, seed: int = 1, model: SensorModel = MODEL) -> Case:
    """The unit's campaign under the model with effects added, observed and refitted."""
    return case_from(spikes_of(*effects, seed=seed, model=model), seed=seed)


def spikes_of(*effects: Effect, seed: int = 1, model: SensorModel = MODEL) -> dict[str, Spikes]:
    """(F, H, W) spikes of every recording, by name, for a test to change."""
    return {name: unpack_frames(packed, SHAPE) for name, packed in _packed(effects, seed, model).items()}


@lru_cache(maxsize=64)
def _packed(effects: tuple[Effect, ...], seed: int, model: SensorModel) -> dict[str, Spikes]:
    there = with_effects(model, effects)
    base = unit(there)
    law = unit_from_refit(there, base, SHAPE)
    return {c.name: expose(there, law, c, SHAPE, seed, take) for take, c in enumerate(conditions())}


def case_from(spikes: dict[str, Spikes], seed: int = 1, shown: Sequence[Condition] | None = None) -> Case:
    """A case of spikes that a test may have changed; lengths are those of the spikes."""
    there = [replace(c, frames=len(spikes[c.name])) for c in shown or conditions() if c.name in spikes]
    seen_by = [_observed(pack_frames(spikes[c.name]).tobytes(), c.frames, c.moves) for c in there]
    return case_of(SHAPE, there, seen_by, seed)


@lru_cache(maxsize=32)
def _observed(packed: bytes, frames: int, film: bool) -> ObservedRecording:
    """Of a recording of these bits; of most a test changes one and the others were observed before."""
    return observe(np.frombuffer(packed, np.uint8).reshape(frames, -1), SHAPE, film=film)


@lru_cache(maxsize=1)
def null() -> Null:
    """The model's prediction for this unit, without any effect."""
    return model_null(recorded(seed=2), MODEL, TWINS)


def made_up_null(count: int, twins: int = TWINS, seed: int = 0) -> Null:
    """So many statistics of rates, of normal noise of deviation 1, as twins tell them."""
    values = np.random.default_rng(seed).standard_normal((twins, count))
    keys = tuple(StatisticKey("rates", "r", str(i)) for i in range(count))
    draws = tuple(Draw(n, v, None) for n, v in enumerate(values))
    return Null(keys, values.mean(axis=0), values.std(axis=0, ddof=1), np.zeros(count), twins, twins - 1, draws=draws)


def problem_of(case: Case, null: Null) -> Problem:
    """A search in a case against a null model, where all of its statistics are to be fitted."""
    measured = values_of(case.bank, null.keys)
    return Problem(case, MODEL, null, measured, measured)


def seen(case: Case) -> dict[StatisticKey, float]:
    """Every statistic of a case as a normal deviate from the model without effects."""
    n = null()
    return dict(zip(n.keys, deviates(n, values_of(case.bank, n.keys)), strict=True))


def loudest(z: dict[StatisticKey, float], group: str) -> tuple[float, StatisticKey | None]:
    """The largest |z| of a group."""
    of = [(abs(v), k) for k, v in z.items() if k.group == group]
    return max(of, default=(0.0, None))


def summary(z: dict[StatisticKey, float]) -> str:
    """One line: the loudest of every group."""
    groups = dict.fromkeys(k.group for k in z)
    return ", ".join(
        f"{g} {loudest(z, g)[0]:.1f} ({loudest(z, g)[1].recording} {loudest(z, g)[1].name})" for g in groups
    )


def quiet(count: int) -> float:
    """|z| that `count` normal deviates exceed once in a thousand times, with room for a null of TWINS twins."""
    return float(stats.norm.isf(0.5e-3 / max(count, 1))) + 1.0


def found_alone(
    case: Case, values: Floats, model: SensorModel, base: BaseFit, predicted: Prediction, margin: float
) -> list[Round]:
    """The rounds of a search that found a dead time, of 0.5 us to a fiftieth, with this prediction.

    Args:
        values: (S,) measured statistics.
        model: with the dead time.
        base: the unit beside it.
    """
    problem = Problem.of(case, MODEL, null(), values)
    first = problem.hypothesis(MODEL, case.base, null().prediction)
    fit = problem.fit_of("dead_time", {"tau_us": 0.5}, model, base, predicted, {"tau_us": 0.01})
    return [Round(first, (fit,), ahead={"": margin}), Round(problem.hypothesis(model, base, predicted))]
