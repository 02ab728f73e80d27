"""`spikecam record`: a scene through the sensor into a file."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

from spikecam_env.cli.camera import CameraOptions
from spikecam_env.cli.options import Size
from spikecam_env.cli.without_effect import WithoutEffect
from spikecam_env.numbers import Count, Rpm, Seed, Whole


@dataclass
class Record:
    """Record a simulated scene: spikes to .h5, .dat or .npz.

    example:  spikecam record --rpm 2000 --frames 4000 --effect readout_skew --out disk.h5
    """

    out: Path
    """Output file: .h5 (bits with attributes), .dat (raw Vidar bits, geometry in .dat.json) or .npz (key `spikes`)."""
    scene: str = "disk"
    """Scene: the rotating disk, or another scene of `spikecam scenes`."""
    frames: Count = 4000
    """Spike frames to record; 40 000 are a second."""
    camera: CameraOptions = field(default_factory=CameraOptions)
    rpm: Rpm | None = None
    """Speed of the disk; default 2000."""
    size: Size = (250, 400)
    """Rows and columns."""
    seed: Seed = 0
    """Seed of the camera unit, its noise and the scene."""
    truth_every: Whole | None = None
    """Frames between ground truths (radiance, flow, object number ...) in an .h5 file; 0: none.  Default: the frame in
    the middle alone, beside which `spikecam denoise` shows its pictures."""

    without_effect: ClassVar = (WithoutEffect(("rpm",), lambda c: c.scene != "disk", "{scene} has a speed of its own"),)

    def run(self) -> None:
        from spikecam_env.cli.named_scene import scene_named
        from spikecam_env.cli.recording import check_out, lit_frames, record_scene
        from spikecam_env.cli.table import table
        from spikecam_env.sensor import SpikeSensor

        check_out(self.out, self.frames, self.size, self.truth_every)
        model = self.camera.load()
        sensor = SpikeSensor(model, self.size, self.seed, engine="auto")
        scene = scene_named(self.scene, self.size, self.seed, model.frame_rate_hz, self.rpm)
        attributes: dict[str, object] = {"model": model.name, "seed": self.seed, "scene": repr(scene)}
        truth = lit_frames(self.out, self.frames, self.truth_every)
        spikes = record_scene(self.out, scene, sensor, self.frames, f"record {self.scene}", attributes, truth)
        rate = spikes / (self.frames * math.prod(self.size))
        print(table([{"file": str(self.out), "frames": self.frames, "engine": sensor.engine, "spikes/frame": rate}]))
