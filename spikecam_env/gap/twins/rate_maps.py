"""Recordings that are rates only: how pixels differ, in the light and in the dark, is all that can be tested.

A twin is a fresh unit of the model, counted as the maps were; its median response and dark level are the measured ones.
Before a search, spreads of response and of dark level are free within the differences of units
(`settings.UnitSettings.spread_limits`).  In its fits they have no limit: one further off is a wrong parameter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from spikecam_env.campaign.reading import Campaign
from spikecam_env.errors import InputError
from spikecam_env.gap.observe.conditions import STEADY_KNOWN, Condition, condition_of
from spikecam_env.gap.settings import DiagnosisSettings
from spikecam_env.gap.statistics import StatisticKey, keyed, pattern, texture
from spikecam_env.gap.twins.case import Case
from spikecam_env.gap.twins.fresh_units import SPREAD_PARAMETERS, drawn_response, with_spreads_scaled
from spikecam_env.gap.unit.refit import BaseFit, responds
from spikecam_env.sensor import SensorModel
from spikecam_env.types import Floats

KINDS_THAT_SHOW = {"gain": ("flat", "picture"), "dark": ("dark",)}
"""Kinds of maps by whose grain a spread is matched, by the property of the unit that it spreads."""


@dataclass(frozen=True)
class MapCase(Case):
    """All maps of a campaign."""

    rates: Mapping[str, Floats] = field(default_factory=dict)
    """(H, W) rates [spikes/frame] by recording, spread within a count."""
    response: Mapping[str, float] = field(default_factory=dict)
    """Medians of lit maps less the dark's, by recording [spikes/frame]."""

    def drawn_banks(self, model: SensorModel, count: int) -> list[dict[StatisticKey, float]]:
        """Statistics of the maps of fresh units."""
        return [map_bank(self.conditions, self.maps_of(model, number)) for number in range(count)]

    def maps_of(self, model: SensorModel, number: int) -> dict[str, Floats]:
        """Maps of a fresh unit at the measured medians, counted over as many frames, by recording."""
        gain, dark = (v.reshape(self.shape) for v in drawn_response(model, self.base, self.shape, self.seed + number))
        rng = np.random.default_rng([self.seed, number])
        maps = {}
        for c in self.conditions:
            light = c.picture.reshape(self.shape) / max(c.level, 1e-12)
            rate = dark + gain * light * self.response.get(c.name, 0.0)
            counts = np.floor(c.frames * rate + rng.random(self.shape))
            maps[c.name] = spread_evenly(np.clip(counts / c.frames, 0.0, 1.0), c.frames)
        return maps


def read_maps(campaign: Campaign, seed: int, jobs: int, settings: DiagnosisSettings) -> MapCase:
    """The rates of a campaign in known, steady light.

    Raises:
        InputError: where there are none.
    """
    both = [(r, condition_of(r)) for r in campaign.recordings if r.rates is not None]
    shown = {c.name: (r, c) for r, c in both if c.kind in STEADY_KNOWN}
    if not shown:
        raise InputError(
            f"{campaign.folder} has neither spikes nor rates in known, steady light: nothing can be tested"
        )
    conditions = tuple(c for _, c in shown.values())
    rates = {name: spread_evenly(r.rate(), r.frames) for name, (r, _) in shown.items()}
    dark = dark_of(conditions, rates)
    level = float(np.median(dark)) if dark is not None else 0.0
    response = {c.name: float(np.median(rates[c.name])) - level for c in conditions if c.kind != "dark"}
    return MapCase(
        shape=campaign.shape,
        conditions=conditions,
        observations=(),
        films={},
        base=unit_of_maps(conditions, rates, response),
        bank=map_bank(conditions, rates),
        seed=seed,
        jobs=jobs,
        frame_rate_hz=campaign.frame_rate_hz,
        settings=settings,
        rates=rates,
        response=response,
    )


def unit_of_maps(
    conditions: Sequence[Condition], rates: Mapping[str, Floats], response: Mapping[str, float]
) -> BaseFit:
    """Response over its median, and dark level [spikes/frame], of every pixel, by the first lit map to fit."""
    shape = next(iter(rates.values())).shape
    dark = dark_of(conditions, rates)
    dark = np.zeros(shape) if dark is None else dark
    lit = [c.name for c in conditions if c.name in response and c.use == "fit"]
    gain = (rates[lit[0]] - dark) / max(response[lit[0]], 1e-12) if lit else np.ones(shape)
    return unit_without_errors(gain, dark)


def unit_without_errors(gain: Floats, dark: Floats) -> BaseFit:
    """A unit of these pixels, of known response and dark level, without jitter."""
    zero = np.zeros(gain.size)
    gain, dark = gain.ravel(), dark.ravel()
    return BaseFit(gain, dark, zero, zero, 0.0, np.zeros((0, gain.size)), responds(gain))


def spread_evenly(rate: Floats, frames: int) -> Floats:
    """Rates spread within a count: else quantiles of ten spikes a pixel would be whole numbers."""
    return rate + (np.random.default_rng(frames).random(rate.shape) - 0.5) / frames


def dark_of(conditions: Sequence[Condition], rates: Mapping[str, Floats]) -> Floats | None:
    """(H, W) mean of the dark maps."""
    dark = [rates[c.name] for c in conditions if c.kind == "dark"]
    return np.mean(dark, axis=0) if dark else None


def map_bank(conditions: Sequence[Condition], rates: Mapping[str, Floats]) -> dict[StatisticKey, float]:
    """Statistics of every map; texture of lit ones less the dark."""
    dark = dark_of(conditions, rates)
    bank: dict[StatisticKey, float] = {}
    for c in conditions:
        rate = rates[c.name]
        own = rate if c.kind == "dark" or dark is None else rate - dark
        bank |= keyed("pattern", c.name, pattern.statistics(rate)) | keyed("texture", c.name, texture.statistics(own))
    return bank


def with_spreads_matched(case: MapCase, model: SensorModel) -> SensorModel:
    """The model with its spreads moved towards the measured grain of each kind of map, as far as units differ."""
    fitted = model
    for _ in range(2):
        [simulated] = case.drawn_banks(fitted, 1)
        factors = {}
        for part in SPREAD_PARAMETERS:
            shown = [c.name for c in case.conditions if c.kind in KINDS_THAT_SHOW[part] and c.use == "fit"]
            keys = [StatisticKey("texture", name, "fine") for name in shown]
            off = [case.bank[k] - simulated[k] for k in keys if k in case.bank and k in simulated]
            factors[part] = float(np.exp(np.mean(off))) if off else 1.0
        fitted = with_spreads_scaled(fitted, model, factors, case.settings.unit.spread_limits)
    return fitted


def at_measured_dark(case: MapCase, model: SensorModel) -> SensorModel:
    """The model, its dark level the measured one."""
    level = next((e for e in model.effects if e.name == "dark_current"), None)
    here, measured = (float(np.median(v)) for v in (model.draw_unit(case.shape, case.seed).dark, case.base.dark))
    if level is None or here <= 0 or measured <= 0:
        return model
    return model.with_effect(replace(level, mean_pA=level.parameters()["mean_pA"] * measured / here))  # type: ignore[call-arg]
