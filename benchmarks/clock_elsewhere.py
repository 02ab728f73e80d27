"""Does the wall's disturbance by the clock show in the other recordings: the flat maps, and the low-light one?

    python -m benchmarks.clock_elsewhere REAL

Both are set beside pixels simulated spike by spike (`benchmarks/clock/pixels.py`) at the recordings' own rates,
without and with the edge and the skew that the wall has (docs/clock_feedthrough.md).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray

from benchmarks.clock.pixels import POINTS, counts, falling_edge, recorded, tabled
from benchmarks.clock_feedthrough import MOST_SPREAD, static_pixels
from spikecam_env.calibration.flat_maps import FRAMES, FlatMaps, read_flat_maps
from spikecam_env.calibration.real import MAPS, plausible_rates
from spikecam_env.calibration.spike_times import spike_times
from spikecam_env.calibration.two_levels import split_shading, two_levels
from spikecam_env.errors import InputError
from spikecam_env.streams import pack_frames
from spikecam_env.types import Floats
from spikecam_env.untrusted import read_arrays

EDGE = (-9.3e-3, 0.798, 0.240, 0.0)
"""amplitude [thresholds], moment at row 155, tau, fall [frames]: the wall's, by docs/clock_feedthrough.md."""
SPAN, ROW = -1.082, 155
"""Frames for 250 rows, and the row that EDGE's moment is of."""
WHITE = 3.3e-5
"""s^2, of the same fit."""

LOW_LIGHT = "helicopter_low_light.npz"
BAND = 50
"""Rows of a line of the low-light table."""


def wall_table(edge: tuple[float, float, float, float] = EDGE) -> Floats:
    return falling_edge(np.arange(POINTS) / POINTS, *edge)


def wall_start(rows: int) -> Floats:
    """(rows,) phases at which rows begin, on the clock of EDGE: v = t + s (row - 155) / 250 at a row's own time t."""
    return np.asarray(np.mod(SPAN * (np.arange(rows) - ROW) / 250.0, 1.0))


LAWS = {"without c(v)": None, "with c(v)": wall_table()}


def simulated_maps(maps: FlatMaps, table: Floats, seed: int = 0) -> FlatMaps:
    """Counts of the same pixels at both levels and in the dark, their rates free of c drawn within a count."""
    shape, rng = maps.lit.shape, np.random.default_rng(seed)
    start = np.repeat(wall_start(shape[0]), shape[1])
    dim = np.where(maps.counted, maps.dim, np.median(maps.dim[maps.counted]))

    def again(level: Floats) -> Floats:
        rate = np.maximum(level + (rng.random(shape) - 0.5) / FRAMES, 0.1 / FRAMES).ravel()
        return counts(1.0 / rate, start, table, WHITE, FRAMES, rng).reshape(shape) / FRAMES

    return FlatMaps(again(maps.lit), again(dim), again(maps.dark), maps.counted)


def smooth_maps(maps: FlatMaps, table: Floats, seed: int = 0) -> FlatMaps:
    """The same of pixels that differ by gain alone, independent of their neighbours, and the maps' shading."""
    gain = 1.0 + two_levels(maps).gain * np.random.default_rng(seed).standard_normal(maps.lit.shape)
    dim = np.where(maps.counted, maps.dim, np.median(maps.dim[maps.counted]))
    lit, dim = (split_shading(level - maps.dark)[0] * gain + maps.dark for level in (maps.lit, dim))
    return simulated_maps(FlatMaps(lit, dim, maps.dark, np.ones_like(maps.counted)), table, seed)


def gathered(level: Floats, interval: int) -> float:
    """Pixels whose counts are those of a whole interval, over what the counts 2 to 12 beside these lead to expect."""
    n = np.round(level[np.isfinite(level)] * FRAMES).astype(np.int64)
    low = FRAMES // interval
    at = np.isin(n, (low, low + 1)).sum()
    beside = ((n >= low - 10) & (n <= low + 11)).sum() - at
    return float(10.0 * at / max(beside, 1))


def next_to_each_other(level: Floats) -> Floats:
    """Correlation of a map's grain, the shading removed, with that of the next pixel along the row, down the column."""
    level = np.where(np.isfinite(level), level, np.nanmedian(level))
    grain = level / split_shading(level)[0] - 1.0
    grain = np.clip(grain, -0.15, 0.15)
    pairs = ((grain[:, 1:], grain[:, :-1]), (grain[1:], grain[:-1]))
    return np.array([np.corrcoef(a.ravel(), b.ravel())[0, 1] for a, b in pairs])


def print_maps(folder: Path) -> None:
    maps = read_flat_maps(folder / MAPS)
    print(
        f"flat maps, {FRAMES} frames: pixels at a whole interval over what counts beside it lead to expect; 1 is none"
    )
    print("".ljust(16) + "335 lux: 6 frames".rjust(20) + "153 lux: 11".rjust(14) + "12 frames".rjust(12))
    worlds = {"real": maps, **{name: simulated_maps(maps, tabled(table)) for name, table in LAWS.items()}}
    for name, seen in worlds.items():
        print(
            name.ljust(16)
            + f"{gathered(seen.lit, 6):20.2f}{gathered(seen.dim, 11):14.2f}{gathered(seen.dim, 12):12.2f}"
        )
    print(
        "\nneighbours' correlation, along rows / down columns; spreads; offset [counts].  Simulated: independent pixels"
    )
    worlds = {"real": maps, **{name: smooth_maps(maps, tabled(table)) for name, table in LAWS.items()}}
    for name, seen in worlds.items():
        levels, lit, dim = two_levels(seen), next_to_each_other(seen.lit), next_to_each_other(seen.dim)
        print(
            f"{name:16s}335 lux {lit[0]:+.3f} /{lit[1]:+.3f}, spread {levels.lit:.2%};"
            f" 153 lux {dim[0]:+.3f} /{dim[1]:+.3f}, spread {levels.dim:.2%}; offset {levels.offset:.1f}"
        )
    for name, level in (("335 lux", maps.lit), ("153 lux", maps.dim), ("dark", maps.dark)):
        edges = {
            "row 0": level[0],
            "row 1": level[1],
            "column 0": level[:, 0],
            "column 1": level[:, 1],
            "last row": level[-1],
            "last column": level[:, -1],
        }
        beside = {
            "row 0": level[2:6],
            "row 1": level[2:6],
            "column 0": level[:, 2:6],
            "column 1": level[:, 2:6],
            "last row": level[-5:-1],
            "last column": level[:, -5:-1],
        }
        ratios = [f"{k} {np.nanmedian(v) / np.nanmedian(beside[k]) - 1:+.1%}" for k, v in edges.items()]
        print(f"{name}, median over that of the next four rows or columns: {', '.join(ratios)}")


def read_low_light(folder: Path) -> NDArray[np.uint8]:
    """(T, rows, columns) spikes; Raises InputError for another shape."""
    spikes = read_arrays(folder / LOW_LIGHT, ("spk",))["spk"]
    if spikes.ndim != 3:
        raise InputError(f"{folder / LOW_LIGHT}: spk has {spikes.ndim} axes; it must be (frames, rows, columns)")
    return np.ascontiguousarray(spikes, dtype=np.uint8)


def second_difference(spikes: NDArray[np.uint8], slow: NDArray[np.bool_]) -> list[tuple[int, float, float]]:
    """By band of (T, rows, columns) spikes: static pixels of `slow`, their mean A_1 [frames^2], its standard error."""
    rows, columns = spikes.shape[1:]
    times = spike_times(pack_frames(spikes), rows * columns, (1,))
    row = np.repeat(np.arange(rows), columns)
    slow = slow & static_pixels(spikes) & (times.terms[:, 0] > 0)
    lines = []
    for first in range(0, rows, BAND):
        part = slow & (row // BAND == first // BAND)
        square, terms = times.square[part, 0], times.terms[part, 0]
        mean = square.sum() / terms.sum()
        lines.append((int(part.sum()), float(mean), float(np.sqrt(((square - mean * terms) ** 2).sum()) / terms.sum())))
    return lines


def print_low_light(folder: Path) -> None:
    spikes = read_low_light(folder)
    frames, rows, columns = spikes.shape
    times = spike_times(pack_frames(spikes), rows * columns, (1,))
    slow = (times.count >= 5) & (times.count <= 10)
    tables = {"real": second_difference(spikes, slow)}
    for name, table in LAWS.items():
        rng = np.random.default_rng(0)
        start = np.repeat(wall_start(rows), columns)
        made = recorded(1.0 / plausible_rates(times, WHITE, rng), start, tabled(table), WHITE, frames, rng)
        tables[name] = second_difference(made.reshape(spikes.shape), slow)
    print(f"\nlow light: of the {slow.sum()} pixels of 5 to 10 spikes in {frames} frames those whose N(t) leaves")
    print(f"its line by less than {MOST_SPREAD} spikes, number and A_1 [frames^2] by rows")
    print("rows".ljust(10) + "".join(name.rjust(24) for name in tables))
    for b, first in enumerate(range(0, rows, BAND)):
        cells = [f"{t[b][0]:6d}{t[b][1]:9.3f} ± {t[b][2]:.3f}".rjust(24) for t in tables.values()]
        print(f"{first}-{first + BAND - 1}".ljust(10) + "".join(cells))


def main(folder: tyro.conf.Positional[Path]) -> None:
    """Print what the flat maps and the low-light recording in `folder` have of the wall's edge."""
    print_maps(folder)
    print_low_light(folder)


if __name__ == "__main__":
    tyro.cli(main)
