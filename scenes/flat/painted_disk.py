"""How a tile, and textured discs and shapes before it, become a picture: compiled, and painted inside the rim alone.

disc:   light = behind + cover (texture - behind),   cover = share of the pixel inside the rim
shape:  light = texture + (1 - mask) behind,         texture times mask, and mask, are texels
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import cv2
import numpy as np
from numba.np.numpy_support import carray
from numpy.typing import NDArray

from spikecam_env.checked import checked_memory
from spikecam_env.compiled import njit
from spikecam_env.sensor.ground.intrinsics import pointer_to, take_ticket, two_at, use_widest_vectors
from spikecam_env.types import Floats, Pictures

TEXELS_PER_PIXEL = 5
"""Of the prefiltered texture.  At a key the default disk is 0.75 % rms of full scale off 16 x 16 supersampling at 5,
0.86 % at 3, 0.72 % at 8; the rest is the pixel's square, which turns over the texture and is taken as round."""

MARGIN = 10
"""Texels around the square of a disc or of a shape, so that its rim is interpolated from texels on both sides."""

EVERYWHERE = 1e9
"""Radius of a texture that repeats without end [pixels]: more than any picture has."""


@dataclass(frozen=True, eq=False)
class Texels:
    """A square picture as the processor reads it fastest, in steps of 1 / 65535 of its range.

    A texel is worth low + step * its bits.
    """

    pairs: NDArray[np.uint32]
    """(side * side,) uint32, row by row: a texel in the lower 16 bits, the one below it in the upper.  So the four
    around a place are two neighbours in memory, and most often one line of cache."""
    side: int
    low: np.float32
    step: np.float32
    period: int = 0
    """Texels after which the picture repeats; 0: it does not."""
    zoom: float = 0.0
    """Texels a pixel; 0: so many that the square within the margin is as wide as the disc."""

    @classmethod
    def of(cls, picture: Pictures) -> Texels:
        """The texels of a square picture (side, side)."""
        low = picture.min()
        step = np.float32(max((picture.max() - low) / 65535, 1e-30))
        bits = np.round((picture - low) / step).astype(np.uint32)
        pairs = bits | np.vstack([bits[1:], bits[-1:]]) << 16
        return cls(pairs.reshape(-1), len(picture), low, step)

    @classmethod
    def repeated(cls, picture: Pictures, zoom: float) -> Texels:
        """The texels of a square picture (period, period) that repeats without end, with `zoom` texels a pixel."""
        return replace(cls.of(np.pad(picture, (0, 2), mode="wrap")), period=len(picture), zoom=zoom)

    def lit(self, gain: float) -> Texels:
        """The same with `gain` times its light."""
        return replace(self, low=self.low * np.float32(gain), step=self.step * np.float32(gain))


@dataclass(frozen=True, eq=False)
class Tile:
    """A background that repeats without end, as the processor reads it fastest: samples a pixel apart adjoin."""

    samples: Pictures
    """(h, step, n) float32: sample (row, s) stands at [row, s % step, s // step], on and on over the period's end for
    as many columns as a picture has from any sample."""
    period: int
    """Samples after which a row repeats."""
    unmoved: Pictures
    """(rows, columns) float32, the picture seen from (0, 0)."""

    @classmethod
    def of(cls, samples: Pictures, shape: tuple[int, int], step: int = 1) -> Tile:
        """The tile behind a picture.

        Args:
            samples: (h, period) float32 radiance.
            shape: (rows, columns) of the picture.
            step: samples from pixel to pixel.
        """
        height, period = samples.shape
        pixels = np.arange(np.lcm(period, step) // step + shape[1])
        by_phase = np.ascontiguousarray(samples[:, (step * pixels + np.arange(step)[:, None]) % period])
        unmoved = by_phase[step * np.arange(shape[0]) % height, 0, : shape[1]]
        return cls(by_phase, period, np.ascontiguousarray(unmoved))

    @classmethod
    def dark(cls, shape: tuple[int, int]) -> Tile:
        """No light behind a picture of (rows, columns)."""
        return cls.of(np.zeros((1, 1), np.float32), shape)

    def lit(self, gain: float) -> Tile:
        """The same with `gain` times its light."""
        by = np.float32(gain)
        return replace(self, samples=self.samples * by, unmoved=self.unmoved * by)

    @property
    def step(self) -> int:
        """Samples from pixel to pixel."""
        return int(self.samples.shape[1])

    def in_order(self) -> Pictures:
        """(h, period), the samples as `of` takes them."""
        place = np.arange(self.period)
        return self.samples[:, place % self.step, place // self.step]


class PlacedDisc(NamedTuple):
    """A disc, or the shape in it that a mask covers, at each key."""

    texels: Texels
    radius: float
    """[pixels]"""
    x: Floats
    y: Floats
    """x and y (K,) [pixels]."""
    angle: Floats
    """(K,) [radians], counter-clockwise in the picture."""
    mask: Texels | None = None
    """Coverage of the shape, with as many texels, 0 at the rim; `texels` are then light times coverage."""

    @property
    def grid(self) -> tuple[float, float, float]:
        """Middle of the texels, texels a pixel, and period."""
        texels, inner = self.texels, self.texels.side - 2 * MARGIN
        return ((texels.period or texels.side) - 1) / 2, texels.zoom or inner / (2 * self.radius), texels.period


@dataclass(frozen=True, eq=False)
class Plane:
    """A tiled background with discs before it, at each of K keys."""

    shape: tuple[int, int]
    frame: Floats
    """(K,) frames of the keys, rising."""
    tile: Tile
    """The background."""
    pan: Floats
    tilt: Floats
    """pan and tilt (K,), place from which the background is seen [samples]."""
    discs: Sequence[PlacedDisc]
    """From the back."""


def places_of(grid: Floats, x: Floats, y: Floats, angle: Floats) -> Floats:
    """Places of discs for painting: (R, 6) of x, y, u0, v0, cosine, sine (`_paint_disc`).

    Args:
        grid: (R, 3) of `PlacedDisc.grid`.
        x: (R,) [pixels].
        y: (R,) [pixels].
        angle: (R,) [radians].
    """
    middle, scale, period = grid.T
    cosine, sine = scale * np.cos(angle), scale * np.sin(angle)
    u, v = middle - cosine * x + sine * y, middle - sine * x - cosine * y
    u, v = (place - period * np.floor(place / np.maximum(period, 1)) for place in (u, v))  # fine in float32
    once = period == 0
    return np.stack([once * x, once * y, u, v, cosine, sine], axis=1)


def prefiltered(texture: NDArray[np.floating], radius: float) -> Pictures:
    """The texture (n, n) at `TEXELS_PER_PIXEL`, averaged over a pixel's area, whatever the angle.

    Resampling by area (m texels a pixel) and bilinear interpolation blur too, by 1 / 12 m^2 and 1 / 6 m^2
    pixels^2; a box of side sqrt(1 - 3 / m^2) makes up the pixel's 1 / 12.

    Args:
        texture: of the square around the disk; its border is repeated outward.
        radius: of the disk [pixels].
    """
    texels = max(2, round(2 * radius * TEXELS_PER_PIXEL))
    checked_memory(20 * texels**2, f"a disk of radius {radius:g} pixels")
    way = cv2.INTER_AREA if texels < len(texture) else cv2.INTER_LINEAR
    resampled = cv2.resize(texture.astype(np.float32), (texels, texels), interpolation=way)
    wide = np.pad(resampled, MARGIN, mode="edge")
    box = _turned_box(TEXELS_PER_PIXEL * np.sqrt(1 - 3 / TEXELS_PER_PIXEL**2))
    return np.asarray(cv2.filter2D(wide, -1, box, borderType=cv2.BORDER_REPLICATE), np.float32)


def _turned_box(side: float) -> Pictures:
    """Kernel (n, n): a square of this side [texels] about the middle, averaged over all angles; sum 1."""
    fine, reach = 16, int(np.ceil(side / np.sqrt(2) + 0.5))
    size = 2 * reach + 1
    axis = (np.arange(size * fine) + 0.5) / fine - size / 2
    distance = np.hypot(axis[:, None], axis[None, :])
    towards_side = np.arccos(np.clip(side / 2 / np.maximum(distance, side / 2), 0, 1))
    share = np.clip(1 - towards_side / (np.pi / 4), 0, 1)
    kernel = share.reshape(size, fine, size, fine).mean(axis=(1, 3))
    normed: Pictures = (kernel / kernel.sum()).astype(np.float32)
    return normed


BAND = 16
"""Rows of a picture that are painted at a time."""

KEYS = 64
"""Keys for which a band of rows is painted before the next one.  From key to key a disk turns by three texels at most.
So the texels of a band are read again while they are in the processor's second cache (0.6 MB for the default disk).
Key by key the whole texture, 5 MB, would pass through it each time."""

_TILE, _TILE_ROWS, _STEP, _TILE_COLUMNS, _PERIOD, _UNMOVED, _ROWS, _COLUMNS, _OUT, _SIZE, _KEYS, _FIRST_KEY = range(12)
_FIRST_DISC, _STOP_DISC, _FIRST_PART = 12, 13, 14
"""Columns of the table of scenes."""

_FIRST_PLACE = 4
"""Column of the table of textures."""


def parts_of(keys: int, rows: int) -> int:
    """Into how many parts `paint_scenes` cuts the pictures of a scene."""
    return -(-keys // KEYS) * -(-rows // BAND)


@njit(cache=True, nogil=True)
def paint_scenes(
    tickets: NDArray[np.int64],
    parts: int,
    scenes: NDArray[np.int64],
    pan: Floats,
    tilt: Floats,
    textures: NDArray[np.int64],
    numbers: Floats,
    places: Floats,
) -> None:
    """Pictures of tiles with disks before them: the parts, a band of rows at some keys, that this thread gets hold of.

    Args:
        tickets: (1, 8) int64, shared: [0, 0] is the next part, of `parts`.
        scenes: (N, 15) int64: address, shape and period of the tile's samples, address of its unmoved picture; rows and
            columns of the picture; address of the first picture, bytes to the next, how many there are, the first
            one's number; the scene's disks, from and to; its first part (`parts_of`).
        pan: (M,) place from which the tile is seen [samples], a picture after another.
        tilt: (M,) likewise.
        textures: (D, 5) int64: address of the texels (`Texels`), their side and period; address of the mask, or 0; row
            of `places` of the first picture.
        numbers: (D, 4): radius, low and step of the texels, step of the mask.
        places: (R, 6): of `places_of`.
    """
    n = 0
    while True:
        part: Any = take_ticket(tickets, 0)
        if part >= parts:
            return
        while n + 1 < len(scenes) and scenes[n + 1, _FIRST_PART] <= part:
            n += 1
        scene = scenes[n]
        rows, columns = scene[_ROWS], scene[_COLUMNS]
        bands = (rows + BAND - 1) // BAND
        block, band = divmod(part - scene[_FIRST_PART], bands)
        top = band * BAND
        bottom = min(top + BAND, rows)
        spare = np.empty((BAND, columns), np.float32)[: bottom - top]
        for key in range(block * KEYS, min((block + 1) * KEYS, scene[_KEYS])):
            m = scene[_FIRST_KEY] + key
            picture = carray(pointer_to(scene[_OUT] + key * scene[_SIZE], np.float32), (rows, columns))[top:bottom]
            left = 0
            for d in range(scene[_FIRST_DISC], scene[_STOP_DISC]):
                left += _in_view(places[textures[d, _FIRST_PLACE] + key], numbers[d, 0], top, bottom, columns)
            if left and pan[m] == 0.0 and tilt[m] == 0.0:
                behind = carray(pointer_to(scene[_UNMOVED], np.float32), (rows, columns))[top:bottom]
            else:
                behind = spare if left % 2 else picture
                stored = scene[_TILE_ROWS], scene[_STEP], scene[_TILE_COLUMNS]
                samples = carray(pointer_to(scene[_TILE], np.float32), stored)
                _paint_tile(samples, scene[_PERIOD], pan[m], tilt[m], top, behind)
            for d in range(scene[_FIRST_DISC], scene[_STOP_DISC]):
                place, radius = places[textures[d, _FIRST_PLACE] + key], numbers[d, 0]
                if _in_view(place, radius, top, bottom, columns):
                    left -= 1
                    front = spare if left % 2 else picture
                    _paint_disc(behind, textures[d], numbers[d], place, top, front)
                    behind = front


@njit(inline="always")
def _in_view(place: Floats, radius: float, top: int, bottom: int, columns: int) -> bool:
    """Whether a disk at a place (`places_of`) is seen in rows from `top` to `bottom`."""
    reach = radius + 1
    return -reach < place[0] < columns - 1 + reach and top - reach < place[1] < bottom - 1 + reach  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def _paint_tile(samples: Pictures, period: int, x: float, y: float, above: int, picture: Pictures) -> None:
    """Rows from `above` on of the picture whose first pixel is sample (x, y) of a `Tile`, bilinear."""
    (height, step, _), (rows, columns) = samples.shape, picture.shape
    left, top = int(np.floor(x)), int(np.floor(y))
    right_share, lower_share = np.float32(x - left), np.float32(y - top)
    left, top = left % period, top + step * above
    here, place = left % step, left // step
    right, beside = (left + 1) % step, (left + 1) // step
    for r in range(rows):
        upper, lower, row = samples[(top + step * r) % height], samples[(top + step * r + 1) % height], picture[r]
        upper_left, upper_right = upper[here, place : place + columns], upper[right, beside : beside + columns]
        lower_left, lower_right = lower[here, place : place + columns], lower[right, beside : beside + columns]
        for c in range(columns):
            to_left = upper_left[c] + lower_share * (lower_left[c] - upper_left[c])
            to_right = upper_right[c] + lower_share * (lower_right[c] - upper_right[c])
            row[c] = to_left + right_share * (to_right - to_left)


@njit(cache=True, nogil=True, fastmath=True)
def _paint_disc(
    behind: Pictures, texture: NDArray[np.int64], numbers: Floats, place: Floats, top: int, picture: Pictures
) -> None:
    """A disc or shape over the picture behind it, rows from `top` on, into another array.

    Texture, numbers and place are rows of the tables of `paint_scenes`.  Pixel (column, row) is read at (u0 + cosine
    column - sine row, v0 + sine column + cosine row), bilinear.  Each row goes through short loops, places, texels,
    light: the first and the last are vectors then.  Of a disc nothing but the rim is blended.
    """
    use_widest_vectors()
    pairs, side, period, mask = texture[0], np.int32(texture[1]), np.float32(texture[2]), texture[3]
    low, step, mask_step = np.float32(numbers[1]), np.float32(numbers[2]), np.float32(numbers[3])
    x, y, u0, v0, cosine, sine = place
    reach, solid = np.float32(numbers[0] + 0.5), np.float32(max(numbers[0] - 0.5, 0.0))
    du, dv, turns = np.float32(cosine), np.float32(sine), np.float32(1 / max(texture[2], 1))
    rows, columns = picture.shape
    index, texels = np.empty(columns, np.uint32), np.empty(columns, np.uint64)
    right_share, lower_share = np.empty(columns, np.float32), np.empty(columns, np.float32)
    for i in range(rows):
        r = top + i
        back, light = behind[i], picture[i]
        dy = np.float32(r - y)
        if abs(dy) >= reach:
            _copy(back, light)
            continue
        chord = np.sqrt(reach * reach - dy * dy)
        first = min(max(int(np.ceil(x - chord)), 0), columns)
        stop = max(min(int(np.floor(x + chord)) + 1, columns), first)
        u_first = np.float32(u0 - sine * r + cosine * first)
        v_first = np.float32(v0 + cosine * r + sine * first)
        for k in range(stop - first):
            u, v = u_first + du * np.float32(k), v_first + dv * np.float32(k)
            if period:
                u, v = u - period * np.floor(u * turns), v - period * np.floor(v * turns)
            column, row = np.int32(u), np.int32(v)
            index[k] = row * side + column
            right_share[k], lower_share[k] = u - np.float32(column), v - np.float32(row)
        inside = light[first:stop]
        _read(pairs, index, texels, inside)
        for k in range(stop - first):
            inside[k] = low + step * _between(texels, k, right_share[k], lower_share[k])
        if mask:
            _read(mask, index, texels, inside)
            for k in range(stop - first):
                cover = mask_step * _between(texels, k, right_share[k], lower_share[k])
                inside[k] += (np.float32(1.0) - cover) * back[first + k]
        else:
            rim = past = stop
            if abs(dy) < solid:
                inner = np.sqrt(solid * solid - dy * dy)
                rim, past = max(min(int(np.ceil(x - inner)), stop), first), max(int(np.floor(x + inner)) + 1, first)
            _blend_rim(back, first, rim, x, dy, reach, light)
            _blend_rim(back, past, stop, x, dy, reach, light)
        _copy(back[:first], light[:first])
        _copy(back[stop:], light[stop:])


@njit(inline="always")
def _read(pairs: int, index: NDArray[np.uint32], texels: NDArray[np.uint64], pixels: Pictures) -> None:
    """The texels around the place of each pixel, from the address `pairs`."""
    for k in range(len(pixels)):
        texels[k] = two_at(pairs + 4 * index[k])


@njit(inline="always")
def _between(texels: NDArray[np.uint64], k: int, right_share: np.float32, lower_share: np.float32) -> np.float32:
    """Pixel k's value between its four texels, in steps."""
    halves = texels.view(np.uint32)
    here, right, bits, half = halves[2 * k], halves[2 * k + 1], np.uint32(0xFFFF), np.uint32(16)
    upper_left, lower_left = np.float32(np.int32(here & bits)), np.float32(np.int32(here >> half))
    upper_right, lower_right = np.float32(np.int32(right & bits)), np.float32(np.int32(right >> half))
    to_left = upper_left + lower_share * (lower_left - upper_left)
    to_right = upper_right + lower_share * (lower_right - upper_right)
    return to_left + right_share * (to_right - to_left)  # type: ignore[no-any-return]


@njit(inline="always")
def _copy(values: Pictures, into: Pictures) -> None:
    for i in range(len(values)):
        into[i] = values[i]


@njit(cache=True, nogil=True, fastmath={"contract", "nnan", "nsz"})
def _blend_rim(
    behind: Pictures, start: int, stop: int, x: float, dy: np.float32, reach: np.float32, row: Pictures
) -> None:
    """Pixels of a row that the disk covers in part."""
    back, light = behind[start:stop], row[start:stop]
    for k in range(len(light)):
        dx = np.float32(start + k - x)
        cover = min(max(reach - np.sqrt(dx * dx + dy * dy), np.float32(0.0)), np.float32(1.0))
        light[k] = back[k] + cover * (light[k] - back[k])
