"""One measurement under diagnosis: light and observations, and the simulation of the same campaign under a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from spikecam_env.gap.observe.conditions import STEADY_KNOWN, Condition
from spikecam_env.gap.observe.observation import ObservedRecording
from spikecam_env.gap.settings import DiagnosisSettings
from spikecam_env.gap.statistics import StatisticKey, pattern_bank, statistics_bank
from spikecam_env.gap.statistics.film import FilmFeatures, films
from spikecam_env.gap.statistics.reading import CampaignReading
from spikecam_env.gap.twins.budget import Budget
from spikecam_env.gap.twins.fresh_units import drawn_banks
from spikecam_env.gap.twins.recent import RecentTwins, Same, fingerprint
from spikecam_env.gap.twins.simulate import FIRST_SEED
from spikecam_env.gap.twins.unknown_scene import simulate_seen
from spikecam_env.gap.unit.refit import BaseFit, free_refit
from spikecam_env.sensor import SensorModel
from spikecam_env.types import Masks


@dataclass(frozen=True)
class Case:
    """A measurement with its free refit and its statistics."""

    shape: tuple[int, int]
    conditions: tuple[Condition, ...]
    observations: tuple[ObservedRecording, ...]
    films: Mapping[str, FilmFeatures]
    base: BaseFit
    """Its free refit."""
    bank: dict[StatisticKey, float]
    """Its statistics."""
    seed: int
    jobs: int = 1
    frame_rate_hz: float = 40_000.0
    budget: Budget = field(default_factory=Budget, compare=False)
    """Recordings simulated for it, and for all cases that were made of it."""
    recent: RecentTwins = field(default_factory=RecentTwins, compare=False)
    """Its last simulated campaigns."""
    nominal_per_label: float = 1.0
    """Nominal radiance of 1 of the labels, by which the light of `conditions` was multiplied."""
    settings: DiagnosisSettings = field(default_factory=DiagnosisSettings)

    @property
    def scenes_only(self) -> bool:
        """Whether no light is known: response and dark level cannot be distinguished from the scene."""
        return not any(c.kind in STEADY_KNOWN for c in self.conditions)

    @property
    def rates_only(self) -> bool:
        """Whether recordings are maps of rates, without spikes (`rate_maps`)."""
        return not self.observations

    def drawn_banks(self, model: SensorModel, count: int) -> list[dict[StatisticKey, float]]:
        """Statistics of the pattern of fresh units (`fresh_units.drawn_banks`)."""
        limits = self.settings.unit.spread_limits
        return drawn_banks(model, self.base, self.conditions, self.shape, count, self.seed, limits)

    def use(self, recording: str) -> str:
        """`fit` or `holdout`."""
        return next((c.use for c in self.conditions if c.name == recording), "fit")

    def to_fit(self, keys: Sequence[StatisticKey]) -> Masks:
        """(S,) whether statistics are of recordings to fit."""
        return np.array([self.use(k.recording) == "fit" for k in keys], bool)

    def held_out(self, keys: Sequence[StatisticKey]) -> Masks:
        """(S,) whether statistics count in the gap: those of recordings held out, or all where none is."""
        held = np.array([self.use(k.recording) == "holdout" for k in keys], bool)
        return held if held.any() else np.ones(len(keys), bool)

    def of(self, conditions: Sequence[Condition], observations: Sequence[ObservedRecording]) -> Case:
        """Other recordings of the same camera in the same unit of light, refitted anew."""
        other = case_of(self.shape, conditions, observations, self.seed, self.jobs, self.frame_rate_hz)
        return replace(other, nominal_per_label=self.nominal_per_label, settings=self.settings)


@dataclass(frozen=True)
class Twin:
    """One simulated campaign."""

    bank: dict[StatisticKey, float]
    """Its statistics."""
    base: BaseFit | None
    """Its own refit; None where recordings that a refit rests on were not simulated."""
    pattern: dict[StatisticKey, float] = field(default_factory=dict)
    """Statistics of the pattern of its rates, whose unit is the measured one."""


def case_of(
    shape: tuple[int, int],
    conditions: Sequence[Condition],
    observations: Sequence[ObservedRecording],
    seed: int = 0,
    jobs: int = 1,
    frame_rate_hz: float = 40_000.0,
) -> Case:
    """Refit and statistics of a measurement."""
    moving = films(conditions, shape)
    base = free_refit(list(observations), list(conditions))
    reading = CampaignReading(observations, conditions, base, moving)
    statistics = {**statistics_bank(reading), **pattern_bank(reading)}
    return Case(shape, tuple(conditions), tuple(observations), moving, base, statistics, seed, jobs, frame_rate_hz)


def twins(
    case: Case,
    model: SensorModel,
    base: BaseFit,
    numbers: Sequence[int],
    only: Sequence[int] | None = None,
    refits: Mapping[int, BaseFit | None] | None = None,
) -> list[Twin]:
    """Campaigns of a unit under a model; one number is one set of draws, whatever the model.

    Args:
        case: the measurement.
        model: its effects.
        base: the unit.
        numbers: of the campaigns.
        only: recordings to simulate, by index; None: all.
        refits: by number, for campaigns without all recordings that a refit rests on; by default the unit itself,
            though beside an effect that bends rates a refit differs from the unit.
    """
    stands = refits or {}
    which = tuple(range(len(case.conditions)) if only is None else only)

    def made(n: int) -> Twin:
        refit, seed = stands.get(n) or base, case.seed * 1000 + FIRST_SEED + n
        units = (fingerprint(unit) for unit in (base, refit))
        key = (model, *units, seed, which, Same(case.conditions), Same(case.observations))
        make = partial(_twin, case, model, base, seed, which, refit)
        twin: Twin = case.recent.made(key, make, partial(case.budget.spend, len(which)))
        return twin

    with ThreadPoolExecutor(case.jobs) as pool:
        return list(pool.map(made, numbers))


def _twin(case: Case, model: SensorModel, base: BaseFit, seed: int, which: Sequence[int], refit: BaseFit) -> Twin:
    conditions = [case.conditions[i] for i in which]
    seen = [case.observations[i] for i in which]
    observations = simulate_seen(model, base, conditions, seen, case.shape, seed, which, case.jobs)
    own = free_refit(observations, conditions) if refit_recordings(case) <= set(which) else None
    reading = CampaignReading(observations, conditions, own or refit, case.films)
    return Twin(statistics_bank(reading), own, pattern_bank(reading))


def refit_recordings(case: Case) -> set[int]:
    """Recordings that the base refit rests on: of use fit and of known light, or where none is, of unknown scenes."""
    known = {i for i, c in enumerate(case.conditions) if c.kind in STEADY_KNOWN and c.use == "fit"}
    return known or {i for i, c in enumerate(case.conditions) if c.kind == "unknown"}
