"""The light before the hidden camera: radiance at keys of any times, linear between them, constant outside.

A plan is a list of recordings; each holds exactly the numbers that its radiance file will hold.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Light:
    """key_frame: (K,) float64, rising.  radiance: (K, rows, columns) or (K, 1, 1) float32."""

    key_frame: NDArray[np.float64]
    radiance: NDArray[np.float32]


@dataclass(frozen=True)
class Shot:
    """A recording to be made.  order: how many of the campaign come before it."""

    name: str
    use: str
    light: Light
    order: int = 0


FIT_LEVELS = (0.01, 0.03, 0.08, 0.2, 0.4, 0.65)
HOLDOUT_LEVELS = (0.018, 0.13, 0.52)
EDGE_FRAMES = 0.1
"""How long an edge of the square wave takes: 2.5 us."""


def plan(shape: tuple[int, int], frames: int, rng: np.random.Generator) -> list[Shot]:
    """Dark, six flats, a step and bars to fit; three flats and a disk held out.  Levels differ a little every time."""

    def flats(levels: tuple[float, ...], use: str) -> list[Shot]:
        return [Shot(f"flat-{1000 * v:03.0f}", use, flat(v)) for v in (x * rng.uniform(0.92, 1.08) for x in levels)]

    shots = [Shot("dark", "fit", flat(0.0)), *flats(FIT_LEVELS, "fit")]
    shots.append(Shot("step", "fit", square_wave(frames, rng)))
    shots.append(Shot("bars", "fit", bars(shape, frames, rng)))
    shots += flats(HOLDOUT_LEVELS, "holdout")
    shots.append(Shot("disk", "holdout", disk(shape, frames, rng)))
    return [replace(shot, order=i) for i, shot in enumerate(shots)]


def flat(level: float) -> Light:
    """Uniform, steady light."""
    return Light(np.zeros(1), np.full((1, 1, 1), level, np.float32))


def square_wave(frames: int, rng: np.random.Generator) -> Light:
    """Uniform light between two levels, half period a few hundred frames, its own clock: edges anywhere in a frame.

    An edge takes a tenth of a frame.
    """
    low, high, half = rng.uniform(0.04, 0.1), rng.uniform(0.4, 0.6), rng.uniform(200.0, 400.0)
    edges = np.arange(half, frames - 1, half)
    frame, value = [0.0], [low]
    for i, edge in enumerate(edges):
        before, after = (low, high) if i % 2 == 0 else (high, low)
        frame += [float(edge), float(edge + EDGE_FRAMES)]
        value += [before, after]
    return Light(np.array(frame), np.array(value, np.float32)[:, None, None])


def bars(shape: tuple[int, int], frames: int, rng: np.random.Generator) -> Light:
    """Upright bars: in the upper half to the right, some beyond one spike a frame; below dim ones, to the left.

    At most one column from key to key.
    """
    rows, columns = shape
    every = 4
    frame = np.arange(0, frames + every, every, dtype=np.float64)
    upper = _bar_line(frame, columns, rng.uniform(0.15, 0.25), (0.25, 0.6, 1.4), rng)
    lower = _bar_line(frame, columns, -rng.uniform(0.15, 0.25), (0.12, 0.2, 0.3), rng)
    radiance = np.empty((frame.size, rows, columns), np.float32)
    radiance[:, : rows // 2] = upper[:, None]
    radiance[:, rows // 2 :] = lower[:, None]
    return Light(frame, radiance)


def _bar_line(
    frame: NDArray[np.float64], columns: int, speed: float, levels: tuple[float, ...], rng: np.random.Generator
) -> NDArray[np.float64]:
    """(K, columns) radiance of bars that move at `speed` columns a frame round and round, averaged over each column."""
    background = rng.uniform(0.04, 0.08)
    line = np.full((frame.size, columns), background)
    slot = columns / len(levels)
    for i, level in enumerate(levels):
        width = rng.uniform(0.3, 0.5) * slot
        left = (rng.uniform(0, 0.3) + i) * slot + speed * frame
        line += (level * rng.uniform(0.9, 1.1) - background) * _covered(left, width, columns)
    return line


def _covered(left: NDArray[np.float64], width: float, columns: int) -> NDArray[np.float64]:
    """(K, columns) share of each column under [left, left + width), the line being closed to a ring."""
    near = np.arange(columns)[None, :] - (left % columns)[:, None]
    covered = np.zeros_like(near)
    for turn in (-columns, 0, columns):
        low = near + turn
        covered += np.clip(np.minimum(low + 1, width) - np.maximum(low, 0.0), 0.0, 1.0)
    return covered


def disk(shape: tuple[int, int], frames: int, rng: np.random.Generator) -> Light:
    """A textured disk that turns, before a still chequer of bright and dark fields."""
    rows, columns = shape
    radius = 0.36 * min(shape)
    every = 8
    frame = np.arange(0, frames + every, every, dtype=np.float64)
    turn = rng.uniform(0.6, 0.9) / every / radius * frame * rng.choice([-1.0, 1.0])
    y, x = np.mgrid[:rows, :columns] - np.array([(rows - 1) / 2, (columns - 1) / 2])[:, None, None]
    field = max(4, columns // 8)
    dark, bright = rng.uniform(0.015, 0.03), rng.uniform(0.7, 0.9)
    i, j = np.mgrid[:rows, :columns] // field
    surround = np.where((i + j) % 2 == 0, bright, dark) * np.where(i % 3 == 0, 0.5, 1.0)
    inside = np.clip(radius - np.hypot(x, y) + 0.5, 0.0, 1.0)
    waves = [(rng.uniform(0.1, 0.5), rng.uniform(0, 2 * np.pi), rng.uniform(0, 2 * np.pi)) for _ in range(6)]
    cos, sin = np.cos(turn)[:, None, None], np.sin(turn)[:, None, None]
    u, v = cos * x + sin * y, cos * y - sin * x
    texture = sum(np.sin(k * (u * np.cos(a) + v * np.sin(a)) + phase) for k, a, phase in waves)
    picture = 0.05 + 0.6 / (1.0 + np.exp(-1.5 * texture))
    return Light(frame, (inside * picture + (1.0 - inside) * surround).astype(np.float32))
