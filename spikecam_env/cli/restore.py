"""A whole recording through the online denoiser: its spikes, and pictures of its rate planes at chosen frames."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from denoiser import OnlineDnSS
from spikecam_env.errors import InputError

CHUNK = 16
"""Frames pushed at a time."""
MOST_PICTURES = 240
"""In a film: 8 seconds."""


def picture_frames(frames: int, window: int) -> list[int]:
    """Frames at the middle of whole windows, at least 8 apart and at most MOST_PICTURES of them.

    Raises InputError for a recording shorter than the window.
    """
    if frames < window:
        raise InputError(f"the recording has {frames} frames, fewer than the picture window of {window}; give --window")
    apart = max(8, -(-(frames - window + 1) // MOST_PICTURES))
    return list(range(window // 2, frames - window // 2, apart))


def restore(
    noisy: NDArray[np.uint8], mode: str, window: int, at: Sequence[int], **options: Any
) -> tuple[NDArray[np.uint8], dict[int, NDArray[np.float32]]]:
    """Denoise (T, H, W) spikes; returns the spikes and, by frame of `at`, the mean rate (H, W) over `window` frames.

    options: of the denoiser.  Rate planes are four bytes a pixel: only those of one window are held at a time.
    """
    online = OnlineDnSS.pretrained(mode, output="both", **options)
    wanted = set(at)
    recent: deque[NDArray[np.float32]] = deque(maxlen=window)
    pictures: dict[int, NDArray[np.float32]] = {}
    spikes = np.empty_like(noisy)
    ready = 0
    with tqdm(total=len(noisy), desc=f"denoise ({mode})", unit="frame", leave=False) as bar:
        for start in range(0, len(noisy) + CHUNK, CHUNK):
            fired, planes = online.push(noisy[start : start + CHUNK]) if start < len(noisy) else online.flush()
            spikes[ready : ready + len(fired)] = fired
            for frame, plane in enumerate(planes, ready):
                recent.append(plane)
                if frame - window // 2 in wanted:
                    pictures[frame - window // 2] = np.mean(recent, axis=0)
            ready += len(fired)
            bar.update(len(fired))
    return spikes, pictures
