"""Scenes before the camera: light over time, and the truth about it."""

from scenes.film.frame_light import FrameLight
from scenes.film.video import VideoScene
from scenes.flat.collage import Collage
from scenes.flat.disk import RotatingDisk
from scenes.flat.sliding import SlidingTexture
from scenes.protocol import Gaze, Scene, Truth
from scenes.textures import TEXTURES, random_texture
from spikecam_env.renamed import old_modules

old_modules(
    "scenes",
    {
        "collage": "flat.collage",
        "discs": "flat.discs",
        "disk": "flat.disk",
        "flow": "derived.flow",
        "sliding": "flat.sliding",
        "video": "film.video",
    },
)

DISTRIBUTION = "spikecam-env"
"""By which `spikecam_env.siblings` knows this package from another of its name."""

__all__ = [
    "TEXTURES",
    "Collage",
    "FrameLight",
    "Gaze",
    "RotatingDisk",
    "Scene",
    "SlidingTexture",
    "Truth",
    "VideoScene",
    "random_texture",
]
