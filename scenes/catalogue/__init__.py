"""The scenes by name: `make_scene("fan")`, and random ones: `random_world(seed)`.

A scene is a small file in this folder with one function

    scene(shape, seed, frame_rate_hz, renderer) -> Scene

and its name in `SCENES`.  Everything in a scene follows from these arguments, so a worker process rebuilds it
from them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from scenes.catalogue import (
    ball,
    car,
    collage,
    cook,
    dice,
    disk,
    doll,
    fan,
    fly,
    hand,
    jump,
    poker,
    random_bodies,
    text,
    top,
    train,
    tumble,
)
from scenes.exposure import expose
from scenes.protocol import FRAME_RATES_HZ, Scene
from scenes.renderers.protocol import Renderer
from scenes.world import World
from spikecam_env.checked import LARGEST_DERIVED_SEED, checked_number, checked_seed, checked_shape
from spikecam_env.errors import unknown_name

SCENES: dict[str, Callable[..., Scene]] = {
    "ball": ball.scene,
    "car": car.scene,
    "collage": collage.scene,
    "cook": cook.scene,
    "dice": dice.scene,
    "disk": disk.scene,
    "doll": doll.scene,
    "fan": fan.scene,
    "fly": fly.scene,
    "hand": hand.scene,
    "jump": jump.scene,
    "poker": poker.scene,
    "text": text.scene,
    "top": top.scene,
    "train": train.scene,
    "tumble": tumble.scene,
    "random": random_bodies.scene,
}

METERED_ROWS = 60
"""Exposure is measured on a small picture of a world."""


def make_scene(
    name: str,
    shape: tuple[int, int] = (250, 400),
    seed: int = 0,
    mean_interval: float = 10.0,
    frame_rate_hz: float = 40_000.0,
    renderer: Renderer | None = None,
) -> Scene:
    """A scene of the catalogue, exposed to a mean interval [frames].

    Args:
        seed: of textures and starting poses.
        renderer: default: chosen on first use, in each process.

    Raises:
        InputError: the name is unknown, or a value is out of range.

    Example:
        >>> light = make_scene("collage", shape=(16, 24)).radiance(0, 64)
        >>> light.radiance.shape[1:]
        (16, 24)
    """
    return exposed(unexposed_scene(name, shape, seed, frame_rate_hz, renderer), mean_interval)


def unexposed_scene(
    name: str, shape: tuple[int, int], seed: int, frame_rate_hz: float, renderer: Renderer | None = None
) -> Scene:
    """A scene of the catalogue in light of its own; nothing is rendered yet.  Arguments and errors: `make_scene`.

    Example:
        >>> unexposed_scene("disk", (16, 24), 0, 40_000.0).shape
        (16, 24)
    """
    if name not in SCENES:
        raise unknown_name("scene", name, SCENES)
    shape, seed = checked_shape(shape), checked_seed(seed, most=LARGEST_DERIVED_SEED)
    checked_number(frame_rate_hz, "frame_rate_hz", *FRAME_RATES_HZ)
    return SCENES[name](shape, seed, frame_rate_hz, renderer)


def exposed(scene: Scene, mean_interval: float) -> Scene:
    """`scenes.exposure.expose`, worlds measured small.

    Example:
        >>> scene = exposed(unexposed_scene("disk", (16, 24), 0, 40_000.0), mean_interval=20.0)
        >>> round(1.0 / float(scene.truth(0.5).radiance.mean()))
        20
    """
    metered, shape = None, scene.shape
    if isinstance(scene, World) and shape[0] > METERED_ROWS:
        metered = replace(scene, shape=(METERED_ROWS, max(1, round(METERED_ROWS * shape[1] / shape[0]))))
    return expose(scene, mean_interval, metered)


def random_world(
    seed: int,
    shape: tuple[int, int] = (250, 400),
    mean_interval: float = 10.0,
    frame_rate_hz: float = 40_000.0,
    renderer: Renderer | None = None,
) -> Scene:
    """Textured objects in random rigid motion before a background, as in SPIFT; the whole follows from the seed.

    Example:
        >>> scene = random_world(seed=3, shape=(16, 24))
        >>> scene.truth(0.5).depth.shape
        (16, 24)
    """
    return make_scene("random", shape, seed, mean_interval, frame_rate_hz, renderer)
