"""Real recordings: no light is known, so pictures are judged by NIQE, which wants at least 192 x 192 pixels."""

from __future__ import annotations

import warnings
from functools import lru_cache
from pathlib import Path

import numpy as np

import spikecam_env
from denoiser.evaluate.case import ExposedStreams, StreamCase
from denoiser.evaluate.phm import AHEAD, reach
from spikecam_env.streams import read_recording

RECORDINGS = ("wall.npz", "helicopter_low_light.npz")
"""Files of the data that lies beside a checkout; the paper's five recordings are not among them."""
FOLDER = Path(spikecam_env.__file__).resolve().parents[2] / "shared" / "data" / "real"
INSTANTS = 3
"""Pictures of a recording, evenly spread over it; NIQE differs from one to the next by a few tenths."""
WHITE = 99.5
"""Percentile of the mean rate that is shown white."""


def real_cases(path: Path) -> list[StreamCase]:
    """A recording as cases, one an instant, whose number is the seed; InputError where it cannot be read."""
    spikes = _spikes(path)
    interval = round(1 / max(float(spikes.mean()), 1e-6), 1)
    shape = (spikes.shape[1], spikes.shape[2])
    return [StreamCase(path.name, i, shape, len(spikes), interval, folder=str(path.parent)) for i in range(INSTANTS)]


def expose(case: StreamCase) -> ExposedStreams:
    """The recording; frames about one of its instants are judged, as far as it goes."""
    noisy = _spikes(Path(case.folder) / case.scene)
    middle = (case.seed + 1) * case.frames // (INSTANTS + 1)
    around = min(reach(case.interval), middle, len(noisy) - 1 - middle)
    first, stop = middle - around, middle + around + 1
    white = float(np.percentile(noisy.mean(axis=0), WHITE)) or 1.0
    return ExposedStreams(noisy[: stop + AHEAD], None, None, first, stop, middle, white)


@lru_cache(maxsize=1)
def _spikes(path: Path) -> np.ndarray:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of axes that could be time: these files are known
        return read_recording(path).spikes
