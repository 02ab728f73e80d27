"""Spikes show whether the geometry of a headerless file is right: never an alarm on a right reading."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from scenes.catalogue import make_scene
from spikecam_env.sensor import SensorModel, SpikeSensor
from spikecam_env.streams import pack_frames, read_recording
from spikecam_env.streams.geometry import coincidences, frame_length, geometry_doubt
from spikecam_env.streams.packing import packed_bytes

SHARED = Path(__file__).parents[2].parent / "shared" / "data"
SHAPE = (250, 400)
SMALL = (120, 160)


def flat(preset: str, light: float, frames: int = 96, shape: tuple[int, int] = SHAPE) -> np.ndarray:
    return SpikeSensor(SensorModel.preset(preset), shape, 0).step(np.full(shape, light, np.float32), frames)


def ramp(preset: str, frames: int = 96, shape: tuple[int, int] = SHAPE) -> np.ndarray:
    light = np.linspace(0.1, 1, shape[1]) * np.linspace(0.3, 1, shape[0])[:, None]
    return SpikeSensor(SensorModel.preset(preset), shape, 0).step(light.astype(np.float32), frames)


def scene(name: str, shape: tuple[int, int] = SHAPE, interval: float = 10.0) -> np.ndarray:
    keys = make_scene(name, shape=shape, seed=1, mean_interval=interval)
    sensor = SpikeSensor(SensorModel.preset("scsim"), shape, 0)
    return sensor.step(keys.radiance(0, 80), 80)


def in_phase(shape: tuple[int, int] = SMALL) -> np.ndarray:
    """A simulation without noise whose pixels all begin empty: neighbours fire together."""
    light = 0.2 + 0.1 * np.sin(np.arange(shape[1]) / 40) * np.ones((shape[0], 1))
    charge = np.floor(np.arange(97)[:, None, None] * light)
    return np.diff(charge, axis=0).astype(np.uint8)


def noise(rate: float, shape: tuple[int, int] = SMALL) -> np.ndarray:
    return (np.random.default_rng(0).random((160, *shape)) < rate).astype(np.uint8)


def flicker() -> np.ndarray:
    """Bright light that goes on and off within a block of frames."""
    light = (0.9 * (np.arange(96) % 20 < 8))[:, None, None] * np.ones(SMALL)
    charge = np.random.default_rng(0).random(SMALL) + np.cumsum(np.concatenate([np.zeros((1, *SMALL)), light]), axis=0)
    return np.diff(np.floor(charge), axis=0).astype(np.uint8)


def bars(period: int) -> np.ndarray:
    """Fine bright bars that move a pixel a frame."""
    at = (np.arange(SMALL[1]) + np.arange(96)[:, None]) % period < period / 2
    light = np.broadcast_to((0.02 + 0.9 * at)[:, None, :], (96, *SMALL))
    charge = np.random.default_rng(0).random(SMALL) + np.concatenate([np.zeros((1, *SMALL)), np.cumsum(light, axis=0)])
    return np.diff(np.floor(charge), axis=0).astype(np.uint8)


def glare(dim_half: bool) -> np.ndarray:
    """Bars of three levels that move fast, up to 0.8 spikes a frame: within a block of frames spikes come and go."""
    rows, columns = SMALL

    def line(speed: float, levels: tuple[float, ...]) -> np.ndarray:
        at = (np.arange(columns) - speed * np.arange(600)[:, None]) % columns / columns * 30
        return np.where(at % 1 < 0.4, np.asarray(levels)[at.astype(int) % 3], 0.06)

    light = np.empty((600, *SMALL))
    light[:] = line(0.25, (0.25, 0.6, 0.8))[:, None]
    if dim_half:
        light[:, rows // 2 :] = line(-0.15, (0.12, 0.2, 0.3))[:, None]
    whole = np.floor(np.random.default_rng(0).random(SMALL) + np.cumsum(light, axis=0))
    return np.diff(whole, axis=0).astype(np.uint8)


def half_dark() -> np.ndarray:
    """Light in the upper or the lower half only, in turn."""
    light = np.zeros((96, *SMALL), np.float32)
    for t in range(96):
        light[t, 60 * (t // 16 % 2) :][:60] = 0.3
    charge = np.random.default_rng(0).random(SMALL) + np.concatenate([np.zeros((1, *SMALL)), np.cumsum(light, axis=0)])
    return np.diff(np.floor(charge), axis=0).astype(np.uint8)


def mosaic() -> np.ndarray:
    """A colour camera's mosaic of filters: even and odd pixels differ three times."""
    light = np.full(SMALL, 0.3, np.float32)
    light[::2, ::2] = light[1::2, 1::2] = 0.1
    return SpikeSensor(SensorModel.preset("scsim"), SMALL, 0).step(light, 96)


RIGHT: dict[str, Callable[[], np.ndarray]] = {
    "dark, scsim": lambda: flat("scsim", 0.0, shape=SMALL),
    "dark, physical": lambda: flat("physical", 0.0, shape=SMALL),
    "flat, interval 100": lambda: flat("scsim", 0.01),
    "flat, interval 5": lambda: flat("scsim", 0.2, shape=SMALL),
    "flat, interval 2": lambda: flat("scsim", 0.5, shape=SMALL),
    "flat, interval 1.3": lambda: flat("scsim", 0.77),
    "flat, every frame": lambda: flat("scsim", 3.0, shape=SMALL),
    "flat, physical": lambda: flat("physical", 0.2, shape=SMALL),
    "ramp, scsim": lambda: ramp("scsim"),
    "ramp, ideal": lambda: ramp("ideal", shape=SMALL),
    "scene: disk, bright": lambda: scene("disk", interval=3.0),
    "scene: disk, dim": lambda: scene("disk", interval=60.0),
    "scene: collage": lambda: scene("collage"),
    "in phase": in_phase,
    "flicker": flicker,
    "bars of three levels": lambda: glare(dim_half=False),
    "bars of three levels, half dim": lambda: glare(dim_half=True),
    "bars of 16 pixels": lambda: bars(16),
    "bars of 4 pixels": lambda: bars(4),
    "bars of 15 pixels": lambda: bars(15),
    "half dark, in turn": half_dark,
    "mosaic": mosaic,
    "silent": lambda: np.zeros((96, *SMALL), np.uint8),
    "all ones": lambda: np.ones((96, *SMALL), np.uint8),
    "dim noise": lambda: noise(0.01),
    "1 frame": lambda: flat("scsim", 0.2, 1),
    "2 frames": lambda: ramp("scsim", 2),
    "3 frames": lambda: ramp("scsim", 3),
    "8 frames": lambda: ramp("scsim", 8),
    "8 x 8, 40 frames": lambda: flat("scsim", 0.2, 40, (8, 8)),
    "8 x 8, 4000 frames": lambda: flat("scsim", 0.2, 4000, (8, 8)),
    "1 x 1, 4000 frames": lambda: flat("scsim", 0.2, 4000, (1, 1)),
    "1 x 64, 2000 frames": lambda: flat("scsim", 0.2, 2000, (1, 64)),
    "3 x 5, 2000 frames": lambda: flat("scsim", 0.2, 2000, (3, 5)),
    "64 x 64": lambda: ramp("scsim", 1000, (64, 64)),
    "250 x 250": lambda: ramp("scsim", 96, (250, 250)),
    "500 x 800": lambda: ramp("scsim", 40, (500, 800)),
    "1000 x 1000, dim": lambda: flat("scsim", 0.01, 20, (1000, 1000)),
}
if SHARED.is_dir():
    RIGHT |= {
        "real: wall": lambda: read_recording(SHARED / "real" / "wall.npz").spikes,
        "real: low light": lambda: read_recording(SHARED / "real" / "helicopter_low_light.npz").spikes,
        "public: REDS": lambda: read_recording(SHARED / "synthetic" / "reds_200_part1.dat").spikes,
    }

stream = cache(lambda name: RIGHT[name]())


@pytest.mark.parametrize("name", RIGHT)
def test_a_right_reading_is_never_doubted(name: str) -> None:
    spikes = stream(name)
    packed = pack_frames(spikes)
    found = coincidences(np.unpackbits(packed[:80].ravel(), bitorder="little"), 8 * packed.shape[1])
    doubt = geometry_doubt(packed, spikes.shape[1:])
    said = f"coincidence {found.next_frame:5.2f} of {found.chance:8.0f}  {doubt or 'no doubt'}"
    print(f"{name:22s} rate {spikes.mean():.4f}  {said}")
    assert doubt is None


def read_as(packed: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """The same bytes as whole frames of another shape."""
    size = packed_bytes(shape)
    flow = packed.ravel()
    return flow[: flow.size // size * size].reshape(-1, size)


SIZES = [(251, 400), (250, 416), (500, 800)]
SEEN_IN = ["flat, interval 100", "flat, interval 1.3", "scene: disk, bright", "scene: disk, dim"]
SEEN_IN += [name for name in ("real: wall", "public: REDS") if name in RIGHT]


@pytest.mark.parametrize("name", SEEN_IN)
def test_another_length_of_frames_is_doubted_and_the_right_one_named(name: str) -> None:
    packed = pack_frames(stream(name))
    for shape in SIZES:
        doubt = geometry_doubt(read_as(packed, shape), shape)
        found = coincidences(np.unpackbits(packed[:80].ravel(), bitorder="little"), 8 * packed_bytes(shape))
        print(f"{name:20s} as {shape[0]} x {shape[1]}: coincidence {found.next_frame:5.2f}; {doubt and doubt.sizes}")
        assert doubt is not None and doubt.sizes == (SHAPE,)


STRUCTURED = ["ramp, scsim", "scene: disk, bright", "scene: collage"]
STRUCTURED += [name for name in ("real: wall", "public: REDS") if name in RIGHT]


@pytest.mark.parametrize("name", STRUCTURED)
def test_other_rows_of_as_many_pixels_are_doubted_where_the_picture_has_structure(name: str) -> None:
    packed = pack_frames(stream(name))
    for shape in ((400, 250), (500, 200)):
        doubt = geometry_doubt(packed, shape)
        print(f"{name:20s} as {shape[0]} x {shape[1]}: {doubt}")
        assert doubt is not None and doubt.sizes == (SHAPE,)


@pytest.mark.parametrize("name", [name for name in STRUCTURED if "ramp" not in name])
def test_the_other_bit_order_is_doubted_where_the_picture_has_structure(name: str) -> None:
    spikes = stream(name)
    for order, other in (("little", "big"), ("big", "little")):
        doubt = geometry_doubt(pack_frames(spikes, bit_order=other), SHAPE, order)
        print(f"{name:20s} {other}-endian read as {order}: {doubt}")
        assert doubt is not None and f"bit_order='{other}'" in str(doubt)
        assert geometry_doubt(pack_frames(spikes, bit_order=order), SHAPE, order) is None


@pytest.mark.parametrize("shape", [(300, 500), (64, 48), (37, 53), (480, 640)])
def test_a_length_that_nobody_knows_is_found(shape: tuple[int, int]) -> None:
    """Frames of any size, read as the usual 250 x 400."""
    frames = max(6, 40 * SHAPE[0] * SHAPE[1] // (shape[0] * shape[1]))
    packed = pack_frames(ramp("scsim", frames, shape))
    doubt = geometry_doubt(read_as(packed, SHAPE), SHAPE)
    print(f"{frames} frames of {shape[0]} x {shape[1]} as 250 x 400: {doubt}")
    assert doubt is not None and f"{packed_bytes(shape)} bytes" in str(doubt) and shape in doubt.sizes
    bits = np.unpackbits(packed.ravel(), bitorder="little")
    assert frame_length(bits) == 8 * packed_bytes(shape)


@pytest.mark.parametrize("one", [1, 255])
def test_a_byte_a_pixel_is_seen(one: int) -> None:
    frames = (one * flat("scsim", 0.2, 20)).reshape(-1, 12500)
    assert "one byte a pixel" in str(geometry_doubt(frames, SHAPE))


def test_what_is_no_stream_at_all_is_doubted() -> None:
    random = np.random.default_rng(0).integers(0, 256, (100, 12500), dtype=np.uint8)
    doubt = geometry_doubt(random, SHAPE)
    print(doubt)
    assert doubt is not None and "no other length" in str(doubt)
