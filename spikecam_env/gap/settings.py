"""The settings of a diagnosis: every tuned number, with its unit and its source, by the stage that uses it.

    DiagnosisSettings().deviance.accept        12, misfit that an effect has to remove

A number of this package is one of five kinds, and only the first is a setting:

setting        a choice that decides something about a campaign: a threshold, a number of twins, a share.
definition     part of what a statistic, an estimator, a template or a format is: lags, quantiles, the trimming of the
               refit, windows, the standard case.  It applies to a measurement and its twins in the same way.
measured table a property of each group of statistics: its floor (`statistics.FLOORS`), the noise of a pair of twins
               (`compare.prediction.PAIR_NOISE`).
numerics       a step of a derivative, a regularisation, a limit against overflow or endless loops.
layout         rows, decimals and sizes of a page.

The others stay where they are used.  `tools/site/settings.py` makes docs/reference/diagnosis_settings.md from the
declarations below.  `tests/gap/test_settings.py` changes each of them by a factor of two.
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

PER_PARAMETER = 2.0
"""Mean reduction of the deviance by a parameter without a meaning (Akaike)."""


def setting(default: Any, unit: str, what: str, source: str, least: float = 0.0, most: float = math.inf) -> Any:
    """A field of settings.

    Args:
        default: its value, whose kind others have: a whole number, or a number.
        unit: of the value.
        what: what it decides, in one sentence.
        source: where the value comes from: a command that measures it, literature, or a choice.
        least: its lowest value; 0 is none.
        most: its highest value.
    """
    about = {"unit": unit, "what": what, "source": source, "range": (least, most)}
    return field(default=default, metadata=about)


def check_setting(name: str, declared: Field[Any], value: object) -> None:
    """Raises InputError unless a value has the kind of its setting's default, and is in its range."""
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
    stop: float = setting(
        1.0,
        "deviance",
        "Least promised reduction for another step of the parameters.  Small, since two parameters that compensate "
        "each other may both be far off while a step gains little.",
        CHOICE,
    )

    @property
    def by_chance(self) -> float:
        """Increase in misfit that the chance of the draws can explain: half a tie."""
        return self.tie / 2

    @property
    def join(self) -> float:
        """Reduction for a later effect to earn a joint refit: two parameters without a meaning.  Less than `accept`,
        since earlier effects may have absorbed part of its signature."""
        return 2 * PER_PARAMETER

    @property
    def compare(self) -> float:
        """As `stop`, while candidates are compared, and for the fit of one to go on after a twin: less would not
        change their order."""
        return 5 * self.stop

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
    """How far off a statistic is, and what is chance."""

    heavy: float = setting(
        8.0,
        "degrees of freedom",
        "Of Student's loss: statistics that are far off count by their logarithm.",
        "a second effect beside the first must not pull its fit",
    )
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
        0.002, "p, adjusted", "Above it, what no candidate explains may be chance.", TUNED, most=1.0
    )
    tolerance: float = setting(
        0.05,
        "of an effect",
        "Error of an effect's simulated change.",
        "laws of first order in sub-frame time, beside a camera's; more twins do not make it smaller",
        most=1.0,
    )
    clear: float = setting(
        5.0,
        "noises",
        "A statistic so far off is not chance: its recording is simulated, it describes a discrepancy; it counts no "
        "further in the score of a bound.",
        "of 600 statistics one is so far off by chance in one campaign of 3000",
    )
    apart: float = setting(
        3.0,
        "noises",
        "Two simulations, or two values of a parameter, that differ by more are not the same.",
        CHOICE,
    )
    as_well: float = setting(
        0.5,
        "of its size on the best",
        "An effect that is clear on no statistic counts on those on which it shows as well as this; one that shows "
        "clearly, on those of the square of this.",
        CHOICE,
        most=1.0,
    )

    @property
    def shows(self) -> float:
        """Noises of a change that is clear of the twins' own noise, twice `apart`: of a pattern or motion that stands
        out by itself, of a step for a derivative, of an effect for its bound, of lost frames."""
        return 2 * self.apart

    @property
    def least_chance(self) -> float:
        """Probability of a lead, which has one side: half of `alarm`, which has two.  Below it, a candidate is no
        rival."""
        return self.alarm / 2


@dataclass(frozen=True)
class Baseline:
    """Before a search: labels, lost frames, orientation and motion, and what a refit shows to be missing."""

    least_error: float = setting(
        1e-3,
        "relative",
        "Error of a label from which it is reported.  An array that fires in all frames but so few fires in every one.",
        CHOICE,
        most=1.0,
    )
    least_gross: float = setting(
        0.02,
        "relative",
        "Error of a dark recording, and curvature by exchanged labels, from which they are reported.",
        "of few spikes a pixel, the rate between first and last is biased by their number squared",
        most=1.0,
    )
    irregular: float = setting(
        0.1,
        "of the error of a label",
        "Share of irregular intervals from which the label is not at fault: light of another level makes none.  In all "
        "frames but so many, frames that are missing are late by little.",
        CHOICE,
        most=1.0,
    )
    least_counts: float = setting(
        20.0,
        "spikes or pixels",
        "Expected in a window that is looked at for motion; timed in a recording that is looked at for lost frames.",
        "fewer are no normal deviates",
    )
    false_alarm: float = setting(
        1e-3,
        "p, of a recording",
        "Below it, a window of a static recording moves (Bonferroni).",
        "0 of 140 static recordings are called moving (docs/gap.md)",
        most=1.0,
    )
    least_contrast: float = setting(
        0.05,
        "relative",
        "Change of a window's rate from which it moves.",
        "local effects of a camera in the blind trial, at forty times their limit, change a corner by 0.01",
    )

    @property
    def least_spread(self) -> float:
        """Standard deviation of pixels' response, or of an interval, from which there is any, relative: its two sides
        are `least_error` apart."""
        return self.least_error / 2


@dataclass(frozen=True)
class UnitSettings:
    """Limits of what a unit may be."""

    usual: float = setting(
        1.8,
        "times nominal",
        "Dark level and spreads of units; beyond it, a parameter is off.  Errors of dark levels that are alike.",
        "units differ by 5-20 %",
        least=1.0,
    )
    usual_noise: float = setting(
        1.5,
        "times nominal",
        "The same of s^2, the relative variance of an interval.",
        "the electrons, or the square of the millivolts, of a unit 20 % off",
        least=1.0,
    )
    identifiable: float = setting(
        0.5,
        "of the refit's s^2",
        "If the unit's own share is smaller, refits of twins do not identify it, and it stays as it was.",
        CHOICE,
        most=1.0,
    )
    own_share: float = setting(
        0.9,
        "of the refit's s^2",
        "If the unit's own share is smaller, it is fitted with the effects.",
        CHOICE,
        most=1.0,
    )

    @property
    def spread_limits(self) -> tuple[float, float]:
        """Spreads of drawn units, times nominal: what is usual.  Beyond, a wider or narrower pattern is a gap."""
        return 1 / self.usual, self.usual


@dataclass(frozen=True)
class Twins:
    """What is simulated, and how often."""

    drawn_units: int = setting(
        24,
        "units",
        "Drawn for the fixed pattern of a model; ten times as many where these do not show the measured value.",
        CHOICE,
        least=2,
    )
    to_confirm: int = setting(
        2, "twins", "Confirm a candidate; show a model whose gap is large beside what two leave open.", CHOICE
    )
    of_events: int = setting(
        3,
        "twins",
        "Of a sparse or mixed effect, which cannot be simulated stronger to exceed one twin's noise.",
        CHOICE,
    )
    target_size: float = setting(
        60.0,
        "noises",
        "A weak linear effect is simulated as strong as this, within `most_extrapolated`, and scaled down.",
        "in proportion so far (benchmarks/in_proportion.py of version 0.1.0)",
    )
    most_extrapolated: float = setting(
        4.0,
        "times",
        "A strength, and the unit under it, are extrapolated at once.",
        "in proportion so far (benchmarks/in_proportion.py of version 0.1.0)",
        least=1.0,
    )
    converged: float = setting(
        3e-4,
        "of the gain",
        "Change of the unit up to which it need not be simulated again.",
        "a thirtieth of what four kicks of 0.0025 add to a rate, the crosstalk of `tests/gap/fit/test_candidate.py`",
    )
    overrun: float = setting(1.3, "budgets", "Limit of steps that an undecided verdict needs.", CHOICE)

    @property
    def in_the_end(self) -> int:
        """Twins that confirm the chosen effects, give the covariance of their parameters, test a bound, and show what a
        model without noise refits to: twice `to_confirm`."""
        return 2 * self.to_confirm

    @property
    def of_random_course(self) -> int:
        """Twins whose scatter counts, twice `of_events`: of an effect of random course, of what is relabelled."""
        return 2 * self.of_events


@dataclass(frozen=True)
class Fitting:
    """The fit of a strength by twins, and of other parameters by Gauss-Newton."""

    visible: float = setting(
        4.0, "noises", "Least size of a simulated effect from which its strength is scaled.", CHOICE
    )
    most_steps: int = setting(4, "steps", "Of a descent, and of effects that start together.", CHOICE)
    small_step: float = setting(
        0.05, "of a logarithm", "A step so small needs no other; two strengths so close show no slope.", CHOICE
    )
    long_step: float = setting(0.5, "of a logarithm", "Beyond it, derivatives are taken anew.", CHOICE)
    longest_step: float = setting(
        0.7, "of a logarithm", "Largest step at once, within what was open of the parameter before.", "a factor of two"
    )

    @property
    def most_tries(self) -> int:
        """Strengths that are tried for one strength, for the score of a bound, and for a bound: one more than the steps
        between them."""
        return self.most_steps + 1

    @property
    def round_off(self) -> tuple[float, float]:
        """Factors within which a strength is scaled without another twin: half of `longest_step`."""
        return math.exp(-self.longest_step / 2), math.exp(self.longest_step / 2)

    @property
    def largest_factor(self) -> float:
        """Factor by which starts are scaled to compare them, or one that mostly scatters without other twins: a
        `longest_step`."""
        return math.exp(self.longest_step)


@dataclass(frozen=True)
class Searching:
    """Which candidates are fitted, which are added, and when a search goes on."""

    most_effects: int = setting(3, "effects", "Named together.", CHOICE)
    campaigns_per_effect: int = setting(
        16,
        "campaigns",
        "Cost of another effect, by which the budget allows it.",
        "measured: 13 to 25 in four diagnoses",
    )
    fewest_fitted: int = setting(3, "candidates", "Fitted in a round at least, the best by their templates.", CHOICE)
    most_fitted: int = setting(5, "candidates", "Fitted in a round at most, the best by their templates.", CHOICE)
    worth: float = setting(
        0.5,
        "of what the best removes",
        "What removes less is not worth another fit: a start, a shape, a runner-up of an earlier effect; nor is a "
        "second bend that removes less of what is beyond chance refined before more is found, nor an effect named that "
        "removes less of what another leaves of a law that differs in details.  Pixels differ by no "
        "more of a label's error; a recording that was turned gains more of what its correlation lacks.",
        CHOICE,
        most=1.0,
    )
    same_share: float = setting(
        0.8,
        "of what the best removes",
        "Nearly all: a runner-up, or another start, that removes more is tried in its place.  A mistake of a campaign, "
        "once undone, removes so much of the disagreement.",
        CHOICE,
        most=1.0,
    )
    least_events: float = setting(
        0.5, "pixels, spikes or frames", "An effect that changes fewer is not there.", "they round to none"
    )
    least_change: float = setting(
        2.0, "noises", "An effect that changes no statistic by more is not added.", "twins of nothing differ by luck"
    )
    line: float = setting(
        30.0, "times the usual power", "A line from whose frequency periodic candidates start.", CHOICE
    )
    least_spikes: int = setting(
        1000, "spikes", "Of a recording whose spectrum, or orientation, says something.", CHOICE
    )
    descents: int = setting(2, "starts", "Of two effects that start jointly, from which both are fitted.", CHOICE)

    @property
    def earlier_tried(self) -> int:
        """Runners-up that are tried in place of an earlier effect: all that are fitted in a round, but the first."""
        return self.most_fitted - 1

    @property
    def least_share(self) -> float:
        """Share that is little: what `same_share` leaves.  A first effect that removes less, and leaves something, is
        not refined before another is found; a mistake that is undone leaves no more of the disagreement."""
        return 1 - self.same_share

    @property
    def largest_sd(self) -> float:
        """Standard deviation of a strength, relative, up to which an effect of maps is there: one by which it is
        `least_change` from 0."""
        return 1 / self.least_change


@dataclass(frozen=True)
class Concluding:
    """From a search to a verdict."""

    most_left: float = setting(
        0.05, "of the deviance beyond chance", "A name may leave so much in all.", TUNED, most=1.0
    )
    most_left_there: float = setting(
        0.25,
        "of the sum of squares",
        "A name may leave so much in a group of statistics of a recording.",
        TUNED,
        most=1.0,
    )
    large_share: float = setting(
        0.3,
        "of all",
        "What many pixels have in common is common to them; irregular intervals that the halves differ by are of one "
        "half; static pixels are enough to be looked at alone; spikes of an expected dark level are there; of a frame, "
        "pixels are late.",
        CHOICE,
        most=1.0,
    )
    local_noises: float = setting(
        8.0,
        "noises",
        "A field, or a half, that stands out so far is where, or when, an effect acts.",
        "comparisons are many; in the clean campaigns of `tests/gap/verdict` none does",
    )
    times_expected: float = setting(
        2.0, "times expected", "Irregular intervals of a field in which an effect acts.", CHOICE, least=1.0
    )
    least_frames: int = setting(
        1000,
        "frames",
        "Shortest recording whose halves are compared, by their lines or for the floor of the gap.",
        "pixels of one rate make a line of their own at first",
    )
    line_ratio: float = setting(6.0, "times", "Power of a line in one half over that in the other.", CHOICE, least=1.0)


@dataclass(frozen=True)
class Bounding:
    """Upper bounds of effects that were not found."""

    most_effect_size: float = setting(
        25.0,
        "noises",
        "Size of an effect at most for its score.",
        "what it changes there is like what it changes at its bound",
    )
    resolution: float = setting(
        0.6,
        "of a bound",
        "The least strength that would be refuted is not below it.",
        "a choice, stated on the page",
        most=1.0,
    )
    overshoot: float = setting(
        1.2, "times", "The first strength that is tested, over what is expected.", CHOICE, least=1.0
    )
    campaigns: int = setting(150, "campaigns", "Cost of all bounds, by which the budget allows them.", "measured")


@dataclass(frozen=True)
class MapSettings:
    """Recordings that are rates only."""

    units: int = setting(8, "units", "Over which a prediction is averaged.", CHOICE, least=2)
    steps: int = setting(6, "steps", "Of a fit.", CHOICE)
    most_effects: int = setting(5, "effects", "Named together.", CHOICE)
    most_left: float = setting(
        0.08,
        "of the mean square beyond chance",
        "A name may leave so much.",
        "of a mean square: statistics of maps are hundreds of noises off",
    )


@dataclass(frozen=True)
class DiagnosisSettings:
    """Every setting of a diagnosis, by stage.

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
    fitting: Fitting = field(default_factory=Fitting)
    searching: Searching = field(default_factory=Searching)
    concluding: Concluding = field(default_factory=Concluding)
    bounding: Bounding = field(default_factory=Bounding)
    maps: MapSettings = field(default_factory=MapSettings)

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

        Raises InputError for an unknown name, and a value of another kind or out of range.

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

        Raises InputError as `of`, and for a file that is no TOML.
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
    """The settings; the defaults for None.  Raises InputError for anything else."""
    if settings is None:
        return DiagnosisSettings()
    if not isinstance(settings, DiagnosisSettings):
        raise InputError(
            f"settings = {shown(settings)}; they must be a DiagnosisSettings: DiagnosisSettings.of({{...}})"
        )
    return settings


def _known(name: str) -> str:
    """A setting's name.  Raises InputError for an unknown one, with those that are like it."""
    known = [f"{stage}.{key}" for stage, key, _ in every_setting()]
    if name in known:
        return name
    stage, _, key = name.partition(".")
    same_name = [n for n in known if n.split(".")[1] in (key, stage)]
    same_stage = [n for n in known if n.split(".")[0] == stage]
    raise unknown_name("setting", name, same_name or same_stage or [f.name for f in fields(DiagnosisSettings)])


def every_setting() -> list[tuple[str, str, Any]]:
    """(stage, name, field) of each setting, in the order of declaration."""
    stages = DiagnosisSettings()
    return [(stage.name, f.name, f) for stage in fields(stages) for f in fields(getattr(stages, stage.name))]
