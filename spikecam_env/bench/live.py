"""Live mode: cost of a frame, pictures a second at several speeds of the stream, and the error of skipping passes.

spikecam bench live

Everything is of the camera of 250 x 400 at 40 kHz, packed, but for the errors, which are of a smaller one.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from denoiser.evaluate.metrics import psnr_db
from denoiser.live import LiveDnSS
from denoiser.live.session import Figures, Session, Shown
from denoiser.online import OnlineDnSS
from denoiser.passes.pixel_history import STEPS
from scenes import RotatingDisk, Scene
from scenes.catalogue import make_scene
from spikecam_env.bench.machine import FRAME_RATE_HZ, SHAPE
from spikecam_env.sensor import Keyframes, SpikeSensor
from spikecam_env.streams.hdf5 import SpikeWriter
from spikecam_env.streams.packing import pack_frames, unpack_frames
from spikecam_env.streams.sources import open_source
from spikecam_env.streams.vidar import save_vidar_dat

RECORDED = 1024
"""Frames of the file that is played over and over: 13 MB, which a machine keeps in memory, as it would a camera's."""
MODES = ("picture", "best", "fast")
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
SEEN = 256
"""Frames of each gap that are simulated, the last: all that a picture of a few passes is made of."""
PICTURES, JUDGED = 72, 6
"""Of each stream, and those of them, the last, that are judged: the gain is known after some 64 passes."""
SETTLED = 2048
"""Frames after which `OnlineDnSS` knows a pixel's gain, of which it remembers 1024."""
PASSES = (1, 2, 4)
SCENES = (("disk", 20.0), ("fan", 10.0), ("tumble", 10.0), ("train", 20.0))
"""Name and mean interval [frames]."""


def bench_live(seconds: float = SECONDS, seed: int = 0) -> dict[str, list[dict[str, Any]]]:
    """Tables by title: a frame's and a picture's cost, streams in real time, errors against the true light."""
    spikes = SpikeSensor("scsim", SHAPE, seed).step(RotatingDisk(SHAPE).radiance(0, RECORDED), RECORDED)
    return {
        "Costs": costs(spikes),
        f"A stream of {FRAME_RATE_HZ} frames/s from a file, {seconds:g} s": streams(spikes, seconds),
        f"Error of a picture of `best`, PSNR [dB] against the true light, {SMALL[0]} x {SMALL[1]}": errors(seed),
    }


def costs(spikes: NDArray[np.uint8]) -> list[dict[str, Any]]:
    """CPU time of a frame that is pushed, read, or taken in by mode `picture`, of a picture by mode, and of a frame of
    `OnlineDnSS`.

    Returns:
        Rows of the work, CPU time [us] of a frame or picture, MB/s of packed bytes, and the cores that real time would
        take (30 pictures a second).
    """
    packed = pack_frames(spikes)
    every, *modes = (LiveDnSS(SHAPE, mode, step=STEPS[1] if mode == "picture" else None) for mode in MODES)
    for live in (every, *modes):
        live.warm_up()
    push_s = _cpu_s(lambda: _pushed(modes[0], packed), 20) / len(packed)
    take_in_s = _cpu_s(lambda: _taken_in(every, packed), STEPS[1] // len(packed)) / len(packed) - push_s
    picture_s = _cpu_s(lambda: _ended(every, packed), 8) - (push_s + take_in_s) * len(packed)
    pictures_s = [picture_s, *(_cpu_s(partial(_pictured, live, packed), 8) - push_s * len(packed) for live in modes)]
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
        ("taken in, a frame", take_in_s, FRAME_RATE_HZ),
        *((f"picture, {mode}", picture_s, 30) for mode, picture_s in zip(MODES, pictures_s, strict=True)),
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

    Returns:
        Rows of the stream, frames/s taken in, frames lost, pictures/s, latency [ms] from a frame to its picture.  The
        last row is `OnlineDnSS` at its full speed: it denoises every frame, so every frame is a picture.
    """
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        path = _saved(spikes, Path(folder) / "stream.dat")
        played = [(mode, speed) for mode in MODES for speed in SPEEDS]
        for mode, speed in tqdm(played, desc="bench", unit="speed", leave=False):
            figures = _played(path, mode, speed, seconds)
            rows.append(
                {
                    "what": f"live, {mode}, speed {speed:g}",
                    "frames/s": figures.frames_per_s,
                    "lost": figures.lost,
                    "pictures/s": figures.pictures_per_s,
                    "latency [ms]": figures.latency_ms,
                }
            )
    rate = _whole_stream(spikes, min(seconds, ONLINE_S))
    return [*rows, {"what": "OnlineDnSS", "frames/s": rate, "lost": 0, "pictures/s": rate, "latency [ms]": None}]


def errors(seed: int) -> list[dict[str, Any]]:
    """Error of skipping passes: pictures of `best`, GAP frames apart, against the true light, once the gain is known.

    Returns:
        Rows of scene and mean interval [frames]; PSNR [dB] of the noisy picture (TFP 41), of live pictures by passes a
        picture, and of the same frames out of `OnlineDnSS`.
    """
    return [_errors(name, interval, seed) for name, interval in tqdm(SCENES, desc="errors", unit="scene", leave=False)]


def _errors(name: str, interval: float, seed: int) -> dict[str, Any]:
    scene = make_scene(name, SMALL, seed, mean_interval=interval)
    camera = SpikeSensor("scsim", SMALL, seed)
    watching = {passes: LiveDnSS(SMALL, "best", passes=passes) for passes in PASSES}
    pictures: dict[str, dict[int, NDArray[np.floating]]] = {}
    for stop in range(GAP, (PICTURES + 1) * GAP, GAP):
        seen = _recorded(scene, camera, stop - SEEN, stop)
        for passes, live in watching.items():
            live.skip(GAP - SEEN)
            live.push(seen)
            picture, frame = live.picture(), live.frame
            assert frame is not None
            pictures.setdefault(f"live, {passes} a picture", {})[frame] = picture
    judged = list(pictures[f"live, {PASSES[0]} a picture"])[-JUDGED:]
    begun = (judged[0] - SETTLED) // GAP * GAP  # passes then cover the frames that they cover live
    whole = unpack_frames(_recorded(scene, SpikeSensor("scsim", SMALL, seed), begun, PICTURES * GAP), SMALL)
    rates = OnlineDnSS.pretrained("best", output="rate").push(whole)
    assert isinstance(rates, np.ndarray)
    noisy = {frame: whole[frame - begun - 20 : frame - begun + 21].mean(axis=0) for frame in judged}
    pictures = {"noisy": noisy, **pictures, "OnlineDnSS": {frame: rates[frame - begun] for frame in judged}}
    light = {frame: scene.truth(frame + 0.5).radiance for frame in judged}
    figures = {
        what: float(np.mean([psnr_db(shown[frame], true, float(true.max())) for frame, true in light.items()]))
        for what, shown in pictures.items()
    }
    return {"scene": name, "mean interval": interval, **figures}


def _recorded(scene: Scene, camera: SpikeSensor, first: int, stop: int) -> NDArray[np.uint8]:
    """Packed frames of a camera, whatever it saw before, in the light of the scene's frames first .. stop."""
    blocks = []
    for at in range(first, stop, BLOCK):
        count = min(BLOCK, stop - at)
        keys = scene.radiance(at, at + count)
        blocks.append(pack_frames(camera.step(Keyframes.known(keys.frame - at + camera.frame, keys.radiance), count)))
    return np.concatenate(blocks)


def _played(path: Path, mode: str, speed: float, seconds: float) -> Figures:
    with (
        open_source(str(path), loop=True) as source,
        Session(source, LiveDnSS(SHAPE, mode), speed=speed, seconds=seconds) as session,
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


def _taken_in(live: LiveDnSS, packed: NDArray[np.uint8]) -> None:
    _pushed(live, packed)
    live.take_in()


def _ended(live: LiveDnSS, packed: NDArray[np.uint8]) -> None:
    _pushed(live, packed)
    live.end()


def _pictured(live: LiveDnSS, packed: NDArray[np.uint8]) -> None:
    _pushed(live, packed)
    live.picture()


def _cpu_s(work: Callable[[], object], times: int) -> float:
    """CPU time of this process [s], all its threads, for one call, on average."""
    begun_s = time.process_time()
    for _ in range(times):
        work()
    return (time.process_time() - begun_s) / times
