"""Whole streams through a denoiser, for the tests that judge it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from denoiser.online import OnlineDnSS, pieces_of

WeightFiles = Mapping[str, str | os.PathLike[str]]
"""Checkpoint by mode, instead of the shipped ones."""


class Restored(NamedTuple):
    """A denoised stream."""

    spikes: NDArray[np.uint8]
    """(T, H, W)."""
    rates: NDArray[np.float32]
    """(T, H, W) [spikes/frame]."""
    whole: int
    """Frames, from the first, that came out before the stream's end was known."""


def denoisers(modes: Sequence[str], weights: WeightFiles | None = None) -> dict[str, OnlineDnSS]:
    """A denoiser of each mode, which gives both spikes and rates; InputError as `OnlineDnSS`."""
    given = weights or {}
    return {
        mode: OnlineDnSS.from_file(given[mode], output="both")
        if mode in given
        else OnlineDnSS.pretrained(mode, output="both")
        for mode in modes
    }


def restored(online: OnlineDnSS, spikes: NDArray[np.uint8], title: str | None = "denoise") -> Restored:
    """(T, H, W) spikes through a denoiser from its first frame, with a bar of progress unless the title is None."""
    stream = online.another("both")
    fired, rates, whole = np.empty_like(spikes), np.empty(spikes.shape, np.float32), 0
    for whole, piece in pieces_of(stream, spikes, title=title):
        part = slice(whole, whole + len(piece[0]))
        fired[part], rates[part] = piece
    return Restored(fired, rates, whole)
