"""Endless training streams, simulated where the network is: collages seen by sensor units, all in torch.

    textures, units (drawn once, on the processor) -> light (collage) -> noisy and clean spikes (`kernels.cuda`)

A stream is a collage of textured shapes in rigid motion (the world of `scenes.collage`, here without sprites: coverage
is computed from the signed distance to a shape's edge) before one sensor unit.  It begins anew, as another scene before
another unit, when it has reached its age.  The sensor's law and draws are those of the fast engine; units are patches
of larger units that the sensor's own code drew.  Everything follows from the seed; on a GPU nothing comes from the
host after the start.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from tqdm import tqdm

from denoiser.pairs import TRAINING_KINDS, draw_model
from scenes.textures import random_texture
from spikecam_env.sensor.kernels import cuda, fast
from spikecam_env.sensor.kernels.cuda.state import BatchLaw, BatchSegment, BatchState
from spikecam_env.sensor.light import GRAINS

SHAPES = 5
"""Shapes before the background; each stream shows a part of them."""

TEXTURE_SIZE = 256
UNIT_SHAPE = (192, 192)

AGES = ((96, 0.2), (192, 0.25), (384, 0.25), (960, 0.3))
"""Frames after which a stream begins anew, and how often."""

STILL = 0.3
"""Share of scenes in which nothing moves."""

SPEEDS = (0.02, 3.0)
"""Speed of the fastest layer of the others, from least to greatest, even in its logarithm [pixels/frame]."""

STILL_BACKGROUND, STILL_SHAPE = 0.5, 0.15
"""Shares of backgrounds and of shapes that stay where they are in scenes that move."""

DIM, DIM_LIGHT, LIGHT = 0.3, (0.012, 0.15), (0.15, 1.0)
"""Share of dim scenes; the brightest light of dim and of other scenes [spikes/frame], even in its logarithm."""

CONTRAST = (2.0, 50.0)
"""Brightest over darkest light of a scene."""


@dataclass(frozen=True)
class Simulated:
    """The next frames of all streams (or of those asked for).

    noisy, clean: (B, K, H, W) uint8, 0 or 1.  light: (B, K, H, W) float32, mean of each frame, at most 1 [spikes/frame].
    begins: (B,) bool, whether the stream began anew with the first of these frames.
    """

    noisy: Tensor
    clean: Tensor
    light: Tensor
    begins: Tensor


@dataclass(frozen=True)
class Bank:
    """What streams are drawn from, on one device.

    textures: (N, size, size) float32 in [0, 1].  gain, dark [grains/frame], spread [grains]: (U, H, W) float32.
    polynomial: (U, 8) float32, shape of a spike's noise (`kernels.fast.PixelLaw`).
    """

    textures: Tensor
    gain: Tensor
    dark: Tensor
    spread: Tensor
    polynomial: Tensor

    @classmethod
    def drawn(
        cls,
        seed: int,
        device: torch.device,
        textures: int = 384,
        units: int = 96,
        pictures: NDArray[np.float32] | None = None,
        progress: bool = False,
    ) -> Bank:
        """`textures` procedural ones beside `pictures` (n, size, size), and `units` sensor units."""
        rng = np.random.default_rng([seed, 0xBA2C])
        bar = tqdm(total=textures + units, desc="textures, units", disable=not progress, leave=False)
        painted = []
        for _ in range(textures):
            painted.append(random_texture(rng, TEXTURE_SIZE, TRAINING_KINDS))
            bar.update()
        laws = []
        for number in range(units):
            unit = draw_model(rng).draw_unit(UNIT_SHAPE, int(rng.integers(2**31)))
            laws.append(fast.PixelLaw.of(unit))
            bar.update()
        bar.close()
        stack = np.stack(painted) if pictures is None else np.concatenate([np.stack(painted), pictures])
        pixels = UNIT_SHAPE[0] * UNIT_SHAPE[1]

        def maps(name: str) -> Tensor:
            planes = np.stack([getattr(law, name)[:pixels].reshape(UNIT_SHAPE) for law in laws])
            return torch.from_numpy(planes).to(device)

        polynomial = torch.tensor([law.polynomial for law in laws], dtype=torch.float32, device=device)
        return cls(torch.from_numpy(stack).to(device), maps("gain"), maps("dark"), maps("spread"), polynomial)


class SimulatedStreams:
    """`count` streams of patch x patch pixels that go on from call to call.

    device: where they are.  seed: everything follows from it.  bank: default, drawn from the seed.
    compiled: the light by `torch.compile` (a GPU's kernels are then few; other rounding).
    """

    def __init__(
        self,
        count: int = 128,
        patch: int = 64,
        device: str | torch.device = "cpu",
        seed: int = 0,
        *,
        bank: Bank | None = None,
        compiled: bool = False,
    ) -> None:
        self.device = torch.device(device)
        self.count, self.patch = count, patch
        self.bank = Bank.drawn(seed, self.device) if bank is None else bank
        self.rng = torch.Generator(self.device).manual_seed(seed)
        self._background, self._over = _background, _over
        if compiled:
            self._background, self._over = (torch.compile(f, dynamic=False) for f in (_background, _over))
        self._timing = torch.tensor([[0, 2, 1 << 17]], dtype=torch.int32, device=self.device)  # of one frame
        self._half = torch.full((1, 1), 0.5, device=self.device)
        self._lengths = torch.tensor([float(age) for age, _ in AGES], device=self.device)
        self._shares = torch.tensor([share for _, share in AGES], device=self.device).cumsum(0)[:-1]
        self._state = self._drawn(count)
        spread = torch.rand(count, generator=self.rng, device=self.device)  # so that not all begin anew together
        self._state["age"] = torch.floor(spread * self._state["length"] / 96) * 96
        self._fresh = torch.ones(count, dtype=torch.bool, device=self.device)

    def advance(self, frames: int, rows: Tensor | None = None) -> Simulated:
        """The next `frames` frames of all streams, or of those in `rows` (int64), each row once."""
        rows = torch.arange(self.count, device=self.device) if rows is None else rows
        mine = {name: value[rows] for name, value in self._state.items()}
        over = mine["age"] >= mine["length"]
        mine = _where(over, self._drawn(len(rows)), mine)
        begins = over | self._fresh[rows]
        self._fresh.index_fill_(0, rows, False)
        times = mine["age"][:, None] + torch.arange(frames + 1, device=self.device)
        pictures = _paint(self.bank.textures, mine, times, self.patch, self._background, self._over)
        noisy = self._exposed(mine, pictures, "noisy")
        clean = self._exposed(mine, pictures, "clean")
        mine["age"] = mine["age"] + frames
        for name, value in mine.items():
            self._state[name][rows] = value
        light = ((pictures[:, :-1] + pictures[:, 1:]) / 2).clamp(0.0, 1.0)
        return Simulated(noisy, clean, light, begins)

    def unit(self, rows: Tensor) -> tuple[Tensor, Tensor]:
        """True gain and dark rate [spikes/frame] of the units of these streams, (B, H, W) each."""
        shape = (len(rows), self.patch, self.patch)
        return self._state["gain"][rows].reshape(shape) / GRAINS, self._state["dark"][rows].reshape(shape) / GRAINS

    def _exposed(self, mine: dict[str, Tensor], pictures: Tensor, twin: str) -> Tensor:
        """Spikes (B, K, H, W) of the noisy units or of their noise-free twins, whose pixels `mine` moves on."""
        count, keys = pictures.shape[:2]
        light = pictures.reshape(count, keys, -1)
        if twin == "noisy":
            law = BatchLaw(mine["gain"], mine["dark"], mine["spread"], mine["polynomial"])
        else:
            nothing = torch.zeros_like(mine["dark"])
            law = BatchLaw(
                torch.full_like(nothing, float(GRAINS)), nothing, nothing, torch.zeros_like(mine["polynomial"])
            )
        state = BatchState(law, mine[f"{twin} remaining"], mine[f"{twin} fired"], mine["seeds"])
        spikes = torch.empty((count, keys - 1, light.shape[2]), dtype=torch.uint8, device=self.device)
        for k in range(keys - 1):
            segment = BatchSegment(light[:, k].contiguous(), light[:, k + 1].contiguous(), self._timing, self._half, 1)
            cuda.run(state, segment, spikes[:, k : k + 1])
        mine[f"{twin} remaining"], mine[f"{twin} fired"] = state.remaining, state.fired
        return spikes.reshape(count, keys - 1, self.patch, self.patch)

    def _drawn(self, count: int) -> dict[str, Tensor]:
        """New streams: scenes, units, phases."""
        return {**self._scene(count), **self._unit(count), **self._ages(count)}

    def _ages(self, count: int) -> dict[str, Tensor]:
        chosen = torch.bucketize(self._uniform(0, 1, count), self._shares)
        return {"length": self._lengths[chosen], "age": torch.zeros(count, device=self.device)}

    def _uniform(self, low: float, high: float, *shape: int) -> Tensor:
        return low + (high - low) * torch.rand(shape, generator=self.rng, device=self.device)

    def _scene(self, count: int) -> dict[str, Tensor]:
        """Layer 0 is the background.  All (B, layers) but what is said."""
        layers = SHAPES + 1
        moving = self._uniform(0, 1, count) >= STILL
        speed = moving * torch.exp(self._uniform(*map(math.log, SPEEDS), count))
        dim = self._uniform(0, 1, count) < DIM
        peak = torch.exp(
            torch.where(
                dim,
                self._uniform(*map(math.log, DIM_LIGHT), count),
                self._uniform(*map(math.log, LIGHT), count),
            )
        )
        contrast = torch.exp(self._uniform(*map(math.log, CONTRAST), count))
        levels = torch.exp(-torch.log(contrast)[:, None, None] * self._uniform(0, 1, count, layers, 2))
        moves = self._uniform(0, 1, count, layers) >= STILL_SHAPE
        moves[:, 0] = self._uniform(0, 1, count) >= STILL_BACKGROUND
        pace = torch.where(moves, speed[:, None] * self._uniform(0, 1, count, layers), 0.0)
        heading = self._uniform(0, 2 * math.pi, count, layers)
        extent = self._uniform(0.06, 0.5, count, layers, 2) * self.patch
        radius = torch.hypot(extent[..., 0], extent[..., 1])
        spins = self._uniform(0, 1, count, layers) < 0.4
        fastest = torch.minimum(speed[:, None] / radius, torch.full_like(radius, 0.05))
        spin = torch.where(spins, self._uniform(-1, 1, count, layers) * fastest, 0.0)
        spin[:, 0] = 0.0
        return {
            "levels": peak[:, None, None] * levels,
            "texture": torch.randint(len(self.bank.textures), (count, layers), generator=self.rng, device=self.device),
            "corner": self._uniform(0, TEXTURE_SIZE, count, layers, 2),
            "zoom": self._uniform(0.5, 1.4, count, layers),
            "centre": self._uniform(0, self.patch, count, layers, 2),
            "velocity": torch.stack([pace * torch.cos(heading), pace * torch.sin(heading)], dim=-1),
            "angle": self._uniform(0, 2 * math.pi, count, layers),
            "spin": spin,
            "extent": extent,
            "shape": torch.randint(3, (count, layers), generator=self.rng, device=self.device),
            "blades": torch.randint(2, 6, (count, layers), generator=self.rng, device=self.device),
            "shown": self._uniform(0, 1, count, layers) < 0.7,
        }

    def _unit(self, count: int) -> dict[str, Tensor]:
        bank, size = self.bank, self.patch
        chosen = torch.randint(len(bank.gain), (count,), generator=self.rng, device=self.device)
        room = [side - size + 1 for side in bank.gain.shape[1:]]
        y, x = (torch.randint(n, (count, 1), generator=self.rng, device=self.device) for n in room)
        along = torch.arange(size, device=self.device)
        where = (chosen[:, None, None], (y + along)[:, :, None], (x + along)[:, None, :])
        maps = {name: getattr(bank, name)[where].reshape(count, -1) for name in ("gain", "dark", "spread")}
        pixels = size * size
        phase = torch.rand((count, pixels), generator=self.rng, device=self.device)
        normal = torch.randn((count, pixels), generator=self.rng, device=self.device)
        left = (1 - phase) * GRAINS
        zero = torch.zeros((count, pixels), dtype=torch.int32, device=self.device)
        seeds = torch.randint(-(1 << 31), (1 << 31) - 1, (count, 2), generator=self.rng, device=self.device)
        return {
            **maps,
            "polynomial": bank.polynomial[chosen],
            "noisy remaining": (left + maps["spread"] * normal).ceil().clamp(min=1).to(torch.int32),
            "noisy fired": zero,
            "clean remaining": left.ceil().clamp(min=1).to(torch.int32),
            "clean fired": zero.clone(),
            "seeds": seeds.to(torch.int32),
        }


def _where(mask: Tensor, new: dict[str, Tensor], old: dict[str, Tensor]) -> dict[str, Tensor]:
    """`new` in the rows of the mask, else `old`."""
    return {n: torch.where(mask.reshape(-1, *[1] * (v.ndim - 1)), new[n], v) for n, v in old.items()}


Painter = Callable[[Tensor, dict[str, Tensor], Tensor, int], Tensor]


def _paint(
    textures: Tensor, scene: dict[str, Tensor], times: Tensor, size: int, background: Painter, over: Any
) -> Tensor:
    """Light (B, K, size, size) of the collages at times (B, K) [frames]."""
    picture = background(textures, _layer(scene, 0), times, size)
    for number in range(1, SHAPES + 1):
        picture = over(picture, textures, _layer(scene, number), times)
    return picture


def _layer(scene: dict[str, Tensor], number: int) -> dict[str, Tensor]:
    return {name: scene[name][:, number].contiguous() for name in _OF_LAYERS}


def _background(textures: Tensor, layer: dict[str, Tensor], times: Tensor, size: int) -> Tensor:
    return _light(textures, layer, *_turned(layer, _place(layer, times), times, size))


def _over(picture: Tensor, textures: Tensor, layer: dict[str, Tensor], times: Tensor) -> Tensor:
    """A shape over what is behind it; its world is a torus somewhat larger than the picture."""
    size = picture.shape[-1]
    reach = (torch.hypot(layer["extent"][:, 0], layer["extent"][:, 1]) + 2)[:, None, None]
    place = torch.remainder(_place(layer, times) + reach, size + 2 * reach) - reach
    u, v = _turned(layer, place, times, size)
    return picture + _coverage(u, v, layer) * (_light(textures, layer, u, v) - picture)


def _place(layer: dict[str, Tensor], times: Tensor) -> Tensor:
    return layer["centre"][:, None, :] + layer["velocity"][:, None, :] * times[..., None]


def _turned(layer: dict[str, Tensor], place: Tensor, times: Tensor, size: int) -> tuple[Tensor, Tensor]:
    """Every pixel in the layer's own axes."""
    along = torch.arange(size, device=times.device, dtype=torch.float32)
    angle = layer["angle"][:, None] + layer["spin"][:, None] * times
    cos, sin = torch.cos(angle)[..., None, None], torch.sin(angle)[..., None, None]
    dx, dy = along[None, :] - place[..., 0, None, None], along[:, None] - place[..., 1, None, None]
    return cos * dx + sin * dy, cos * dy - sin * dx


def _light(textures: Tensor, layer: dict[str, Tensor], u: Tensor, v: Tensor) -> Tensor:
    zoom, corner = layer["zoom"][:, None, None, None], layer["corner"][:, None, None, None, :]
    seen = _texture(textures, layer["texture"], u * zoom + corner[..., 0], v * zoom + corner[..., 1])
    low, high = (layer["levels"][:, i, None, None, None] for i in (0, 1))
    return low + (high - low) * seen


_OF_LAYERS = (
    *("levels", "texture", "corner", "zoom", "centre", "velocity", "angle", "spin", "extent", "shape", "blades"),
    "shown",
)


def _texture(textures: Tensor, chosen: Tensor, x: Tensor, y: Tensor) -> Tensor:
    """Texture chosen[b] at (x, y)[b], (B, K, H, W), bilinear, repeated without end."""
    size = textures.shape[-1]
    left, top = torch.floor(x), torch.floor(y)
    wx, wy = x - left, y - top
    x0 = left.to(torch.int32) & (size - 1)
    y0 = top.to(torch.int32) & (size - 1)
    x1, y1 = (x0 + 1) & (size - 1), (y0 + 1) & (size - 1)
    flat = textures.reshape(-1)
    base = (chosen * (size * size))[:, None, None, None]

    def at(row: Tensor, column: Tensor) -> Tensor:
        return flat[base + row * size + column]

    upper = at(y0, x0) * (1 - wx) + at(y0, x1) * wx
    lower = at(y1, x0) * (1 - wx) + at(y1, x1) * wx
    return upper * (1 - wy) + lower * wy


def _coverage(u: Tensor, v: Tensor, layer: dict[str, Tensor]) -> Tensor:
    """Share of each pixel that a shape covers, from the distance to its edge [pixels] (`scenes.collage`)."""
    a, b = (layer["extent"][:, i, None, None, None] for i in (0, 1))
    radius = torch.hypot(u, v)
    ellipse = (1 - torch.hypot(u / a, v / b)) * torch.minimum(a, b)
    rectangle = torch.minimum(a - u.abs(), b - v.abs())
    blades = layer["blades"][:, None, None, None]
    fan = torch.minimum(torch.sin(blades * torch.atan2(v, u)) * radius / blades, torch.maximum(a, b) - radius)
    shape = layer["shape"][:, None, None, None]
    inside = torch.where(shape == 0, ellipse, torch.where(shape == 1, rectangle, fan))
    return (inside + 0.5).clamp(0.0, 1.0) * layer["shown"][:, None, None, None]
