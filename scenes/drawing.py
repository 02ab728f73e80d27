"""Drawing textures: antialiased shapes, letters and pictures of things, in linear grey.

A canvas is drawn at `FINE` times its size and averaged.  Places are shares of its width and height, x to the right
and y down; sizes of strokes and letters are shares of its height.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from scenes.textures import Texture

FINE = 4

_FONT = cv2.FONT_HERSHEY_DUPLEX


class Canvas:
    """A picture in the making: `Canvas(256, 256, 0.9).disc(0.5, 0.5, 0.2, 0.05).texture()`."""

    def __init__(self, width: int, height: int, grey: float) -> None:
        self._image = np.full((height * FINE, width * FINE), grey, np.float32)

    def polygon(self, corners: Sequence[tuple[float, float]], grey: float) -> Canvas:
        """Filled."""
        cv2.fillPoly(self._image, [self._places(corners)], grey)
        return self

    def rectangle(self, left: float, top: float, right: float, bottom: float, grey: float) -> Canvas:
        """Filled."""
        return self.polygon([(left, top), (right, top), (right, bottom), (left, bottom)], grey)

    def ellipse(self, x: float, y: float, across: float, down: float, grey: float) -> Canvas:
        """Filled; half axes as shares of width and height."""
        turn = np.linspace(0, 2 * np.pi, 72, endpoint=False)
        return self.polygon(list(zip(x + across * np.cos(turn), y + down * np.sin(turn), strict=True)), grey)

    def disc(self, x: float, y: float, radius: float, grey: float) -> Canvas:
        """Round whatever the canvas's shape; the radius is a share of its height."""
        return self.ellipse(x, y, radius * self._image.shape[0] / self._image.shape[1], radius, grey)

    def line(self, corners: Sequence[tuple[float, float]], width: float, grey: float) -> Canvas:
        """Straight pieces through corners."""
        cv2.polylines(self._image, [self._places(corners)], False, grey, self._stroke(width))
        return self

    def text(self, text: str, x: float, y: float, height: float, grey: float, turned: bool = False) -> Canvas:
        """With its middle at (x, y), capitals this high; `turned` stands on its head."""
        rows, columns = self._image.shape
        (_, unit), _ = cv2.getTextSize(text, _FONT, 1.0, 1)
        scale = height * rows / unit
        stroke = max(1, round(0.14 * height * rows))
        (wide, tall), _ = cv2.getTextSize(text, _FONT, scale, stroke)
        target = self._image[::-1, ::-1].copy() if turned else self._image
        place = (1 - x, 1 - y) if turned else (x, y)
        corner = (round(place[0] * columns - wide / 2), round(place[1] * rows + tall / 2))
        cv2.putText(target, text, corner, _FONT, scale, grey, stroke, cv2.LINE_AA)
        if turned:
            self._image = np.ascontiguousarray(target[::-1, ::-1])
        return self

    def picture(self, texture: Texture, left: float, top: float, right: float, bottom: float) -> Canvas:
        """A texture stretched over a rectangle."""
        (x0, y0), (x1, y1) = self._places([(left, top), (right, bottom)])
        self._image[y0:y1, x0:x1] = cv2.resize(texture, (x1 - x0, y1 - y0), interpolation=cv2.INTER_LINEAR)
        return self

    def texture(self) -> Texture:
        """(h, w) float32."""
        rows, columns = self._image.shape
        return np.asarray(
            cv2.resize(self._image, (columns // FINE, rows // FINE), interpolation=cv2.INTER_AREA), np.float32
        )

    def _places(self, corners: Sequence[tuple[float, float]]) -> np.ndarray:
        rows, columns = self._image.shape
        return np.round(np.asarray(corners) * [columns, rows]).astype(np.int32)

    def _stroke(self, width: float) -> int:
        return max(1, round(width * self._image.shape[0]))
