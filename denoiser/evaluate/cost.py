"""Processor time of a picture, as one of a stream: seconds of one core, after all is compiled and loaded.

rate plane          passes over a stream, by the planes that come out: `best` gives 16 a pass, `picture` one a step
picture of spikes   the reconstruction of one frame; of denoised spikes, and the plane behind them
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from denoiser.evaluate.rows import Weights, denoiser, weights_of
from denoiser.reconstruct import reconstruct
from spikecam_env.torch_settings import torch_settings

WINDOW = 41
"""Frames that a reconstruction sees at most."""
RATE = 0.2
"""Of the spikes that are timed [spikes/frame]."""
LEAST_FRAMES = 8
"""That are timed."""


def plane_seconds(source: str, weights: Weights, shape: tuple[int, int]) -> float:
    """Of a rate plane of a denoiser's stream; 0 for a source without a network.

    Args:
        source: "noisy", or a denoiser of `rows.SOURCES`.
        weights: of the source.
        shape: (rows, columns) of the frames.
    """
    name = weights_of(source)
    return 0.0 if name is None else _plane_seconds(source, name, weights.path(name), shape)


@lru_cache(maxsize=64)
def picture_seconds(name: str, path: Path | None, shape: tuple[int, int]) -> float:
    """Of a picture of spikes by a method of `reconstruct`, with weights of a path where it has some."""
    spikes = _spikes(WINDOW, shape)

    def picture() -> None:
        reconstruct(name, spikes, WINDOW // 2, weights=path)

    with torch_settings(threads=1):
        picture()
        return _timed(picture)


@lru_cache(maxsize=64)
def _plane_seconds(source: str, name: str, path: Path, shape: tuple[int, int]) -> float:
    online = denoiser(source, Weights({name: path})).another("rate")
    recipe = online.engine.recipe
    a_pass = online.engine.step if recipe.decoder is None else recipe.layout.planes
    frames = max(2 * a_pass, LEAST_FRAMES)
    spikes = _spikes(online.latency + a_pass + frames, shape)
    with torch_settings(threads=1):
        online.push(spikes[:-frames])  # compiles, and fills the window
        seconds = _timed(lambda: online.push(spikes[-frames:]))
    return seconds / (frames / a_pass if recipe.decoder is None else frames)


def _timed(work: Callable[[], object]) -> float:
    begun = time.process_time()
    work()
    return time.process_time() - begun


def _spikes(frames: int, shape: tuple[int, int]) -> NDArray[np.uint8]:
    return (np.random.default_rng(0).random((frames, *shape)) < RATE).astype(np.uint8)
