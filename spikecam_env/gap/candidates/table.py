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


@dataclass(frozen=True)
class Candidate:
    """What a diagnosis knows of an effect besides its law.

    family: effects of one family act on the same thing.  fitted: parameters, the strength first.
    shapes: values of other parameters to start from.  square: statistics go with the square of the strength.
    mixed: some statistics go with the strength, others with its square.
    only_contrast: it changes nothing in light that is steady and uniform.
    wanders: its course in time is drawn anew every time, so that statistics scatter, each way alike.
    events: it is single events, few enough for one twin to have many more or less of them than another.
    strikes: it is in a few pixels, others in every twin: one takes where they lie for a sign of it.
    share: the parameter that is a share of what can be counted, and of what: pixels, spikes, or frames of pixels.
    nudge: step of a shape's logarithm to take a derivative by: a time constant needs a long one, to show above what
    twins scatter; a level of light from which something begins leads elsewhere by it.
    needs: says what recordings are lacking to see it, or None.  experiment: what would tell it from its twins.
    """

    family: str
    fitted: tuple[str, ...]
    shapes: dict[str, tuple[float, ...]] = field(default_factory=dict)
    square: bool = False
    mixed: bool = False
    needs: Needs = lambda shown: None
    only_contrast: bool = False
    wanders: bool = False
    events: bool = False
    strikes: bool = False
    share: tuple[str, str] | None = None
    nudge: float = -0.5
    experiment: str = "flats at more levels, up to 0.9 spikes a frame, and bars of several brightnesses"

    @property
    def power(self) -> float:
        """Of the strength, that statistics are in proportion to: events are counted, on a scale of roots."""
        return 2.0 if self.square else 0.5 if self.events else 1.0


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
_SECOND = "flats at a second V_d"

CANDIDATES: dict[str, Candidate] = {
    "dead_time": Candidate("saturation", ("tau_us",), needs=_levels),
    "comparator_delay": Candidate("saturation", ("delay_us",), needs=_levels),
    "photo_response_nonlinearity": Candidate("saturation", ("beta",), needs=_levels),
    "ir_drop": Candidate("saturation", ("droop",), needs=_levels, experiment=_FIELD),
    "synchronous_reset": Candidate("reset", ("fraction",), needs=_steady),
    "incomplete_reset": Candidate("reset", ("fraction", "tau_us"), {"tau_us": (50.0, 250.0, 1250.0)}, needs=_levels),
    "photodiode_lag": Candidate(
        "lag", ("fraction", "tau_us"), {"tau_us": (150.0, 600.0, 2500.0, 10000.0)}, needs=_moving, only_contrast=True
    ),
    "light_flicker": Candidate(
        "light", ("modulation",), {"frequency_hz": (100.0, 400.0, 2000.0)}, square=True, needs=_steady
    ),
    "lamp_drift": Candidate("light", ("sigma_per_root_s",), square=True, needs=_steady, wanders=True),
    "supply_ripple": Candidate(
        "common", ("ripple",), {"frequency_hz": (100.0, 400.0, 2000.0)}, square=True, needs=_steady
    ),
    "common_threshold_noise": Candidate("common", ("sigma_mV",), square=True, needs=_steady),
    "clock_jitter": Candidate("common", ("sigma_ns",), square=True, needs=_steady),
    "row_temporal_noise": Candidate("common", ("sigma_mV",), square=True, needs=_steady),
    "threshold_flicker_noise": Candidate("noise", ("sigma_mV",), square=True, needs=_steady),
    "frame_threshold_noise": Candidate("noise", ("sigma_mV",), square=True, needs=_steady),
    "excess_threshold_noise": Candidate("noise", ("sigma_mV",), square=True, needs=_steady),
    "reset_noise": Candidate("noise", ("sigma_mV",), square=True, needs=_steady, experiment=_SECOND),
    "shot_noise": Candidate("noise", ("quanta",), needs=_steady, experiment=_SECOND),
    "random_telegraph_noise": Candidate(
        "dark",
        ("amplitude_pA", "fraction", "dwell_ms"),
        {"dwell_ms": (0.5, 3.0, 20.0)},
        square=True,
        strikes=True,
        share=("fraction", "pixels"),
        needs=_steady,
    ),
    "dark_current_drift": Candidate(
        "dark", ("rise", "tau_ms"), {"tau_ms": (10.0, 50.0, 200.0)}, mixed=True, needs=_dark
    ),
    "dark_current": Candidate("dark", ("mean_pA",), needs=_dark),
    "dark_current_spread": Candidate("dark", ("sigma_pA",), needs=_dark),
    "dark_current_tail": Candidate("dark", ("sigma",), needs=_dark),
    "hot_pixels": Candidate(
        "dark", ("fraction", "mean_pA"), {"mean_pA": (3.0,)}, share=("fraction", "pixels"), needs=_dark
    ),
    "dead_pixels": Candidate("defects", ("fraction",), share=("fraction", "pixels"), needs=_even),
    "conversion_gain_spread": Candidate("pattern", ("sigma",), needs=_even),
    "capacitor_spread": Candidate("pattern", ("sigma_fF",), needs=_even, experiment=_SECOND),
    "bias_voltage_spread": Candidate("pattern", ("sigma_V",), needs=_even, experiment=_SECOND),
    "row_fixed_pattern": Candidate("pattern", ("sigma_mV",), needs=_even),
    "column_fixed_pattern": Candidate("pattern", ("sigma_mV",), needs=_even),
    "vignetting": Candidate("optics", ("falloff",), needs=_even),
    "optical_blur": Candidate("optics", ("sigma_pixels",), square=True, needs=_edges, only_contrast=True),
    "crosstalk": Candidate("coupling", ("kick",), mixed=True, needs=_steady),
    "blooming": Candidate("coupling", ("share", "full"), {"full": (0.75, 0.85, 1.0)}, needs=_bright, nudge=-0.1),
    "readout_skew": Candidate("readout", ("span",), needs=_moving, only_contrast=True),
    "missed_spikes": Candidate(
        "readout", ("probability",), share=("probability", "spikes"), needs=_steady, events=True
    ),
    "spurious_spikes": Candidate(
        "readout", ("probability",), share=("probability", "frames"), needs=_steady, events=True
    ),
    "afterpulsing": Candidate(
        "readout",
        ("probability",),
        {"delay_frames": (1, 2, 3, 4, 6)},
        share=("probability", "spikes"),
        needs=_steady,
        events=True,
    ),
}

NOISE_OF_A_RESET = ("reset_noise", "excess_threshold_noise", "shot_noise")
"""White noise of a spike: one number, s^2, whatever it is called; a second V_d splits it."""


def candidate(name: str) -> Candidate:
    """What is known of an effect; one of a user's own is fitted by its strength alone."""
    return CANDIDATES.get(name) or Candidate("other", (CATALOGUE[name].strength,))


def expected_events(
    name: str, parameters: Mapping[str, float], shown: Sequence[Condition], seen: Sequence[Observation]
) -> float:
    """Pixels, spikes or frames of pixels that an effect is expected to change in the steady recordings to fit of a
    campaign; infinite where it is no share of such."""
    share = candidate(name).share
    if share is None:
        return math.inf
    told = [o for c, o in zip(shown, seen, strict=True) if c.use == "fit" and not c.moves]
    pixels = max((o.times.count.size for o in told), default=0)
    spikes = float(sum(o.times.count.sum() for o in told))
    of = {"pixels": pixels, "spikes": spikes, "frames": sum(pixels * o.frames for o in told) - spikes}
    return parameters[share[0]] * of[share[1]]


def is_pattern(name: str) -> bool:
    """Whether an effect changes nothing but the fixed pattern, so that drawing units is simulating it."""
    effect: type[Effect] = CATALOGUE[name]
    return effect.is_fixed() and not effect.overrides("image") and name not in NOISE_OF_A_RESET


def of_motion(name: str) -> bool:
    """Whether an effect shows by contrast or change alone, so that how depends on the very picture."""
    return candidate(name).needs in (_moving, _edges, _bright)


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
