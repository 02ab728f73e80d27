"""The catalogue: every scene is lit, moves, and its flow carries it; random worlds follow from their seed."""

from __future__ import annotations

import numpy as np
import pytest

from scenes.catalogue import SCENES, make_scene, random_world
from scenes.derived.flow import check_flow
from scenes.protocol import Scene
from scenes.renderers.embree import Embree
from spikecam_env.errors import InputError

SHAPE = (60, 96)


def test_the_ten_scenes_of_phm_are_there() -> None:
    assert {"ball", "cook", "dice", "doll", "fan", "fly", "hand", "jump", "poker", "top"} <= set(SCENES)
    assert {"disk", "train", "car", "text", "random"} <= set(SCENES)


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_is_lit_and_moves_and_its_flow_carries_it(name: str, renderer: Embree) -> None:
    scene = make_scene(name, SHAPE, mean_interval=8.0, renderer=renderer)
    assert isinstance(scene, Scene) and scene.shape == SHAPE
    keys = scene.radiance(100, 104)
    assert keys.radiance.shape[1:] == SHAPE
    truth = scene.truth(100.5)
    interval, contrast = 1 / keys.radiance.mean(), truth.radiance.std() / truth.radiance.mean()
    fastest = float(np.linalg.norm(truth.flow, axis=-1).max())
    flow = check_flow(scene, 100.5)
    print(
        f"{name}: mean interval {interval:.1f} frames, contrast {contrast:.2f}, fastest {fastest:.3f} pixels/frame; "
        f"{flow}"
    )
    assert 5 < interval < 13  # metered at other frames, so not exactly 8
    assert contrast > 0.1 and fastest > 0.005
    assert flow.error < 0.02
    assert flow.compared > 0.1  # a small picture lies beside edges for the most part


def test_a_random_world_follows_from_its_seed(renderer: Embree) -> None:
    first, again, other = (random_world(seed, (30, 48), renderer=renderer).truth(3.5).radiance for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_an_unknown_scene_is_named_with_those_there_are() -> None:
    with pytest.raises(InputError, match="unknown scene 'fun'; choose one of ball, car"):
        make_scene("fun")
