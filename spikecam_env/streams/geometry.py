"""Whether a headerless file was read with the right geometry, by its spikes.

A pixel of a spike camera integrates light, so its spikes are regular: one that fires less than every second frame
hardly ever fires in two frames running, and one that fires more often hardly ever misses two.  Call the rarer of spike
and gap an event, b in {0, 1}.

1. Coincidence.  In blocks of BLOCK frames, over the pixels with n events in a block,

       c = events in frames t and t + 1 / (sum of n (n - 1) / BLOCK, as by chance)

   read right: 0.00;  frames of another length, so other pixels: 1.

2. Repulsion at a distance of L bits in the file.  With C(L) = sum over i of b_i b_{i+L},

       D(L) = min over d = 1..8 of (C(L - d) + C(L + d)) / 2 - C(L)

   A pixel and itself a frame later: D > 0, by many standard errors; two pixels, whatever the light: 0 or less.
   So L is the length of a frame, and frames of that length are found even where nobody knows it.

3. Rows.  The mean picture m as one line: its correlation at a distance W, the length of a row, is the largest among
   the lengths that a row can have.

4. Bits.  In bytes of the other bit order the neighbours across a byte's edge lie 15 pixels apart: m differs less
   between pixels 15 apart than between those that seem neighbours.

Each speaks only where there is enough to see: a dark recording, two frames or a picture without structure say nothing.
`python -m pytest -s tests/streams/test_geometry.py` prints these figures of recordings read right and wrong.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy

from spikecam_env.streams.packing import BitOrder, packed_bytes
from spikecam_env.types import Floats, Spikes

KNOWN_SHAPES = (
    (250, 400),
    (250, 416),
    (500, 800),
    (250, 250),
    (1000, 1000),
    (256, 448),
    (400, 600),
    (480, 640),
    (360, 640),
)
"""(rows, columns) of cameras, dumps and public simulations: Vidar, Vidar with the padding of its USB dumps, SPIFT and
PHM, UHSR, SPS100, and simulated sets (loaders of SpikeCV, Spike-Zoo and others)."""

BLOCK = 16
"""Frames in which a pixel's light is taken as steady."""
FEWEST_CHANCES = 20.0
"""Coincidences that chance must have given before their absence, or presence, says anything."""
MANY_CHANCES = 500.0
"""The same, where nothing but the coincidences speaks against a reading."""
COINCIDES = 0.5
"""c above: read wrong.  Read right 0.00 to 0.04, wrong 0.5 to 1.7."""
LIKE_CHANCE = 1.15
"""Largest ratio of c to 1, either way and beyond three standard errors, of events that nothing orders.  Bright textures
that move fast reach 1.2 to 1.4 in a file read right."""
SURE = 8.0
"""Standard errors of D beyond which it is no chance; the search sees some million lengths."""
WIDTH_MARGIN = 0.15
"""By how much the correlation of rows of another length must be larger."""
TURNED = 0.7
"""Ratio of squared differences 15 pixels apart and across a byte's edge; right order 0.95 and more, wrong to 0.55."""
DEEP, SHALLOW = 0.2, 0.003
"""Share of the chance coincidences that is missing at the length of a frame: where it is looked for, and where the
reading says it is (light that flickers within a block of frames leaves little)."""
MOST_TRIED = 12
"""Lengths that the search looks at closely, the shortest first."""
LAGS = 6
"""Distances [frames] at which coincidences are counted."""
DIM = 0.02
"""Rate [spikes/frame] below which spikes may be noise, independent from frame to frame, in a file read right."""
MOST_BITS = 1 << 23
"""Bits of a file that are looked at."""
SEARCHED = 1 << 21
"""Bits that the search for the length of a frame looks at; frames of up to 1.5 million pixels."""
STRETCH = 3.0
"""Largest ratio of a picture's sides that is looked for."""


@dataclass(frozen=True)
class Doubt:
    """A fault of a reading."""

    text: str
    sizes: tuple[tuple[int, int], ...] = ()
    """(rows, columns) that would be right, as far as they are known."""

    def __str__(self) -> str:
        if not self.sizes:
            return self.text
        return f"{self.text}; looks right: {', '.join(f'height={h}, width={w}' for h, w in self.sizes)}"


def geometry_doubt(packed: Spikes, shape: tuple[int, int], bit_order: BitOrder = "little") -> Doubt | None:
    """The doubt that frames (T, ceil(H W / 8)) of a file are of this shape and bit order; None where there is none."""
    if len(packed) < 2:
        return None
    one = _byte_of_a_pixel(packed, shape)
    if one:
        return Doubt(f"its bytes are all 0 or {one}: one byte a pixel, not one bit; name it .raw to read it so")
    lag, pixels = 8 * packed.shape[1], shape[0] * shape[1]
    bits = np.unpackbits(packed[: max(2, MOST_BITS // lag)].ravel(), bitorder=bit_order)
    shorter = _shorter_frame(bits, lag)
    if shorter is not None:
        return Doubt(
            f"spikes of a pixel repel within a frame, {shorter // 8} bytes apart: frames are shorter",
            _sizes(bits, shorter),
        )
    by_lag = coincidences(bits, lag)
    if by_lag.chance > FEWEST_CHANCES and by_lag.next_frame > COINCIDES and not repels(bits, lag, SHALLOW):
        return _other_length(bits, lag, by_lag)
    picture = bits.reshape(-1, lag)[:, :pixels].mean(axis=0)
    width = row_length(picture, shape)
    if width != shape[1]:
        return Doubt(f"rows look {width} pixels long", ((pixels // width, width),))
    if bits_turned(picture):
        other = "big" if bit_order == "little" else "little"
        return Doubt(f"pixels look turned about in every byte; bit_order={other!r} looks right")
    return None


def looks_right(packed: Spikes, bit_order: BitOrder = "little") -> bool:
    """Whether frames (T, bytes) of a file have the length that they should: their spikes say so, beyond chance."""
    lag = 8 * packed.shape[1]
    bits = np.unpackbits(packed[: max(2, MOST_BITS // lag)].ravel(), bitorder=bit_order)
    return repels(bits, lag) and _regular(bits, lag) and _shorter_frame(bits, lag) is None


@dataclass(frozen=True)
class Coincidences:
    """How often events of a pixel coincide, beside chance."""

    chance: float
    """Coincidences in successive frames that chance would give."""
    c: Floats
    """(LAGS,) coincidences over those of chance, 1 .. LAGS frames apart."""
    by_part: tuple[tuple[float, float], ...] = ()
    """The same two, of successive frames, for each stretch of the frame that has enough of them."""

    @property
    def next_frame(self) -> float:
        return float(self.c[0])

    @property
    def independent(self) -> bool:
        """Whether events come as chance has it at every distance and everywhere, as of other pixels, or of no camera.

        In light that moves and is above one spike a frame they come in runs in some places, and apart in others.
        """
        found = [*((self.chance, c) for c in self.c), *self.by_part]
        return all(abs(math.log(max(c, 1e-9))) < math.log(LIKE_CHANCE) + 3 / math.sqrt(n) for n, c in found)


def coincidences(bits: Spikes, lag: int) -> Coincidences:
    """The module's rule 1, for frames of `lag` bits, one after the other in `bits`; 0 where nothing is known."""
    frames = bits[: len(bits) // lag * lag].reshape(-1, lag)[:256]
    block = min(BLOCK, len(frames))
    if block < 4:
        return Coincidences(0.0, np.zeros(LAGS))
    seen, chance, by_part = np.zeros(LAGS), 0.0, []
    for start, stop in _parts(lag):
        part = frames[: len(frames) // block * block, start:stop].reshape(-1, block, stop - start)
        count = part.sum(axis=1, dtype=np.int64)
        often = count > block / 2
        events = part ^ often[:, None]
        n = np.where(often, block - count, count)
        found = [np.count_nonzero(events[:, k:] & events[:, : block - k]) / (block - k) for k in _lags(block)]
        seen += np.pad(found, (0, LAGS - len(found)), constant_values=found[-1])
        here = float((n * (n - 1)).sum()) / (block * (block - 1))
        chance += here
        if here * (block - 1) > 5 * FEWEST_CHANCES:
            by_part.append((here * (block - 1), found[0] / here))
    return Coincidences(chance * (block - 1), seen / chance if chance else np.zeros(LAGS), tuple(by_part))


def repels(bits: Spikes, lag: int, least: float = DEEP) -> bool:
    """Whether bits this far apart repel as a pixel and itself a frame later do.

    Args:
        bits: (n,) of the file.
        lag: distance [bits].
        least: share of the chance coincidences, rate^2, that has to be missing.
    """
    rate = float(bits.mean())
    rarer, rate = (bits, rate) if rate <= 0.5 else (1 - bits, 1 - rate)
    length = min(len(rarer) - lag - 16, MOST_BITS // 2)
    if length < 64:
        return False

    def together(d: int) -> int:
        return int(np.count_nonzero(rarer[8 : 8 + length] & rarer[lag + 8 + d : lag + 8 + d + length]))

    here = together(0)
    depths = []
    for d in range(1, 9):
        depths.append((together(-d) + together(d)) / 2 - here)
        lowest, about = min(depths), min(depths) + here
        if lowest <= least * rate**2 * length or lowest < SURE * math.sqrt(1.5 * about) or about < FEWEST_CHANCES:
            return False
    return lowest > 0.5 * float(np.mean(depths))


def frame_length(bits: Spikes) -> int | None:
    """The shortest distance [bits], a whole number of bytes, at which bits repel; None where there is none."""
    flow = bits[:SEARCHED]
    rate = float(flow.mean())
    size = len(flow)
    if size < 256 or not 0 < rate < 1:
        return None
    padded = scipy.fft.next_fast_len(2 * size, real=True)
    spectrum = scipy.fft.rfft(flow.astype(np.float32) - np.float32(rate), padded)
    together = scipy.fft.irfft(spectrum.real**2 + spectrum.imag**2, padded)[: size * 3 // 4]
    lags = np.arange(64, len(together) - 8, 8)
    about = np.min([(together[lags - d] + together[lags + d]) / 2 for d in range(1, 9)], axis=0)
    pairs = size - lags
    depth = (about - together[lags]) / pairs
    sure = depth > SURE * rate * (1 - rate) * np.sqrt(1.5 / pairs)
    deepest = np.sort(depth[sure])[-64:] if sure.any() else np.empty(0)
    if not deepest.size:
        return None
    for lag in lags[sure & (depth > 0.4 * float(np.median(deepest)))][:MOST_TRIED]:
        if repels(bits, int(lag)) and _regular(bits, int(lag)):
            return int(lag)
    return None


def row_length(picture: Floats, shape: tuple[int, int]) -> int:
    """Pixels in a row: the width of `shape`, unless the rows of another size of as many pixels agree much better."""
    pixels, width = picture.size, shape[1]
    others = {*_sides(pixels), *(w for h, w in KNOWN_SHAPES if h * w == pixels)}
    step = 2 if _correlation(picture, 2) > _correlation(picture, 1) else 1  # a mosaic of filters repeats every 2 pixels
    found = {w: _correlation(picture, step * w) for w in sorted({width, *others}) if step * w < pixels}
    best = max(found, key=lambda w: found[w], default=width)
    margin = max(WIDTH_MARGIN, 8 / math.sqrt(pixels))
    return best if found.get(best, 0.0) > found.get(width, 0.0) + margin else width


def bits_turned(picture: Floats) -> bool:
    """Whether the pixels of every byte stand in the other order."""
    parts = 32
    each = (len(picture) // 8 - 1) // parts
    if each < 4:
        return False
    byte = _clipped(picture)[: len(picture) // 8 * 8].reshape(-1, 8)
    inside = float(((byte[:, 1:] - byte[:, :-1]) ** 2).mean())
    across, far = (byte[:-1, 7] - byte[1:, 0]) ** 2, (byte[:-1, 0] - byte[1:, 7]) ** 2
    more = (across - far)[: parts * each].reshape(parts, each).mean(axis=1)
    sure = more.mean() > 3 * more.std(ddof=1) / math.sqrt(parts)
    return bool(sure and max(inside, float(far.mean())) < TURNED * float(across.mean()))


def _byte_of_a_pixel(packed: Spikes, shape: tuple[int, int]) -> int:
    """1 or 255 where bytes are that or 0, and change from frame to frame; else 0."""
    some = packed[: max(2, MOST_BITS // (8 * packed.shape[1]))]
    if shape[0] * shape[1] < 16 or np.array_equal(some[0], some[-1]):
        return 0
    values = np.bincount(some.ravel(), minlength=256)
    return next((one for one in (1, 255) if values[one] > 100 and values[0] + values[one] == some.size), 0)


def _other_length(bits: Spikes, lag: int, by_lag: Coincidences) -> Doubt | None:
    """The doubt where spikes coincide: another length of a frame, or none; no doubt where the light may do it."""
    length = frame_length(bits)
    seen = (
        f"spikes of a pixel in successive frames coincide {by_lag.next_frame:.2f} times as often as by chance "
        "(read right: 0.00)"
    )
    if length is not None and length != lag:
        return Doubt(f"{seen}; frames look {length // 8} bytes long", _sizes(bits, length))
    noise = min(bits.mean(), 1 - bits.mean()) < DIM
    if length is None and by_lag.independent and by_lag.chance > MANY_CHANCES and not noise:
        return Doubt(f"{seen}, and no other length of a frame does better")
    return None


def _shorter_frame(bits: Spikes, lag: int) -> int | None:
    """A whole part of a frame after which bits repel already; None where there is none."""
    for parts in range(16, 1, -1):
        if lag % (8 * parts) == 0 and repels(bits, lag // parts) and _regular(bits, lag // parts):
            return lag // parts
    return None


def _regular(bits: Spikes, lag: int) -> bool:
    """Whether frames of `lag` bits do not coincide, as far as can be said."""
    found = coincidences(bits, lag)
    return found.chance < FEWEST_CHANCES or found.next_frame < COINCIDES


def _sizes(bits: Spikes, lag: int) -> tuple[tuple[int, int], ...]:
    """Sizes whose frames take so many bits: known ones, else the one whose rows agree best."""
    known = tuple(size for size in KNOWN_SHAPES if 8 * packed_bytes(size) == lag)
    if known:
        return known
    picture = bits[: len(bits) // lag * lag].reshape(-1, lag).mean(axis=0)
    heights = {w: pixels // w for pixels in range(lag, lag - 8, -1) for w in _sides(pixels)}
    agree = {w: _correlation(picture, w) for w in heights}
    best = max(agree, key=lambda w: agree[w], default=0)
    return ((heights[best], best),) if best and agree[best] > 2 * WIDTH_MARGIN else ()


def _sides(pixels: int) -> list[int]:
    """Lengths of rows that make whole pictures of so many pixels, not too long and not too high."""
    widths = range(max(8, math.isqrt(int(pixels / STRETCH))), math.isqrt(int(pixels * STRETCH)) + 1)
    return [w for w in widths if pixels % w == 0]


def _lags(block: int) -> range:
    return range(1, min(LAGS, block - 2) + 1)


def _parts(lag: int) -> list[tuple[int, int]]:
    """Eight stretches of pixels, spread over a frame of `lag`."""
    size = min(lag // 8 or lag, 2048)
    return [(start, start + size) for start in range(0, lag - size + 1, max(1, (lag - size) // 7 or lag))][:8]


def _correlation(picture: Floats, distance: int) -> float:
    centred = _clipped(picture)
    centred = centred - centred.mean()
    power = float((centred * centred).mean())
    return float((centred[:-distance] * centred[distance:]).mean()) / power if power else 0.0


def _clipped(picture: Floats) -> Floats:
    """Without the tails that hot and dead pixels make."""
    low, high = np.percentile(picture, (1, 99))
    return np.clip(picture, low, high)
