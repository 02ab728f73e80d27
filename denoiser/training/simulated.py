"""Endless training streams, simulated where the network is: collages seen by sensor units, all in torch.

    textures, units (drawn once, on the processor) -> light (collage) -> noisy and clean spikes (`kernels.cuda`)

A stream is a collage of textured shapes in rigid motion (the shapes of `scenes.flat.collage`, whose coverage is here
computed for every pixel of every frame) before one sensor unit.  It begins anew, as another scene before
another unit, when it has reached its age.  The sensor's law and draws are those of the fast engine; units are patches
of larger units that the sensor's own code drew.  Everything follows from the seed; on a GPU nothing comes from the
host after the start.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from tqdm import tqdm

from denoiser.training.pairs import TRAINING_KINDS, draw_model
from scenes.flat.collage import depths
from scenes.textures import random_texture
from spikecam_env.errors import InputError
from spikecam_env.sensor.engines import gpu
from spikecam_env.sensor.engines.compiled import fast
from spikecam_env.sensor.engines.gpu.state import BatchLaw, BatchSegment, BatchState
from spikecam_env.sensor.light import GRAINS

TWINS = ("noisy", "clean")
"""Spikes of a stream: of its camera, and of the camera without noise."""

SHAPES = 5
"""Shapes before the background; each stream shows a part of them."""

SHOWN = 0.7
"""Share of the shapes that are shown."""

EXTENTS = (0.06, 0.5)
"""Half a shape's height and width, from least to greatest [sides of the picture]."""

BLADES = (2, 5)
"""Of a fan, from fewest to most."""

TEXTURE_SIZE = 256
"""Side of a texture [texels]; a power of two."""

ZOOMS = (0.5, 1.4)
"""Texels a pixel, from least to greatest."""

UNIT_SHAPE = (192, 192)
"""Pixels of the units that streams' patches are cut from."""

AGES = ((96, 0.2), (192, 0.25), (384, 0.25), (960, 0.3))
"""Frames after which a stream begins anew, and how often."""

AGE_STEP = 96
"""First streams begin at ages that are multiples of this [frames], so that not all begin anew together."""

STILL = 0.3
"""Share of scenes in which nothing moves."""

SPEEDS = (0.02, 3.0)
"""Speed of the fastest layer of the others, from least to greatest, even in its logarithm [pixels/frame]."""

TURNING, FASTEST_TURN = 0.4, 0.05
"""Share of shapes that turn; the most that they do [radians/frame], where that is slower than the fastest layer."""

STILL_BACKGROUND, STILL_SHAPE = 0.5, 0.15
"""Shares of backgrounds and of shapes that stay where they are in scenes that move."""

WEAK_CONTRAST = (0.02, 0.3)
"""Of weak texture, its brightest light over its darkest, less one: from least to greatest, even in its logarithm."""

DIM, DIM_LIGHT, LIGHT = 0.3, (0.012, 0.15), (0.15, 1.0)
"""Share of dim scenes; the brightest light of dim and of other scenes [spikes/frame], even in its logarithm."""

CONTRAST = (2.0, 50.0)
"""Brightest over darkest light of a scene."""


@dataclass(frozen=True)
class StreamBlock:
    """The next frames of all streams, or of some."""

    spikes: dict[str, Tensor]
    """By twin, (B, K, H, W) uint8, 0 or 1."""
    light: Tensor
    """(B, K, H, W) float32 in [0, 1], each frame's mean [spikes/frame]."""
    begins: Tensor
    """(B,) bool, whether the stream began anew with the first of these frames."""

    @property
    def noisy(self) -> Tensor:
        """Spikes of the noisy units."""
        return self.spikes["noisy"]

    @property
    def clean(self) -> Tensor:
        """Spikes of their noise-free twins."""
        return self.spikes["clean"]


@dataclass(frozen=True)
class Bank:
    """Textures and units from which streams are drawn, on one device."""

    textures: Tensor
    """(N, size, size) float32 in [0, 1]."""
    gain: Tensor
    """(U, H, W) float32, at light 1 [grains/frame]."""
    dark: Tensor
    """(U, H, W) float32 [grains/frame]."""
    spread: Tensor
    """(U, H, W) float32 [grains]."""
    polynomial: Tensor
    """(U, 8) float32, shape of a spike's noise (`kernels.fast.PixelLaw`)."""

    @classmethod
    def drawn(
        cls,
        seed: int,
        device: torch.device,
        textures: int = 384,
        units: int = 96,
        pictures: NDArray[np.float32] | None = None,
        streams: int | None = None,
        progress: bool = False,
    ) -> Bank:
        """A bank; everything follows from the seed, and from how many are drawn.

        Args:
            seed: of textures and units.
            device: of the bank.
            textures: how many.
            units: how many.
            pictures: (n, size, size) in [0, 1], textures besides.
            streams: drawn in all; a bank for so few holds no more units, nor more textures than a layer each.
            progress: shows a bar.
        """
        if streams is not None:
            textures, units = min(textures, streams * (SHAPES + 1)), min(units, streams)
        rng = np.random.default_rng([seed, 0xBA2C])
        bar = tqdm(total=textures + units, desc="textures, units", disable=not progress, leave=False)
        painted = []
        for _ in range(textures):
            painted.append(random_texture(rng, TEXTURE_SIZE, TRAINING_KINDS))
            bar.update()
        laws = []
        for _ in range(units):
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
    """Streams of patch x patch pixels that go on from call to call.

    After the start only `advance` changes anything, and in place (`denoiser.ground.captured`).

    Args:
        count: how many.
        patch: side of a stream [pixels].
        device: of the streams.
        seed: everything follows from it.
        bank: default, drawn from the seed.
        compiled: the light by `torch.compile` (a GPU's kernels are then few; other rounding).
        twins: the spikes that are simulated, of TWINS; the same bits whether the other is or not.
        panned: share of the scenes before a camera that pans, so that all layers move, still ones too.
        weak: share of the layers whose texture has a WEAK_CONTRAST.

    Raises:
        InputError: the patch is larger than the bank's units.
    """

    simulated = True
    """Light and units are known."""

    def __init__(
        self,
        count: int = 128,
        patch: int = 64,
        device: str | torch.device = "cpu",
        seed: int = 0,
        *,
        bank: Bank | None = None,
        compiled: bool = False,
        twins: tuple[str, ...] = TWINS,
        panned: float = 0.0,
        weak: float = 0.0,
    ) -> None:
        self._panned, self._weak = panned, weak
        self.device, self.twins = torch.device(device), twins
        self.count, self.patch = count, patch
        self.bank = Bank.drawn(seed, self.device) if bank is None else bank
        if patch > min(self.bank.gain.shape[1:]):
            raise InputError(f"patch is {patch}; the sensor units have {min(self.bank.gain.shape[1:])} pixels a side")
        self.rng = torch.Generator(self.device).manual_seed(seed)
        self._background: Background = torch.compile(_background, dynamic=False) if compiled else _background
        self._over: Over = torch.compile(_over, dynamic=False) if compiled else _over
        self._timing = torch.tensor([[0, 2, 1 << 17]], dtype=torch.int32, device=self.device)  # of one frame
        self._half = torch.full((1, 1), 0.5, device=self.device)
        self._lengths = torch.tensor([float(age) for age, _ in AGES], device=self.device)
        self._shares = torch.tensor([share for _, share in AGES], device=self.device).cumsum(0)[:-1]
        self._state = self._drawn(count)
        spread = torch.rand(count, generator=self.rng, device=self.device)
        self._state["age"] = torch.floor(spread * self._state["length"] / AGE_STEP) * AGE_STEP
        self._fresh = torch.ones(count, dtype=torch.bool, device=self.device)

    def advance(self, frames: int, rows: Tensor | None = None) -> StreamBlock:
        """The next `frames` frames of all streams, or of those in `rows` (int64), each row once."""
        rows = torch.arange(self.count, device=self.device) if rows is None else rows
        mine = {name: value[rows] for name, value in self._state.items()}
        over = mine["age"] >= mine["length"]
        mine = _where(over, self._drawn(len(rows)), mine)
        begins = over | self._fresh[rows]
        self._fresh.index_fill_(0, rows, False)
        times = mine["age"][:, None] + torch.arange(frames + 1, device=self.device)
        pictures = _paint(self.bank.textures, mine, times, self.patch, self._background, self._over)
        spikes = {twin: self._exposed(mine, pictures, twin) for twin in self.twins}
        mine["age"] = mine["age"] + frames
        for name, value in mine.items():
            self._state[name][rows] = value
        light = ((pictures[:, :-1] + pictures[:, 1:]) / 2).clamp(0.0, 1.0)
        return StreamBlock(spikes, light, begins)

    def unit(self, rows: Tensor) -> tuple[Tensor, Tensor]:
        """True gain and dark rate [spikes/frame] of the units of these streams, (B, H, W) float32 each."""
        shape = (len(rows), self.patch, self.patch)
        return self._state["gain"][rows].reshape(shape) / GRAINS, self._state["dark"][rows].reshape(shape) / GRAINS

    def _exposed(self, mine: dict[str, Tensor], pictures: Tensor, twin: str) -> Tensor:
        """Spikes (B, K, H, W) of the noisy units or of their noise-free twins, whose pixels `mine` moves on."""
        count, keys = pictures.shape[:2]
        light = pictures.reshape(count, keys, -1)
        law = BatchLaw(mine["gain"], mine["dark"], mine["spread"], mine["polynomial"])
        if twin == "clean":
            law = BatchLaw(torch.full_like(law.gain, float(GRAINS)), *(torch.zeros_like(t) for t in law.tensors[1:]))
        state = BatchState(law, mine[f"{twin} remaining"], mine[f"{twin} fired"], mine["seeds"])
        spikes = torch.empty((count, keys - 1, light.shape[2]), dtype=torch.uint8, device=self.device)
        for k in range(keys - 1):
            segment = BatchSegment(light[:, k].contiguous(), light[:, k + 1].contiguous(), self._timing, self._half, 1)
            gpu.run(state, segment, spikes[:, k : k + 1])
        mine[f"{twin} remaining"], mine[f"{twin} fired"] = state.remaining, state.fired
        return spikes.reshape(count, keys - 1, self.patch, self.patch)

    def _drawn(self, count: int) -> dict[str, Tensor]:
        """New streams: scenes, units, phases."""
        return {**self._scene(count), **self._unit(count), **self._ages(count)}

    def _ages(self, count: int) -> dict[str, Tensor]:
        chosen = torch.bucketize(self._uniform(0, 1, count), self._shares)
        return {"length": self._lengths[chosen], "age": torch.zeros(count, device=self.device)}

    def _scene(self, count: int) -> dict[str, Tensor]:
        """Layer 0 is the background.  All (B, layers) but levels, corner, centre, velocity, extent: (B, layers, 2)."""
        layers = (count, SHAPES + 1)
        speed = (self._uniform(0, 1, count) >= STILL) * torch.exp(self._uniform_logarithm(SPEEDS, count))
        levels = self._levels(count)
        velocity = self._velocity(speed)
        if self._panned:
            velocity = velocity + self._pan(count)
        if self._weak:
            levels = self._weakened(levels)
        extent = self._uniform(*EXTENTS, *layers, 2) * self.patch
        spin = self._spin(speed, torch.hypot(extent[..., 0], extent[..., 1]))
        return {
            "levels": levels,
            "texture": self._whole(0, len(self.bank.textures), *layers),
            "corner": self._uniform(0, TEXTURE_SIZE, *layers, 2),
            "zoom": self._uniform(*ZOOMS, *layers),
            "centre": self._uniform(0, self.patch, *layers, 2),
            "velocity": velocity,
            "angle": self._uniform(0, 2 * math.pi, *layers),
            "spin": spin,
            "extent": extent,
            "shape": self._whole(0, 3, *layers),
            "blades": self._whole(BLADES[0], BLADES[1] + 1, *layers),
            "shown": self._uniform(0, 1, *layers) < SHOWN,
        }

    def _levels(self, count: int) -> Tensor:
        """Light at both ends of each layer's texture, (B, layers, 2) [spikes/frame]."""
        dim = self._uniform(0, 1, count) < DIM
        dim_peak, peak = self._uniform_logarithm(DIM_LIGHT, count), self._uniform_logarithm(LIGHT, count)
        brightest = torch.exp(torch.where(dim, dim_peak, peak))
        contrast = torch.exp(self._uniform_logarithm(CONTRAST, count))
        levels = torch.exp(-torch.log(contrast)[:, None, None] * self._uniform(0, 1, count, SHAPES + 1, 2))
        return brightest[:, None, None] * levels

    def _velocity(self, speed: Tensor) -> Tensor:
        """Of each layer of scenes whose fastest layer has this speed, (B, layers, 2), along x and y [pixels/frame]."""
        count = len(speed)
        moves = self._uniform(0, 1, count, SHAPES + 1) >= STILL_SHAPE
        moves[:, 0] = self._uniform(0, 1, count) >= STILL_BACKGROUND
        pace = torch.where(moves, speed[:, None] * self._uniform(0, 1, count, SHAPES + 1), 0.0)
        heading = self._uniform(0, 2 * math.pi, count, SHAPES + 1)
        return torch.stack([pace * torch.cos(heading), pace * torch.sin(heading)], dim=-1)

    def _pan(self, count: int) -> Tensor:
        """Velocity of all layers of each scene before a panning camera, else 0, (B, 1, 2) [pixels/frame]."""
        speed = torch.exp(self._uniform_logarithm(SPEEDS, count)) * (self._uniform(0, 1, count) < self._panned)
        heading = self._uniform(0, 2 * math.pi, count)
        return torch.stack([speed * torch.cos(heading), speed * torch.sin(heading)], dim=-1)[:, None]

    def _weakened(self, levels: Tensor) -> Tensor:
        """Levels (B, layers, 2), some of them of weak texture, no brighter than they were."""
        count = levels.shape[:2]
        contrast = 1 + torch.exp(self._uniform_logarithm(WEAK_CONTRAST, *count))
        weak = torch.stack([levels[..., 0], levels[..., 0] / contrast], dim=-1)
        return torch.where((self._uniform(0, 1, *count) < self._weak)[..., None], weak, levels)

    def _spin(self, speed: Tensor, radius: Tensor) -> Tensor:
        """Turn of each layer, whose rim is no faster than the fastest layer, (B, layers) [radians/frame]."""
        turns = self._uniform(0, 1, *radius.shape) < TURNING
        fastest = torch.minimum(speed[:, None] / radius, torch.full_like(radius, FASTEST_TURN))
        spin = torch.where(turns, self._uniform(-1, 1, *radius.shape) * fastest, 0.0)
        spin[:, 0] = 0.0
        return spin

    def _unit(self, count: int) -> dict[str, Tensor]:
        """Units and the first charge of their pixels: maps (B, P), polynomial (B, 8), seeds (B, 2)."""
        bank, size = self.bank, self.patch
        chosen = self._whole(0, len(bank.gain), count)
        y, x = (self._whole(0, side - size + 1, count, 1) for side in bank.gain.shape[1:])
        along = torch.arange(size, device=self.device)
        where = (chosen[:, None, None], (y + along)[:, :, None], (x + along)[:, None, :])
        maps = {name: getattr(bank, name)[where].reshape(count, -1) for name in ("gain", "dark", "spread")}
        pixels = size * size
        phase = torch.rand((count, pixels), generator=self.rng, device=self.device)
        normal = torch.randn((count, pixels), generator=self.rng, device=self.device)
        left = (1 - phase) * GRAINS
        zero = torch.zeros((count, pixels), dtype=torch.int32, device=self.device)
        return {
            **maps,
            "polynomial": bank.polynomial[chosen],
            "noisy remaining": (left + maps["spread"] * normal).ceil().clamp(min=1).to(torch.int32),
            "noisy fired": zero,
            "clean remaining": left.ceil().clamp(min=1).to(torch.int32),
            "clean fired": zero.clone(),
            "seeds": self._whole(-(1 << 31), (1 << 31) - 1, count, 2).to(torch.int32),
        }

    def _uniform(self, low: float, high: float, *shape: int) -> Tensor:
        return low + (high - low) * torch.rand(shape, generator=self.rng, device=self.device)

    def _uniform_logarithm(self, limits: tuple[float, float], *shape: int) -> Tensor:
        """Logarithms, even between those of the limits."""
        return self._uniform(math.log(limits[0]), math.log(limits[1]), *shape)

    def _whole(self, least: int, stop: int, *shape: int) -> Tensor:
        return torch.randint(least, stop, shape, generator=self.rng, device=self.device)


def in_turn(following: Tensor, taken: int, count: int) -> Tensor:
    """Rows (int64) of the next `taken` of `count` streams; `following`, a number on their device, moves on in place."""
    rows = torch.remainder(following + torch.arange(taken, device=following.device), count)
    following += taken
    return rows


def _where(mask: Tensor, new: dict[str, Tensor], old: dict[str, Tensor]) -> dict[str, Tensor]:
    """`new` in the rows of the mask, else `old`."""
    return {n: torch.where(mask.reshape(-1, *[1] * (v.ndim - 1)), new[n], v) for n, v in old.items()}


Background = Callable[[Tensor, dict[str, Tensor], Tensor, int], Tensor]
Over = Callable[[Tensor, Tensor, dict[str, Tensor], Tensor], Tensor]


def _paint(
    textures: Tensor, scene: dict[str, Tensor], times: Tensor, size: int, background: Background, over: Over
) -> Tensor:
    """Light (B, K, size, size) of the collages at times (B, K) [frames]."""
    picture = background(textures, _layer(scene, 0), times, size)
    for number in range(1, SHAPES + 1):
        picture = over(picture, textures, _layer(scene, number), times)
    return picture


_OF_LAYERS = (
    *("levels", "texture", "corner", "zoom", "centre", "velocity", "angle", "spin", "extent", "shape", "blades"),
    "shown",
)


def _layer(scene: dict[str, Tensor], number: int) -> dict[str, Tensor]:
    return {name: scene[name][:, number].contiguous() for name in _OF_LAYERS}


def _background(textures: Tensor, layer: dict[str, Tensor], times: Tensor, size: int) -> Tensor:
    return _light(textures, layer, *_turned(layer, _place(layer, times), times, size))


def _over(picture: Tensor, textures: Tensor, layer: dict[str, Tensor], times: Tensor) -> Tensor:
    """A shape over the picture behind it; its world is a torus somewhat larger than the picture."""
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
    """Share of each pixel that a shape covers."""
    width, height = (layer["extent"][:, i, None, None, None] for i in (0, 1))
    shape, blades = (layer[name][:, None, None, None] for name in ("shape", "blades"))
    ellipse, rectangle, fan = depths(torch, u, v, width, height, blades)
    inside = torch.where(shape == 0, ellipse, torch.where(shape == 1, rectangle, fan))
    return (inside + 0.5).clamp(0.0, 1.0) * layer["shown"][:, None, None, None]
