"""Static optics: the image that the lens gives of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from spikecam_env.sensor.effects.base import Effect
from spikecam_env.sensor.light import Segment, same_light
from spikecam_env.types import Pictures


class Imaging:
    """The optics among a model's effects, for pictures of `shape`.

    They are linear, so they act on the two ends of a ramp.  The images of the last two pictures are kept, since a key
    interval begins where the one before it ended.  Pictures are compared by value: an array
    that was changed in place gets another image.
    """

    def __init__(self, effects: Sequence[Effect], shape: tuple[int, int]) -> None:
        self._optics = tuple(effect for effect in effects if effect.overrides("image"))
        self._shape = shape
        self._known: list[tuple[Pictures, Pictures]] = []

    def __bool__(self) -> bool:
        return bool(self._optics)

    def segment_image(self, segment: Segment) -> Segment:
        """Light as it reaches the pixels."""
        if not self._optics:
            return segment
        start = self.image(segment.radiance0)
        held = segment.radiance1 is segment.radiance0
        rise = None if segment.rise is None else self.image(segment.rise)
        course = segment.course and segment.course._replace(pictures=tuple(map(self.image, segment.course.pictures)))
        stop = start if held else self.image(segment.radiance1)
        return replace(segment, radiance0=start, radiance1=stop, rise=rise, course=course)

    def image(self, picture: Pictures) -> Pictures:
        """The image (H*W,) of a picture (H*W,); the same array while the picture is the same."""
        for known, image in self._known:
            if same_light(known, picture):
                return image
        image = picture
        for effect in self._optics:
            image = effect.image(image.reshape(self._shape)).reshape(-1)
        self._known = [(picture.copy(), image), *self._known[:1]]
        return image
