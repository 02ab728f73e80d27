"""Spike-Zoo's layout: a clip is a stream of spikes and the picture at its middle.

    <folder>/test/spike/NAME.dat    bits, eight pixels a byte, the first in the lowest, bottom row first
    <folder>/test/gt/NAME.png       grey values 0 .. 1 = light / RATE at frame T // 2, of 8 bits

`train` beside `test` is laid out in the same way.  Spike-Zoo divides a rate [spikes/frame] by RATE, cuts it to [0, 1]
and compares it with the picture; its clips hold 301 frames of 250 x 400, of which its networks see the middle 41.

Source: K. Chen et al., https://github.com/chenkang455/Spike-Zoo (v0.2.3), `datasets/base_dataset.py`,
`utils/spike_utils.py`, `pipeline/base_pipeline.py`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from scenes.film.pictures import read_picture
from spikecam_env.checked import checked_number
from spikecam_env.errors import InputError
from spikecam_env.names import file_name
from spikecam_env.streams import load_vidar_dat, save_vidar_dat
from spikecam_env.whole import whole_file

RATE = 0.6
"""Spikes a frame of white, in its REDS clips: mean rate over mean picture is 0.597 in the one measured."""
WHITES = (1e-3, 10.0)
"""Least and greatest white [spikes/frame]: below, every spike is white; above, all that a pixel reports, one spike a
frame, is a tenth of white and less."""
CLIP_FRAMES = 301
"""Frames of its REDS clips."""
GREY = np.array([0.299, 0.587, 0.114], np.float32)
"""Grey of red, green, blue (BT.601), as OpenCV has it."""
Bits = Literal[8, 16]
"""Of a pixel of the picture.  Spike-Zoo itself reads the upper 8."""


@dataclass(frozen=True)
class Clip:
    """A stream and its picture, by name."""

    name: str
    spikes: Path
    picture: Path


def find_clips(folder: str | Path) -> list[Clip]:
    """The clips of a folder that holds spike/ and gt/, or test/ with them, in the order of their names.

    Raises:
        InputError: where there is no such folder, no .dat in it, or a stream without its picture.
    """
    root = Path(folder)
    root = root if (root / "spike").is_dir() else root / "test"
    if not (root / "spike").is_dir():
        raise InputError(f"{folder} has no folder spike, nor test/spike; give one that holds spike/*.dat and gt/*.png")
    streams = sorted((root / "spike").glob("*.dat"))
    if not streams:
        raise InputError(f"{root / 'spike'} holds no .dat file")
    clips = [Clip(path.stem, path, root / "gt" / f"{path.stem}.png") for path in streams]
    for clip in clips:
        if not clip.picture.is_file():
            raise InputError(f"{clip.spikes} has no picture {clip.picture}; each stream needs one of the same name")
    return clips


def read_clip(clip: Clip) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Spikes (T, H, W) uint8, upright, and the picture (H, W) in [0, 1], which gives rows and columns.

    Raises:
        InputError: as of `read_picture` and `load_vidar_dat`.
    """
    stored = read_picture(clip.picture).values
    picture = stored if stored.ndim == 2 else stored[..., :3] @ GREY
    height, width = picture.shape
    return load_vidar_dat(clip.spikes, height=height, width=width, flip=True), picture.astype(np.float32)


def write_clip(
    folder: str | Path, name: str, spikes: ArrayLike, light: NDArray[np.floating], rate: float = RATE, bits: Bits = 8
) -> float:
    """Write a clip into spike/ and gt/ of a folder.

    Args:
        folder: made if needed.
        name: of the clip.
        spikes: (T, H, W).
        light: (H, W) at frame T // 2 [spikes/frame].
        rate: light that is white [spikes/frame].
        bits: of a pixel of the picture.

    Returns:
        Share of pixels whose light is cut at white.

    Raises:
        InputError: for a name that is no file's, a rate out of range (WHITES), and frames of no whole bytes, which
            Spike-Zoo cannot read.
    """
    rate = checked_number(rate, "rate", *WHITES, unit="spikes/frame")
    file_name(name, "clip name")
    if light.size % 8:
        raise InputError(f"frames have {light.shape[0]} x {light.shape[1]} pixels; Spike-Zoo reads multiples of 8")
    for kind in ("spike", "gt"):
        (Path(folder) / kind).mkdir(parents=True, exist_ok=True)
    save_vidar_dat(Path(folder) / "spike" / f"{name}.dat", spikes, flip=True)
    white = 2**bits - 1
    values = np.rint(np.clip(np.asarray(light, np.float64) / rate, 0.0, 1.0) * white)
    with whole_file(Path(folder) / "gt" / f"{name}.png") as beside:
        Image.fromarray(values.astype(np.uint8 if bits == 8 else np.uint16)).save(beside)
    return float((light > rate).mean())
