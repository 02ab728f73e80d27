"""What a diagnosis says: format `spikecam-diagnosis/1` (docs/gap.md), and what its report shows beside it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.baseline.motion import DetectedMotion
from spikecam_env.gap.baseline.static_part import static_pixels
from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.observe.observation import ObservedRecording
from spikecam_env.gap.twins.budget import CAMPAIGNS
from spikecam_env.gap.unit.refit import BaseFit
from spikecam_env.sensor import SensorModel
from spikecam_env.whole import whole_folder, write_text_whole

DIAGNOSIS_FORMAT = "spikecam-diagnosis/1"
VERDICTS = ("none", "named", "class", "unknown", "parameter", "data")


@dataclass(frozen=True)
class Estimate:
    """A parameter's value, its standard deviation, and where it is with 90 %, in the parameter's unit.

    interval: low and high, of the coordinate in which it was fitted and within its range (`fit.coordinates`); None
    where no error is known.
    """

    value: float
    sd: float
    interval: tuple[float, float] | None = None


MOST_CONFIDENCE = 0.99
"""Confidence in a name without a rival: an effect outside of the catalogue may explain as much."""


@dataclass(frozen=True)
class NamedEffect:
    """An effect found.  confidence: 0 to 1.  alternatives: (name, confidence), best first.

    where, when: the part of the array or of the time that it acts in; empty for everywhere and always.
    instead: share of the gap that an alternative would remove in its place, by name.
    """

    name: str
    family: str
    confidence: float
    parameters: dict[str, Estimate]
    alternatives: tuple[tuple[str, float], ...] = ()
    where: str = ""
    when: str = ""
    instead: dict[str, float] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """The documented format."""
        others = [
            {"name": n, "confidence": c, **({"removed": self.instead[n]} if n in self.instead else {})}
            for n, c in self.alternatives
        ]
        stated = {k: v for k, v in asdict(self).items() if k != "instead"}
        return {**stated, "alternatives": others}


@dataclass(frozen=True)
class Remainder:
    """What is left beyond chance beside effects that are named: where their law differs from the catalogue's.

    noises: largest deviate left.  share: of the sum of squares beyond chance, of all recordings.  worst: the statistic
    that is left off most, recordings: those of statistics left off, the worst first.  groups: share of each group of
    statistics in what is left, largest first.  where, when: as of `NamedEffect`.
    """

    noises: float
    share: float
    worst: str
    groups: dict[str, float]
    recordings: tuple[str, ...]
    where: str = ""
    when: str = ""


@dataclass(frozen=True)
class Statistic:
    """One number of the bank, measured and simulated.

    group: what it looks at (rates, noise, spectrum ...).  before, after: mean over twins under the model as given and
    as patched; sd: of one campaign, under the model as given.  z: (measured - before) / sd, as a normal deviate.
    z_after: the same of what is left.  holdout: whether its recordings were held out.
    """

    name: str
    group: str
    recordings: tuple[str, ...]
    measured: float
    before: float
    after: float
    sd: float
    z: float
    z_after: float
    p_adjusted: float
    holdout: bool


@dataclass(frozen=True)
class Ranked:
    """A candidate that was tried.  misfit: heavy-tailed sum of squares of what it leaves; parameters: at the best.

    misfit_before: of what the candidates of its step were added to.  reason: why it was accepted or rejected.
    """

    name: str
    family: str
    misfit_before: float
    misfit: float
    parameters: dict[str, Estimate]
    accepted: bool
    reason: str


LEAST_STATED = 0.05
"""Of the misfit, from which what a candidate removes is stated with one decimal."""


def why_rejected(misfit: float, before: float, best: str, asked: float) -> str:
    """Why a candidate was not added, by its misfit alone.  before: what its step started from; best: the candidate
    that was preferred; asked: what has to be removed of the misfit for an effect to be added."""
    removed = before - misfit
    if removed < LEAST_STATED:
        return "explains nothing"
    if removed < asked:
        return f"removes {removed:.1f} of the misfit; an effect must remove {asked:g}"
    return f"larger misfit than {best.replace('_', ' ')}"


@dataclass(frozen=True)
class Bound:
    """Upper bound (95 %, `verdict.bounds`) of an effect not found.  at: its other parameters there, by name."""

    name: str
    parameter: str
    unit: str
    below: float
    at: dict[str, float] = field(default_factory=dict)


BOUNDED_VERDICTS = ("none", "parameter")
"""Verdicts with upper bounds of the effects that were not found, where they are asked for."""

SIGNIFICANT = 0.05
"""Adjusted p-value below which a statistic is listed as one that differs."""

CHANCE = 1.0
"""Gap of statistics that lie off by their own noise alone."""

LEAST_GAP = 1.5
"""Times its floor that a gap is at least, for a removed share to be stated: the mean square of 30 statistics scatters,
by chance, by a quarter of itself, sqrt(2 / 30)."""


@dataclass(frozen=True)
class Gap:
    """Mean square distance of held-out statistics, in noise.

    floor: of two halves of the measurement; in the pattern, of two units.  removed: share that is gone after.
    """

    before: float
    after: float
    floor: float
    removed: float
    by_recording: dict[str, dict[str, float]]

    @classmethod
    def of(
        cls, before: float, after: float, by_recording: Mapping[str, tuple[float, float]], floor: float = CHANCE
    ) -> Gap:
        """From mean squares before and after, of all that is held out and by recording, and one floor."""
        removed = (before - after) / (before - floor) if before > LEAST_GAP * floor else 0.0
        rows = {name: {"before": b, "after": a, "floor": floor} for name, (b, a) in by_recording.items()}
        return cls(before, after, floor, removed, rows)


LABELLED_LIGHT, NOMINAL_LIGHT = "radiance [unit of the labels]", "radiance [nominal, 1: a spike a frame]"
"""Axes of light on a page: as it was labelled, or counted anew (`unit.label_unit`)."""


@dataclass(frozen=True)
class Evidence:
    """What the report draws: conditions and observations of the measurement, and of one twin before and after.

    again: another twin of the model before, with another seed: what chance alone makes differ.
    drawn_before, drawn_after: gain and dark (P,) of a fresh unit of each model (`fresh_units.drawn_response`): the
    fixed pattern to expect, where twins have the measured one.  light: the name of the axis of light.
    """

    conditions: tuple[Condition, ...]
    measured: tuple[ObservedRecording, ...]
    before: tuple[ObservedRecording, ...]
    after: tuple[ObservedRecording, ...] | None
    free_refit: BaseFit
    before_base: BaseFit
    after_base: BaseFit | None
    again: tuple[ObservedRecording, ...] | None = None
    drawn_before: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    drawn_after: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    light: str = LABELLED_LIGHT


@dataclass(frozen=True)
class Conclusion:
    """What the rooms of a diagnosis find, before it is put in words: fields as in `Diagnosis`.

    notes: contradictions first, then how the gap is to be read (`verdict.notes.Note`).
    """

    verdict: str
    effects: tuple[NamedEffect, ...]
    unknown: dict[str, Any] | None
    class_: dict[str, Any] | None
    parameters: dict[str, dict[str, float]]
    notes: tuple[str, ...]
    gap: Gap | None
    statistics: tuple[Statistic, ...]
    ranking: tuple[Ranked, ...]
    not_testable: tuple[tuple[str, str], ...]
    patched: SensorModel
    remainder: Remainder | None = None


@dataclass(frozen=True)
class Diagnosis:
    """The answer of a diagnosis.

    Args:
        verdict: one of `VERDICTS`.
        sentence: the answer in words.
        effects: named effects.
        unknown: for verdict `unknown`, the structure of the difference.
        class_: for verdict `class`, {"members": [...], "experiment": "..."}.
        parameters: of the model's effects whose strength is off: {effect: {measured, nominal, ratio}}.
        data: notes on the recordings; for verdict `data`, the contradictions.
        gap: on the held-out recordings; None where nothing is held out.
        statistics: every statistic, measured and simulated.
        ranking: candidates that were tried.
        not_testable: (name, what is needed) of effects that these recordings cannot show.
        bounds: upper bounds of effects that were not found; empty unless `diagnose` was called with bounds=True.
        patched: the model with the effects found, or with an empirical patch; loads back as a model.
        model_name: of the model that was tested.
        campaign: its folder.
        seed: of all simulations.
        stages: seconds by stage.
        candidates, exclude: as given to `diagnose`; None: all of the catalogue.
        evidence: recordings and twins that the report draws.
        simulated: number of recordings simulated, without those that the report draws.
        effort: the budget [campaigns].
        not_bounded: (name, what is needed) of effects that were not found and have no bound.
        effect_files: of a user's own effects, among the model's and those tried.
        motion: of recordings that are labelled static.
        static_only: whether moving pixels were left out.
        remainder: for verdict `named`, the difference beyond chance that remains; None where nothing does.
        settings: those that differ from the defaults, by "stage.name".
        with_bounds: whether upper bounds were to be simulated.

    Example:
        >>> flats = [Dark(), *(Flat(radiance=level) for level in (0.1, 0.3))]
        >>> campaign = write_campaign("camera", "scsim", shape=(8, 8), frames=400, recordings=flats)
        >>> diagnosis = diagnose(campaign, "scsim", candidates=["dead_time"], twin_count=6, progress=False)
        >>> diagnosis.verdict, diagnosis.effects
        ('none', ())
        >>> diagnosis.to_json()["format"]
        'spikecam-diagnosis/1'
    """

    verdict: str
    sentence: str
    effects: tuple[NamedEffect, ...]
    unknown: dict[str, Any] | None
    class_: dict[str, Any] | None
    parameters: dict[str, dict[str, float]]
    data: tuple[str, ...]
    gap: Gap | None
    statistics: tuple[Statistic, ...]
    ranking: tuple[Ranked, ...]
    not_testable: tuple[tuple[str, str], ...]
    bounds: tuple[Bound, ...]
    patched: SensorModel
    model_name: str
    campaign: str
    seed: int
    stages: dict[str, float]
    candidates: tuple[str, ...] | None = None
    exclude: tuple[str, ...] = ()
    evidence: Evidence | None = field(default=None, repr=False)
    simulated: int = 0
    effort: float = CAMPAIGNS
    not_bounded: tuple[tuple[str, str], ...] = ()
    effect_files: tuple[str, ...] = ()
    motion: tuple[DetectedMotion, ...] = ()
    static_only: bool = False
    remainder: Remainder | None = None
    settings: dict[str, Any] = field(default_factory=dict)
    with_bounds: bool = False

    @property
    def static_share(self) -> float:
        """Share of pixels of unknown scenes that stand still: 1 where nothing moves."""
        return float(static_pixels(self.motion).mean()) if self.motion else 1.0

    def to_json(self) -> dict[str, Any]:
        """The documented format."""
        found = [s for s in self.statistics if s.p_adjusted < SIGNIFICANT]
        return {
            "format": DIAGNOSIS_FORMAT,
            "verdict": self.verdict,
            "sentence": self.sentence,
            "effects": [e.to_json() for e in self.effects],
            "unknown": self.unknown,
            "class": self.class_,
            "remainder": asdict(self.remainder) if self.remainder else None,
            "parameters": self.parameters,
            "data": list(self.data),
            "gap": asdict(self.gap) if self.gap else None,
            "discrepancies": [
                {
                    "statistic": s.name,
                    "group": s.group,
                    "recordings": list(s.recordings),
                    "z": s.z,
                    "p_adjusted": s.p_adjusted,
                }
                for s in sorted(found, key=lambda s: -abs(s.z))
            ],
            "not_testable": [{"name": n, "needs": w} for n, w in self.not_testable],
            "bounds": [asdict(b) for b in self.bounds],
            "not_bounded": [{"name": n, "needs": w} for n, w in self.not_bounded],
            "motion": [m.to_json() for m in self.motion],
            "static_share": self.static_share,
            "ranking": [asdict(r) for r in self.ranking],
            "model": self.model_name,
            "effect_files": list(self.effect_files),
            "campaign": self.campaign,
            "seed": self.seed,
            "simulated": self.simulated,
            "stages_s": self.stages,
            "elapsed_s": sum(self.stages.values()),
            **({"settings": self.settings} if self.settings else {}),
        }

    def write(self, folder: Path) -> None:
        """Write diagnosis.json and model.toml into a folder, made if needed: both or neither."""
        with whole_folder(folder, replace=True) as beside:
            self.patched.to_toml(beside / "model.toml")
            write_text_whole(beside / "diagnosis.json", json.dumps(self.to_json(), indent=1, default=json_value))


def json_value(value: Any) -> Any:
    if isinstance(value, (np.floating, np.integer)):
        return value.item()
    if isinstance(value, NDArray | np.ndarray):
        return value.tolist()
    raise TypeError(type(value))
