"""One id of every kind.  The others of a kind differ in the scene that is seen, and in no code of the environment."""

from __future__ import annotations

from scenes.flat.collage import Collage
from scenes.flat.disk import RotatingDisk
from scenes.world import World

DISK = "spikecam_env/RotatingDisk-v0"
RANDOM = "spikecam_env/Scene-v0"
"""A new world every episode."""
BY_SCENE = {
    RotatingDisk: "spikecam_env/Disk-v0",
    Collage: "spikecam_env/Collage-v0",
    World: "spikecam_env/Fan-v0",
}
"""By the class of a named scene; `test_scene_environment` makes every id and finds its class here."""

KINDS = (DISK, RANDOM, *BY_SCENE.values())
