"""Size and frame rate of a scene that is made of another."""

from __future__ import annotations

from scenes.protocol import Scene


class Derived:
    """Base of a scene made of `scene`, whose light it shows in its own way."""

    scene: Scene

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.scene.shape

    @property
    def frame_rate_hz(self) -> float:
        """Frames a second."""
        return self.scene.frame_rate_hz
