"""What the camera looks at: light over time, and the truth about it."""

from scenes.collage import Collage
from scenes.disk import RotatingDisk
from scenes.protocol import Gaze, Scene, Truth
from scenes.textures import TEXTURES, random_texture

__all__ = ["TEXTURES", "Collage", "Gaze", "RotatingDisk", "Scene", "Truth", "random_texture"]
