"""Task: keep something that moves in the middle of the view, in any scene of the catalogue."""

from __future__ import annotations

from functools import lru_cache
from math import inf
from typing import Any, ClassVar

import numpy as np

from scenes.catalogue import SCENES, exposed, unexposed_scene
from scenes.derived.later import Later
from scenes.exposure import checked_interval
from scenes.protocol import Placed
from scenes.renderers.choose import chosen
from scenes.world import World
from spikecam_env.checked import checked_count, checked_seed, checked_whole
from spikecam_env.envs.aiming import SUCCESS_SHARE, AimingEnv
from spikecam_env.envs.episode import Episode
from spikecam_env.envs.keywords import check_settled
from spikecam_env.envs.passes import Passes, passes
from spikecam_env.envs.registration import MAX_EPISODE_STEPS
from spikecam_env.envs.reset_options import Rule, checked_options, pair
from spikecam_env.envs.task import DRIFT, checked_limit, drawn_within, is_inside, polar
from spikecam_env.errors import InputError, unknown_name

LATEST_START = 40_000
"""Frames: a second into the scene."""

CUTS_KNOWN = 60_000
"""Frames: every scene of the catalogue that starts over does so between LATEST_START and this, the train last."""

LEAST_STEPS = 40
"""Steps that an episode has before the scene starts over, where one of the moments drawn has as many."""

SLOWEST_GAZE = 4.0
"""[shorter sides/s] The gaze's top rate at least."""

GAZE_OVER_TARGET = 2.0
"""The gaze's top rate over the target's."""

FASTEST_TARGET = 50.0
"""[shorter sides/s] Of a target that is chosen where none is named: before a camera at rest that looks past it by a
quarter of the side, it stays in view for 5 ms or more."""

RANDOM_TOP = 100.0
"""[shorter sides/s] Top speed of the targets of random worlds, taken for all alike so that an action means the same in
each: `envs.passes` gives 22 as the median of 60 worlds, 100 as the 99 % quantile, 133 as the highest."""

_STARTS = 64
"""Moments drawn for an episode to start at; the first is taken that has the target in view, and time left."""


class SceneEnv(AimingEnv):
    """A scene of the catalogue, or a new random world every episode; the camera turns after one thing in it.

    The reward is "distance" of `envs.task` unless `reward="progress"`: 1 in the middle, 0 in a corner, less beyond.
    On the target: within an eighth of the shorter side.  The episode terminates when the target's middle leaves the
    picture.  It is truncated when the scene starts over (a ball is thrown again), whatever `max_episode_steps` is, and
    `info["scene_over"]` says so.  `gymnasium.make` truncates it after 500 steps (0.5 s at 40 frames a step), or after
    its `max_episode_steps`.  At first the camera, on a mount that drifts slowly, looks past the target by
    `start_offset_px` or half of it.

    Options:
        start_frame, offset (pan, tilt) [pixels], drift_px_s (pan, tilt) and, of random worlds, seed; the others are
        drawn.
    Info:
        scene_over, whether the episode is truncated because its scene starts over; the others of `AimingEnv`.

    Args:
        scene: a name of `scenes.catalogue.SCENES`; "random" is another world in every episode.
        target: a name in `poses` of the truth; default the first that moves at FASTEST_TARGET at most, or else the
            slowest.
        shape: (rows, columns).
        scene_seed: of a named scene: textures, poses; episodes differ by where and when they start.
        start_offset_px: most the camera looks past the target at first; default a quarter of the shorter side.
        mean_interval: of the exposure [frames].
        max_gaze_rate_px_s: default twice the target's top speed, 4 of the shorter side a second at least.
        steps: after which the class itself truncates an episode; None, as the ids have it: it never does.
        camera: keywords of `AimingEnv` and `SpikeCameraEnv`: reward, model, frames_per_step, ground_truth, ...

    Raises:
        InputError: for an unknown scene or target, and for a scene in which nothing moves.

    Example:
        >>> env = SceneEnv(scene="disk", shape=(16, 24))
        >>> spikes, info = env.reset(seed=0)
        >>> spikes.shape, env.action_space.shape
        ((40, 16, 24), (2,))
    """

    settles: ClassVar[tuple[str, ...]] = ("draw",)

    def __init__(
        self,
        *,
        scene: str = "random",
        target: str | None = None,
        shape: tuple[int, int] = (250, 400),
        scene_seed: int = 0,
        start_offset_px: float | None = None,
        mean_interval: float = 10.0,
        max_gaze_rate_px_s: float | None = None,
        steps: int | None = MAX_EPISODE_STEPS,
        **camera: Any,
    ) -> None:
        check_settled(type(self), camera)
        super().__init__(self._draw, shape=shape, max_gaze_rate_px_s=max_gaze_rate_px_s, **camera)
        if scene not in SCENES:
            raise unknown_name("scene", scene, SCENES)
        self.start_offset_px = checked_limit("start_offset_px", start_offset_px, 0.25 * min(self.shape))
        self.steps = None if steps is None else checked_count(steps, "steps")
        scene_seed = checked_seed(scene_seed, "scene_seed")
        self.scene_name, self.target, self.mean_interval = scene, target, checked_interval(mean_interval)
        self._unexposed = None if scene == "random" else self._build(scene_seed)
        self._named: Placed | None = None
        self._passes = Passes(RANDOM_TOP * min(self.shape), np.zeros(0, np.int64))
        if self._unexposed is not None:
            last = LATEST_START + MAX_EPISODE_STEPS * self.frames_per_step
            self.target, self._passes = _followable(
                scene, target, self.shape, scene_seed, self.model.frame_rate_hz, last
            )
        if max_gaze_rate_px_s is None:
            self.set_top_rate(max(SLOWEST_GAZE * min(self.shape), GAZE_OVER_TARGET * self._passes.top_px_s))
        if scene == "random" or isinstance(self._unexposed, World):
            chosen()  # in this process, once: workers forked from it need not try again

    def close(self) -> None:
        """See `SpikeCameraEnv.close`."""
        self._unexposed = self._named = None
        super().close()

    def _build(self, seed: int) -> Placed:
        """The scene of this seed, not yet exposed; InputError where there is nothing to follow in it."""
        return _followed(self.scene_name, self.target, self.shape, seed, self.model.frame_rate_hz)

    def _draw(self, rng: np.random.Generator, options: dict[str, Any]) -> Episode:
        """One episode: always the same number of draws, so that an option changes nothing else."""
        seed, starts = int(rng.integers(2**31)), rng.integers(LATEST_START, size=_STARTS)
        past = polar(self.start_offset_px * rng.uniform(0.5, 1.0), rng.uniform(0, 2 * np.pi))
        drift = drawn_within(rng, DRIFT * min(self.shape))
        given = checked_options(options, self._rules)
        scene = self._named or self._exposed(given.get("seed", seed))
        target = self.target or next(iter(scene.places(0.0)))
        start = given["start_frame"] if "start_frame" in given else self._start(scene, target, starts)
        offset = given["offset"] if "offset" in given else self._beside(scene, target, start, past)
        across, down = (float(rate) / self.model.frame_rate_hz for rate in given.get("drift_px_s", drift))
        later = Later(scene, start, offset, (across, down))
        steps, beyond = self._length(start)
        return Episode(later, target, SUCCESS_SHARE * min(self.shape), steps, beyond=beyond)

    @property
    def _rules(self) -> dict[str, Rule]:
        """Of the options of reset."""
        of_all: dict[str, Rule] = {"start_frame": _start_frame, "offset": pair, "drift_px_s": pair}
        return of_all | ({"seed": checked_seed} if self._unexposed is None else {})

    def _length(self, start: int) -> tuple[int, float]:
        """(`Episode.steps`, `Episode.beyond`) of an episode that begins at this frame of the scene."""
        left = self._passes.end(start) - start
        whole = inf if left == inf else max(1, int(left // self.frames_per_step) - 1)  # the first block is reset's
        most = self.steps or MAX_EPISODE_STEPS
        steps = int(min(most, whole))
        return steps, 0 if self.steps is not None else whole - steps

    def _of_standing(self) -> dict[str, Any]:
        course, scenes = self.course, self.episode.steps + self.episode.beyond
        over = course.truncated and (self.steps is None or scenes < self.steps)
        return super()._of_standing() | {"scene_over": over}

    def _start(self, scene: Placed, target: str, starts: Any) -> int:
        """The first moment with the target in the scene's own view and time left; else the one with most time left."""
        left = {int(start): self._passes.end(int(start)) - start for start in starts}
        least = (LEAST_STEPS + 1) * self.frames_per_step
        good = (s for s, frames in left.items() if frames >= least and is_inside(scene.places(s)[target], scene.shape))
        return next(good, max(left, key=lambda s: left[s]))

    def _beside(self, scene: Placed, target: str, start: int, past: tuple[float, float]) -> tuple[float, float]:
        """(pan, tilt) of a camera that looks past the target by so much when its first block is over."""
        x, y = scene.places(start + self.frames_per_step)[target]
        rows, columns = scene.shape
        return x - (columns - 1) / 2 + past[0], y - (rows - 1) / 2 + past[1]

    def _exposed(self, seed: int) -> Placed:
        """The scene of an episode.  Its first picture is rendered here, not at construction: a vector environment makes
        one in the parent, only to ask for its spaces, and OpenGL does not survive the fork that follows."""
        scene = exposed(self._unexposed or self._build(seed), self.mean_interval)
        assert isinstance(scene, Placed)
        if self._unexposed is not None:
            self._named = scene
        return scene


def _start_frame(value: Any, name: str) -> int:
    """A rule of `reset_options`."""
    return checked_whole(value, name, 0, LATEST_START)


def _followed(name: str, target: str | None, shape: tuple[int, int], seed: int, frame_rate_hz: float) -> Placed:
    scene = unexposed_scene(name, shape, seed, frame_rate_hz)
    places = scene.places(0.0) if isinstance(scene, Placed) else {}
    if not isinstance(scene, Placed) or not places:
        raise InputError(f"nothing moves in the scene {name!r}, so there is nothing to follow")
    if target is not None and target not in places:
        raise unknown_name(f"target in the scene {name!r}:", target, places)
    return scene


@lru_cache(maxsize=64)
def _followable(
    name: str, target: str | None, shape: tuple[int, int], seed: int, frame_rate_hz: float, last: int
) -> tuple[str, Passes]:
    """The target, chosen where none is named, and its passes.

    Kept, since environments of a kind are made in numbers, and a scene of many bodies takes a second.
    """
    scene = _followed(name, target, shape, seed, frame_rate_hz)
    by_name: dict[str, Passes] = {}
    for one in scene.places(0.0) if target is None else (target,):
        by_name[one] = passes(scene, one, last, max(last, CUTS_KNOWN))
        if by_name[one].top_px_s <= FASTEST_TARGET * min(shape):
            return one, by_name[one]
    slowest = min(by_name, key=lambda one: by_name[one].top_px_s)
    return slowest, by_name[slowest]
