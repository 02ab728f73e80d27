"""Training `picture` along simulated streams: the network meets its own past, as it will online.

    collages (`scenes.flat.collage`) -> camera (`spikecam_env.sensor`) -> planes (`pixel_history`) -> network

Scenes move at up to 3 pixels a frame, stand still, stop, start and are panned; their light changes.  Each stream has a
camera unit, a step and an age of its pictures of its own; a step of training takes some streams on by a few pictures:

    loss = mean (picture - light)^2 / (picture + OFFSET)      the divisor is not differentiated: no bias
         + STEADY mean (change of error from picture to picture)^2 / (picture + OFFSET)

A stream is simulated once and played many times: turned and mirrored, at other steps.  One stream in REPLACED steps of
training is exchanged for a new one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from denoiser.ground.number_type import computing_in, number_type
from denoiser.passes.history_kernels import DARK
from denoiser.passes.pixel_history import (
    HISTORY,
    TYPICAL_LOOK,
    TYPICAL_STEP,
    PictureInput,
    PictureLayout,
    PixelHistory,
)
from denoiser.passes.pixel_map import GAINS, PixelMap
from denoiser.passes.recipe import PictureRecipe
from denoiser.training.pairs import draw_model, drawn_evenly, light_in_frame
from denoiser.training.rollout import MAP_ERRORS, OFFSET, STEADY
from denoiser.training.simulated import Bank
from denoiser.training.training_source import HeldOut, TrainingSource
from scenes.flat.collage import Collage
from scenes.flat.planes import painted_planes
from scenes.protocol import Gaze
from scenes.textures import Texture
from spikecam_env.sensor import Keyframes, SpikeSensor
from spikecam_env.sensor.engines.compiled import fast
from spikecam_env.sensor.light import GRAINS
from spikecam_env.streams.packing import pack_frames, unpack_frames
from spikecam_env.types import Floats, Pictures, Spikes

FRAMES = 1024
"""Of a stream."""
POOL, VALIDATED = 256, 16
"""Streams that are kept, in training and in a validation."""
PASSES = 4
"""Pictures by which a step of training takes a stream on."""
REPLACED = 24
"""Steps of training for each new stream."""
SLOTS = 8
"""Streams that are played for each one that a step of training takes on."""
SPEEDS = (0.02, 3.0)
"""Of the fastest layer, from least to greatest, even in its logarithm [pixels/frame]."""
STILL = 0.2
"""Share of scenes in which nothing moves."""
PANNED, PANS = 0.25, (0.02, 1.5)
"""Share of the other scenes before which the camera turns; how fast [pixels/frame]."""
DIM, DIM_LIGHT, LIGHT = 0.35, (0.012, 0.15), (0.15, 1.1)
"""Share of dim scenes; the brightest light of dim and of other scenes [spikes/frame], even in its logarithm."""
CONTRAST = (2.0, 50.0)
"""Brightest over darkest light of a scene."""
STRETCHES = (80, 400)
"""Frames for which a scene moves, or stands, and its light stays."""
STOPS, SLOWER = 0.2, 0.15
"""Shares of stretches in which the scene stands, and in which it moves more slowly."""
FLICKERS, BRIGHTER = 0.3, math.log(4.0)
"""Share of streams whose light changes between stretches; by how much at most, in its logarithm."""
STEPS = (8.0, 256.0)
"""Frames of a stream's steps, from least to most, even in its logarithm."""
VARIED_STEPS = 0.05
"""Share of pictures after which a stream's steps have another length."""
LOOKS = (4, 24)
"""Ages of pictures; half the streams have TYPICAL_LOOK [frames]."""
MAPPED = 0.35
"""Share of the streams whose unit is calibrated."""
MOTION_A_KEY = 0.7
"""[pixels]"""
LEAST_SEEN = 16
"""Frames of a stream before its pictures count."""


@dataclass(frozen=True)
class SimulatedStream:
    """A stream with its light."""

    packed: NDArray[np.uint8]
    """(FRAMES, H W / 8) as `pack_frames` packs."""
    light: Keyframes
    gain: Pictures
    """(H, W) of the unit, relative to the mean pixel."""
    dark: Pictures
    """(H, W) [spikes/frame]."""

    def light_at(self, frame: int) -> Pictures:
        """(H, W) mean light of a frame, in [0, 1] [spikes/frame]."""
        return light_in_frame(self.light, frame)


def simulated_stream(rng: np.random.Generator, size: int, textures: list[Texture]) -> SimulatedStream:
    """A stream of size x size pixels, drawn anew."""
    speed = 0.0 if rng.random() < STILL else drawn_evenly(rng, *SPEEDS)
    pan = drawn_evenly(rng, *PANS) if speed and rng.random() < PANNED else 0.0
    light = drawn_evenly(rng, *(DIM_LIGHT if rng.random() < DIM else LIGHT))
    scene = Collage(
        (size, size), int(rng.integers(2**31)), speed=speed, light=light, contrast=drawn_evenly(rng, *CONTRAST),
        textures=textures,
    )  # fmt: skip
    every = max(1, min(32, int(MOTION_A_KEY / max(speed + pan, 1e-3))))
    frames = np.arange(0, FRAMES + every, every, dtype=np.float64)
    times, brightness = _course(rng, frames)
    heading = rng.uniform(0, 2 * math.pi)
    path = 2.0 * FRAMES * pan
    gaze = Gaze((0.0, 0.0), (path * math.cos(heading), path * math.sin(heading)), (0.0, 2.0 * FRAMES))
    painted = painted_planes([scene.plane_at(times, gaze)])[0].radiance
    pictures = np.multiply(painted, brightness[:, None, None], dtype=np.float32)
    keys = Keyframes(frames, pictures)
    sensor = SpikeSensor(draw_model(rng), shape=(size, size), seed=int(rng.integers(2**31)))
    law = fast.PixelLaw.of(sensor.unit)
    gain, dark = ((getattr(law, name)[: size * size] / GRAINS).reshape(size, size) for name in ("gain", "dark"))
    return SimulatedStream(pack_frames(sensor.step(keys, frames=FRAMES)), keys, gain, dark)


def _course(rng: np.random.Generator, frames: Floats) -> tuple[Floats, Floats]:
    """The scene's time, and its brightness, at these frames."""
    ends = np.cumsum(rng.integers(*STRETCHES, size=2 + FRAMES // STRETCHES[0]))
    kind = rng.random(len(ends))
    pace = np.where(kind < STOPS, 0.0, np.where(kind < STOPS + SLOWER, rng.uniform(0.1, 1.0, len(ends)), 1.0))
    changes = rng.random() < FLICKERS
    levels = np.exp(rng.uniform(-BRIGHTER, 0.0, len(ends))) if changes else np.ones(len(ends))
    stretch = np.searchsorted(ends, np.arange(frames[-1] + 1), side="right")
    times = np.concatenate([[0.0], np.cumsum(pace[stretch])])
    at = frames.astype(np.int64)
    return times[at], levels[np.searchsorted(ends, at, side="right")].astype(np.float32)


@dataclass
class StreamPlayed:
    """A stream before the network, mid-way."""

    stream: SimulatedStream
    turn: Callable[[NDArray[Any]], NDArray[Any]]
    """Turns and mirrors frames (..., H, W)."""
    window: PixelHistory
    place: int = 0
    """Frames that were played."""
    hidden: Tensor | None = None
    error: Tensor | None = field(default=None)
    """(1, H, W) of the last picture."""

    @classmethod
    def begin(cls, stream: SimulatedStream, rng: np.random.Generator | None, layout: PictureLayout) -> StreamPlayed:
        """From the first frame; without a generator as it is, at the usual step and age."""
        shape = stream.gain.shape
        if rng is None:
            return cls(stream, _turned(0, mirrored=False), PixelHistory(layout, shape))
        turn = _turned(int(rng.integers(4)), mirrored=bool(rng.integers(2)))
        look = TYPICAL_LOOK if rng.random() < 0.5 else int(rng.integers(LOOKS[0], LOOKS[1] + 1))
        unit = _measured(rng, turn(stream.gain), turn(stream.dark)) if rng.random() < MAPPED else None
        return cls(stream, turn, PixelHistory(layout, shape, unit, round(drawn_evenly(rng, *STEPS)), look))

    @property
    def is_over(self) -> bool:
        return self.place + self.window.step > len(self.stream.packed)

    def vary(self, rng: np.random.Generator) -> None:
        """Now and then, take steps of another length."""
        if rng.random() < VARIED_STEPS:
            self.window.step = round(drawn_evenly(rng, *STEPS))

    def next(self) -> tuple[PictureInput, Pictures]:
        """The next pass, and the light that it is to show (1, H, W)."""
        frames = self.stream.packed[self.place : self.place + self.window.step]
        self.place += self.window.step
        spikes: Spikes = np.ascontiguousarray(self.turn(unpack_frames(frames, self.stream.gain.shape)))
        (window,) = self.window.push(spikes)
        return window, self.turn(self.stream.light_at(window.start))[None]


def _turned(quarters: int, *, mirrored: bool) -> Callable[[NDArray[Any]], NDArray[Any]]:
    def turn(frames: NDArray[Any]) -> NDArray[Any]:
        turned = np.rot90(frames, quarters, axes=(-2, -1))
        return turned[..., ::-1] if mirrored else turned

    return turn


def _measured(rng: np.random.Generator, gain: Pictures, dark: Pictures) -> PixelMap:
    """A calibration map of a unit, with a calibration's errors."""
    size = drawn_evenly(rng, *MAP_ERRORS)
    measured = gain * (1 + size * rng.standard_normal(gain.shape))
    below = dark + size * dark.mean() * rng.standard_normal(dark.shape)
    return PixelMap(np.clip(measured / measured.mean(), *GAINS), np.clip(below, 0.0, 1.0))


@dataclass(frozen=True)
class Host:
    """Where streams are simulated, and random numbers of torch (`training_loop`)."""

    device: torch.device
    rng: torch.Generator


class PictureLessons(TrainingSource):
    """Simulated streams before networks of a `PictureRecipe`, taken in turn.

    Args:
        recipe: of the network.
        taken: streams a step of training.
        patch: their side [pixels].
        device: of the network.
        seed: everything follows from it.
        pool: streams that are kept.
        bank: of which the textures are used.
    """

    options: ClassVar[dict[str, Any]] = {"batch": 8, "validate_every": 1000, "start": None, "channels": None}
    held_out: ClassVar[HeldOut] = HeldOut(streams=1, patch=80, passes=HISTORY)

    def __init__(
        self,
        recipe: PictureRecipe,
        *,
        taken: int,
        patch: int,
        device: torch.device,
        seed: int,
        pool: int | None = None,
        bank: Bank | None = None,
        **_: Any,
    ) -> None:
        self.layout, self._patch = recipe.layout, patch
        self.streams = Host(device, torch.Generator(device).manual_seed(seed))
        self._rng = np.random.default_rng([seed, 0x91C7])
        self._type = number_type("auto", device)
        bank = Bank.drawn(seed, torch.device("cpu"), units=0) if bank is None else bank
        self._textures = list(bank.textures.cpu().numpy())
        count = VALIDATED if pool is not None else min(POOL, 32 * taken)
        self._pool = [simulated_stream(self._rng, patch, self._textures) for _ in range(count)]
        self._playing = [self._begun() for _ in range(SLOTS * taken)]
        self._taken, self._next, self._steps = taken, 0, 0

    def _begun(self) -> StreamPlayed:
        return StreamPlayed.begin(self._pool[int(self._rng.integers(len(self._pool)))], self._rng, self.layout)

    def loss(self, network: nn.Module) -> Tensor:
        """Take some streams on by PASSES pictures; the mean loss of these, with gradients."""
        self._steps += 1
        if self._steps % REPLACED == 0:
            self._pool[int(self._rng.integers(len(self._pool)))] = simulated_stream(
                self._rng, self._patch, self._textures
            )
        rows = [(self._next + i) % len(self._playing) for i in range(self._taken)]
        self._next = (self._next + self._taken) % len(self._playing)
        total: list[Tensor] = []
        for _ in range(PASSES):
            for row in rows:
                self._playing[row].vary(self._rng)
                if self._playing[row].is_over:
                    self._playing[row] = self._begun()
            _, picture, light, known, before = self._pass(network, [self._playing[row] for row in rows])
            weight = 1 / (picture.detach().clamp(min=0.0) + OFFSET)
            error = picture - light
            counts, steady = ((mask / len(rows))[:, None, None, None] * weight for mask in (known, known * before[0]))
            total.append((counts * error.square()).mean(dim=(1, 2, 3)).sum())
            total.append((STEADY * steady * (error - before[1]).square()).mean(dim=(1, 2, 3)).sum())
            for i, row in enumerate(rows):
                self._playing[row].error = error[i]
        for row in rows:
            played = self._playing[row]
            assert played.hidden is not None and played.error is not None
            played.hidden, played.error = played.hidden.detach(), played.error.detach()
        return torch.stack(total).sum() / PASSES

    def _pass(
        self, network: nn.Module, playing: list[StreamPlayed]
    ) -> tuple[Sequence[PictureInput], Tensor, Tensor, Tensor, tuple[Tensor, Tensor]]:
        """One pass of these streams.

        Returns:
            Their input; pictures and light (N, 1, H, W); 1 where the picture counts (N,); 1 where one came before it,
            and its error.
        """
        device = self.streams.device
        inputs, lights = zip(*(played.next() for played in playing), strict=True)
        planes = torch.from_numpy(np.stack([one.planes for one in inputs])).to(device)
        conditions = torch.from_numpy(np.stack([one.conditions for one in inputs])).to(device)
        light = torch.from_numpy(np.ascontiguousarray(np.stack(lights))).to(device)
        some = next((p.hidden for p in playing if p.hidden is not None), None)
        hidden = None
        if some is not None:
            hidden = torch.stack([torch.zeros_like(some) if p.hidden is None else p.hidden for p in playing])
        with computing_in(self._type, device):
            picture, (kept,) = network(planes, conditions, hidden)
        known = torch.tensor([float(p.window.seen >= LEAST_SEEN) for p in playing], device=device)
        nothing = torch.zeros_like(light[0])
        before = torch.stack([nothing if p.error is None else p.error for p in playing])
        had = torch.tensor([float(p.error is not None) for p in playing], device=device)
        shown = picture.detach().clamp(0.0, 1.0).cpu().numpy()
        for i, played in enumerate(playing):
            played.window.learn(inputs[i], shown[i])
            played.hidden = kept[i]
        return inputs, picture, light, known, (had, before)

    @torch.no_grad()
    def errors(self, network: nn.Module, passes: int) -> dict[str, float]:
        """Mean squared errors over the pool's streams, at the usual step and age, against the light of each one's peak.

        Args:
            network: that is judged.
            passes: frames of each stream before its pictures count.

        Returns:
            Of the network, of 1/ISI ("interval") and of a count of 40 frames ("mean"), as geometric means over streams.
        """
        playing = [StreamPlayed.begin(stream, None, self.layout) for stream in self._pool]
        layout = self.layout
        guesses = {"interval": 1, "mean": len(layout.instants) + layout.counts.index(40)}
        logs: dict[str, list[float]] = {name: [] for name in ("network", *guesses)}
        for played in playing:
            peak = max(float(np.max(played.stream.light_at(t))) for t in range(0, FRAMES, 64))
            sums = dict.fromkeys(logs, 0.0)
            while not played.is_over:
                (seen,), picture, light, _, _ = self._pass(network, [played])
                if played.place <= passes:
                    continue
                sums["network"] += float((picture.clamp(0, 1) - light).square().mean())
                for name, plane in guesses.items():
                    guess = seen.planes[plane] ** 2 - DARK
                    sums[name] += float(np.mean((guess - light.cpu().numpy()[0, 0]) ** 2))
            for name, value in sums.items():
                logs[name].append(math.log(max(value / ((FRAMES - passes) // TYPICAL_STEP), 1e-12) / peak**2))
        return {name: math.exp(float(np.mean(values))) for name, values in logs.items()}
