"""Streams of `spikecam view`, block by block: a recording, a scene through a sensor, an episode."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from spikecam_env.cli.live.episodes import Moment, episode
from spikecam_env.cli.live.players import Player
from spikecam_env.envs.wrappers.any_env import spike_camera_of

if TYPE_CHECKING:
    from scenes import Scene
    from spikecam_env.sensor import SpikeSensor

FRAME_RATE_HZ = 40_000.0
"""Of a recording that does not say: the Vidar camera's."""


@dataclass(frozen=True)
class Block:
    """first: its first frame; spikes (K, H, W) uint8; figures: by name, at its end; target: (x, y) [pixels] there."""

    first: int
    spikes: NDArray[np.uint8]
    figures: Mapping[str, float] = field(default_factory=dict)
    target: tuple[float, float] | None = None


@dataclass(frozen=True)
class Stream:
    """title; shape (rows, columns); frames: there are at most; blocks: in order, taken once."""

    title: str
    shape: tuple[int, int]
    frame_rate_hz: float
    frames: int
    blocks: Iterator[Block]


def of_recording(path: str | Path, frames: int | None, every: int, **options: Any) -> Stream:
    """The first frames of a file, or all; options: of `read_recording`."""
    from spikecam_env.streams import read_recording

    recording = read_recording(path, **options)
    spikes = recording.spikes[:frames]
    blocks = (Block(first, spikes[first : first + every]) for first in range(0, len(spikes), every))
    _, rows, columns = spikes.shape
    rate = FRAME_RATE_HZ if recording.frame_rate_hz is None else recording.frame_rate_hz
    return Stream(Path(path).name, (rows, columns), rate, len(spikes), blocks)


def of_scene(name: str, scene: Scene, sensor: SpikeSensor, frames: int, every: int) -> Stream:
    """A scene before a camera at rest."""

    def blocks() -> Iterator[Block]:
        for first in range(0, frames, every):
            count = min(every, frames - first)
            yield Block(first, sensor.step(scene.radiance(first, first + count), count))

    return Stream(name, scene.shape, scene.frame_rate_hz, frames, blocks())


def of_episode(name: str, env: gymnasium.Env[Any, Any], acting: Player, seed: int, frames: int) -> Stream:
    """Steps of an episode; the last that ends by `frames`, or the episode's."""
    camera: Any = spike_camera_of(env)
    moments = takewhile(lambda moment: moment.frame <= frames, episode(env, acting, seed))
    return Stream(name, camera.shape, camera.model.frame_rate_hz, frames, map(_of_moment, moments))


def _of_moment(moment: Moment) -> Block:
    info = moment.info
    x, y = info["target"]
    figures = {
        "reward/reward": moment.reward,
        "return/return": moment.total,
        "performance/performance": info["performance"],
        "distance/distance [px]": info["distance_px"],
    }
    if "gaze" in info:
        figures |= dict(zip(("gaze/pan [px]", "gaze/tilt [px]"), info["gaze"], strict=True))
    first = moment.frame - len(moment.spikes)
    return Block(first, moment.spikes, {name: float(value) for name, value in figures.items()}, (float(x), float(y)))
