"""Real recordings: no light is known, so pictures are judged by NIQE, which wants at least 192 x 192 pixels."""

from __future__ import annotations

import warnings
from functools import lru_cache
from pathlib import Path

import numpy as np

import spikecam_env
from denoiser.evaluate.exposed import Case, Exposed
from denoiser.evaluate.phm import AHEAD, reach
from spikecam_env.streams import read_recording

RECORDINGS = ("wall.npz", "helicopter_low_light.npz")
"""Files of the data that lies beside a checkout; the paper's five recordings are not among them."""
FOLDER = Path(spikecam_env.__file__).resolve().parents[2] / "shared" / "data" / "real"
WHITE = 99.5
"""Percentile of the mean rate that is shown white."""


def real_case(path: Path) -> Case:
    """A recording as a case; its middle frame is the picture.  Raises InputError where it cannot be read."""
    spikes = _spikes(path)
    interval = 1 / max(float(spikes.mean()), 1e-6)
    shape = (spikes.shape[1], spikes.shape[2])
    return Case("real", path.name, 0, shape, len(spikes), round(interval, 1), folder=str(path.parent))


def expose(case: Case) -> Exposed:
    """The recording; what is judged are the frames about its middle."""
    noisy = _spikes(Path(case.folder) / case.scene)
    middle = case.frames // 2
    around = min(reach(case.interval), middle)
    first, stop = middle - around, min(middle + around + 1, len(noisy))
    white = float(np.percentile(noisy.mean(axis=0), WHITE)) or 1.0
    return Exposed(noisy[: stop + AHEAD], None, None, first, stop, middle, white)


@lru_cache(maxsize=1)
def _spikes(path: Path) -> np.ndarray:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of axes that could be time: these files are known
        return read_recording(path).spikes
