"""The files of a campaign, as they are written: each appears whole, and `campaign.json` last.

Sizes: a frame of spikes takes H W / 8 bytes.  Light is stored with the axes along which it changes and no others:
(1, 1, 1) for a flat, (K, 1, 1) for an even step, (K, 1, W) for upright bars.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spikecam_env.campaign.reading import FORMAT, Campaign, read_campaign
from spikecam_env.sensor import Keyframes
from spikecam_env.streams import pack_frames
from spikecam_env.whole import whole_file, write_text_whole


def save_spikes(path: Path, blocks: Iterable[ArrayLike]) -> None:
    """Blocks of (T, H, W) spikes -> one `.dat`, unflipped; only a block at a time is in memory."""
    with whole_file(path) as beside, beside.open("wb") as file:
        for block in blocks:
            file.write(pack_frames(block).data)


def save_light(path: Path, light: Keyframes) -> None:
    """Keys -> npz with `frame` (K,) float64 and `radiance` float32, in the shape it was given."""
    with whole_file(path) as beside, beside.open("wb") as file:
        np.savez_compressed(file, frame=light.frame, radiance=light.radiance)


def save_rates(path: Path, rate: NDArray[np.floating], frames: int) -> None:
    """(H, W) spikes a frame, counted over so many frames -> npz with `rate` and `frames`."""
    with whole_file(path) as beside, beside.open("wb") as file:
        np.savez_compressed(file, rate=np.asarray(rate, np.float64), frames=frames)


def finish_campaign(
    folder: Path, shape: tuple[int, int], frame_rate_hz: float, entries: Sequence[Mapping[str, Any]]
) -> Campaign:
    """Write `campaign.json` and read the campaign back; entries that are None are left out."""
    data = {
        "format": FORMAT,
        "camera": {"height": shape[0], "width": shape[1], "frame_rate_hz": frame_rate_hz},
        "recordings": [{key: value for key, value in entry.items() if _is_stated(key, value)} for entry in entries],
    }
    write_text_whole(folder / "campaign.json", json.dumps(data, indent=1) + "\n")
    return read_campaign(folder)


def _is_stated(key: str, value: Any) -> bool:
    """Whether an entry is written; a radiance of null is: an unknown static scene."""
    return key == "radiance" or (value is not None and value != "")
