"""The same scene from another moment on, and from a camera that has turned already."""

from __future__ import annotations

from dataclasses import dataclass

from scenes.derived.flow import displacement
from scenes.protocol import Derived, Gaze, Placed, Scene, Truth
from spikecam_env.sensor import Keyframes
from spikecam_env.types import Pictures


@dataclass(frozen=True)
class Later(Derived):
    """Scene: another one's light, frame 0 being its frame `frames`, a camera at rest being one at `offset`."""

    scene: Scene
    frames: int = 0
    """Whole frames."""
    offset: tuple[float, float] = (0.0, 0.0)
    """(pan, tilt) [pixels]."""
    drift: tuple[float, float] = (0.0, 0.0)
    """(pan, tilt) velocity of the mount that the camera is on [pixels/frame]; the offset is at frame 0."""

    def radiance(self, start: int, stop: int, gaze: Gaze | None = None) -> Keyframes:
        """The scene's keys, at their frames here."""
        keys = self.scene.radiance(start + self.frames, stop + self.frames, self._gaze_of_scene(gaze))
        return Keyframes.known(keys.frame - self.frames, keys.radiance)

    def truth(self, frame: float, gaze: Gaze | None = None) -> Truth:
        """The scene's truth; its camera pose has the offset in it."""
        return self.scene.truth(frame + self.frames, self._gaze_of_scene(gaze))

    def displacement(self, frame: float, by: float, gaze: Gaze | None = None) -> Pictures:
        """The displacement of the scene's points, the camera's own motion in it."""
        return displacement(self.scene, frame + self.frames, by, self._gaze_of_scene(gaze))

    def places(self, frame: float, gaze: Gaze | None = None) -> dict[str, tuple[float, float]]:
        """The scene's places; none where it has nothing to follow."""
        if not isinstance(self.scene, Placed):
            return {}
        return self.scene.places(frame + self.frames, self._gaze_of_scene(gaze))

    def _gaze_of_scene(self, gaze: Gaze | None) -> Gaze | None:
        if gaze is None and self.offset == self.drift == (0.0, 0.0):
            return None
        gaze = gaze or Gaze.fixed(0.0, 0.0)
        first, last = gaze.frames
        return Gaze(
            self._moved(gaze.start, first), self._moved(gaze.stop, last), (first + self.frames, last + self.frames)
        )

    def _moved(self, gaze: tuple[float, float], frame: float) -> tuple[float, float]:
        """A gaze of the camera at a frame, as the scene has it."""
        return (
            gaze[0] + self.offset[0] + self.drift[0] * frame,
            gaze[1] + self.offset[1] + self.drift[1] * frame,
        )
