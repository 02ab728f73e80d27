"""The candidates: every effect of the catalogue, with what is fitted of it and which recordings can show it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from spikecam_env.errors import unknown_name
from spikecam_env.gap.observe.conditions import STEADY_KNOWN, Condition
from spikecam_env.gap.observe.observation import Observation
from spikecam_env.sensor import CATALOGUE, Effect, SensorModel

Needs = Callable[[Sequence[Condition]], "str | None"]

BENDING = ("saturation", "reset")
"""Families of what bends the rate curve."""


@dataclass(frozen=True)
class Candidate:
    """What a diagnosis knows of an effect besides its law.

    family: effects of one family act on the same thing.  fitted: parameters, the strength first.
    shapes: values of other parameters to start from.  square: statistics go with the square of the strength.
    mixed: some statistics go with the strength, others with its square.
    only_contrast: it changes nothing in light that is steady and uniform.
    random_course: its course in time is drawn anew every time, so that it changes no mean, but how statistics scatter.
    events: it is single events, few enough for one twin to have many more or less of them than another.
    few_pixels: it is in a few pixels, others in every twin: one takes where they lie for a sign of it.
    share: the parameter that is a share of what can be counted, and of what: pixels, spikes, or frames of pixels.
    shape_step: step of a shape's logarithm to take a derivative by: a time constant needs a long one, to show above
    what twins scatter; a level of light from which something begins leads elsewhere by it.
    needs: says what recordings are lacking to see it, or None.
    experiment: what would distinguish it from others that do the same.
    """

    name: str
    family: str
    fitted: tuple[str, ...]
    shapes: dict[str, tuple[float, ...]] = field(default_factory=dict)
    square: bool = False
    mixed: bool = False
    needs: Needs = lambda shown: None
    only_contrast: bool = False
    random_course: bool = False
    events: bool = False
    few_pixels: bool = False
    share: tuple[str, str] | None = None
    shape_step: float = -0.5
    experiment: str = "flats at more levels, up to 0.9 spikes a frame, and bars of several brightnesses"

    @property
    def strength(self) -> str:
        """The parameter that is its strength."""
        return self.fitted[0]

    @property
    def power(self) -> float:
        """Of the strength, that statistics are in proportion to: events are counted, on a scale of roots."""
        return 2.0 if self.square else 0.5 if self.events else 1.0

    @property
    def is_pattern(self) -> bool:
        """Whether it changes nothing but the fixed pattern, so that drawing units is simulating it."""
        effect: type[Effect] = CATALOGUE[self.name]
        return effect.is_fixed() and not effect.overrides("image") and self.name not in NOISE_OF_A_RESET

    @property
    def is_linear(self) -> bool:
        """Whether statistics go in proportion to its strength for long: noise goes by its square, and its bands and
        lateness are logarithms, which are not."""
        return self.power == 1.0 and not (self.mixed or self.random_course or self.is_pattern)

    @property
    def of_motion(self) -> bool:
        """Whether it shows by contrast or change alone, so that how depends on the very picture."""
        return self.needs in (_moving, _edges, _bright)

    @property
    def may_be_negative(self) -> bool:
        """Whether its strength may be."""
        bounds = CATALOGUE[self.name].__dataclass_fields__[CATALOGUE[self.name].strength].metadata["bounds"]
        return bool(bounds and bounds[0] < 0)

    @property
    def has_shapes(self) -> bool:
        """Whether more is fitted of it, by simulation, than its strength."""
        return len(self.fitted) > 1 and not self.is_pattern and not self.random_course

    @property
    def bends_response(self) -> bool:
        """Whether it bends the rate curve: beside one that does, others that do fit in its error."""
        return self.family in BENDING


def _moving(shown: Sequence[Condition]) -> str | None:
    return None if any(s.moves for s in shown) else "a recording with moving or flickering light"


def _edges(shown: Sequence[Condition]) -> str | None:
    pictures = any(s.kind in ("moving", "picture") for s in shown)
    return None if pictures else "a recording with contrast in it: bars, a disk, a chart"


def _bright(shown: Sequence[Condition]) -> str | None:
    lit = [s for s in shown if s.light is not None and s.kind in ("moving", "picture")]
    above = any(float(s.light.radiance.max()) > 1.0 for s in lit if s.light is not None)
    return None if above else "a recording with lights brighter than one spike a frame (radiance above 1) beside dark"


def _levels(shown: Sequence[Condition]) -> str | None:
    levels = {round(s.level, 6) for s in shown if s.kind == "flat" and s.use == "fit"}
    return None if len(levels) >= 3 else "flats at three levels or more, up to 0.6 spikes a frame"


def _dark(shown: Sequence[Condition]) -> str | None:
    return None if any(s.kind == "dark" for s in shown) else "a dark recording"


def _steady(shown: Sequence[Condition]) -> str | None:
    return (
        None if any(s.kind in ("dark", "flat", "picture", "unknown") for s in shown) else "a recording in steady light"
    )


def _even(shown: Sequence[Condition]) -> str | None:
    return (
        None if any(s.kind in STEADY_KNOWN for s in shown) else "flats: a pattern cannot be told from an unknown scene"
    )


_FIELD = "flats at several levels beside a picture with bright and dark rows"
_SECOND_V_D = "flats at a second V_d"

_ALL = (
    Candidate("dead_time", "saturation", ("tau_us",), needs=_levels),
    Candidate("comparator_delay", "saturation", ("delay_us",), needs=_levels),
    Candidate("photo_response_nonlinearity", "saturation", ("beta",), needs=_levels),
    Candidate("ir_drop", "saturation", ("droop",), needs=_levels, experiment=_FIELD),
    Candidate("synchronous_reset", "reset", ("fraction",), needs=_steady),
    Candidate("incomplete_reset", "reset", ("fraction", "tau_us"), {"tau_us": (50.0, 250.0, 1250.0)}, needs=_levels),
    Candidate(
        "photodiode_lag",
        "lag",
        ("fraction", "tau_us"),
        {"tau_us": (150.0, 600.0, 2500.0, 10000.0)},
        needs=_moving,
        only_contrast=True,
    ),
    Candidate(
        "light_flicker", "light", ("modulation",), {"frequency_hz": (100.0, 400.0, 2000.0)}, square=True, needs=_steady
    ),
    Candidate("lamp_drift", "light", ("sigma_per_root_s",), square=True, needs=_steady, random_course=True),
    Candidate(
        "supply_ripple", "common", ("ripple",), {"frequency_hz": (100.0, 400.0, 2000.0)}, square=True, needs=_steady
    ),
    Candidate("common_threshold_noise", "common", ("sigma_mV",), square=True, needs=_steady),
    Candidate("clock_jitter", "common", ("sigma_ns",), square=True, needs=_steady),
    Candidate("row_temporal_noise", "common", ("sigma_mV",), square=True, needs=_steady),
    Candidate(
        "clock_feedthrough",
        "clock",
        ("amplitude_mV", "phase_frames", "tau_us"),
        {"phase_frames": (0.1, 0.35, 0.6, 0.85), "tau_us": (2.0, 6.0, 18.0)},
        needs=_steady,
        experiment="flats whose intervals are whole numbers of frames, and a hundredth more and less",
    ),
    Candidate("threshold_flicker_noise", "noise", ("sigma_mV",), square=True, needs=_steady),
    Candidate("frame_threshold_noise", "noise", ("sigma_mV",), square=True, needs=_steady),
    Candidate("excess_threshold_noise", "noise", ("sigma_mV",), square=True, needs=_steady),
    Candidate("reset_noise", "noise", ("sigma_mV",), square=True, needs=_steady, experiment=_SECOND_V_D),
    Candidate("shot_noise", "noise", ("quanta",), needs=_steady, experiment=_SECOND_V_D),
    Candidate(
        "random_telegraph_noise",
        "dark",
        ("amplitude_pA", "fraction", "dwell_ms"),
        {"dwell_ms": (0.5, 3.0, 20.0)},
        square=True,
        few_pixels=True,
        share=("fraction", "pixels"),
        needs=_steady,
    ),
    Candidate(
        "dark_current_drift", "dark", ("rise", "tau_ms"), {"tau_ms": (10.0, 50.0, 200.0)}, mixed=True, needs=_dark
    ),
    Candidate("dark_current", "dark", ("mean_pA",), needs=_dark),
    Candidate("dark_current_spread", "dark", ("sigma_pA",), needs=_dark),
    Candidate("dark_current_tail", "dark", ("sigma",), needs=_dark),
    Candidate(
        "hot_pixels", "dark", ("fraction", "mean_pA"), {"mean_pA": (3.0,)}, share=("fraction", "pixels"), needs=_dark
    ),
    Candidate("dead_pixels", "defects", ("fraction",), share=("fraction", "pixels"), needs=_even),
    Candidate("conversion_gain_spread", "pattern", ("sigma",), needs=_even),
    Candidate("capacitor_spread", "pattern", ("sigma_fF",), needs=_even, experiment=_SECOND_V_D),
    Candidate("bias_voltage_spread", "pattern", ("sigma_V",), needs=_even, experiment=_SECOND_V_D),
    Candidate("row_fixed_pattern", "pattern", ("sigma_mV",), needs=_even),
    Candidate("column_fixed_pattern", "pattern", ("sigma_mV",), needs=_even),
    Candidate("vignetting", "optics", ("falloff",), needs=_even),
    Candidate("optical_blur", "optics", ("sigma_pixels",), square=True, needs=_edges, only_contrast=True),
    Candidate("crosstalk", "coupling", ("kick",), mixed=True, needs=_steady),
    Candidate("blooming", "coupling", ("share", "full"), {"full": (0.75, 0.85, 1.0)}, needs=_bright, shape_step=-0.1),
    Candidate("readout_skew", "readout", ("span",), needs=_moving, only_contrast=True),
    Candidate(
        "missed_spikes", "readout", ("probability",), share=("probability", "spikes"), needs=_steady, events=True
    ),
    Candidate(
        "spurious_spikes", "readout", ("probability",), share=("probability", "frames"), needs=_steady, events=True
    ),
    Candidate(
        "afterpulsing",
        "readout",
        ("probability",),
        {"delay_frames": (1, 2, 3, 4, 6)},
        share=("probability", "spikes"),
        needs=_steady,
        events=True,
    ),
)

CANDIDATES: dict[str, Candidate] = {c.name: c for c in _ALL}

NOISE_OF_A_RESET = ("reset_noise", "excess_threshold_noise", "shot_noise")
"""White noise of a spike: one number, s^2, whatever it is called; a second V_d splits it."""


def candidate(name: str) -> Candidate:
    """What is known of an effect; one of a user's own is fitted by its strength alone."""
    return CANDIDATES.get(name) or Candidate(name, "other", (CATALOGUE[name].strength,))


@dataclass(frozen=True)
class Candidates:
    """Several effects at once, asked for what all or any of them are."""

    names: tuple[str, ...]

    @property
    def each(self) -> tuple[Candidate, ...]:
        """What is known of each."""
        return tuple(candidate(name) for name in self.names)

    @property
    def any_pattern(self) -> bool:
        """Whether drawn units are to say what one of them does."""
        return any(c.is_pattern for c in self.each)

    @property
    def all_pattern(self) -> bool:
        """Whether none of them changes anything but the fixed pattern."""
        return all(c.is_pattern for c in self.each)

    @property
    def only_contrast(self) -> bool:
        """Whether none of them changes anything in light that is steady and uniform."""
        return all(c.only_contrast for c in self.each)


def expected_events(
    name: str, parameters: Mapping[str, float], shown: Sequence[Condition], seen: Sequence[Observation]
) -> float:
    """Pixels, spikes or frames of pixels that an effect is expected to change in the steady recordings to fit of a
    campaign; infinite where it is no share of such."""
    share = candidate(name).share
    if share is None:
        return math.inf
    steady = [o for c, o in zip(shown, seen, strict=True) if c.use == "fit" and not c.moves]
    pixels = max((o.times.count.size for o in steady), default=0)
    spikes = float(sum(o.times.count.sum() for o in steady))
    of = {"pixels": pixels, "spikes": spikes, "frames": sum(pixels * o.frames for o in steady) - spikes}
    return parameters[share[0]] * of[share[1]]


def chosen(model: SensorModel, only: Sequence[str] | None, exclude: Sequence[str]) -> list[str]:
    """Names to try: the catalogue less what the model has, less `exclude`; raises InputError for unknown names."""
    for name in (*(only or ()), *exclude):
        if name not in CATALOGUE:
            raise unknown_name("candidate", name, CATALOGUE)
    has = {e.name for e in model.effects}
    return [n for n in CATALOGUE if n not in has and n not in exclude and (only is None or n in only)]


def testable(names: Sequence[str], shown: Sequence[Condition]) -> tuple[list[str], list[tuple[str, str]]]:
    """Candidates that these recordings can reveal, and the others with what each would need."""
    lacks = [(n, candidate(n).needs(shown)) for n in names]
    return [n for n, why in lacks if why is None], [(n, why) for n, why in lacks if why is not None]
