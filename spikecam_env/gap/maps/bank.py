"""Maps of rates, measured or of a fresh unit, and the statistics of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from spikecam_env.campaign.reading import Campaign
from spikecam_env.errors import InputError
from spikecam_env.gap.observe.conditions import STEADY_KNOWN, Condition, condition_of
from spikecam_env.gap.settings import DiagnosisSettings
from spikecam_env.gap.statistics import StatisticKey, pattern, texture
from spikecam_env.sensor import SensorModel
from spikecam_env.types import Floats


@dataclass(frozen=True)
class RateMap:
    """One recording of rates."""

    shown: Condition
    rate: Floats
    """(H, W) rates [spikes/frame], spread within a count."""


@dataclass(frozen=True)
class MapCase:
    """All maps of a campaign."""

    shape: tuple[int, int]
    maps: tuple[RateMap, ...]
    response: dict[str, float]
    """Medians of lit maps less the dark's, by name [spikes/frame]."""
    dark: float
    """Median dark level [spikes/frame]."""
    seed: int
    jobs: int
    settings: DiagnosisSettings = field(default_factory=DiagnosisSettings)

    @property
    def statistics(self) -> dict[StatisticKey, float]:
        """Statistics of the measured maps."""
        return map_bank(self.maps)


def read_maps(campaign: Campaign, seed: int, jobs: int, settings: DiagnosisSettings) -> MapCase:
    """The rates of a campaign in known, steady light."""
    maps = []
    for r in campaign.recordings:
        condition = condition_of(r)
        if r.rates is not None and condition.kind in STEADY_KNOWN:
            maps.append(RateMap(condition, spread_evenly(r.rate(), r.frames)))
    if not maps:
        raise InputError(
            f"{campaign.folder} has neither spikes nor rates in known, steady light: nothing can be tested"
        )
    dark = dark_of(maps)
    level = float(np.median(dark)) if dark is not None else 0.0
    response = {m.shown.name: float(np.median(m.rate)) - level for m in maps if m.shown.kind != "dark"}
    return MapCase(campaign.shape, tuple(maps), response, level, seed, jobs, settings)


def spread_evenly(rate: Floats, frames: int) -> Floats:
    """Rates spread within a count: else quantiles of ten spikes a pixel would be whole numbers."""
    return rate + (np.random.default_rng(frames).random(rate.shape) - 0.5) / frames


def dark_of(maps: Sequence[RateMap]) -> Floats | None:
    """(H, W) mean of the dark maps."""
    dark = [m.rate for m in maps if m.shown.kind == "dark"]
    return np.mean(dark, axis=0) if dark else None


def map_bank(maps: Sequence[RateMap]) -> dict[StatisticKey, float]:
    """Statistics of every map; texture of lit ones less the dark."""
    dark = dark_of(maps)
    statistics = {}
    for m in maps:
        own = m.rate if m.shown.kind == "dark" or dark is None else m.rate - dark
        for group, values in (("pattern", pattern.statistics(m.rate)), ("texture", texture.statistics(own))):
            for name, value in values.items():
                statistics[StatisticKey(group, m.shown.name, name)] = value
    return statistics


def unit_maps(model: SensorModel, case: MapCase, number: int) -> tuple[RateMap, ...]:
    """Maps of a fresh unit at the measured medians, counted over as many frames."""
    gain, dark = unit_levels(model, case, number)
    rng = np.random.default_rng([case.seed, number])
    made = []
    for m in case.maps:
        light = m.shown.picture.reshape(case.shape) / max(m.shown.level, 1e-12)
        rate = dark + gain * light * case.response.get(m.shown.name, 0.0)
        counts = np.floor(m.shown.frames * rate + rng.random(case.shape))
        rate = np.clip(counts / m.shown.frames, 0.0, 1.0)
        made.append(RateMap(m.shown, spread_evenly(rate, m.shown.frames)))
    return tuple(made)


def unit_levels(model: SensorModel, case: MapCase, number: int) -> tuple[Floats, Floats]:
    """(H, W) response over its median, and dark level [spikes/frame], of a fresh unit."""
    unit = model.draw_unit(case.shape, case.seed + number)
    gain = unit.gain / max(float(np.median(unit.gain)), 1e-12)
    middle = float(np.median(unit.dark))
    dark = unit.dark * (case.dark / middle) if middle > 0 else unit.dark
    return gain.reshape(case.shape), dark.reshape(case.shape)


def with_use(case: MapCase, keys: Sequence[StatisticKey], use: str) -> NDArray[np.bool_]:
    """(S,) whether a statistic is of a recording of this use."""
    names = {m.shown.name for m in case.maps if m.shown.use == use}
    return np.array([k.recording in names for k in keys])
