"""`spikecam export`: recordings with ground truth in the layout that others read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from spikecam_env.numbers import Count, Positive, Whole


@dataclass
class Export:
    """Write noisy streams and true pictures as Spike-Zoo lays them out: test/spike/*.dat, test/gt/*.png.

    A clip is cut out about a frame whose light is known, 301 frames long as Spike-Zoo's are.  White of the picture is
    light 0.6 (spikes a frame), by which Spike-Zoo divides; brighter pixels are cut, and the table says how many.

    example:  spikecam export phm --out phm-zoo
              spikecam evaluate spikezoo phm-zoo
    """

    sources: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE...")]
    """Folders of `spikecam dataset`, and .h5 recordings made with --truth-every."""
    out: Path
    """A new folder for the clips and export.json."""
    frames: Count = 301
    """Spike frames of a clip; odd."""
    clips: Count = 1
    """Clips from one recording at most, spread evenly over its frames of known light."""
    first: Whole = 0
    """First frame of a recording that a clip may have."""
    count: Count | None = None
    """Frames of a recording from there on that clips may have; default: all."""
    rate: Positive = 0.6
    """Light [spikes/frame] that is white; another one than 0.6 has to be set in Spike-Zoo's data configuration too."""
    bits: Literal[8, 16] = 8
    """Bits of a pixel of the pictures; Spike-Zoo reads the upper 8."""
    stream: Literal["spikes", "clean"] = "spikes"
    """Which stream: the noisy one, or that of the noise-free twin, which datasets hold."""

    def run(self) -> None:
        from spikecam_env.cli.table import table
        from spikecam_env.datasets.export import export_spikezoo

        done = export_spikezoo(
            self.sources,
            self.out,
            frames=self.frames,
            clips=self.clips,
            first=self.first,
            count=self.count,
            rate=self.rate,
            bits=self.bits,
            stream=self.stream,
            progress=True,
        )
        rows = [
            {
                "clip": f"{clip.split}/{clip.name}",
                "frame": clip.frame,
                "mean light [spikes/frame]": clip.light,
                "above white": f"{100 * clip.cut:.2f} %",
            }
            for clip in done
        ]
        print(table(rows))
        print(f"wrote {len(done)} clips of {self.frames} frames in {self.out}; white is {self.rate:g} spikes/frame")
