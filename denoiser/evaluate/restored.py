"""Whole streams through a denoiser, for the tests that judge it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from denoiser.online import OnlineDnSS

CHUNK = 16
"""Frames pushed at a time."""
Weights = Mapping[str, str | os.PathLike[str]]
"""Checkpoint by mode, instead of the shipped ones."""


class Restored(NamedTuple):
    """A denoised stream."""

    spikes: NDArray[np.uint8]
    """(T, H, W)."""
    rates: NDArray[np.float32]
    """(T, H, W) [spikes/frame]."""
    whole: int
    """Frames, from the first, that came out before the stream's end was known."""


def denoisers(modes: Sequence[str], weights: Weights | None = None) -> dict[str, OnlineDnSS]:
    """A denoiser of each mode, which gives both spikes and rates; InputError as `OnlineDnSS`."""
    given = weights or {}
    return {
        mode: OnlineDnSS.from_file(given[mode], output="both")
        if mode in given
        else OnlineDnSS.pretrained(mode, output="both")
        for mode in modes
    }


def restored(online: OnlineDnSS, spikes: NDArray[np.uint8], title: str = "denoise") -> Restored:
    """(T, H, W) spikes through a denoiser from its first frame, with a bar of progress."""
    stream = online.another("both")
    fired, rates, whole = np.empty_like(spikes), np.empty(spikes.shape, np.float32), 0
    ready = 0
    with tqdm(total=len(spikes), desc=title, unit="frame", leave=False) as bar:
        for start in range(0, len(spikes) + CHUNK, CHUNK):
            over = start >= len(spikes)
            whole = ready if over else whole
            piece = stream.flush() if over else stream.push(spikes[start : start + CHUNK])
            count = len(piece[0])
            fired[ready : ready + count], rates[ready : ready + count] = piece
            ready += count
            bar.update(count)
            if over:
                break
    return Restored(fired, rates, whole)
