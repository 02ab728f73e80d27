"""Task: keep something that moves in the middle of the view, in any scene of the catalogue."""

from __future__ import annotations

from typing import Any

import numpy as np

from scenes.catalogue import SCENES, exposed, unexposed_scene
from scenes.exposure import checked_interval
from scenes.later import Later
from scenes.protocol import Gaze, Placed
from scenes.renderers.choose import chosen
from scenes.world import World
from spikecam_env.envs.spike_camera import SpikeCameraEnv
from spikecam_env.envs.task import in_the_middle, is_inside
from spikecam_env.errors import InputError, unknown_name

LATEST_START = 40_000
"""Frames: a second into the scene."""

_STARTS = 64
"""Moments drawn for an episode to start at; the first with the target in view is taken."""


class SceneEnv(SpikeCameraEnv):
    """A scene of the catalogue, or a new random world every episode; the camera turns after one thing in it.

        reward = 1 - distance of the target's middle from the picture's / half the picture's diagonal

    at the end of the step: 1 in the middle, 0 in a corner, less beyond.  The episode terminates when the target's
    middle leaves the picture, and is truncated after 500 steps (0.5 s at 40 frames a step).

    scene             a name of `scenes.catalogue.SCENES`; "random" is another world in every episode
    target            name of what is to be followed (`poses` of the truth has them); default: the first that moves
    scene_seed        of a named scene: textures, poses; episodes differ by where and when they start
    start_offset_px   most the camera looks away from its place at first; default a quarter of the shorter side
    mean_interval     of the exposure [frames]
    shape             (rows, columns)
    camera            keywords of `SpikeCameraEnv`: model, frames_per_step, packed, ground_truth, ...

    Options of reset: start_frame, offset (pan, tilt) [pixels] and, of random worlds, seed fix what is drawn otherwise.
    Info: `target` (2,) float64 is where the target's middle is seen at the end of the step [pixels].
    Errors: InputError for an unknown scene or target, and for a scene in which nothing moves.
    """

    def __init__(
        self,
        *,
        scene: str = "random",
        target: str | None = None,
        shape: tuple[int, int] = (250, 400),
        scene_seed: int = 0,
        start_offset_px: float | None = None,
        mean_interval: float = 10.0,
        **camera: Any,
    ) -> None:
        super().__init__(self._draw, self._judge_target, shape=shape, **camera)
        if scene not in SCENES:
            raise unknown_name("scene", scene, SCENES)
        self.start_offset_px = 0.25 * min(self.shape) if start_offset_px is None else float(start_offset_px)
        if not 0 <= self.start_offset_px < np.inf:
            raise InputError(f"start_offset_px is {start_offset_px}; it must be 0 or more, and finite")
        self.scene_name, self.target, self.mean_interval = scene, target, checked_interval(mean_interval)
        self._unexposed = None if scene == "random" else self._build(scene_seed)
        self._named: Placed | None = None
        if scene == "random" or isinstance(self._unexposed, World):
            chosen()  # in this process, once: workers forked from it need not try again

    def close(self) -> None:
        """See `SpikeCameraEnv.close`."""
        self._unexposed = self._named = None
        super().close()

    def _build(self, seed: int) -> Placed:
        """The scene of this seed, not yet exposed; raises InputError where there is nothing to follow in it."""
        scene = unexposed_scene(self.scene_name, self.shape, seed, self.model.frame_rate_hz)
        places = scene.places(0.0) if isinstance(scene, Placed) else {}
        if not isinstance(scene, Placed) or not places:
            raise InputError(f"nothing moves in the scene {self.scene_name!r}, so there is nothing to follow")
        if self.target is not None and self.target not in places:
            raise unknown_name(f"target in the scene {self.scene_name!r}:", self.target, places)
        return scene

    def _draw(self, rng: np.random.Generator, options: dict[str, Any]) -> Later:
        """The scene of one episode: always the same number of draws, so that an option changes nothing else."""
        seed, starts = int(rng.integers(2**31)), rng.integers(LATEST_START, size=_STARTS)
        distance, direction = self.start_offset_px * np.sqrt(rng.random()), rng.uniform(0, 2 * np.pi)
        known = ("start_frame", "offset", *(("seed",) if self._unexposed is None else ()))
        for name in options:
            if name not in known:
                raise unknown_name("option of reset", name, known)
        scene = self._named or self._exposed(int(options.get("seed", seed)))
        pan, tilt = options.get("offset", (distance * np.cos(direction), distance * np.sin(direction)))
        offset = (float(pan), float(tilt))
        if "start_frame" in options:
            return Later(scene, int(options["start_frame"]), offset)
        episodes = [Later(scene, int(start), offset) for start in starts]
        return next((e for e in episodes if is_inside(self._place(e, 0.0, None), e.shape)), episodes[0])

    def _exposed(self, seed: int) -> Placed:
        """The scene of an episode.  Its first picture is rendered here, not at construction: a vector environment makes
        one in the parent, only to ask for its spaces, and OpenGL does not survive the fork that follows."""
        scene = exposed(self._unexposed or self._build(seed), self.mean_interval)
        assert isinstance(scene, Placed)
        if self._unexposed is not None:
            self._named = scene
        return scene

    def _place(self, scene: Placed, frame: float, gaze: Gaze | None) -> tuple[float, float]:
        places = scene.places(frame, gaze)
        return places[self.target or next(iter(places))]

    def _judge_target(self, scene: Placed, frame: float, gaze: Gaze) -> tuple[float, bool]:
        return in_the_middle(self._place(scene, frame, gaze), scene.shape)

    def _info(self, scene: Any, gaze: Gaze) -> dict[str, Any]:
        return super()._info(scene, gaze) | {"target": np.array(self._place(scene, gaze.frames[1], gaze))}
