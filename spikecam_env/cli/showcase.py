"""The demonstration: a scene through environment and online denoiser, beside its clean twin and its truth."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from tqdm import trange

from denoiser import OnlineDnSS
from denoiser.evaluate.metrics import psnr_db
from denoiser.evaluate.rows import restored
from scenes.protocol import Gaze
from spikecam_env.checked import checked_memory
from spikecam_env.cli.restore import WHITE, WINDOW, DenoisedRecording, light_db, restore
from spikecam_env.cli.screen.screen import compose, white_of
from spikecam_env.errors import InputError
from spikecam_env.sensor import SensorModel
from spikecam_env.streams import middleTFI, middleTFP
from spikecam_env.types import Pictures, Spikes

BLOCK = 25
"""Frames a step; odd, since the truth of a block is that of its middle frame."""
FIRST_SHOWN = 4
"""Blocks left out at the start: noisy and clean twins need 60 frames to forget their common phase."""
LAST_SHOWN = 2
"""Blocks left out at the end, where TFP windows are cut."""
PICTURE_FRAMES = BLOCK * (FIRST_SHOWN + 1 + LAST_SHOWN)
"""Fewest frames that have a block to show."""
FILM_FRAMES = 500
"""Fewest frames of a film: two thirds of its blocks are shown, and TABLE_FRAMES of them are of settled twins."""
TABLE_FRAMES = 250
"""Stretch that the table is of: the paper's network takes 20 times as long as `best`, so it sees no more."""


@dataclass(frozen=True)
class Streamed(DenoisedRecording):
    """One run; planes and true light are of the middle frame of each block."""

    frame_rate_hz: float
    mode: str
    clean: Spikes
    """(T, H, W) of the clean twin."""
    camera_s: float
    """That scene and camera took."""

    @property
    def times_real(self) -> float:
        """The camera's time over the time it took, scene, camera and denoiser together."""
        return len(self.noisy) / self.frame_rate_hz / (self.camera_s + self.seconds)

    @property
    def shown(self) -> list[int]:
        """Frames to show."""
        return list(self.light)[FIRST_SHOWN:-LAST_SHOWN]


def stream(
    *,
    scene: str,
    rpm: float | None,
    frames: int,
    mode: str,
    model: SensorModel | str,
    shape: tuple[int, int],
    seed: int,
    least: int = FILM_FRAMES,
) -> Streamed:
    """Stream a scene through environment and denoiser.

    Args:
        scene: "disk", or another name of the catalogue.
        rpm: speed of the disk; default 2000; of no other scene.
        frames: length of the stream.
        mode: of the denoiser.
        model: of the sensor.
        shape: (rows, columns).
        seed: of scene, camera unit and noise.
        least: fewest frames that can be shown, FILM_FRAMES or PICTURE_FRAMES.

    Raises:
        InputError: fewer frames, or an unknown scene.
    """
    if frames < least:
        raise InputError(f"{frames} frames are too few to show; ask for {least} or more (1200 are a turn at 2000 rpm)")
    checked_memory(4 * frames * shape[0] * shape[1], f"a film of {frames} frames of {shape[0]} x {shape[1]} pixels")
    env, start = _camera(scene, rpm, shape, seed, model=model, frames_per_step=BLOCK, max_episode_steps=frames)
    camera: Any = env.unwrapped
    online = OnlineDnSS.pretrained(mode, output="both")
    _compile(env, online, shape)
    still = np.zeros(2, np.float32)
    noisy, clean = (np.empty((-(-frames // BLOCK) * BLOCK, *shape), np.uint8) for _ in range(2))
    light, camera_s = {}, 0.0
    for first in trange(0, frames, BLOCK, desc="stream", unit="block", leave=False):
        began = time.perf_counter()
        block = env.step(still)[0] if first else env.reset(seed=seed, options=start)[0]
        camera_s += time.perf_counter() - began
        noisy[first : first + BLOCK] = block.view(np.uint8)
    twin = camera.sensor.clean_twin()
    for first in range(0, frames, BLOCK):
        gaze = Gaze((0.0, 0.0), (0.0, 0.0), (first, first + BLOCK))
        light[first + BLOCK // 2] = camera.scene.truth(first + BLOCK / 2, gaze).radiance
        clean[first : first + BLOCK] = twin.step(camera.scene.radiance(*gaze.frames, gaze), BLOCK)
    frame_rate_hz = camera.model.frame_rate_hz
    env.close()
    denoised, planes, seconds = restore(noisy, online, light, BLOCK)
    return Streamed(
        noisy, denoised, planes, light, WINDOW, frame_rate_hz, seconds, online.latency, mode, clean, camera_s
    )


def _camera(
    scene: str, rpm: float | None, shape: tuple[int, int], seed: int, **options: Any
) -> tuple[gymnasium.Env, dict[str, Any]]:
    """The environment, and the options of reset that put the camera before the scene."""
    if scene == "disk":
        env = gymnasium.make("spikecam_env/RotatingDisk-v0", shape=shape, rpm=2000.0 if rpm is None else rpm, **options)
        return env, {"centre": ((shape[1] - 1) / 2, (shape[0] - 1) / 2), "drift_px_s": (0.0, 0.0)}
    env = gymnasium.make("spikecam_env/Scene-v0", scene=scene, shape=shape, scene_seed=seed, **options)
    start: dict[str, Any] = {"start_frame": 0, "offset": (0.0, 0.0)}
    return env, start | ({"seed": seed} if scene == "random" else {})


def picture(run: Streamed, frame: int) -> NDArray[np.uint8]:
    """The screen at a frame of `run.shown`: noisy, denoised, true light, with PSNR against the true light."""
    noisy, _, rate, light = run.panels(frame)
    white = white_of(next(iter(run.light.values())), WHITE)
    return compose([noisy, rate, light], white, corner=f"{run.mode}: denoised online, {run.latency} frames later")


def comparison(run: Streamed) -> list[dict[str, Any]]:
    """A row a stream over TABLE_FRAMES from the middle of the run: mean PSNR [dB].

    Columns `light` compare pictures with the true light: TFP 21, TFP 41, and one instant (TFI; of a denoiser its rate
    plane).  Columns `twin` compare TFP pictures with the clean twin's.  Motion blurs a TFP picture of a fast disk, 41
    frames are 24 pixels at the rim, so the clean twin's row is the limit of the others.  `picture` gives one picture of
    each block, and no stream for TFP.

    Returns:
        Rows of noisy, denoised in three modes with their speed, and clean twin.
    """
    first = BLOCK * max(FIRST_SHOWN, (len(run.light) - TABLE_FRAMES // BLOCK) // 2)
    noisy, clean = (spikes[first : first + TABLE_FRAMES] for spikes in (run.noisy, run.clean))
    judged = range(2 * BLOCK + BLOCK // 2, len(noisy) - 2 * BLOCK, BLOCK)
    instants: dict[str, dict[int, Pictures]] = {
        name: {at: middleTFI(spikes, at) for at in judged} for name, spikes in (("noisy", noisy), ("clean twin", clean))
    }
    streams, seconds = {"noisy": noisy, "clean twin": clean}, {}
    for mode in ("paper", "best"):
        online, began = OnlineDnSS.pretrained(mode, output="both"), time.perf_counter()
        streams[mode], planes, _ = restored(online, noisy, f"compare ({mode})")
        seconds[mode], instants[mode] = time.perf_counter() - began, {at: planes[at] for at in judged}
    online = OnlineDnSS.pretrained("picture", step=BLOCK, look=BLOCK // 2)  # of the middle of each block
    online.another().push(noisy[: 2 * BLOCK])  # compiled
    began = time.perf_counter()
    pictures: Any = online.push(noisy)
    seconds["picture"] = time.perf_counter() - began
    instants["picture"] = {at: pictures[at // BLOCK] for at in judged}
    rows = []
    for name in ("noisy", "paper", "best", "picture", "clean twin"):
        scores = [_scores(instants[name][at], streams.get(name), clean, at, run.light[first + at]) for at in judged]
        means = {measure: _mean([score[measure] for score in scores]) for measure in scores[0]}
        rows.append({"stream": name, **means, "frames/s": len(noisy) / seconds[name] if name in seconds else None})
    return rows


def _mean(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _scores(one: Pictures, spikes: Spikes | None, clean: Spikes, at: int, light: Pictures) -> dict[str, float | None]:
    """PSNR [dB] by column of `comparison`: of one instant's picture, and of means about a frame of a stream."""
    scores: dict[str, float | None] = {"instant, light": light_db(one, light)}
    for window in (21, WINDOW):
        if spikes is None:
            scores[f"TFP {window}, light"] = scores[f"TFP {window}, twin"] = None
            continue
        mean, twin = middleTFP(spikes, at, window), middleTFP(clean, at, window)
        scores[f"TFP {window}, light"] = light_db(mean, light)
        scores[f"TFP {window}, twin"] = psnr_db(mean, twin, float(light.max()))
    return scores


def _compile(env: gymnasium.Env, online: OnlineDnSS, shape: tuple[int, int]) -> None:
    """Run everything once, so that just-in-time compilation does not count as the camera's speed."""
    env.reset(seed=0)
    env.step(np.zeros(2, np.float32))
    online.push(np.zeros((64, *shape), np.uint8))
    online.reset()
