"""The recordings that a candidate's twins simulate, and the number of twins."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spikecam_env.gap.candidates.table import Candidates, candidate
from spikecam_env.gap.compare.distance import CLEAR
from spikecam_env.gap.compare.prediction import Null
from spikecam_env.gap.twins.case import Case, refit_recordings
from spikecam_env.sensor.effects.identification import Response
from spikecam_env.types import Floats

OF_EVENTS = 3
"""Twins of a sparse or mixed effect."""

SPARSE_OR_MIXED = (Response.EVENTS, Response.FEW_PIXELS, Response.MIXED)
"""Responses of which one simulation says little, and a stronger effect no more."""

OF_RANDOM_COURSE = 2 * OF_EVENTS
"""Twins of an effect of random course: their scatter counts."""


def twins_of(name: str) -> int:
    """Number of twins for an effect.

    Several of a sparse one (few events, few random pixels) or a mixed one.  These cannot be simulated stronger to
    exceed one twin's noise.
    """
    return OF_EVENTS if candidate(name).response in SPARSE_OR_MIXED else 1


def recordings_affected(case: Case, names: Sequence[str], null: Null, measured: Floats, effect: Floats) -> list[int]:
    """Recordings to fit on which effects show, or a disagreement is, by index; all where there is none.

    They include those that the refit rests on: it takes up the effects' mean, and the others are judged by it.  Effects
    that leave steady uniform light alone need only the others, unless the refit rests on one of these.  Maps of rates
    are not simulated: their twins are fresh units.

    Args:
        null: the prediction without them.
        measured: (S,) statistics.
        effect: (S,) change of the statistics by the effects.
    """
    if case.rates_only:
        return []
    off = np.maximum(np.abs(effect), np.abs(np.nan_to_num(measured - null.mean)))
    seen = off > CLEAR * null.noise
    shows = {k.recording for k, s in zip(null.keys, seen, strict=True) if s}
    fitted = {i for i, c in enumerate(case.conditions) if c.use == "fit"}
    which = {i for i in fitted if case.conditions[i].name in shows} or fitted
    uneven = {i for i in which if case.conditions[i].kind not in ("dark", "flat")}
    if uneven and not uneven & refit_recordings(case) and Candidates(tuple(names)).only_contrast:
        return sorted(uneven)
    return sorted(which | refit_recordings(case))


def with_held_out(case: Case, only: Sequence[int]) -> list[int]:
    """Recordings `only` and the held-out ones: those in motion, and all where a refit can judge them."""
    held = {i for i, c in enumerate(case.conditions) if c.use != "fit"}
    if any(case.conditions[i].kind == "picture" for i in held):
        held |= refit_recordings(case)
    if not refit_recordings(case) <= {*only, *held}:
        held = {i for i in held if case.conditions[i].moves}
    return sorted({*only, *held})
