"""The base refit: this unit's own response, dark level and jitter.

A unit's parameters differ from nominal and its fixed pattern is a new draw; neither is a gap.  The free refit gives
every pixel its own; the constrained one keeps a parameter nominal where the model has no effect for it, so
that its difference shows.  The same refit is made of measured and of simulated recordings.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from spikecam_env.calibration.jitter import fit_jitter
from spikecam_env.calibration.response import fit_lines, rates_from_times, together
from spikecam_env.gap.observe.conditions import STEADY_KNOWN, Condition
from spikecam_env.gap.observe.observation import DIFFERENCES, ObservedRecording
from spikecam_env.sensor import SensorModel
from spikecam_env.types import Floats, Masks

RESPONSE = ("conversion_gain_spread", "bias_voltage_spread", "capacitor_spread", "vignetting", "row_fixed_pattern",
            "column_fixed_pattern", "dead_pixels")  # fmt: skip
"""Effects that make pixels' gain differ."""

DARK = ("dark_current", "dark_current_spread", "dark_current_tail", "hot_pixels")
"""Effects that have a dark level."""

DARK_PATTERN = (*DARK[1:], *RESPONSE)
"""Effects that make pixels' dark level differ."""

NOISE = ("shot_noise", "reset_noise", "excess_threshold_noise")
"""Effects of white noise, s^2 a spike."""

UNSEEN_JITTER = 3e-5
"""s^2 of a unit whose recordings do not show it: that of 33 000 electrons a spike."""

NOISY = 3.0
"""Relative A_16, over the median, from which a pixel is left out of the jitter."""

EQUAL_WITHIN = 5.0
"""Standard errors from the median up to which a pixel does not differ from most."""

RARE = 0.1
"""Share of pixels too dark or too bright in a recording, below which these have no residuals: their line rests on the
other recordings alone, and where the response bends it is another line."""


@dataclass(frozen=True)
class BaseFit:
    """A unit as its recordings show it."""

    gain: Floats
    """(P,) thresholds a frame at radiance 1."""
    dark: Floats
    """(P,) thresholds a frame in the dark."""
    gain_sd: Floats
    """(P,) standard error."""
    dark_sd: Floats
    """(P,) standard error."""
    white: float
    """s^2 = 1/N + kappa^2 a spike."""
    residual: Floats
    """(R, P) relative distance of the static recordings' rates from the line gain L + dark, in the order given; NaN
    where unknown, and for pixels whose line rests on other recordings than most."""
    live: Masks
    """(P,) pixels that respond; all where most get darker in more light, a fault of the labels."""


def free_refit(observations: list[ObservedRecording], conditions: list[Condition]) -> BaseFit:
    """Every pixel's own line, by steady recordings of known light of use fit; without known light, jitter alone."""
    static = [(o, c) for o, c in zip(observations, conditions, strict=True) if c.kind in STEADY_KNOWN]
    if not static:
        return _of_scenes([o for o, c in zip(observations, conditions, strict=True) if c.use == "fit"] or observations)
    rates = together([rates_from_times([o.times]) for o, _ in static])
    light = np.stack([np.broadcast_to(c.picture, o.times.count.shape) for o, c in static])
    use = np.array([c.use == "fit" for _, c in static])
    white = pooled_jitter([o for o, c in static if c.use == "fit"] or [o for o, _ in static])
    lines = fit_lines(light, rates, white, use)
    gain, dark = np.nan_to_num(lines.gain), np.nan_to_num(lines.dark)
    expected = gain * light + dark
    unused = rates.saturated | np.isfinite(rates.limit)
    of_all = ~unused[use & (unused.mean(axis=1) < RARE)].any(axis=0)
    known = ~unused & of_all & (expected > 0) & (expected < 0.95)
    residual = np.where(known, rates.rate / np.where(known, expected, 1.0) - 1.0, np.nan)
    return BaseFit(gain, dark, np.sqrt(lines.var_gain), np.sqrt(lines.var_dark), white, residual, responds(gain))


def responds(gain: Floats) -> Masks:
    """(P,) pixels with a tenth of the usual gain; all where most get darker in more light."""
    usual = np.median(gain)
    return gain > 0.1 * usual if usual > 0 else np.ones(gain.shape, bool)


def _of_scenes(observations: list[ObservedRecording]) -> BaseFit:
    one = np.ones(observations[0].times.count.size)
    live = np.all([o.times.count > 1 for o in observations], axis=0)
    nothing = np.zeros((0, one.size))
    return BaseFit(one, 0.0 * one, 0.0 * one, 0.0 * one, pooled_jitter(observations), nothing, live)


def pooled_jitter(observations: list[ObservedRecording]) -> float:
    """s^2 pooled over steady recordings; UNSEEN_JITTER where they have too few second differences."""
    rate = np.stack(
        [np.where((o.times.count / o.frames > 0.9) | noisy_pixels(o), np.nan, o.times.rate) for o in observations]
    )
    square = np.stack([o.times.square for o in observations])
    terms = np.stack([o.times.terms for o in observations]).astype(np.float64)
    jitter = fit_jitter(np.array(DIFFERENCES), square, terms, rate)
    return jitter.white if jitter else UNSEEN_JITTER


def noisy_pixels(o: ObservedRecording) -> Masks:
    """(P,) pixels whose A_16 is far above the others', or with irregular intervals: a few would bias the noise of all.

    One false spike in a pixel of three hundred adds half of it.

    Args:
        o: the recording.
    """
    terms = o.times.terms[:, DIFFERENCES.index(16)]
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = o.times.square[:, DIFFERENCES.index(16)] / terms * o.times.rate**2
    usual = np.nanmedian(np.where(terms > 20, relative, np.nan)) if np.any(terms > 20) else np.inf
    out: Masks = np.where(terms > 20, relative > NOISY * usual, False) | o.irregular
    return out


def constrained_refit(model: SensorModel, base: BaseFit) -> BaseFit:
    """A free refit with parameters nominal, or the same for all pixels, where the model has no effect for them."""
    names = {e.name for e in model.effects}
    gain, dark, white = base.gain, base.dark, base.white
    if not names & set(RESPONSE):
        gain = np.full_like(gain, np.median(gain))
    if not names & set(DARK):
        dark = np.zeros_like(dark)
    elif not names & set(DARK_PATTERN):
        dark = np.full_like(dark, common_level(dark, base.dark_sd))
    if not names & set(NOISE):
        white = 0.0
    return replace(base, gain=np.maximum(gain, 0.0), dark=np.maximum(dark, 0.0), white=white)


def common_level(values: Floats, errors: Floats) -> float:
    """The level of all pixels: the mean of those that differ by their errors alone where most do, else the median.

    Rates are read between whole frames, and those of equal pixels lie on a lattice, of which a median is one step.

    Args:
        values: (P,) levels.
        errors: (P,) their standard errors.
    """
    middle = np.median(values)
    equal = np.abs(values - middle) <= EQUAL_WITHIN * errors
    return float(values[equal].mean()) if equal.mean() > 0.5 else float(middle)


def unusual(ratio: float, usual: float) -> bool:
    """Whether a ratio to nominal is beyond the spread of units, a factor `usual`: a parameter of the model is wrong."""
    return not 1 / usual < ratio < usual
