"""Scenes before the camera: light over time, and the truth about it."""

from scenes.collage import Collage
from scenes.disk import RotatingDisk
from scenes.protocol import Gaze, Scene, Truth
from scenes.sliding import SlidingTexture
from scenes.textures import TEXTURES, random_texture
from scenes.video import VideoScene

DISTRIBUTION = "spikecam-env"
"""By which `spikecam_env.siblings` knows this package from another of its name."""

__all__ = [
    "TEXTURES",
    "Collage",
    "Gaze",
    "RotatingDisk",
    "Scene",
    "SlidingTexture",
    "Truth",
    "VideoScene",
    "random_texture",
]
