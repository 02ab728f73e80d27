"""Training pairs: noisy spikes of a random scene, with its true light and its clean twin's intervals.

Everything follows from (seed, clip number): the scene, the camera unit (its fixed pattern is new in every clip), the
noise, and the windows that are kept.  Static, slow and fast scenes; light from 60 frames between spikes to nearly one
spike a frame; the sensor's presets at two frame rates.  Windows that are taught the clean twin's interval start
64 frames in, when noisy and clean twins have forgotten their common phase.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import chain
from multiprocessing import get_context
from pathlib import Path

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from denoiser import infer
from denoiser.recipe import Recipe
from denoiser.weights import load_weights
from denoiser.window import RollingWindow, Window, WindowLayout, without_gain
from scenes.collage import Collage
from scenes.textures import random_texture
from spikecam_env.sensor import Keyframes, SensorModel, SpikeSensor
from spikecam_env.stopping import without_interrupts
from spikecam_env.streams import isi_planes

TRAINING_KINDS = ("fractal_noise", "dead_leaves", "stripes", "blobs", "rectangles", "gradient")
ENGINE = "reference"  # the specification: the pairs stay the same, bit for bit, when a faster engine changes
WARM_UP = 64  # frames until noisy and clean twins have lost their common phase (DESIGN section 7: 60)
CLIP_SHAPE = (96, 96)
WINDOWS_PER_CLIP = 8
CLIPS_AHEAD = 6
VARIED = (  # effect, least and greatest factor on its strength
    ("conversion_gain_spread", 0.25, 1.3),
    ("bias_voltage_spread", 0.25, 1.3),
    ("dark_current", 0.3, 3.0),
    ("dark_current_spread", 0.5, 6.0),
)


@dataclass(frozen=True)
class Sample:
    """One window: spikes (span, H, W) uint8, planes (layers, H, W), light and target (planes, H, W), float16."""

    spikes: NDArray[np.uint8]
    planes: NDArray[np.float16]
    light: NDArray[np.float16]
    target: NDArray[np.float16]


def draw_clip(
    recipe: Recipe,
    seed: int,
    number: int,
    network: nn.Module | None = None,
    *,
    knows_gain: bool = True,
    shape: tuple[int, int] = CLIP_SHAPE,
) -> list[Sample]:
    """Simulate clip `number` of the training set `seed` and keep WINDOWS_PER_CLIP windows of it.

    network: runs over the clip so that the windows carry the gain it finds; None: gain 1.  A network that was trained
    at gain 1 does not know what to do with another: with `knows_gain` False it is not shown the gain.
    """
    rng = np.random.default_rng([seed, number])
    scene = draw_scene(rng, shape, _texture_bank(seed))
    frames = int(rng.choice((192, 256, 384, 640), p=(0.35, 0.3, 0.2, 0.15)))
    light = scene.radiance(0, frames)
    sensor = SpikeSensor(draw_model(rng), shape=shape, seed=int(rng.integers(2**31)), engine=ENGINE)
    noisy = sensor.step(light, frames=frames)
    layout = recipe.layout
    learns_clean = recipe.target == "clean_inverse_interval"
    starts = np.arange(WARM_UP if learns_clean else 0, frames - (WARM_UP if learns_clean else 0), layout.planes)
    kept = set(rng.choice(starts, WINDOWS_PER_CLIP, replace=False).tolist())
    clean = sensor.clean_twin().step(light, frames=frames) if learns_clean else None
    samples = []
    for window in _windows(layout, noisy, kept, network, knows_gain):
        covered = range(window.start, window.start + layout.planes)
        truth = np.stack([light_in_frame(light, t) for t in covered])
        target = truth if clean is None else isi_planes(clean, start=covered[0], stop=covered[-1] + 1, normalised=True)
        half = np.float16
        samples.append(Sample(window.spikes, window.planes.astype(half), truth.astype(half), target.astype(half)))
    return samples


def _windows(
    layout: WindowLayout, spikes: NDArray[np.uint8], kept: set[int], network: nn.Module | None, knows_gain: bool
) -> Iterator[Window]:
    """The windows that start in `kept`, as an online denoiser with this network would see them."""
    roller = RollingWindow(layout, (spikes.shape[1], spikes.shape[2]))
    wanted = kept if network is None else None
    for window in chain(roller.push(spikes, wanted), roller.end(wanted)):
        if window.start in kept:
            yield window
        if network is not None:
            shown = window if knows_gain else without_gain(window)
            roller.learn(window, infer.rates(network, shown, torch.bfloat16))


def draw_scene(rng: np.random.Generator, shape: tuple[int, int], textures: list[NDArray[np.float32]]) -> Collage:
    """A collage that is still, slow (0.02 to 0.3) or fast (up to 2 pixels a frame), from very dim to bright."""
    speed = (0.0, float(np.exp(rng.uniform(np.log(0.02), np.log(0.3)))), float(rng.uniform(0.3, 2.0)))
    lowest, highest = (0.02, 0.15) if rng.random() < 0.3 else (0.15, 0.95)
    return Collage(
        shape,
        int(rng.integers(2**31)),
        speed=speed[rng.choice(3, p=(0.25, 0.25, 0.5))],
        light=float(np.exp(rng.uniform(np.log(lowest), np.log(highest)))),
        contrast=float(np.exp(rng.uniform(np.log(2.0), np.log(50.0)))),
        textures=textures,
    )


def draw_model(rng: np.random.Generator) -> SensorModel:
    """A sensor: half SCSim's preset, else a preset with the strength of its fixed pattern drawn anew; 40 or 20 kHz.

    Real units differ: flat-field maps show 2.7 % from pixel to pixel where SCSim has 7.3 %, and a wider dark current.
    """
    preset = ("scsim", "physical", "ideal")[rng.choice(3, p=(0.75, 0.17, 0.08))]
    model = replace(SensorModel.preset(preset), frame_rate_hz=40_000.0 if rng.random() < 0.7 else 20_000.0)
    if rng.random() < 0.5:
        return model
    strength = {name: float(np.exp(rng.uniform(np.log(low), np.log(high)))) for name, low, high in VARIED}
    for effect in model.effects:
        if effect.name in strength:
            varied = {field: value * strength[effect.name] for field, value in effect.parameters().items()}
            model = model.with_effect(replace(effect, **varied))
    return model


def light_in_frame(light: Keyframes, frame: int) -> NDArray[np.float32]:
    """Mean radiance over one frame, cut to what a spike a frame can carry: (H, W) in [0, 1]."""
    return np.clip(light.at(frame + 0.5), 0, 1)


@lru_cache(maxsize=2)
def _texture_bank(seed: int, count: int = 96, size: int = 256) -> list[NDArray[np.float32]]:
    rng = np.random.default_rng([seed, 0x7E57])
    return [random_texture(rng, size, TRAINING_KINDS) for _ in range(count)]


class ClipFeed:
    """Clips first, first + 1, ... in order, simulated ahead of use in `workers` processes.

    `weights` may be set to a checkpoint: the clips that are begun from then on carry the gain its network finds.
    """

    def __init__(
        self, recipe: Recipe, seed: int, first: int = 0, weights: Path | None = None, *, workers: int = 1
    ) -> None:
        self.weights = weights
        self._recipe, self._seed, self._next = recipe, seed, first
        self._ahead = CLIPS_AHEAD * workers
        self._workers = ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_one_thread)
        self._waiting: deque[Future[list[Sample]]] = deque()

    def __iter__(self) -> Iterator[list[Sample]]:
        return self

    def __next__(self) -> list[Sample]:
        while len(self._waiting) < self._ahead:
            with without_interrupts():  # it starts the workers
                job = self._workers.submit(_draw_with, self._recipe, self._seed, self._next, self.weights)
            self._waiting.append(job)
            self._next += 1
        return self._waiting.popleft().result()

    def close(self) -> None:
        """Stop simulating."""
        self._workers.shutdown(wait=True, cancel_futures=True)


def _draw_with(recipe: Recipe, seed: int, number: int, weights: Path | None) -> list[Sample]:
    if weights is None:
        return draw_clip(recipe, seed, number)
    network, knows_gain = _network_of(weights)
    return draw_clip(recipe, seed, number, network, knows_gain=knows_gain)


@lru_cache(maxsize=1)
def _network_of(weights: Path) -> tuple[nn.Module, bool]:
    _, network, training = load_weights(weights)
    return network.to(memory_format=torch.channels_last), training.get("knows_gain") is True  # type: ignore[call-overload]


def _one_thread() -> None:
    import numba

    cv2.setNumThreads(1)
    numba.set_num_threads(1)
    torch.set_num_threads(1)
