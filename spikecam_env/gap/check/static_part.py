"""The static part of a campaign: recordings without the pixels of unknown scenes that move."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from spikecam_env.campaign.reading import CampaignRecording
from spikecam_env.gap.check.motion import DetectedMotion, find_motion
from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.observe.observation import ObservedRecording, observe
from spikecam_env.gap.settings import DiagnosisSettings
from spikecam_env.types import Masks

ENOUGH_STATIC = 0.3
"""Share of static pixels that is enough to look at them alone."""


@dataclass(frozen=True)
class Observed:
    """Recordings of spikes at one V_d, their conditions and observations; all empty where none is usable."""

    recordings: tuple[CampaignRecording, ...]
    conditions: tuple[Condition, ...]
    observations: tuple[ObservedRecording, ...]


def without_motion(
    observed: Observed, *, static_only: bool, settings: DiagnosisSettings
) -> tuple[Observed, tuple[DetectedMotion, ...]]:
    """The recordings without moving pixels, and the motion.

    All unknown scenes keep the same pixels.

    Args:
        observed: the recordings.
        static_only: whether moving pixels may be left out.
        settings: limits of motion.

    Returns:
        (recordings, motion).  There are no recordings where motion cannot be left out: without `static_only`, where
        light said to be known changes, or where too few pixels are static.
    """
    both = zip(observed.conditions, observed.observations, strict=True)
    motion = tuple(m for c, o in both if (m := find_motion(c, o, settings)))
    if not motion:
        return observed, ()
    static, moving = static_pixels(motion), {m.recording for m in motion}
    known = any(c.light is not None for c in observed.conditions if c.name in moving)
    if not static_only or known or static.mean() < ENOUGH_STATIC:
        return Observed((), (), ()), motion
    conditions = [replace(c, static=static) if c.kind == "unknown" else c for c in observed.conditions]
    seen = [
        o if c.static is None else observe(r.packed(), o.shape, static=c.static)
        for r, c, o in zip(observed.recordings, conditions, observed.observations, strict=True)
    ]
    return Observed(observed.recordings, tuple(conditions), tuple(seen)), motion


def static_pixels(motion: tuple[DetectedMotion, ...]) -> Masks:
    """(H, W) bool: pixels that move in none of the recordings."""
    return np.asarray(~np.logical_or.reduce([m.moving for m in motion]))


def counted_pixels(condition: Condition) -> Masks | slice:
    """Index of the pixels of a recording that count, of (P,)."""
    return slice(None) if condition.static is None else condition.static.reshape(-1)
