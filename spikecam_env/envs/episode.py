"""An episode: a scene, the place in it that is to come to the middle of the view, and when this is over.

`Episode` is the plain case: follow one thing for so many steps, and lose it when it leaves the picture.  A task with
another end overrides `end` and `performance`; one whose action does more than turn the camera overrides `acted` and
`rest`, and `through` where that changes the light.  An episode is a value: an action makes a new one.
"""

from __future__ import annotations

from dataclasses import dataclass

from scenes.protocol import Gaze, Placed, Scene
from spikecam_env.envs.task import closeness, is_inside


@dataclass(frozen=True)
class Standing:
    """Where an episode stands at the end of a step."""

    frame: int
    """Frame of the sensor."""
    step: int
    """Steps so far; 0 after reset."""
    place: tuple[float, float]
    """(x, y) at which the target appears [pixels]."""
    distance_px: float
    """Distance of the target from the middle [pixels]."""
    on_target: bool
    """Whether the episode counts this as being on the target."""
    steps_on: int
    """Steps so far that ended on the target."""
    held: int
    """Steps in a row, up to this one, that ended on the target."""


@dataclass(frozen=True, eq=False)
class Episode:
    """A scene, and the place in it that is to come to the middle of the view."""

    scene: Placed
    target: str
    """Its name in `places`."""
    success_px: float
    """How near counts as on it [pixels]."""
    steps: int
    """Steps of which `performance` is a share."""
    number: int = 0
    """Of the episode within its split, where a task numbers them."""
    beyond: float = 0
    """Steps that may follow after `steps`, until it is truncated; infinite where others set the end
    (`max_episode_steps` of `gymnasium.make`)."""

    def aim(self, frame: float, gaze: Gaze) -> tuple[float, float]:
        """Where the target is seen, (x, y) [pixels]."""
        return self.scene.places(frame, gaze)[self.target]

    def is_on(self, frame: float, distance_px: float) -> bool:
        """Whether this distance, at this frame, counts as being on the target."""
        return distance_px <= self.success_px

    def worth(self, standing: Standing) -> float:
        """How good things are, 1 at best; the rewards of `envs.task` are made of it."""
        return closeness(standing.distance_px, self.scene.shape)

    def end(self, standing: Standing) -> bool | None:
        """None while the episode goes on; at its end True for a success, False for a failure."""
        return None if is_inside(standing.place, self.scene.shape) else False

    def is_success(self, standing: Standing) -> bool:
        """Whether the task is done, as things stand."""
        return standing.on_target

    def performance(self, standing: Standing) -> float:
        """Of the whole episode if it ended here, 1 at best: the share of its steps that ended on the target."""
        return standing.steps_on / max(self.steps, standing.step)

    def acted(self, rest: tuple[float, ...], standing: Standing, stop: int) -> Episode:
        """The episode after an action.

        Args:
            rest: further numbers of the action, in [-1, 1].
            standing: at the beginning of the step.
            stop: frame at which the step ends.
        """
        return self

    def through(self, scene: Scene) -> Scene:
        """The scene behind the filters that actions have set; after reset the camera sees the scene itself."""
        return scene

    def rest(self, standing: Standing, first: int, stop: int) -> tuple[float, ...]:
        """The further numbers of an action that knows everything."""
        return ()


@dataclass(frozen=True, eq=False)
class Reaching(Episode):
    """An episode that ends in success when the target has been held for `hold` steps in a row."""

    hold: int = 1

    def end(self, standing: Standing) -> bool | None:
        """See `Episode.end`."""
        return True if standing.held >= self.hold else None

    def is_success(self, standing: Standing) -> bool:
        """See `Episode.is_success`."""
        return standing.held >= self.hold

    def performance(self, standing: Standing) -> float:
        """1 for a success, 0 for none."""
        return float(self.is_success(standing))
