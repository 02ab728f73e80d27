"""Live mode: what a frame costs, pictures a second at several speeds of the stream, and what leaving passes out costs.

spikecam bench live

Everything is of the camera of 250 x 400 at 40 kHz, packed, but for the errors, which are of a smaller one.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from denoiser.live import LiveDnSS
from denoiser.live.session import Figures, Session, Shown
from denoiser.metrics import psnr_db
from denoiser.online import OnlineDnSS
from scenes import RotatingDisk, Scene
from scenes.catalogue import make_scene
from spikecam_env.bench.machine import FRAME_RATE_HZ, SHAPE
from spikecam_env.sensor import SpikeSensor
from spikecam_env.streams.hdf5 import SpikeWriter
from spikecam_env.streams.packing import pack_frames, unpack_frames
from spikecam_env.streams.sources import open_source
from spikecam_env.streams.vidar import save_vidar_dat

RECORDED = 1024
"""Frames of the file that is played over and over: 13 MB, which a machine keeps in memory, as it would a camera's."""
SPEEDS = (1.0, 0.5, 0.1)
"""Of the file, 1 being real time."""
SECONDS = 60.0
"""Of each speed: the goal is that of a minute nothing is lost."""
ONLINE_S = 10.0
"""Of these at most `OnlineDnSS` is measured."""
BLOCK = 256
SMALL = (64, 96)
"""Rows and columns of the streams that errors are of."""
GAP = 1344
"""Frames from picture to picture of those: 30 pictures a second at real time; a multiple of a pass."""
PICTURES = 16
"""Of each stream; the first half, in which the gain is found, is not judged."""
PASSES = (1, 2, 4)
SCENES = (("disk", 20.0), ("fan", 10.0), ("tumble", 10.0), ("train", 20.0))
"""Name and mean interval [frames]."""


def bench_live(seconds: float = SECONDS, seed: int = 0) -> dict[str, list[dict[str, Any]]]:
    """Tables by title: a frame's and a picture's cost, streams in real time, errors against the true light."""
    spikes = SpikeSensor("scsim", SHAPE, seed).step(RotatingDisk(SHAPE).radiance(0, RECORDED), RECORDED)
    return {
        "What it costs": costs(spikes),
        f"A stream of {FRAME_RATE_HZ} frames/s from a file, {seconds:g} s": streams(spikes, seconds),
        f"Error of a picture, PSNR [dB] against the true light, {SMALL[0]} x {SMALL[1]}": errors(seed),
    }


def costs(spikes: NDArray[np.uint8]) -> list[dict[str, Any]]:
    """CPU time of taking a frame in, of reading it, and of a picture; `OnlineDnSS`, for every frame, to compare with.

    Columns: what, CPU time [us] of a frame or picture, MB/s of packed bytes, and the cores that real time would take (30
    pictures a second).
    """
    packed = pack_frames(spikes)
    live = LiveDnSS(SHAPE)
    live.warm_up()
    push_s = _cpu_s(lambda: _pushed(live, packed), 20) / len(packed)
    picture_s = _cpu_s(lambda: _pictured(live, packed), 8) - push_s * len(packed)
    online = OnlineDnSS.pretrained("best", output="rate")
    chunk = spikes[:16]
    online.push(spikes[:64])
    whole_s = _cpu_s(lambda: online.push(chunk), 8) / len(chunk)
    with tempfile.TemporaryDirectory() as folder:
        dat, h5 = (_read_s(_saved(spikes, Path(folder) / name)) for name in ("stream.dat", "stream.h5"))
    found = (
        ("push, a frame", push_s, FRAME_RATE_HZ),
        ("read from .dat, a frame", dat, FRAME_RATE_HZ),
        ("read from .h5, a frame", h5, FRAME_RATE_HZ),
        ("picture", picture_s, 30),
        ("OnlineDnSS, a frame", whole_s, FRAME_RATE_HZ),
    )
    return [
        {
            "what": what,
            "CPU [us]": 1e6 * each_s,
            "MB/s": packed.shape[1] / each_s / 1e6 if rate == FRAME_RATE_HZ else None,
            "cores at real time": rate * each_s,
        }
        for what, each_s, rate in found
    ]


def streams(spikes: NDArray[np.uint8], seconds: float) -> list[dict[str, Any]]:
    """A file played over and over at several speeds, denoised as it comes, as `spikecam live` does.

    Columns: what, frames/s taken in, frames lost, pictures/s, latency [ms] from a frame's coming to its picture.  The
    last row is `OnlineDnSS`, as fast as it goes: every frame is denoised, so every frame is a picture.
    """
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        path = _saved(spikes, Path(folder) / "stream.dat")
        for speed in tqdm(SPEEDS, desc="bench", unit="speed", leave=False):
            figures = _played(path, speed, seconds)
            rows.append(
                {
                    "what": f"live, speed {speed:g}",
                    "frames/s": figures.frames_per_s,
                    "lost": figures.lost,
                    "pictures/s": figures.pictures_per_s,
                    "latency [ms]": figures.latency_ms,
                }
            )
    rate = _whole_stream(spikes, min(seconds, ONLINE_S))
    return [*rows, {"what": "OnlineDnSS", "frames/s": rate, "lost": 0, "pictures/s": rate, "latency [ms]": None}]


def errors(seed: int) -> list[dict[str, Any]]:
    """What leaving passes out costs: pictures GAP frames apart against the true light.

    Columns: scene, mean interval [frames]; PSNR [dB] of the noisy picture (TFP 41), of live pictures by passes a
    picture, and of the same frames out of `OnlineDnSS`.
    """
    return [_errors(name, interval, seed) for name, interval in tqdm(SCENES, desc="errors", unit="scene", leave=False)]


def _errors(name: str, interval: float, seed: int) -> dict[str, Any]:
    scene = make_scene(name, SMALL, seed, mean_interval=interval)
    sensor = SpikeSensor("scsim", SMALL, seed)
    packed = [
        pack_frames(sensor.step(scene.radiance(first, first + GAP), GAP)) for first in range(0, PICTURES * GAP, GAP)
    ]
    row: dict[str, Any] = {"scene": name, "mean interval": interval}
    stream = np.concatenate(packed)
    for passes in PASSES:
        live, shown = LiveDnSS(SMALL, passes=passes), {}
        for block in packed:
            live.push(block)
            picture = live.picture()
            assert live.frame is not None
            shown[live.frame] = picture
        judged = list(shown)[PICTURES // 2 :]
        if passes == PASSES[0]:
            noisy = {frame: unpack_frames(stream[frame - 20 : frame + 21], SMALL).mean(axis=0) for frame in judged}
            row["noisy"] = _psnr_db(scene, noisy, judged)
        row[f"live, {passes} a picture"] = _psnr_db(scene, shown, judged)
    row["OnlineDnSS"] = _psnr_db(scene, _rates(stream, judged), judged)
    return row


def _rates(stream: NDArray[np.uint8], frames: list[int]) -> dict[int, NDArray[np.float32]]:
    """Some frames (H, W) [spikes/frame] of the whole stream, denoised."""
    online, done = OnlineDnSS.pretrained("best", output="rate"), 0
    found: dict[int, NDArray[np.float32]] = {}
    for first in range(0, len(stream), BLOCK):
        rates = online.push(unpack_frames(stream[first : first + BLOCK], SMALL))
        assert isinstance(rates, np.ndarray)
        found |= {frame: rates[frame - done].copy() for frame in frames if done <= frame < done + len(rates)}
        done += len(rates)
    return found


def _psnr_db(scene: Scene, pictures: dict[int, NDArray[np.floating]], frames: list[int]) -> float:
    light = {frame: scene.truth(frame + 0.5).radiance for frame in frames}
    return float(np.mean([psnr_db(pictures[frame], light[frame], float(light[frame].max())) for frame in frames]))


def _played(path: Path, speed: float, seconds: float) -> Figures:
    with (
        open_source(str(path), loop=True) as source,
        Session(source, LiveDnSS(SHAPE), speed=speed, seconds=seconds) as session,
    ):
        shown: Shown | None = None
        while not session.over:
            shown = session.newest(shown, 1.0) or shown
    return session.figures


def _whole_stream(spikes: NDArray[np.uint8], seconds: float) -> float:
    """Frames a second of `OnlineDnSS`."""
    online = OnlineDnSS.pretrained("best", output="rate")
    online.push(spikes[:64])
    begun_s, frames = time.perf_counter(), 0
    while (taken_s := time.perf_counter() - begun_s) < seconds or not frames:
        frames += len(online.push(spikes[:16]))
    return frames / taken_s


def _saved(spikes: NDArray[np.uint8], path: Path) -> Path:
    if path.suffix == ".dat":
        save_vidar_dat(path, spikes, side_file=True, frame_rate_hz=FRAME_RATE_HZ)
    else:
        with SpikeWriter(path, SHAPE, FRAME_RATE_HZ) as writer:
            writer.append(spikes)
    return path


def _read_s(path: Path) -> float:
    """CPU time [s] of reading a frame of a file that is in memory already."""
    rows = np.empty((BLOCK, SHAPE[0] * SHAPE[1] // 8), np.uint8)
    with open_source(str(path), loop=True) as source:
        source.read(rows)
        return _cpu_s(lambda: source.read(rows), 40) / BLOCK


def _pushed(live: LiveDnSS, packed: NDArray[np.uint8]) -> None:
    for first in range(0, len(packed), BLOCK):
        live.push(packed[first : first + BLOCK])


def _pictured(live: LiveDnSS, packed: NDArray[np.uint8]) -> None:
    _pushed(live, packed)
    live.picture()


def _cpu_s(work: Callable[[], object], times: int) -> float:
    """CPU time of this process [s], all its threads, for one call, on average."""
    begun_s = time.process_time()
    for _ in range(times):
        work()
    return (time.process_time() - begun_s) / times
