"""Write a campaign folder: campaign.json, a .dat of bits a recording, an .npz of its light.

.dat: frames in order, rows from the top, pixels row by row, eight a byte, the first in the lowest bit.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.hidden_world.light import Light


@dataclass(frozen=True)
class Recorded:
    """A recording as it is handed over: bits (T, rows, columns) and the light it is said to have seen."""

    name: str
    use: str
    bits: NDArray[np.uint8]
    light: Light


def write_recording(folder: Path, recorded: Recorded) -> dict[str, object]:
    """Write its two files; returns its entry in campaign.json."""
    spikes, radiance = f"{recorded.name}.dat", f"{recorded.name}.npz"
    frames = len(recorded.bits)
    packed = np.packbits(recorded.bits.reshape(frames, -1), axis=1, bitorder="little")
    packed.tofile(folder / spikes)
    np.savez(folder / radiance, frame=recorded.light.key_frame, radiance=recorded.light.radiance)
    return {
        "name": recorded.name, "spikes": spikes, "frames": frames, "radiance": radiance, "use": recorded.use,
    }  # fmt: skip


def write_index(folder: Path, shape: tuple[int, int], recordings: list[dict[str, object]]) -> None:
    """Write campaign.json, last and whole: a folder with one is complete."""
    camera = {"height": shape[0], "width": shape[1], "frame_rate_hz": 40000.0}
    text = json.dumps({"format": "spikecam-campaign/1", "camera": camera, "recordings": recordings}, indent=1)
    beside = folder / "campaign.json.partial"
    beside.write_text(text + "\n", encoding="utf-8")
    os.replace(beside, folder / "campaign.json")
