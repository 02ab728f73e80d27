"""The arguments of the block loop: F frames, H rows of pixels, P pixels in all; float64 unless stated."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spikecam_env.compiled import njit
from spikecam_env.sensor.effects.base import Feedback
from spikecam_env.sensor.engines.compiled.bands.rows import Bytes, Places, Words
from spikecam_env.types import Floats, Pictures


class BlockLight(NamedTuple):
    """Charge that arrives."""

    light: Floats
    """(F or 1, P) [thresholds]."""
    dark: Floats
    """Likewise."""
    light_factor: Floats
    """Of each row, (F, H)."""
    dark_factor: Floats
    few: Places
    """Pixels (n,), ascending, with extra dark charge."""
    extra: Floats
    """That charge, (F, n)."""


class BlockReferences(NamedTuple):
    """What charge is compared with."""

    factor: Floats
    """Of thresholds, (F, H), the least of each frame."""
    common: Floats
    """Shift (F, H) [mV], likewise."""
    field: Pictures
    """Shift of each pixel, (F or 1, P) float32 [mV]."""
    grains_per_mV: Floats
    """(P,)."""
    at: Floats
    """Nodes within a frame, (H or 1, n); n = 0 where no reference moves within one."""
    factor_at: Floats
    """Factor at the nodes, (F or 1, H or 1, n)."""
    common_at: Floats
    """Likewise."""


class SpikeLaw(NamedTuple):
    """The law of a spike."""

    feedback: Feedback
    """kick_at_once in grains, on the grid."""
    per_electron: Floats
    """1/N, (P,)."""
    kappa_squared: Floats
    """(P,)."""
    polynomial: tuple[np.float32, ...]
    """8 float32, law of a spike's charge."""
    seed_low: np.uint32
    seed_high: np.uint32


class BlockPixels(NamedTuple):
    """The pixels, updated."""

    charge: Floats
    """(P,) [grains]."""
    threshold: Floats
    """Likewise."""
    fired: Words
    """Spikes so far (P,) uint32."""
    activity: Floats
    """Share of each row that fired in the last frame (H,)."""
    crossing: Floats
    """Time of the last crossing (P,) [frames]."""


class BlockFrames(NamedTuple):
    """The frames to be written."""

    number: int
    """Of the first."""
    columns: int
    """Pixels of a row."""
    spikes: Bytes
    """(F, P) uint8, overwritten."""


class FrameSway(NamedTuple):
    """How references move within one frame."""

    columns: int
    """Pixels of a row."""
    at: Floats
    """Nodes (H or 1, n)."""
    factor: Floats
    """There (H or 1, n)."""
    common: Floats
    """[mV], likewise."""
    field: Pictures
    """(P,) float32 [mV]."""
    grains_per_mV: Floats
    """(P,)."""
    loads: Floats
    """Of the rows (H,)."""


class Plan(NamedTuple):
    """What moves in a block, and how its lines are taken."""

    light_moves: bool
    dark_moves: bool
    field_moves: bool
    """From frame to frame."""
    moves: bool
    """Anything, from frame to frame."""
    sways: bool
    """References, within a frame."""
    alone: bool
    """Pixels may go from event to event by themselves."""
    pieces: int
    """Lines of a row."""
    pitch: int
    """Places of a line."""
    lines: int
    """Of a band."""
    together: int
    """Bands that pass a frame together."""


@njit(inline="always")
def differ(values: Floats) -> bool:
    """Whether any frame's values differ from the first's."""
    return bool((values != values[0]).any())


@njit(inline="always")
def sway_of(references: BlockReferences, droop: float, activity: Floats, columns: int, t: int) -> FrameSway:
    """How references move within frame t of a block."""
    factor, common, field = references.factor_at, references.common_at, references.field
    return FrameSway(
        columns,
        references.at,
        factor[t if factor.shape[0] > 1 else 0],
        common[t if common.shape[0] > 1 else 0],
        field[t if field.shape[0] > 1 else 0],
        references.grains_per_mV,
        1.0 + droop * activity,
    )
