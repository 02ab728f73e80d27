"""Small cameras for the tests of the diagnosis: a known unit, with or without an effect, recorded and refitted."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from spikecam_env.gap import Bars, Dark, Flat, Step
from spikecam_env.gap.case import Case, case_of
from spikecam_env.gap.compare import Null, deviates, values_of
from spikecam_env.gap.refit import BaseFit
from spikecam_env.gap.statistics import Key
from spikecam_env.gap.templates import model_null, unit_as_base
from spikecam_env.gap.twin import simulate
from spikecam_env.gap.world import Shown, planned
from spikecam_env.sensor import CATALOGUE, Effect, SensorModel

SHAPE = (32, 32)
FRAMES = 2000
MODEL = SensorModel.preset("scsim")
DESIGN = (Dark(), *(Flat(radiance=x) for x in (0.03, 0.08, 0.2, 0.4, 0.65)), Step(), Bars(high=1.4, period=8.0),
          Flat(radiance=0.5, use="holdout"))  # fmt: skip
UNIT = 3
TWINS = 12


def effect(name: str, **parameters: float) -> Effect:
    """An effect of the catalogue."""
    return CATALOGUE[name](**parameters)


def conditions() -> list[Shown]:
    """What the small design shows."""
    return planned(DESIGN, SHAPE, FRAMES)


@lru_cache(maxsize=64)
def unit(model: SensorModel = MODEL, seed: int = UNIT) -> BaseFit:
    """A drawn unit, exactly."""
    return unit_as_base(model.draw_unit(SHAPE, seed))


@lru_cache(maxsize=64)
def recorded(*effects: Effect, seed: int = 1, model: SensorModel = MODEL) -> Case:
    """The unit's campaign under the model with effects added, observed and refitted."""
    there = model
    for e in effects:
        there = there.with_effect(e)
    shown = conditions()
    return case_of(SHAPE, shown, simulate(there, unit(there), shown, SHAPE, seed), seed)


@lru_cache(maxsize=1)
def null() -> Null:
    """What the model predicts for this unit, without any effect."""
    return model_null(recorded(seed=2), MODEL, TWINS)


def seen(case: Case) -> dict[Key, float]:
    """Every statistic of a case as a normal deviate from the model without effects."""
    n = null()
    return dict(zip(n.keys, deviates(n, values_of(case.bank, n.keys)), strict=True))


def loudest(z: dict[Key, float], group: str) -> tuple[float, Key | None]:
    """The largest |z| of a group."""
    of = [(abs(v), k) for k, v in z.items() if k.group == group]
    return max(of, default=(0.0, None))


def summary(z: dict[Key, float]) -> str:
    """One line: the loudest of every group."""
    groups = dict.fromkeys(k.group for k in z)
    return ", ".join(f"{g} {loudest(z, g)[0]:.1f} ({loudest(z, g)[1].recording} {loudest(z, g)[1].name})" for g in groups)


def quiet(count: int) -> float:
    """|z| that `count` normal deviates exceed once in a thousand times, with room for a null of TWINS twins."""
    from scipy import stats

    return float(stats.norm.isf(0.5e-3 / max(count, 1))) + 1.0


def still(level: float, shape: tuple[int, int] = SHAPE, frames: int = FRAMES, use: str = "fit") -> Shown:
    """A flat, or the dark."""
    design = (Flat(radiance=level, use=use),) if level else (Dark(),)
    return planned(design, shape, frames)[0]


def flat_bits(model: SensorModel, level: float, frames: int = FRAMES, seed: int = 1) -> np.ndarray:
    """(F, H, W) spikes of the unit in steady light."""
    from spikecam_env.gap.twin import expose
    from spikecam_env.gap.refit import unit_of
    from spikecam_env.streams import unpack_frames

    base = unit(model)
    shown = still(level, frames=frames)
    return unpack_frames(expose(model, unit_of(model, base, SHAPE), shown, base, SHAPE, seed, 0), SHAPE)
