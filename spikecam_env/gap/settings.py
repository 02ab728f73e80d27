"""The settings of a diagnosis: numbers that a user may turn, with unit and source, by the stage that uses them.

    DiagnosisSettings().deviance.accept        12, misfit that an effect has to remove

A setting decides something about a campaign that users may decide otherwise: an effort, a threshold of the alarm or of
a name, a limit.  All other numbers are constants, with their unit and source, of the modules that use them.
`tools/site/settings.py` makes docs/reference/diagnosis_settings.md from the declarations below.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import Field, asdict, dataclass, field, fields, replace
from typing import Any

from spikecam_env.checked import checked_number, checked_whole
from spikecam_env.errors import InputError, shown, unknown_name
from spikecam_env.untrusted import read_toml

CHOICE = "a choice; the blind trial measures it with the others"
TUNED = "set on the blind trial's part `tune`"

CONSTANTS = {
    "deviance": ("stop",),
    "judging": ("heavy", "tolerance", "clear", "apart", "as_well"),
    "baseline": ("least_gross", "irregular", "least_counts", "least_error", "least_contrast"),
    "unit": ("usual_noise", "identifiable", "own_share"),
    "twins": ("of_events", "target_size", "most_extrapolated", "converged", "overrun"),
    "fitting": ("visible", "most_steps", "small_step", "long_step", "longest_step"),
    "searching": (
        "fewest_fitted",
        "worth",
        "same_share",
        "least_events",
        "least_change",
        "line",
        "least_spikes",
        "descents",
        "campaigns_per_effect",
    ),
    "concluding": ("large_share", "local_noises", "times_expected", "least_frames", "line_ratio"),
    "bounding": ("most_effect_size", "overshoot", "resolution", "campaigns"),
    "maps": ("steps", "most_left", "units", "most_effects"),
}
"""Numbers that were settings once, by stage."""


UNITS_OF_MAPS = 8
"""Fresh units over which a prediction of maps of rates is averaged; a choice."""

EFFECTS_OF_MAPS = 5
"""Effects that are named together in maps of rates; a choice."""


def setting(default: Any, unit: str, meaning: str, source: str, least: float = 0.0, most: float = math.inf) -> Any:
    """A field of settings.

    Args:
        default: its value, of the kind that others must have: a whole number, or a number.
        unit: of the value.
        meaning: the decision that it takes, in one sentence.
        source: a command that measures it, literature, or a choice.
        least: its lowest value; 0 is none.
        most: its highest value.
    """
    about = {"unit": unit, "meaning": meaning, "source": source, "range": (least, most)}
    return field(default=default, metadata=about)


def check_setting(name: str, declared: Field[Any], value: object) -> None:
    """Check a value against its setting.

    Raises:
        InputError: for a value of another kind than the default, or out of range.
    """
    least, most = declared.metadata["range"]
    if isinstance(declared.default, int):
        checked_whole(value, name, max(int(least), 1))
    else:
        checked_number(value, name, least, most, above=least == 0)


@dataclass(frozen=True)
class Deviance:
    """Thresholds on the difference in misfit between two hypotheses, twice the logarithm of a likelihood ratio."""

    accept: float = setting(12.0, "deviance", "Reduction in misfit to accept an effect.", "two ties")
    tie: float = setting(
        6.0, "deviance", "Two hypotheses nearer to each other than this are tied.", "2 log 20, a likelihood ratio of 20"
    )

    @property
    def by_chance(self) -> float:
        """Increase in misfit that the chance of the draws can explain: half a tie."""
        return self.tie / 2

    @property
    def dismiss(self) -> float:
        """Lead on the recordings to fit up to which all recordings decide: two ties, as the noise beside another
        effect is known from few twins."""
        return 2 * self.tie

    @property
    def keep(self) -> float:
        """Distance between two fits by few twins each that chance cannot explain: `accept`, and chance.  An earlier
        effect stays if the misfit without it is larger by this; an unconfirmed fit this far from the best confirmed
        one is not confirmed."""
        return self.accept + self.by_chance

    @property
    def keep_untried(self) -> float:
        """As `keep` of an earlier effect, where the model without it is not simulated: no refit could make up so
        much."""
        return 10 * self.keep

    @property
    def accept_map(self) -> float:
        """Reduction to accept an effect of maps of rates: twice `accept`, as statistics of one map depend on each
        other."""
        return 2 * self.accept


@dataclass(frozen=True)
class Judging:
    """The limits of chance."""

    alarm: float = setting(
        0.02,
        "p, adjusted",
        "Below it, recordings and model disagree.",
        "one false alarm in fifty campaigns; 2.0 % of 200 were measured (benchmarks/moderated_variances.py, 0.1.0)",
        most=1.0,
    )
    gate: float = setting(
        0.005,
        "p, adjusted",
        "Below it, a named effect leaves something.",
        "stricter than the alarm, as a named effect is itself only good to its tolerance",
        most=1.0,
    )
    chance_p: float = setting(
        0.002, "p, adjusted", "Above it, a difference that no candidate explains may be chance.", TUNED, most=1.0
    )

    @property
    def least_chance(self) -> float:
        """Probability of a lead, which has one side: half of `alarm`, which has two.  Below it, a candidate is no
        rival."""
        return self.alarm / 2


@dataclass(frozen=True)
class Baseline:
    """Before a search: motion."""

    false_alarm: float = setting(
        1e-3,
        "p, of a recording",
        "Below it, a window of a static recording moves (Bonferroni).",
        "0 of 140 static recordings are called moving (docs/gap.md)",
        most=1.0,
    )


@dataclass(frozen=True)
class UnitSettings:
    """The spread of units."""

    usual: float = setting(
        1.8,
        "times nominal",
        "Dark level and spreads of units; beyond it, a parameter is off.  Errors of dark levels that are alike.",
        "units differ by 5-20 %",
        least=1.0,
    )

    @property
    def spread_limits(self) -> tuple[float, float]:
        """Usual spreads of drawn units, times nominal.  Beyond, a wider or narrower pattern is a gap."""
        return 1 / self.usual, self.usual


@dataclass(frozen=True)
class Twins:
    """Numbers of simulations."""

    drawn_units: int = setting(
        24,
        "units",
        "Drawn for the fixed pattern of a model; ten times as many where these do not show the measured value.",
        CHOICE,
        least=2,
    )
    to_confirm: int = setting(
        2, "twins", "Confirm a candidate; show a model whose gap is large beside the error of two twins.", CHOICE
    )

    @property
    def in_the_end(self) -> int:
        """Twins that confirm the chosen effects, give the covariance of their parameters, test a bound, and show the
        refit of a model without noise: twice `to_confirm`."""
        return 2 * self.to_confirm


@dataclass(frozen=True)
class Searching:
    """Limits of a search."""

    most_effects: int = setting(3, "effects", "Named together.", CHOICE)
    most_fitted: int = setting(5, "candidates", "Fitted in a round at most, the best by their templates.", CHOICE)

    @property
    def earlier_tried(self) -> int:
        """Runners-up that are tried in place of an earlier effect: all that are fitted in a round, but the first."""
        return self.most_fitted - 1


@dataclass(frozen=True)
class Concluding:
    """The remainder that a name may leave."""

    most_left: float = setting(
        0.05, "of the squares beyond chance", "Effects that explain nearly all leave so much at most.", TUNED, most=1.0
    )
    least_margin: float = setting(
        0.5,
        "of the misfit removed",
        "Least share of what a right name removes that no other candidate removes.",
        TUNED,
        most=1.0,
    )
    most_missed: float = setting(
        0.75,
        "of the squares of the change",
        "Right names leave so much at most in a group of statistics of a recording that they change.",
        TUNED,
    )

    @property
    def least_margin_map(self) -> float:
        """As `least_margin`, of maps of rates: half of it, since all candidates change the same few statistics."""
        return self.least_margin / 2


@dataclass(frozen=True)
class DiagnosisSettings:
    """Every setting of a diagnosis, by stage.

    Example:
        >>> DiagnosisSettings().deviance.keep
        15.0
        >>> DiagnosisSettings.of({"deviance.tie": 8.0}).changed()
        {'deviance.tie': 8.0}
    """

    deviance: Deviance = field(default_factory=Deviance)
    judging: Judging = field(default_factory=Judging)
    baseline: Baseline = field(default_factory=Baseline)
    unit: UnitSettings = field(default_factory=UnitSettings)
    twins: Twins = field(default_factory=Twins)
    searching: Searching = field(default_factory=Searching)
    concluding: Concluding = field(default_factory=Concluding)

    def __post_init__(self) -> None:
        for stage in fields(self):
            own: Any = getattr(self, stage.name)
            kind: Any = stage.default_factory
            if type(own) is not kind:
                raise InputError(f"{stage.name} = {shown(own)}; it must be a {kind.__name__}")
            for declared in fields(own):
                check_setting(f"{stage.name}.{declared.name}", declared, getattr(own, declared.name))

    @classmethod
    def of(cls, changes: Mapping[str, Any]) -> DiagnosisSettings:
        """The defaults with some settings changed, as `changed` lists them.

        Args:
            changes: {"stage.name": value}.

        Raises:
            InputError: for an unknown name, and a value of another kind or out of range.

        Example:
            >>> DiagnosisSettings.of({"deviance.tie": 8.0}).deviance.dismiss
            16.0
        """
        stages: dict[str, dict[str, Any]] = {}
        for name, value in changes.items():
            stage, key = _known(name).split(".")
            stages.setdefault(stage, {})[key] = value
        default = cls()
        return replace(default, **{stage: replace(getattr(default, stage), **own) for stage, own in stages.items()})

    @classmethod
    def from_toml(cls, path: str | os.PathLike[str]) -> DiagnosisSettings:
        """The defaults with some settings changed, as a TOML file lists them: `deviance.tie = 8.0`, or a table a stage.

        Raises:
            InputError: as `of`, and for a file that is no TOML.
        """
        changes: dict[str, Any] = {}
        for stage, own in read_toml(os.fspath(path)).items():
            changes |= (
                {f"{stage}.{name}": value for name, value in own.items()} if isinstance(own, dict) else {stage: own}
            )
        try:
            return cls.of(changes)
        except InputError as error:
            raise InputError(f"{os.fspath(path)}: {error}") from error

    @property
    def of_maps(self) -> DiagnosisSettings:
        """The settings of a search in maps of rates."""
        return replace(
            self,
            deviance=replace(self.deviance, accept=self.deviance.accept_map),
            twins=replace(self.twins, drawn_units=UNITS_OF_MAPS),
            searching=replace(self.searching, most_effects=EFFECTS_OF_MAPS),
            concluding=replace(self.concluding, least_margin=self.concluding.least_margin_map),
        )

    def changed(self) -> dict[str, Any]:
        """Settings that differ from their defaults: {"stage.name": value}."""
        default, own = asdict(DiagnosisSettings()), asdict(self)
        return {
            f"{stage}.{name}": value
            for stage, values in own.items()
            for name, value in values.items()
            if value != default[stage][name]
        }


def checked_settings(settings: DiagnosisSettings | None) -> DiagnosisSettings:
    """The settings; the defaults for None.

    Raises:
        InputError: for anything else.
    """
    if settings is None:
        return DiagnosisSettings()
    if not isinstance(settings, DiagnosisSettings):
        raise InputError(
            f"settings = {shown(settings)}; they must be a DiagnosisSettings: DiagnosisSettings.of({{...}})"
        )
    return settings


def _known(name: str) -> str:
    """A setting's name.

    Raises:
        InputError: for a constant, and for an unknown name, with the settings that are like it.
    """
    known = [f"{stage}.{key}" for stage, key, _ in every_setting()]
    if name in known:
        return name
    stage, _, key = name.partition(".")
    if key in CONSTANTS.get(stage, ()):
        raise InputError(f"{name} is a constant of the diagnosis now, not a setting; leave it out")
    same_name = [n for n in known if n.split(".")[1] in (key, stage)]
    same_stage = [n for n in known if n.split(".")[0] == stage]
    raise unknown_name("setting", name, same_name or same_stage or [f.name for f in fields(DiagnosisSettings)])


def every_setting() -> list[tuple[str, str, Any]]:
    """(stage, name, field) of each setting, in the order of declaration."""
    stages = DiagnosisSettings()
    return [(stage.name, f.name, f) for stage in fields(stages) for f in fields(getattr(stages, stage.name))]
