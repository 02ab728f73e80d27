"""`spikecam export`: recordings with ground truth in the layout that others read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import tyro

from spikecam_env.cli.mode_weights import Brightness, Mode, brightness_for
from spikecam_env.cli.without_effect import WithoutEffect
from spikecam_env.numbers import Count, Positive, Whole

if TYPE_CHECKING:
    from spikecam_env.types import Spikes


@dataclass
class Export:
    """Write streams and their truth as others lay them out: Spike-Zoo, or SCFlow, which finds optical flow.

    spikezoo: test/spike/*.dat, test/gt/*.png.  A clip is cut out about a frame whose light is known, 301 frames long as
    Spike-Zoo's are.  White of the picture is light 0.6 (spikes a frame), by which Spike-Zoo divides; brighter pixels
    are cut, and the table says how many.

    scflow: windows of 25 frames, 10 and 20 frames apart, as test/SCENE/encoding25_dt10/*.npy.  The optical flow from
    each to the next is test/SCENE/dt=10/motion_vector/*.flo.

    example:  spikecam export phm --out phm-zoo
              spikecam evaluate spikezoo phm-zoo
              spikecam export phm --layout scflow --denoise best --out phm-scflow
    """

    sources: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE...")]
    """Folders of `spikecam dataset`, and for Spike-Zoo .h5 recordings made with --truth-every."""
    out: Path
    """A new folder for the clips or windows and export.json."""
    layout: Literal["spikezoo", "scflow"] = "spikezoo"
    """Whose layout."""
    frames: Count = 301
    """Spike-Zoo: spike frames of a clip; odd."""
    clips: Count = 1
    """Spike-Zoo: clips from one recording at most, spread evenly over its frames of known light."""
    first: Whole = 0
    """Spike-Zoo: first frame of a recording that a clip may have."""
    count: Count | None = None
    """Spike-Zoo: frames of a recording from there on that clips may have; default: all."""
    rate: Positive = 0.6
    """Spike-Zoo: light [spikes/frame] that is white; another one than 0.6 has to be set in its data configuration
    too."""
    bits: Literal[8, 16] = 8
    """Spike-Zoo: bits of a pixel of the pictures; it reads the upper 8."""
    stream: Literal["spikes", "clean"] = "spikes"
    """Which stream: the noisy one, or that of the noise-free twin, which datasets hold."""
    denoise: Mode | None = None
    """The stream goes through this denoiser first."""
    overlap: bool = False
    """With --denoise, but `paper`: passes that overlap by half: less error, twice the time."""
    ease: bool = False
    """With --denoise, but `paper`: passes eased into one another: half the flicker at their seams, in the same time."""
    brightness: Brightness = 1.0
    """With --denoise: spikes are made of rates times this, as of `spikecam denoise`; auto: a factor for each
    recording."""

    without_effect: ClassVar = (
        WithoutEffect(
            ("overlap", "ease", "brightness"), lambda c: c.denoise is None, "nothing is denoised without --denoise"
        ),
        WithoutEffect(("ease",), lambda c: c.overlap, "passes that overlap have no seams"),
        WithoutEffect(
            ("frames", "clips", "first", "count", "rate", "bits"),
            lambda c: c.layout == "scflow",
            "SCFlow's layout has no such choice",
        ),
    )

    def run(self) -> None:
        from spikecam_env.cli.table import table

        print(table(self._spikezoo() if self.layout == "spikezoo" else self._scflow()))
        print(f"wrote {self.out}" + (f"; white is {self.rate:g} spikes/frame" if self.layout == "spikezoo" else ""))

    def _spikezoo(self) -> list[dict[str, Any]]:
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
            restore=self._restore,
            progress=True,
        )
        return [
            {
                "clip": f"{clip.split}/{clip.name}",
                "frame": clip.frame,
                "mean light [spikes/frame]": clip.light,
                "above white": f"{100 * clip.cut:.2f} %",
            }
            for clip in done
        ]

    def _scflow(self) -> list[dict[str, Any]]:
        from spikecam_env.datasets.export import export_scflow

        done = export_scflow(self.sources, self.out, stream=self.stream, restore=self._restore, progress=True)
        return [
            {
                "scene": f"{scene.split}/{scene.scene}",
                "frames apart": scene.interval,
                "windows": scene.windows,
                "spikes/frame": scene.rate,
                "mean flow [pixels]": scene.flow,
            }
            for scene in done
        ]

    @property
    def _restore(self) -> Any:
        return None if self.denoise is None else self._denoised

    def _denoised(self, spikes: Spikes) -> tuple[Spikes, dict[str, Any]]:
        """Spikes through the denoiser, and for the record of the export how."""
        from denoiser import OnlineDnSS
        from spikecam_env.cli.restore import restore

        assert self.denoise is not None
        brightness = brightness_for(self.brightness, spikes)
        joined = {"overlap": self.overlap, "ease": self.ease}
        online = OnlineDnSS.pretrained(self.denoise, output="both", brightness=brightness, **joined)
        found, _, _ = restore(spikes, online, ())
        how = {"mode": self.denoise, **joined, "brightness": brightness, "saturated": online.saturated}
        return found, how
