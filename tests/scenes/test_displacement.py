"""Where the points of a picture go: by the poses of a world, by the flow of any other scene."""

from __future__ import annotations

import numpy as np
import pytest

from scenes import RotatingDisk, SlidingTexture
from scenes.catalogue import make_scene
from scenes.derived.faster import Faster
from scenes.derived.flow import displacement
from scenes.derived.later import Later
from scenes.protocol import Displacing, Gaze, Scene


@pytest.fixture(scope="module")
def fan() -> Scene:
    return make_scene("fan", (48, 80))


def test_the_points_of_a_disk_turn_by_its_angle() -> None:
    """6000 rpm at 40 kHz are 0.9 degrees a frame."""
    disk = RotatingDisk((64, 96), rpm=6000)
    way, truth = displacement(disk, 20.5, 10.0), disk.truth(20.5)
    y, x = np.indices(disk.shape)
    from_middle = np.stack([x - 47.5, y - 31.5], axis=-1)
    radius = np.linalg.norm(from_middle, axis=-1)
    inside = (truth.object_id > 0) & (radius < radius[truth.object_id > 0].max() - 3)  # the rim reads its neighbour's
    along = from_middle[..., 0] * truth.flow[..., 1] - from_middle[..., 1] * truth.flow[..., 0]
    sign = np.sign(along[inside].sum())
    turn = sign * np.radians(9.0)
    turned = from_middle @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    off = np.linalg.norm(way - (turned - from_middle), axis=-1)[inside]
    print(f"{inside.sum()} points go {radius[inside].max() * np.radians(9):.1f} pixels at most, off by {off.max():.4f}")
    assert off.max() < 0.02


def test_a_world_knows_the_way_that_its_flow_leads_where_one_object_is_seen(fan: Scene) -> None:
    assert isinstance(fan, Displacing)
    way, middle = displacement(fan, 60.5, 10.0), 10 * fan.truth(65.5).flow
    owner = fan.truth(60.5).object_id
    same = owner == fan.truth(65.5).object_id
    off = np.linalg.norm(way - middle, axis=-1)[same]
    print(
        f"way {np.linalg.norm(way, axis=-1).max():.2f} pixels at most; ten times the speed is off by {off.mean():.3f}"
    )
    assert off.mean() < 0.1 * np.linalg.norm(way[owner > 0], axis=-1).mean()


def test_a_way_there_and_on_is_the_whole_way(fan: Scene) -> None:
    first, whole = displacement(fan, 60.5, 5.0), displacement(fan, 60.5, 10.0)
    still = np.linalg.norm(first, axis=-1) < 1e-6
    assert np.abs(whole[still]).max() < 1e-4 and (~still).any()


@pytest.mark.parametrize("name", ["fan", "disk"])
def test_a_moving_camera_moves_what_is_at_rest_the_other_way(name: str) -> None:
    scene = make_scene(name, (48, 80))
    still = displacement(scene, 0.5, 10.0)
    moving = displacement(Later(scene, drift=(0.5, -0.2)), 0.5, 10.0, Gaze.fixed(0.0, 0.0))
    at_rest = np.abs(still).max(axis=-1) < 1e-6
    assert at_rest.mean() > 0.3
    assert np.abs(np.median(moving[at_rest], axis=0) - (-5.0, 2.0)).max() < 0.05


def test_a_faster_scene_and_a_later_one_go_the_ways_of_their_scene(fan: Scene) -> None:
    way = displacement(fan, 60.5, 10.0)
    assert np.array_equal(displacement(Faster(fan, 2.0), 30.25, 5.0), way)
    assert np.array_equal(displacement(Later(fan, frames=60), 0.5, 10.0), way)
    sliding = SlidingTexture((16, 24), (4000.0, -2000.0))
    assert np.abs(displacement(sliding, 3.5, 7.0)[4:12, 6:18] - (0.7, -0.35)).max() < 1e-3
