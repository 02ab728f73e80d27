"""Motion in a recording that is said to be static: regions whose pixels change together, beyond the change of all.

    z = sum (c - e) / sqrt(sum v),   v = k (f (1 - f) + noise)        c: a pixel's count in a block of frames

f is the fractional part of the expected count e: an integrator that carries its charge over fires a whole number of
times from a uniform phase (variance 1/6 on average, 1/4 at most; not Poisson's e).  e is the pixel's mean times the
course of its level in that block (`common_mode`): lamp drift, flicker and ripple are in all pixels, dark-current drift
in all by their dark level, so neither is motion.  A single pixel counts three standard deviations at most, so a hot
pixel is none either.  k is the scatter of neighbours of a level about each other over that law (`excess`): single
events, false or missed spikes and telegraph noise, are each pixel's own; motion is shared by neighbours.  Events that
pixels of a row share, such as a glitch of the read-out, make rows scatter more from block to block than columns, and
windows with them (`shared_variance`); motion does not.  Rows are no regions: windows are as high as wide, and even, so
that changes of sign from row to row cancel.

Blind to: changes of all pixels of a level by the same share, regions smaller than the least of SIDES, and contrast
below `LEAST_CONTRAST`, which local effects of a camera reach; slow noise of single pixels (1/f) is below it in the mean
of a window.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from spikecam_env.gap.observe.conditions import STEADY, Condition
from spikecam_env.gap.observe.observation import TIME_BLOCKS, ObservedRecording
from spikecam_env.gap.settings import Baseline, DiagnosisSettings, checked_settings
from spikecam_env.types import Floats, Masks

SIDES = (4, 8, 16)
"""Sides of the windows [pixels]: smaller motion is missed, larger is in several."""

SPANS = (1, 4, 8)
"""Lengths of the windows [sixteenths of a recording]."""

LEAST_CONTRAST = 0.05
"""Relative change of a window's rate from which it moves: local effects of a camera in the blind trial, at forty times
their limit, change a corner by 0.01."""

MOST_OF_A_PIXEL = 3.0
"""Standard deviations that a single pixel counts at most in a deviate; a contrast is of all that it changes."""

OWN_NOISE = 0.1
"""Variance of a count beside f (1 - f), which is 0 where whole numbers are expected: its ends are jittered.

Jitter of s of an interval gives 1.13 s; a tenth is above the presets' (0.06 at most, in blocks of 100 spikes)."""

PIXELS_OF_A_LEVEL = 256
"""Pixels of neighbouring levels whose scatter is taken together: with two parts of the recording it is known to 7 %, by
simulation."""

FEW_SPIKES = 2.0
"""Spikes by which a pixel has to be off a common mode to be left out of it: where most pixels have none, those that
have one or two are the mean."""

_ROUNDS = 20
"""Times at most that a recording is searched again without the windows that moved."""

_TRIMS = 4
"""Times that a common mode is fitted anew without the pixels that are off it."""


LEAST_COUNTS = 20.0
"""Spikes that are expected in a window, at least: fewer are no normal deviates."""


@dataclass(frozen=True)
class DetectedMotion:
    """The moving part of a recording."""

    recording: str
    moving: Masks
    """(H, W)."""
    rows: tuple[int, int]
    """First and last of the largest connected region."""
    columns: tuple[int, int]
    """First and last of the same."""
    frames: tuple[int, int]
    """First and last in which it differs most."""
    contrast: float
    """Largest relative change of a window, of either sign."""
    z: float
    """Largest deviate."""
    rate: Floats
    """(H, W) of the recording [spikes/frame]."""
    light_known: bool = False
    """Whether the label says the light."""

    @property
    def share(self) -> float:
        """Share of pixels that move."""
        return float(self.moving.mean())

    @property
    def text(self) -> str:
        """The finding, in words."""
        (r, s), (c, d), (f, g) = self.rows, self.columns, self.frames
        return (
            f"{self.recording}: the scene moves, or the light of a part changes, in rows {r} to {s}, columns {c} to "
            f"{d} ({100 * self.share:.3g} % of pixels in all), most in frames {f} to {g}"
        )

    def to_json(self) -> dict[str, Any]:
        """The documented format: no pictures."""
        shown = ("recording", "rows", "columns", "frames", "contrast", "z")
        return {**{key: getattr(self, key) for key in shown}, "share": self.share}


def find_motion(
    condition: Condition, seen: ObservedRecording, settings: DiagnosisSettings | None = None
) -> DetectedMotion | None:
    """The moving part of a recording of steady light.

    In the dark nothing can move; changes there are the camera's.

    Args:
        condition: of the recording.
        seen: the recording.
        settings: limits; None: the defaults.

    Returns:
        None where nothing moves, or the light is known to change.
    """
    if condition.kind not in STEADY or condition.kind == "dark":
        return None
    limits = checked_settings(settings).baseline
    counts, frames = whole_blocks(seen)
    kept = np.ones(seen.shape, bool) if condition.static is None else condition.static
    windows: list[_Window] = []
    for _ in range(_ROUNDS):
        more = list(_moving_windows(counts, seen.shape, kept, limits))
        if not more:
            break
        windows += more
        kept = kept & ~_union(more, seen.shape)
    return _described(condition, windows, seen, frames) if windows else None


def whole_blocks(seen: ObservedRecording) -> tuple[Floats, int]:
    """(n, P) counts of the blocks that are whole, and their frames."""
    frames = -(-seen.frames // TIME_BLOCKS)
    return seen.blocks[: seen.frames // frames].astype(np.float64), frames


def expected_variance(expected: Floats) -> Floats:
    """Variance of a static pixel's count, of which `expected` are expected."""
    part = np.mod(expected, 1.0)
    return part * (1.0 - part) + OWN_NOISE * np.minimum(expected, 1.0) + 1e-6


def common_mode(counts: Floats, mean: Floats, use: Masks) -> Floats:
    """(P,) expected counts of a block, by the level of each pixel.

    They are the parabola through all pixels, fitted without those off it by FEW_SPIKES or more: motion is not common.

    Args:
        counts: (P,) of the block.
        mean: (P,) over blocks.
        use: (P,) pixels that count.
    """
    level = mean / max(float(mean[use].mean()), 1e-9)
    design = np.stack([np.ones_like(level), level, level**2], axis=1)
    expected, inside = mean, use
    for _ in range(_TRIMS):
        weight = 1.0 / np.sqrt(expected_variance(np.maximum(expected, 0.0))[inside])
        line, *_ = np.linalg.lstsq(design[inside] * weight[:, None], counts[inside] * weight, rcond=1e-6)
        expected = np.maximum(design @ line, 0.0)
        spikes = np.abs(counts - expected)
        off = spikes / np.sqrt(expected_variance(expected))
        usual = max(1.0, 1.4826 * float(np.median(off[use])))
        inside = use & ((off < MOST_OF_A_PIXEL * usual) | (spikes < FEW_SPIKES))
        if not inside.any():
            break
    return expected


def of_one_level(level: Floats, kept: Masks) -> list[NDArray[np.intp]]:
    """Flat indices of the pixels kept, of neighbouring levels (mean counts, (P,)) together."""
    order = np.flatnonzero(kept)[np.argsort(level[kept.reshape(-1)], kind="stable")]
    return np.array_split(order, max(order.size // PIXELS_OF_A_LEVEL, 1))


def excess(deviates: Floats, kept: Masks, groups: list[NDArray[np.intp]]) -> Floats:
    """(P,) variance of the deviates of neighbours about each other, in each group; 1 at least.

    Args:
        deviates: (n, H, W) of n parts of the time, each pixel's in its own standard deviations.
        kept: (H, W) pixels that count.
        groups: of pixels, flat indices.
    """
    half, pairs = np.zeros(kept.shape), np.zeros(kept.shape)
    by_rows, by_columns = (deviates, kept, half, pairs), (deviates.swapaxes(1, 2), kept.T, half.T, pairs.T)
    for values, use, sums, number in (by_rows, by_columns):
        both = use[1:] & use[:-1]
        square = np.where(both, 0.5 * np.mean(np.diff(values, axis=1) ** 2, axis=0), 0.0)
        for side in (slice(1, None), slice(None, -1)):
            sums[side] += square
            number[side] += both
    factor = np.ones(kept.size)
    for group in groups:
        factor[group] = max(half.reshape(-1)[group].sum() / max(pairs.reshape(-1)[group].sum(), 1.0), 1.0)
    return factor


def without_bias(deviates: Floats, groups: list[NDArray[np.intp]]) -> Floats:
    """Deviates (n, P) whose mean over each group and all parts of the time is 0: those of few spikes are skewed, and
    the limit of a pixel's deviate moves their mean."""
    centred = deviates.copy()
    for group in groups:
        centred[:, group] -= deviates[:, group].mean()
    return np.asarray(centred)


@dataclass(frozen=True)
class _Window:
    """A part of the array in a part of the time that is off: slices, blocks (first, stop), deviate and contrast."""

    row: int
    column: int
    height: int
    width: int
    blocks: tuple[int, int]
    z: float
    contrast: float


def _moving_windows(counts: Floats, shape: tuple[int, int], kept: Masks, limits: Baseline) -> Iterator[_Window]:
    """Windows in space and time whose pixels, of those `kept`, are off together beyond chance."""
    use = kept.reshape(-1)
    if len(counts) < 2 or not use.any():
        return
    mean = counts.mean(axis=0)
    expected = np.stack([common_mode(block, mean, use) for block in counts])
    groups = of_one_level(mean, kept)
    sizes = [(min(side, shape[0]), min(side, shape[1])) for side in SIDES]
    sizes = [s for s in dict.fromkeys(sizes) if s != shape]
    spans = [s for s in SPANS if s <= len(counts) // 2]
    tests = sum((len(counts) // span) * len(_starts(shape[0], h)) * len(_starts(shape[1], w))
                for span in spans for h, w in sizes)  # fmt: skip
    least_z = least_deviate(tests, limits)
    planes = {span: _deviations(counts, expected, span, kept, groups) for span in {1, *spans}}
    for size in sizes:
        shared = shared_variance(planes[1], size[1])
        for span in spans:
            yield from beyond(planes[span], size, span, shared * span, least_z, limits)


def _deviations(
    counts: Floats, expected: Floats, span: int, kept: Masks, groups: list[NDArray[np.intp]]
) -> tuple[Floats, ...]:
    """(n, H, W) of n parts of the time of `span` blocks: spikes off, off as far as a pixel counts, their variance, and
    spikes expected; 0 where not `kept`."""
    firsts = range(0, len(counts) - span + 1, span)
    sums = np.stack([expected[first : first + span].sum(axis=0) for first in firsts])
    off = np.stack([counts[first : first + span].sum(axis=0) for first in firsts]) - sums
    sd = np.sqrt(expected_variance(sums))
    deviates = without_bias(np.clip(off / sd, -MOST_OF_A_PIXEL, MOST_OF_A_PIXEL), groups)
    scatter = excess(deviates.reshape(-1, *kept.shape), kept, groups)
    parts = (off, deviates * sd, scatter * sd**2, sums)
    return tuple(np.where(kept, part.reshape(-1, *kept.shape), 0.0) for part in parts)


def least_deviate(tests: int, limits: Baseline) -> float:
    """Deviate, of either sign, that one of so many windows exceeds by chance of `false_alarm` (Bonferroni)."""
    return -float(scipy.special.ndtri(limits.false_alarm / (2 * max(tests, 1))))


def beyond(
    planes: tuple[Floats, ...], size: tuple[int, int], span: int, shared: float, least_z: float, limits: Baseline
) -> Iterator[_Window]:
    """Windows of one size that move.

    Few events that pixels share are no normal deviates.  Their chance is bounded by Bernstein's inequality,
    exp(-d^2 / (2 v + 2 m d / 3)) of a deviation d in steps of m spikes; m is the factor by which they multiply the
    variance.

    Args:
        planes: `_deviations` of parts of the time.
        size: of the windows (rows, columns).
        span: length of a part [blocks].
        shared: variance of a pixel's count by events that pixels of a row share, times those that share one.
        least_z: of a window that moves.
        limits: of its contrast.
    """
    rows, columns = (_starts(n, side) for n, side in zip(planes[0].shape[1:], size, strict=True))
    off, capped, variance, expected = (_window_sums(plane, rows, columns, size) for plane in planes)
    times = 1.0 + shared / max(_own_variance(planes), 1e-9)
    z = capped / np.sqrt(np.maximum(times * variance + (times - 1.0) * np.abs(capped) / 3.0, 1e-9))
    contrast = off / np.maximum(expected, 1e-9)
    enough = np.maximum(expected, expected + off) >= LEAST_COUNTS
    for k, i, j in np.argwhere(enough & (np.abs(z) > least_z) & (np.abs(contrast) > LEAST_CONTRAST)):
        blocks = (int(k) * span, (int(k) + 1) * span)
        yield _Window(int(rows[i]), int(columns[j]), *size, blocks, float(z[k, i, j]), float(contrast[k, i, j]))


def shared_variance(planes: tuple[Floats, ...], width: int) -> float:
    """Variance of a pixel's count in a block by events that pixels of a row share, times those that share one.

    From block to block, parts of rows scatter more by it than parts of columns; motion is shared along both, or slow.

    Args:
        planes: `_deviations` of single blocks.
        width: of windows [pixels]; no more pixels share an event.
    """
    along_rows, along_columns = (_scatter_of_strips(planes, size) for size in ((1, width), (width, 1)))
    return float(np.clip(along_rows - along_columns, 0.0, width - 1.0)) * _own_variance(planes)


def _own_variance(planes: tuple[Floats, ...]) -> float:
    """Mean variance of a pixel's count, of pixels that count."""
    variance = planes[2][planes[2] > 0]
    return float(variance.mean()) if variance.size else 0.0


def _scatter_of_strips(planes: tuple[Floats, ...], size: tuple[int, int]) -> float:
    """Variance of strips of a size, from block to block, over that of their pixels."""
    _, capped, variance, _ = planes
    places = [np.arange(n - side + 1) for n, side in zip(capped.shape[1:], size, strict=True)]
    if not all(p.size for p in places):
        return 1.0
    steps, own = (_window_sums(plane, places[0], places[1], size) for plane in (np.diff(capped, axis=0), variance))
    blocks = len(capped)
    return float(np.mean(steps**2) / 2.0 * (1.0 - 1.0 / blocks) / max(float(np.mean(own)), 1e-9))


def _starts(length: int, side: int) -> NDArray[np.int64]:
    """Where windows begin: they overlap by half, and the last one ends with the array."""
    return np.unique(np.append(np.arange(0, length - side + 1, max(side // 2, 1)), length - side))


def _window_sums(planes: Floats, rows: NDArray[np.int64], columns: NDArray[np.int64], size: tuple[int, int]) -> Floats:
    """(n, rows, columns) sums of planes (n, H, W) over windows."""
    total = np.pad(planes.cumsum(axis=1).cumsum(axis=2), ((0, 0), (1, 0), (1, 0)))
    strips = total[:, rows + size[0]] - total[:, rows]
    return np.asarray(strips[..., columns + size[1]] - strips[..., columns])


def _union(windows: list[_Window], shape: tuple[int, int]) -> Masks:
    moving = np.zeros(shape, bool)
    for w in windows:
        moving[w.row : w.row + w.height, w.column : w.column + w.width] = True
    return moving


def _described(condition: Condition, windows: list[_Window], seen: ObservedRecording, frames: int) -> DetectedMotion:
    """The largest connected region, and when its windows are off."""
    moving = _union(windows, seen.shape)
    regions, _ = scipy.ndimage.label(moving)
    largest = int(np.argmax(np.bincount(regions.ravel())[1:])) + 1
    row, column = np.nonzero(regions == largest)
    mine = [w for w in windows if regions[w.row, w.column] == largest]
    worst = max(mine, key=lambda w: abs(w.z))
    shortest = min(w.blocks[1] - w.blocks[0] for w in mine)
    when = [w.blocks for w in mine if w.blocks[1] - w.blocks[0] == shortest]
    return DetectedMotion(
        recording=condition.name,
        moving=moving,
        rows=(int(row.min()), int(row.max())),
        columns=(int(column.min()), int(column.max())),
        frames=(min(w[0] for w in when) * frames, max(w[1] for w in when) * frames - 1),
        contrast=max(abs(w.contrast) for w in mine),
        z=abs(worst.z),
        rate=(seen.times.count / seen.frames).reshape(seen.shape),
        light_known=condition.light is not None,
    )
