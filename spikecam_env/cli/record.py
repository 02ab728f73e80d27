"""`spikecam record`: a scene through the sensor into a file."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

from spikecam_env.checked import checked_disk, checked_memory
from spikecam_env.cli.camera import Camera
from spikecam_env.cli.options import Count, Rpm, Seed, Size
from spikecam_env.errors import InputError


@dataclass
class Record:
    """Record a simulated scene: spikes to .h5, .dat or .npz.

    example:  spikecam record --rpm 2000 --frames 4000 --effect readout_skew --out disk.h5
    """

    out: Path
    """Where to; .h5 (bit-packed with attributes), .dat (raw Vidar bits) or .npz (key `spikes`)."""
    scene: str = "disk"
    """What the camera looks at: the rotating disk, or another scene of `spikecam scenes`."""
    frames: Count = 4000
    """Spike frames to record; 40 000 are a second."""
    camera: Camera = field(default_factory=Camera)
    rpm: Rpm | None = None
    """Speed of the disk; default 2000."""
    size: Size = (250, 400)
    """Rows and columns."""
    seed: Seed = 0
    """Seed of the camera unit, its noise and the scene."""

    def run(self) -> None:
        import numpy as np
        from tqdm import trange

        from spikecam_env.cli.scene import scene_named
        from spikecam_env.cli.table import table
        from spikecam_env.sensor import SpikeSensor
        from spikecam_env.streams import SpikeWriter, save_npz, save_vidar_dat
        from spikecam_env.streams.packing import packed_bytes
        from spikecam_env.whole import check_file

        suffix = self.out.suffix.lower()
        if suffix not in (".h5", ".hdf5", ".dat", ".npz"):
            raise InputError(f"--out {self.out}: unknown file type {suffix!r}; use .h5, .dat or .npz")
        check_file(self.out)
        if suffix in (".h5", ".hdf5"):
            checked_disk(self.frames * packed_bytes(self.size), self.out, f"--frames {self.frames}")
        else:
            checked_memory(3 * self.frames * math.prod(self.size), f"--frames {self.frames} in {suffix}")
        model = self.camera.load()
        sensor = SpikeSensor(model, self.size, self.seed, engine="auto")
        scene = scene_named(self.scene, self.size, self.seed, model.frame_rate_hz, self.rpm)

        def stream():
            for start in trange(0, self.frames, 64, desc=f"record {self.scene}", unit="block", leave=False):
                count = min(64, self.frames - start)
                yield sensor.step(scene.radiance(start, start + count), count)

        spikes = 0
        if suffix in (".h5", ".hdf5"):
            attributes = {"model": model.name, "seed": self.seed, "scene": repr(scene)}
            with SpikeWriter(self.out, sensor.shape, model.frame_rate_hz, **attributes) as writer:
                for block in stream():
                    writer.append(block)
                    spikes += int(block.sum())
        else:
            blocks = np.concatenate(list(stream()))
            spikes = int(blocks.sum())
            (save_vidar_dat if suffix == ".dat" else save_npz)(self.out, blocks)
        rate = spikes / (self.frames * math.prod(self.size))
        print(table([{"file": str(self.out), "frames": self.frames, "engine": sensor.engine, "spikes/frame": rate}]))
