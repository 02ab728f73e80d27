"""The paper's validation figure: simulated streams beside the real wall, at matched rates.

    python -m benchmarks.paper_figure REAL --out validation.png

Five patches of bare wall stand for the paper's five grey levels.  Cameras: an ideal one (as SPCS), SCSim, `measured`,
for 0.1 s each under flat light that gives them the patch's mean rate; the real one for the 500 frames that there are.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy import ndimage

from spikecam_env.calibration.real import read_wall
from spikecam_env.sensor import SensorModel, SpikeSensor
from spikecam_env.whole import whole_file

CAMERAS = {"SPCS-like (ideal)": "ideal", "SCSim": "scsim", "measured": "measured"}
PATCH = (18, 34)
"""Rows and columns of a patch: small against the shading, large against the pixels' spread."""
LEVELS = 5
FRAMES = 4000
PRESSED = 10
"""Frames pressed onto a surface in the spike pattern, as in the paper."""


@dataclass(frozen=True)
class Stream:
    """One camera at one level.  mean, spread: of its pixels' rates [spikes/frame].  share: of intervals 0 .. 12."""

    camera: str
    level: float
    mean: float
    spread: float
    share: NDArray[np.float64]


def validation_streams(wall: NDArray[np.uint8], frames: int = FRAMES) -> list[Stream]:
    """Every camera at every level; wall: (T, rows, columns) spikes."""
    streams = []
    for patch in grey_patches(wall):
        level = float(patch.mean())
        streams.append(_summary("real wall", level, patch))
        for label, preset in CAMERAS.items():
            streams.append(_summary(label, level, _flat(preset, level, frames)))
    return streams


def grey_patches(wall: NDArray[np.uint8]) -> list[NDArray[np.uint8]]:
    """LEVELS patches (T, rows, columns) of the wall, from dim to bright, the evenest near each level."""
    rows, columns = PATCH
    corners = [
        (y, x)
        for y in range(0, wall.shape[1] - rows + 1, rows // 2)
        for x in range(0, wall.shape[2] - columns + 1, columns // 2)
    ]
    rate = wall.mean(axis=0)
    smooth = ndimage.gaussian_filter(rate, 4)
    means = np.array([rate[y : y + rows, x : x + columns].mean() for y, x in corners])
    uneven = np.array([smooth[y : y + rows, x : x + columns].std() for y, x in corners]) / means
    chosen = []
    dim, bright = np.quantile(means, [0.03, 0.97])
    for level in np.linspace(dim, bright, LEVELS):
        cost = np.abs(means / level - 1) + uneven
        y, x = corners[int(np.argmin(cost))]
        chosen.append(wall[:, y : y + rows, x : x + columns])
    return chosen


def _flat(preset: str, level: float, frames: int) -> NDArray[np.uint8]:
    """Spikes of a patch-sized camera under flat light whose mean rate is `level`."""
    sensor = SpikeSensor(_without_shading(preset), PATCH, seed=1, engine="auto")
    light = (level - sensor.unit.dark.mean()) / sensor.unit.gain.mean()
    return sensor.step(np.full(PATCH, light, np.float32), frames)


def _without_shading(preset: str) -> SensorModel:
    """The wall's rates have the real camera's shading in them; a patch is too small to have its own."""
    model = SensorModel.preset(preset)
    return model.without("vignetting") if any(e.name == "vignetting" for e in model.effects) else model


def _summary(camera: str, level: float, spikes: NDArray[np.uint8]) -> Stream:
    rate = spikes.mean(axis=0)
    pixel, frame = np.nonzero(spikes.reshape(len(spikes), -1).T)
    intervals = np.diff(frame)[np.diff(pixel) == 0]
    share = np.bincount(np.minimum(intervals, 12), minlength=13) / intervals.size
    return Stream(camera, level, float(rate.mean()), float(rate.std()), share)


def spike_patterns(wall: NDArray[np.uint8]) -> dict[str, NDArray[np.int64]]:
    """Spikes of PRESSED frames, added up, of the wall and of each camera under the wall's smoothed light."""
    first = len(wall) // 2
    patterns = {"real wall": wall[first : first + PRESSED].sum(axis=0, dtype=np.int64)}
    light = ndimage.gaussian_filter(wall.mean(axis=0), 3).astype(np.float32)
    for label, preset in CAMERAS.items():
        sensor = SpikeSensor(_without_shading(preset), light.shape, seed=1, engine="auto")
        scaled = np.maximum(light - sensor.unit.dark.mean(), 0) / sensor.unit.gain.mean()
        sensor.step(scaled.astype(np.float32), 64)
        patterns[label] = sensor.step(scaled.astype(np.float32), PRESSED).sum(axis=0, dtype=np.int64)
    return patterns


def draw(streams: list[Stream], patterns: dict[str, NDArray[np.int64]]) -> Figure:
    """Spikes per sampling, interval histograms, spike patterns."""
    figure = Figure(figsize=(15, 10.5), layout="constrained")
    top, middle, bottom = np.ravel(np.array(figure.subfigures(3, 1, height_ratios=[1.0, 1.0, 1.25])))
    cameras = list(patterns)
    levels = sorted({s.level for s in streams})
    mean, spread = top.subplots(1, 2)
    for i, camera in enumerate(cameras):
        mine = [s for s in streams if s.camera == camera]
        x = np.arange(len(levels)) + 0.2 * (i - 1.5)
        mean.bar(x, [s.mean for s in mine], 0.19, yerr=[s.spread for s in mine], label=camera, error_kw={"lw": 0.8})
        spread.bar(x, [100 * s.spread / s.mean for s in mine], 0.19, label=camera)
    for axis in (mean, spread):
        axis.set_xticks(range(len(levels)), [f"level {i + 1}" for i in range(len(levels))])
    mean.set(title="(a) spikes per sampling and pixel; bar: spread over pixels", ylabel="spikes / frame")
    spread.set(title="(a') that spread over the mean", ylabel="%")
    mean.legend(fontsize=8, loc="upper left")
    for axis, level in zip(middle.subplots(1, len(levels), sharey=True), levels, strict=True):
        for i, camera in enumerate(cameras):
            stream = next(s for s in streams if s.camera == camera and s.level == level)
            axis.bar(np.arange(13) + 0.2 * (i - 1.5), stream.share, 0.2)
        axis.set(title=f"(b) at {level:.3f} spikes/frame", xlabel="interval [frames]", xlim=(2, 10))
    highest = max(int(p.max()) for p in patterns.values())
    for axis, camera in zip(bottom.subplots(2, 2).flat, cameras, strict=True):
        axis.imshow(patterns[camera], cmap="gray", vmin=0, vmax=highest, interpolation="nearest")
        axis.set(title=f"(c) {camera}: {PRESSED} frames pressed together", xticks=[], yticks=[])
    return figure


def main(folder: tyro.conf.Positional[Path], out: Path = Path("validation.png")) -> None:
    """Draw the figure from the real recordings in `folder`, and print what is in it."""
    wall = read_wall(folder)
    streams = validation_streams(wall)
    with whole_file(out) as beside:
        draw(streams, spike_patterns(wall)).savefig(beside, dpi=90, format="png")
    print("level    camera               spikes/frame  spread   share of intervals of 3 .. 8 frames")
    for s in streams:
        shares = "".join(f"{v:7.3f}" for v in s.share[3:9])
        print(f"{s.level:.4f}   {s.camera:20s} {s.mean:12.4f} {s.spread / s.mean:7.2%} {shares}")
    print(f"wrote {out}")


if __name__ == "__main__":
    tyro.cli(main)
