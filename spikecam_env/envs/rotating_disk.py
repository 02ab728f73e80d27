"""Task: keep a spinning disk in the middle of the view."""

from __future__ import annotations

from math import inf
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from scenes.flat.disk import RotatingDisk
from spikecam_env.checked import checked_count, checked_number
from spikecam_env.envs.aiming import SUCCESS_SHARE, AimingEnv
from spikecam_env.envs.episode import Episode
from spikecam_env.envs.keywords import check_settled
from spikecam_env.envs.registration import MAX_EPISODE_STEPS
from spikecam_env.envs.reset_options import checked_options, pair
from spikecam_env.envs.task import DRIFT, checked_limit, drawn_within


class RotatingDiskEnv(AimingEnv):
    """The disk starts off the middle and drifts slowly; the camera turns after it.

    The reward is "distance" of `envs.task` unless `reward="progress"`: 1 in the middle, 0 in a corner.  The episode
    terminates when the disk's centre leaves the picture.  On the target: within an eighth of the shorter side.
    `gymnasium.make` truncates it after 500 steps (0.5 s at 40 frames a step), or after its `max_episode_steps`.

    Options:
        centre (x, y) [pixels], drift_px_s (x, y), angle [radians]; the others are drawn.

    The arguments shape, rpm, radius, light, texture, background and texture_seed are those of `scenes.RotatingDisk`.

    Args:
        start_offset_px: most the disk starts off the middle; default a quarter of the shorter side.
        drift_px_s: most it drifts; default 0.8 of the shorter side a second.
        steps: after which the class itself truncates an episode; None, as the ids have it: it never does.
        camera: keywords of `AimingEnv` and `SpikeCameraEnv`: reward, model, frames_per_step, ground_truth, ...

    Example:
        >>> env = RotatingDiskEnv(shape=(16, 24))
        >>> spikes, info = env.reset(seed=0)
        >>> spikes, reward, terminated, truncated, info = env.step(np.array([0.2, 0.0]))
        >>> spikes.shape, spikes.dtype
        ((40, 16, 24), dtype('int8'))
    """

    settles: ClassVar[tuple[str, ...]] = ("draw",)

    def __init__(
        self,
        *,
        shape: tuple[int, int] = (250, 400),
        rpm: float = 2000.0,
        radius: float | None = None,
        light: tuple[float, float] = (0.05, 0.6),
        texture: ArrayLike | None = None,
        background: float | ArrayLike | None = None,
        texture_seed: int = 0,
        start_offset_px: float | None = None,
        drift_px_s: float | None = None,
        steps: int | None = MAX_EPISODE_STEPS,
        **camera: Any,
    ) -> None:
        check_settled(type(self), camera)
        super().__init__(self._draw, shape=shape, **camera)
        self.steps = None if steps is None else checked_count(steps, "steps")
        side = min(self.shape)
        self.start_offset_px = checked_limit("start_offset_px", start_offset_px, 0.25 * side)
        self.drift_px_s = checked_limit("drift_px_s", drift_px_s, DRIFT * side)
        self._disk = RotatingDisk(
            self.shape, rpm, radius, light, texture, background, texture_seed, self.model.frame_rate_hz
        )

    def _draw(self, rng: np.random.Generator, options: dict[str, Any]) -> Episode:
        """The disk of one episode: always the same number of draws, so that an option changes nothing else."""
        middle_x, middle_y = self._disk.centre
        x, y = drawn_within(rng, self.start_offset_px)
        drawn = {
            "centre": (middle_x + x, middle_y + y),
            "drift_px_s": drawn_within(rng, self.drift_px_s),
            "angle": float(rng.uniform(0, 2 * np.pi)),
        }
        given = checked_options(options, {"centre": pair, "drift_px_s": pair, "angle": checked_number})
        disk, success_px = self._disk.placed(**{**drawn, **given}), SUCCESS_SHARE * min(self.shape)
        beyond = inf if self.steps is None else 0
        return Episode(disk, "disk", success_px, self.steps or MAX_EPISODE_STEPS, beyond=beyond)
