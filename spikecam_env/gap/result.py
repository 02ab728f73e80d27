"""The result of a diagnosis: format `spikecam-diagnosis/1` (docs/gap.md), and the evidence of its report."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.check.motion import DetectedMotion
from spikecam_env.gap.check.static_part import static_pixels
from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.observe.observation import ObservedRecording
from spikecam_env.gap.search.round import Round
from spikecam_env.gap.twins.budget import CAMPAIGNS
from spikecam_env.gap.unit.refit import BaseFit
from spikecam_env.sensor import SensorModel
from spikecam_env.types import Floats
from spikecam_env.whole import whole_folder, write_text_whole

DIAGNOSIS_FORMAT = "spikecam-diagnosis/1"
VERDICTS = ("none", "named", "class", "unknown", "parameter", "data")

EXPLAINS_ALL, EXPLAINS_NEARLY_ALL, LARGEST = "explains all", "explains nearly all", "largest of several"
UNKNOWN = "unknown"
DEGREES = (EXPLAINS_ALL, EXPLAINS_NEARLY_ALL, LARGEST, UNKNOWN)
"""How much of a difference is explained (`verdict.degree`), from most to least."""


@dataclass(frozen=True)
class Estimate:
    """A parameter's value with its errors, in the parameter's unit."""

    value: float
    sd: float
    """Standard deviation."""
    interval: tuple[float, float] | None = None
    """Low and high end of 90 %, of the coordinate that was fitted (`fit.coordinates`); None where no error is known."""


@dataclass(frozen=True)
class NamedEffect:
    """An effect found."""

    name: str
    family: str
    confidence: float
    """0 to 1."""
    parameters: dict[str, Estimate]
    alternatives: tuple[tuple[str, float], ...] = ()
    """(name, confidence), best first."""
    where: str = ""
    """The part of the array that it acts in; empty for everywhere."""
    when: str = ""
    """The part of the time that it acts in; empty for always."""
    instead: dict[str, float] = field(default_factory=dict)
    """Share of the gap that an alternative would remove in its place, by name."""

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
    """The rest beyond chance beside named effects: a law that differs from the catalogue's, or another effect."""

    noises: float
    """Largest deviate left."""
    share: float
    """Of the sum of squares beyond chance, of all recordings."""
    worst: str
    """The statistic that is left off most."""
    groups: dict[str, float]
    """Share of each group of statistics, largest first."""
    recordings: tuple[str, ...]
    """Those of statistics left off, the worst first."""
    light: tuple[str, ...] = ()
    """Kinds of light of these recordings, in words."""
    looks: tuple[str, ...] = ()
    """Its extent, and marks of a mechanism, in words."""
    where: str = ""
    """As of `NamedEffect`."""
    when: str = ""


@dataclass(frozen=True)
class Statistic:
    """One number of the bank, measured and simulated."""

    name: str
    group: str
    """Rates, noise, spectrum, ..."""
    recordings: tuple[str, ...]
    measured: float
    before: float
    """Mean over twins under the model as given."""
    after: float
    """The same as patched."""
    sd: float
    """Of one campaign, under the model as given."""
    z: float
    """(measured - before) / sd, as a normal deviate."""
    z_after: float
    """The same of (measured - after)."""
    p_adjusted: float
    holdout: bool
    """Whether its recordings were held out."""


@dataclass(frozen=True)
class Ranked:
    """A candidate that was tried."""

    name: str
    family: str
    misfit_before: float
    """Misfit of the model that the candidates of its step were added to."""
    misfit: float
    """Heavy-tailed sum of squares that it leaves."""
    parameters: dict[str, Estimate]
    """At the best."""
    accepted: bool
    reason: str
    """Why it was accepted or rejected."""


@dataclass(frozen=True)
class Bound:
    """Upper bound (95 %, `verdict.bounds`) of an effect not found.

    Example:
        >>> Bound("light_flicker", "modulation", "relative", 0.0012, {"frequency_hz": 2000.0}, kind="linear").below
        0.0012
    """

    name: str
    parameter: str
    unit: str
    below: float
    at: dict[str, float] = field(default_factory=dict)
    """Its other parameters there, by name."""
    kind: str = "simulated"
    """`simulated` on these recordings, or `linear`: by linear response."""


BOUND_KINDS = ("linear", "simulated", "none")
"""Kinds of upper bounds that a diagnosis may state."""

BOUNDED_VERDICTS = ("none", "parameter")
"""Verdicts with upper bounds of the effects that were not found."""

SIGNIFICANT = 0.05
"""Adjusted p-value below which a statistic is listed as one that differs."""

CHANCE = 1.0
"""Gap of statistics that lie off by their own noise alone."""

LEAST_GAP = 1.5
"""Times its floor that a gap is at least, for a removed share to be stated: the mean square of 30 statistics scatters,
by chance, by a quarter of itself, sqrt(2 / 30)."""


@dataclass(frozen=True)
class Gap:
    """Mean square distance of held-out statistics, in noise."""

    before: float
    after: float
    floor: float
    """Of two halves of the measurement; in the pattern, of two units."""
    removed: float
    """Share that is gone after."""
    by_recording: dict[str, dict[str, float]]
    """{recording: {before, after, floor}}."""

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
    """Recordings that the report draws: of the measurement, and of one twin before and after."""

    conditions: tuple[Condition, ...]
    measured: tuple[ObservedRecording, ...]
    before: tuple[ObservedRecording, ...]
    after: tuple[ObservedRecording, ...] | None
    free_refit: BaseFit
    before_base: BaseFit
    after_base: BaseFit | None
    again: tuple[ObservedRecording, ...] | None = None
    """Another twin of the model before, with another seed: the difference that chance alone makes."""
    drawn_before: tuple[Floats, Floats] | None = None
    """Gain and dark (P,) of a fresh unit of the model before (`fresh_units.drawn_response`): the fixed pattern to
    expect, where twins have the measured one."""
    drawn_after: tuple[Floats, Floats] | None = None
    """The same of the model after."""
    light: str = LABELLED_LIGHT
    """Name of the axis of light."""


@dataclass(frozen=True, kw_only=True)
class Conclusion:
    """A verdict and its reasons, before they are put in words."""

    verdict: str
    """One of `VERDICTS`."""
    degree: str | None = None
    """How much the named effects explain, one of `DEGREES`; None where no effect is missing, and for verdict `data`."""
    effects: tuple[NamedEffect, ...] = ()
    """Named effects."""
    stand_ins: tuple[str, ...] = ()
    """Names of effects of `patched` that make the gap smaller and are not shown to be right."""
    unknown: dict[str, Any] | None = None
    """For verdict `unknown`, the structure of the difference."""
    class_: dict[str, Any] | None = None
    """For verdict `class`, {"members": [...], "experiment": "..."}."""
    parameters: dict[str, dict[str, float]] = field(default_factory=dict)
    """Of the model's effects whose strength is off: {effect: {measured, nominal, ratio}}."""
    data: tuple[str, ...] = ()
    """Notes on the recordings: contradictions first (for verdict `data`), then how the gap is to be read
    (`Note`), then labels and pixels that were left out."""
    gap: Gap | None = None
    """On the held-out recordings; None where nothing is held out."""
    statistics: tuple[Statistic, ...] = ()
    """Every statistic, measured and simulated."""
    ranking: tuple[Ranked, ...] = ()
    """Candidates that were tried."""
    not_testable: tuple[tuple[str, str], ...] = ()
    """(name, need) of effects that these recordings cannot show."""
    patched: SensorModel
    """The model with the effects found, or with an empirical patch; loads back as a model."""
    remainder: Remainder | None = None
    """For verdict `named`, the difference beyond chance that remains; None where nothing does."""


@dataclass(frozen=True, kw_only=True)
class Findings(Conclusion):
    """A conclusion with its evidence and bounds."""

    evidence: Evidence | None = field(default=None, repr=False)
    """Recordings and twins that the report draws."""
    bounds: tuple[Bound, ...] = ()
    """Upper bounds of effects that were not found; empty where something was, and with bounds="none"."""
    not_bounded: tuple[tuple[str, str], ...] = ()
    """(name, need) of effects that were not found and have no bound."""
    simulated: int = 0
    """Number of recordings simulated, without those that the report draws."""
    motion: tuple[DetectedMotion, ...] = ()
    """Of recordings that are labelled static."""


@dataclass(frozen=True, kw_only=True)
class Diagnosis(Findings):
    """The answer of a diagnosis.

    Example:
        >>> flats = [Dark(), *(Flat(radiance=level) for level in (0.1, 0.3))]
        >>> campaign = write_campaign("camera", "scsim", shape=(8, 8), frames=400, recordings=flats)
        >>> diagnosis = diagnose(campaign, "scsim", candidates=["dead_time"], twin_count=6, progress=False)
        >>> diagnosis.verdict, diagnosis.effects
        ('none', ())
        >>> diagnosis.to_json()["format"]
        'spikecam-diagnosis/1'
    """

    sentence: str
    """The answer in words."""
    model_name: str
    """Of the model that was tested."""
    campaign: str
    """Its folder."""
    seed: int
    """Of all simulations."""
    stages: dict[str, float]
    """Seconds by stage."""
    candidates: tuple[str, ...] | None = None
    """As given to `diagnose`; None: all of the catalogue."""
    exclude: tuple[str, ...] = ()
    """As given to `diagnose`."""
    effort: float = CAMPAIGNS
    """The budget [campaigns]."""
    effect_files: tuple[str, ...] = ()
    """Of a user's own effects, among the model's and those tried."""
    static_only: bool = False
    """Whether moving pixels were left out."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Those that differ from the defaults, by "stage.name"."""
    bounds_kind: str = "linear"
    """One of `BOUND_KINDS`, as given to `diagnose`."""

    @property
    def static_share(self) -> float:
        """Share of pixels of unknown scenes that stand still: 1 where nothing moves."""
        return float(static_pixels(self.motion).mean()) if self.motion else 1.0

    def to_json(self) -> dict[str, Any]:
        """The documented format."""
        off = sorted((s for s in self.statistics if s.p_adjusted < SIGNIFICANT), key=lambda s: -abs(s.z))
        return {
            "format": DIAGNOSIS_FORMAT,
            "verdict": self.verdict,
            "degree": self.degree,
            "sentence": self.sentence,
            "effects": [e.to_json() for e in self.effects],
            "stand_ins": list(self.stand_ins),
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
                for s in off
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


class Note(str, Enum):
    """Why the gap on recordings held out is no check.  The value is the sentence that page, terminal and JSON state."""

    PARAMETERS_FROM_HELD_OUT = (
        "The held-out recordings were fitted too, within the errors of the first fit: the gap on them is no "
        "independent check."
    )
    """The recordings to fit left parameters open, and those held out were fitted too."""

    ONLY_HELD_OUT_DISAGREE = (
        "The recordings to fit agree with the model, as given or with the effects found first; those held out do not. "
        "Held-out recordings of moving light were therefore fitted: the gap on them is no independent check."
    )
    """Only held-out motion disagrees with the model."""

    __str__ = str.__str__  # the sentence, as StrEnum has it from Python 3.11 on


def notes_of(rounds: Sequence[Round]) -> list[str]:
    """Notes on the rounds of a search whose effects were kept."""
    from_held_out = [Note.PARAMETERS_FROM_HELD_OUT] if any(r.used_held_out for r in rounds) else []
    return [*from_held_out, *([Note.ONLY_HELD_OUT_DISAGREE] if any(r.motion_alone for r in rounds) else [])]


def gap_is_fitted(notes: Sequence[str]) -> bool:
    """Whether recordings held out were fitted, by the kinds of notes and not by their words."""
    return any(isinstance(note, Note) for note in notes)
